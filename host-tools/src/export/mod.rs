//! Result exports: one file a format, behind the trait [`Export`].
//!
//! A new format is a file in this folder with a type that implements [`Export`], its two lines in
//! this one (`mod` and [`FORMATS`]) and its row in the manual. The commands, their help and their
//! completions read the list.
//!
//! An export is made in memory as a whole, read again by a parser of its own and compared with the
//! result before the first byte is written ([`bytes()`]): numbers that a format would lose or confuse
//! reach no file.

mod body;
mod covariance;
mod csv;
mod json;
mod mass_matrix;
mod mjcf;
mod nastran;
mod parquet;
mod responses;
mod sdf;
mod sysid;
#[cfg(test)]
mod tests;
mod urdf;
mod xml;

use crate::frame::Frame;
use crate::result::ResultDocument;
use body::Body;
use massline_core::geometry::{GeometryError, Placement};
pub use responses::responses;
use std::io::{self, Write};

/// A format that results are exported to.
pub trait Export: Sync + std::fmt::Debug {
    /// Name, content and needs of the format.
    fn form(&self) -> Form;

    /// Writes a result.
    ///
    /// # Errors
    /// [`ExportError::Unsuitable`] if the format cannot hold this result,
    /// [`ExportError::Write`] if the writer fails.
    fn write(
        &self,
        result: &ResultDocument,
        view: &View,
        out: &mut dyn Write,
    ) -> Result<(), ExportError>;

    /// Reads an export again and compares it with the result; the reason why they differ.
    ///
    /// # Errors
    /// The difference in words.
    fn compare(&self, result: &ResultDocument, view: &View, bytes: &[u8]) -> Result<(), String>;
}

/// Name, content and needs of a format.
#[derive(Clone, Copy, Debug)]
pub struct Form {
    /// Name of the format, as `--to` has it.
    pub name: &'static str,
    /// Content of a file of this format, in a few words.
    pub description: &'static str,
    /// Ending of the names of such files, without its point.
    pub extension: &'static str,
    /// Needs and options of the format.
    pub kind: Kind,
}

/// Needs and options of a format; each kind has those of the kinds before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd)]
pub enum Kind {
    /// A table, which holds what is observable, about the points that it names.
    Table,
    /// A whole body, which needs all ten numbers and is given about a point and in axes.
    Body,
    /// A body at a grid point of a finite-element model.
    Element,
}

/// Point, axes and identifiers that a body is exported with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Origin of the exported coordinates, m, in those of the result; the reference point A if
    /// `None`.
    pub about: Option<[f64; 3]>,
    /// Rotation vector that turns the axes of the result into those of the export, degrees.
    pub rotation: Option<[f64; 3]>,
    /// Identifier of the grid point of a finite-element model; 1 if `None`.
    pub grid: Option<u32>,
    /// Identifier of the element; 1 if `None`.
    pub element: Option<u32>,
}

impl View {
    /// The reference point A and the axes of the result.
    pub const OF_THE_RESULT: Self = Self {
        about: None,
        rotation: None,
        grid: None,
        element: None,
    };

    /// The frame of an export, in coordinates of the result.
    ///
    /// # Errors
    /// [`GeometryError`] if the rotation is no number.
    fn frame(&self, result: &ResultDocument) -> Result<Frame, GeometryError> {
        let rotation = self.rotation.unwrap_or_default();
        let placement = Placement::new(rotation.into(), nalgebra::Vector3::zeros())?;
        Ok(Frame {
            origin: self.about.unwrap_or(result.reference_point),
            axes: placement.rotation().into(),
        })
    }

    /// Refuses an option that a format of this kind does not take.
    fn suits(&self, kind: Kind) -> Result<(), ExportError> {
        let options = [
            ("--about", self.about.is_some(), Kind::Body),
            ("--rotation", self.rotation.is_some(), Kind::Body),
            ("--grid", self.grid.is_some(), Kind::Element),
            ("--element", self.element.is_some(), Kind::Element),
        ];
        let foreign = options
            .iter()
            .find(|(_, given, least)| *given && kind < *least);
        let Some((option, _, least)) = foreign else {
            return Ok(());
        };
        let takers = FORMATS.iter().filter(|format| format.form().kind >= *least);
        let formats: Vec<&str> = takers.map(|format| format.form().name).collect();
        let formats = formats.join(", ");
        Err(ExportError::Option { option, formats })
    }
}

/// All formats, in the order in which the help lists them.
pub const FORMATS: [&dyn Export; 10] = [
    &json::Json,
    &csv::Csv,
    &covariance::Covariance,
    &parquet::Parquet,
    &mass_matrix::MassMatrix,
    &nastran::Nastran,
    &urdf::URDF,
    &sdf::SDF,
    &mjcf::MJCF,
    &sysid::Sysid,
];

/// Reason why a result is not exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The format cannot hold this result, as where it needs a number that the test does not
    /// determine.
    #[error("{reason}")]
    Unsuitable {
        /// The reason, and what to do.
        reason: String,
    },
    /// An option that the format does not take.
    #[error("{option} is for {formats}; leave it out")]
    Option {
        /// The option.
        option: &'static str,
        /// The formats that take it.
        formats: String,
    },
    /// The export reads back as something else.
    #[error("read again, it differs from the result: {difference}; report this with the result")]
    Differs {
        /// The difference in words.
        difference: String,
    },
    /// The writer failed.
    #[error(transparent)]
    Write(#[from] io::Error),
}

impl ExportError {
    /// Exit code of a command that ends with this error.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Option { .. } => 2,
            _ => 1,
        }
    }
}

/// The format with this name.
#[must_use]
pub fn find(name: &str) -> Option<&'static dyn Export> {
    FORMATS
        .into_iter()
        .find(|format| format.form().name == name)
}

/// An export as a whole, read again and compared with the result.
///
/// # Errors
/// [`ExportError`].
pub fn bytes(
    format: &dyn Export,
    result: &ResultDocument,
    view: &View,
) -> Result<Vec<u8>, ExportError> {
    view.suits(format.form().kind)?;
    let mut bytes = Vec::new();
    format.write(result, view, &mut bytes)?;
    format
        .compare(result, view, &bytes)
        .map_err(|difference| ExportError::Differs { difference })?;
    Ok(bytes)
}

/// A doubt about the body of a result that programs refuse to load, where the format holds a body.
#[must_use]
pub fn doubt(format: &dyn Export, result: &ResultDocument) -> Option<&'static str> {
    match format.form().kind {
        Kind::Table => None,
        Kind::Body | Kind::Element => Body::doubt(result),
    }
}
