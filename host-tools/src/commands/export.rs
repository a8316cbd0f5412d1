//! `massline export`: a result in another program's format.

use super::{Failure, refuse, warn};
use crate::commands::Verbosity;
use crate::export::{Export, ExportError, FORMATS, View, bytes, doubt, find, responses};
use crate::identification::Answer;
use crate::output::{self, Existing};
use crate::result::ResultDocument;
use clap::builder::PossibleValue;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Export a result to the format of another program
#[derive(clap::Args)]
#[command(after_help = help())]
pub struct Arguments {
    /// The document of `massline identify --json`
    result: PathBuf,
    /// The result of this method, where the document has those of several
    #[arg(long, value_name = "NAME")]
    method: Option<String>,
    /// The format
    #[arg(long, visible_alias = "format", value_name = "FORMAT", value_parser = Formats)]
    to: &'static dyn Export,
    /// The file to write; stdout if absent
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replace the file if it is there already
    #[arg(long, requires = "out")]
    force: bool,
    /// Export numbers that are refused because the data contradict them; exit code 1 stays
    #[arg(long)]
    anyway: bool,
    #[command(flatten)]
    view: Place,
}

/// Point, axes and identifiers of an exported body.
#[derive(Clone, Copy, Debug, clap::Args)]
struct Place {
    /// Origin of the exported coordinates, m: grid point, origin of the link, point of the mass
    /// matrix; the reference point A if absent
    #[arg(long, value_name = "X,Y,Z", value_parser = three, allow_hyphen_values = true)]
    about: Option<[f64; 3]>,
    /// Rotation vector, degrees, that turns the axes of the result into those of the export
    #[arg(long, value_name = "X,Y,Z", value_parser = three, allow_hyphen_values = true)]
    rotation: Option<[f64; 3]>,
    /// Identifier of the grid point of a finite-element model; 1 if absent
    #[arg(long, value_name = "ID", value_parser = clap::value_parser!(u32).range(1..100_000_000))]
    grid: Option<u32>,
    /// Identifier of the element; 1 if absent
    #[arg(long, value_name = "ID", value_parser = clap::value_parser!(u32).range(1..100_000_000))]
    element: Option<u32>,
}

/// Numbers beyond this are typing errors; below it, squares stay finite.
const LARGEST: f64 = 1e100;

/// Three numbers between commas.
fn three(text: &str) -> Result<[f64; 3], String> {
    let numbers = text.split(',').map(|part| part.trim().parse().ok());
    let numbers: Option<Vec<f64>> = numbers
        .map(|n| n.filter(|x: &f64| x.abs() <= LARGEST))
        .collect();
    let numbers = numbers.and_then(|list| list.try_into().ok());
    numbers
        .ok_or_else(|| "expected three numbers with commas between, such as 0.1,0,-0.25".to_owned())
}

/// The formats, each with its content, and examples.
fn help() -> String {
    let formats = FORMATS.map(|f| f.form());
    let formats = formats.map(|f| format!("  {:<14}{}\n", f.name, f.description));
    format!(
        "Formats:\n{}\nExamples:\n{EXAMPLES}",
        formats.concat().replace('`', "")
    )
}

const EXAMPLES: &str = "  massline identify setup.toml --json > result.json
  massline export result.json --to csv --out result.csv
  massline export result.json --to nastran --grid 12 --element 9001 -o body.bdf
  massline export result.json --to mjcf --about 0,0,0.25 --rotation 0,0,90 -o body.xml";

/// Reads the name of a format, one of the list.
#[derive(Clone)]
struct Formats;

impl clap::builder::TypedValueParser for Formats {
    type Value = &'static dyn Export;

    fn parse_ref(
        &self,
        command: &clap::Command,
        argument: Option<&clap::Arg>,
        value: &std::ffi::OsStr,
    ) -> Result<Self::Value, clap::Error> {
        let names = FORMATS.map(|format| format.form().name);
        let name = clap::builder::PossibleValuesParser::new(names);
        let name = name.parse_ref(command, argument, value)?;
        find(&name).ok_or_else(|| clap::Error::new(clap::error::ErrorKind::InvalidValue))
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        let value = |format: &dyn Export| PossibleValue::new(format.form().name);
        Some(Box::new(FORMATS.into_iter().map(value)))
    }
}

/// A file that a result is exported to, in the format that its name or the words before it tell.
#[derive(Clone, Debug)]
pub(super) struct Target {
    /// The format of the result; its frequency responses if `None`.
    format: Option<&'static dyn Export>,
    file: PathBuf,
}

/// Name of the frequency responses, and endings of universal files.
const RESPONSES: &str = "responses";
const UNIVERSAL: [&str; 2] = ["uff", "unv"];

impl Target {
    /// Reads `FILE`, whose ending tells the format, or `FORMAT=FILE`. The first format of the list
    /// has an ending that several have.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        if let Some((name, file)) = text.split_once('=')
            && let format @ (Some(_), _) | format @ (_, true) = (find(name), name == RESPONSES)
            && !file.is_empty()
        {
            let (format, file) = (format.0, file.into());
            return Ok(Self { format, file });
        }
        if let Some((name, file)) = text.split_once('=')
            && name.chars().all(|c| c.is_ascii_lowercase() || c == '-')
        {
            return Err(format!(
                "no format is called `{name}`; there are {}, {RESPONSES} (`./{name}={file}` is a file of that name)",
                FORMATS.map(|f| f.form().name).join(", ")
            ));
        }
        let file = PathBuf::from(text);
        let ending = file.extension().map(|e| e.to_string_lossy().to_lowercase());
        let is = |known: &str| ending.as_deref() == Some(known);
        let format = FORMATS
            .into_iter()
            .find(|format| is(format.form().extension));
        if format.is_some() || UNIVERSAL.into_iter().any(is) {
            return Ok(Self { format, file });
        }
        let mut endings: Vec<String> = Vec::new();
        for ending in FORMATS.map(|f| format!(".{}", f.form().extension)) {
            if !endings.contains(&ending) {
                endings.push(ending);
            }
        }
        Err(format!(
            "its ending tells no format; the endings are {}, .uff, and FORMAT=FILE names one of {}, {RESPONSES}",
            endings.join(", "),
            FORMATS.map(|f| f.form().name).join(", ")
        ))
    }

    pub(super) fn file(&self) -> &Path {
        &self.file
    }

    /// Writes a result, or the responses of the answer that it is of, to the file.
    ///
    /// # Errors
    /// [`Failure`] if the result does not suit the format or the file cannot be written.
    pub(super) fn write(
        &self,
        result: &ResultDocument,
        answer: &Answer,
        verbosity: Verbosity,
    ) -> Result<(), Failure> {
        let (name, made) = match self.format {
            Some(format) => {
                let view = &View::OF_THE_RESULT;
                (
                    format.form().name,
                    make(format, result, view, &self.file, verbosity)?,
                )
            }
            None => {
                let made = responses(answer, &result.title);
                (
                    RESPONSES,
                    made.map_err(|e| unsuitable(&e, RESPONSES, &self.file))?,
                )
            }
        };
        place(name, &self.file, &made, verbosity)
    }
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let format = arguments.to;
    if let Some(file) = &arguments.out {
        let existing = Existing::Keep.or_force(arguments.force);
        output::check(file, [arguments.result.as_path()], existing)?;
    }
    let result = ResultDocument::read(&arguments.result, arguments.method.as_deref())?;
    if result.refused.is_some() && !arguments.anyway {
        return refuse(result.refused.as_deref());
    }
    let Place {
        about,
        rotation,
        grid,
        element,
    } = arguments.view;
    let view = View {
        about,
        rotation,
        grid,
        element,
    };
    let made = make(format, &result, &view, &arguments.result, verbosity)?;
    match &arguments.out {
        Some(file) => place(format.form().name, file, &made, verbosity)?,
        None => std::io::stdout()
            .write_all(&made)
            .map_err(|error| Failure::stdout(&error))?,
    }
    refuse(result.refused.as_deref())
}

/// An export as a whole before the first byte is written: a result that does not suit leaves no
/// file. Errors name a file.
fn make(
    format: &dyn Export,
    result: &ResultDocument,
    view: &View,
    file: &Path,
    verbosity: Verbosity,
) -> Result<Vec<u8>, Failure> {
    let made = bytes(format, result, view)
        .map_err(|error| unsuitable(&error, format.form().name, file))?;
    if let Some(doubt) = doubt(format, result) {
        warn(&[format!("{}: {doubt}", format.form().name)], verbosity);
    }
    Ok(made)
}

/// Writes a file and names it.
fn place(format: &str, file: &Path, made: &[u8], verbosity: Verbosity) -> Result<(), Failure> {
    output::write(file, made)?;
    if !verbosity.quiet {
        eprintln!("{format}: {}", file.display());
    }
    Ok(())
}

fn unsuitable(error: &ExportError, format: &str, file: &Path) -> Failure {
    Failure::because(
        error.exit_code(),
        format!("{}: no export to {format}: {error}", file.display()),
    )
}
