//! Errors of model files and of simulations.

use std::path::PathBuf;

use crate::setup::{BandError, DocumentError, Place};

/// A model that cannot be used; every text says where, what, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The file cannot be read, is not TOML, or a key is unknown, missing or of the wrong kind.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// Neither of the two formats.
    #[error(
        "{}: expected `fork`, which is built in, or a file whose name ends in .toml (bodies and \
         sprung masses) or .json (plane beams)", file.display()
    )]
    Format {
        /// The file.
        file: PathBuf,
    },
    /// The JSON of a beam model is broken or lacks something.
    #[error("{}: not a plane beam model: {source}", file.display())]
    Json {
        /// The file.
        file: PathBuf,
        /// The JSON reader's error, with line and column.
        source: serde_json::Error,
    },
    /// An index beyond the list of nodes.
    #[error(
        "{}: {what} refers to node {node}, but there are {nodes} nodes, counted from 0; \
         correct the number", file.display()
    )]
    NoSuchNode {
        /// The file.
        file: PathBuf,
        /// Element, mass or sensor, counted from one.
        what: String,
        /// As written.
        node: usize,
        /// Nodes in the file.
        nodes: usize,
    },
    /// A section, material or mass that cannot be.
    #[error("{}: the {key} of {what} is {found}; expected a number {expected}", file.display())]
    BeamValue {
        /// The file.
        file: PathBuf,
        /// Element or mass, counted from one.
        what: String,
        /// The property.
        key: &'static str,
        /// As written, or as computed from the nodes.
        found: f64,
        /// Its range.
        expected: &'static str,
    },
    /// A base plate sensor that is not on the base.
    #[error(
        "{}: {what} is said to be on the base plate, but sits on node {node} while the base is \
         node {base}; correct the node or drop \"base_plate\"", file.display()
    )]
    OffTheBase {
        /// The file.
        file: PathBuf,
        /// The sensor, counted from one.
        what: String,
        /// Its node.
        node: usize,
        /// The base node.
        base: usize,
    },
    /// A part of the frame that nothing holds.
    #[error(
        "{}: no chain of elements joins node {node} to the base node {base}; add the missing \
         element or remove the node", file.display()
    )]
    Loose {
        /// The file.
        file: PathBuf,
        /// First such node.
        node: usize,
        /// The base node.
        base: usize,
    },
    /// Stiffnesses so far apart that the modes cannot be computed.
    #[error(
        "{}: the stiffness matrix is singular to working precision; look for an element that is \
         some ten powers of ten stiffer or softer than the others", file.display()
    )]
    Singular {
        /// The file.
        file: PathBuf,
    },
    /// A list that a test cannot do without.
    #[error("{}: there is no {list}; add at least one, without it {reason}", file.display())]
    NoEntries {
        /// The file.
        file: PathBuf,
        /// The list.
        list: &'static str,
        /// Property that is not known then.
        reason: &'static str,
    },
    /// A chain of `extends` that does not end.
    #[error(
        "{}: `extends` leads through more than {limit} files; look for one that extends itself",
        file.display()
    )]
    Endless {
        /// The file where the search was given up.
        file: PathBuf,
        /// Longest chain allowed.
        limit: usize,
    },
    /// A name that is taken.
    #[error("{place}: the name \"{name}\" belongs to {first} already; choose another")]
    DuplicateName {
        /// The second of the two.
        place: Box<Place>,
        /// The name they share.
        name: String,
        /// Section that has the name already.
        first: String,
    },
    /// A sensor on something that the file does not have.
    #[error("{place}: `on` names \"{name}\", which is no part of this model; {hint}")]
    NoSuchPart {
        /// File, line and section.
        place: Box<Place>,
        /// As written.
        name: String,
        /// The nearest part, or all.
        hint: String,
    },
    /// A run that is neither shaken nor tilted, or both.
    #[error(
        "{place}: a run needs either `motion` (six RMS accelerations) or `poses` (a list of \
         tilts), and not both"
    )]
    MotionOrPoses {
        /// File, line and section.
        place: Box<Place>,
    },
    /// A run that wants a motion which the table does not have.
    #[error(
        "{place}: `motion` moves the axis \"{axis}\", which [table] `axes` does not list; add it \
         there or set this component to 0"
    )]
    NoSuchAxis {
        /// File, line and section.
        place: Box<Place>,
        /// One of x, y, z, rx, ry, rz.
        axis: &'static str,
    },
    /// A band that the spectrum cannot serve.
    #[error("{place}: {source}")]
    Band {
        /// File, line and section.
        place: Box<Place>,
        /// The band and the lines that there are.
        source: BandError,
    },
}

/// Reason why a sound model cannot be simulated as asked.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SimulationError {
    /// A setting outside its range.
    #[error("{what} is {found}; expected {expected}")]
    Option {
        /// The setting.
        what: &'static str,
        /// Its value.
        found: f64,
        /// Its range.
        expected: &'static str,
    },
    /// Less than one block.
    #[error(
        "{duration} s at {sample_rate} samples per second are {samples} samples, less than one \
         block of {block_length}; make the duration longer"
    )]
    TooShort {
        /// s.
        duration: f64,
        /// Hz.
        sample_rate: f64,
        /// Their product.
        samples: usize,
        /// Samples of a block.
        block_length: usize,
    },
    /// More than memory should be asked for.
    #[error(
        "{duration} s at {sample_rate} samples per second are more than {limit} samples a \
         channel; make the duration shorter"
    )]
    TooLong {
        /// s.
        duration: f64,
        /// Hz.
        sample_rate: f64,
        /// Most samples a channel.
        limit: usize,
    },
    /// A band that does not fit the sample rate.
    #[error(transparent)]
    Band(#[from] BandError),
    /// A drive band without a single line.
    #[error(
        "run \"{run}\": no spectral line lies in the drive's band from {} to {} Hz at \
         {sample_rate} samples per second; widen it", band[0], band[1]
    )]
    SilentDrive {
        /// The run.
        run: String,
        /// Hz.
        band: [f64; 2],
        /// Hz.
        sample_rate: f64,
    },
}
