//! `massline export`: a result in another program's format.

use super::{Failure, refuse};
use crate::commands::Verbosity;
use crate::export::{Export, ExportError, FORMATS, find};
use crate::output::{self, Existing};
use crate::result::ResultDocument;
use clap::builder::PossibleValue;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Export a result to the format of another program
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline identify setup.toml --json > result.json\n  massline export result.json --to csv --out result.csv\n  massline export result.json --to csv | column -s, -t"
)]
pub struct Arguments {
    /// The document of `massline identify --json`
    result: PathBuf,
    /// The format
    #[arg(long, visible_alias = "format", value_name = "FORMAT", value_parser = Formats)]
    to: &'static dyn Export,
    /// The file to write; stdout if absent
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replace the file if it is there already
    #[arg(long, requires = "out")]
    force: bool,
    /// Export numbers that are refused because the data contradict them; exit code 1 stays
    #[arg(long)]
    anyway: bool,
}

/// Reads the name of a format; the list of formats is its help.
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
        let names = FORMATS.map(|format| format.name());
        let name = clap::builder::PossibleValuesParser::new(names);
        let name = name.parse_ref(command, argument, value)?;
        find(&name).ok_or_else(|| clap::Error::new(clap::error::ErrorKind::InvalidValue))
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        let value =
            |format: &dyn Export| PossibleValue::new(format.name()).help(format.description());
        Some(Box::new(FORMATS.into_iter().map(value)))
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
    let result = ResultDocument::read(&arguments.result)?;
    if result.refused.is_some() && !arguments.anyway {
        return refuse(result.refused.as_deref());
    }
    // As a whole before the first byte is written: a result that does not suit leaves no file.
    let mut bytes = Vec::new();
    format
        .write(&result, &mut bytes)
        .map_err(|error| unsuitable(&error, format, &arguments.result))?;
    match &arguments.out {
        Some(file) => {
            output::write(file, &bytes)?;
            if !verbosity.quiet {
                eprintln!("{}: {}", format.name(), file.display());
            }
        }
        None => std::io::stdout()
            .write_all(&bytes)
            .map_err(|error| Failure::stdout(&error))?,
    }
    refuse(result.refused.as_deref())
}

fn unsuitable(error: &ExportError, format: &dyn Export, result: &Path) -> Failure {
    Failure::because(
        1,
        format!(
            "{}: no export to {}: {error}",
            result.display(),
            format.name()
        ),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::result::tests::FORK;

    /// A format that needs all ten numbers, which the fork's plane test does not determine.
    struct NeedsAll;

    impl Export for NeedsAll {
        fn name(&self) -> &'static str {
            "needs-all"
        }

        fn description(&self) -> &'static str {
            "a body of six degrees of freedom"
        }

        fn extension(&self) -> &'static str {
            "body"
        }

        fn write(&self, result: &ResultDocument, out: &mut dyn Write) -> Result<(), ExportError> {
            for property in result.properties() {
                let value = property
                    .number
                    .value
                    .ok_or_else(|| ExportError::Unsuitable {
                        reason: format!("`{}` is not observable", property.name),
                    })?;
                writeln!(out, "{value}")?;
            }
            Ok(())
        }
    }

    #[test]
    fn a_result_that_does_not_suit_a_format_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let result = folder.path().join("result.json");
        std::fs::write(&result, serde_json::to_vec(&*FORK).unwrap()).unwrap();
        let out = folder.path().join("x.body");
        let arguments = Arguments {
            result,
            to: &NeedsAll,
            out: Some(out.clone()),
            force: false,
            anyway: false,
        };
        let failure = run(&arguments, Verbosity::default()).unwrap_err();
        assert_eq!(failure.code, 1);
        for words in ["result.json", "needs-all", "`centre_of_gravity.y`"] {
            assert!(failure.message.contains(words), "{}", failure.message);
        }
        assert!(!out.exists());
    }
}
