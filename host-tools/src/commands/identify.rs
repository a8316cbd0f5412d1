//! `massline identify`: recordings to ten numbers.

use super::export::Target;
use super::procedure::{Procedure, parse_method};
use super::progress::reading;
use super::{
    Failure, check, compare, details, fitted, print_json, print_numbers, refuse, true_body, warn,
};
use crate::commands::Verbosity;
use crate::detective::{self, Findings};
use crate::format::plain;
use crate::identification::{Answer, Choice, LIKELIHOOD, Refusal, Session, WARNED, Wanted};
use crate::output::{self, Existing};
use crate::printable::quoted;
use crate::report;
use crate::result::ResultDocument;
use crate::setup::{Run, Setup, read_document};
use crate::simulate::Truth;
use std::path::{Path, PathBuf};

/// Contradiction of poses, over what sensors usually differ by, from which their numbers are refused: gains that are
/// 2.5 % off, directions 2.5° and positions 5 mm.
const GRAVE: f64 = 5.0;
/// Advice where no fault was named.
const CHECK: &str = "check `direction`, `position` and `scale` of each sensor, and that the rows of all channels belong to the same poses; `massline check` says more";

/// Identify the ten rigid-body properties from recordings
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  massline identify setup.toml\n  massline identify setup.toml --report report.html\n  massline identify setup.toml --json | jq .mass\n  massline identify setup.toml --export body.bdf --export body.urdf --export mass-matrix=m.csv\n  massline identify setup.toml --method apparent-mass\n  massline identify setup.toml --method all"
)]
pub struct Arguments {
    /// The setup: sensors, processing and runs
    setup: PathBuf,
    /// Method that finds the masslines; the recommended one if absent
    #[arg(long, value_parser = parse_named, value_name = "NAME|all")]
    method: Option<Named>,
    #[command(flatten)]
    procedure: Procedure,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
    /// Write a report with plots; an earlier report is replaced
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Export the result to a file, whose ending tells the format (see `massline export`), or
    /// FORMAT=FILE
    #[arg(long, value_name = "FILE", value_parser = Target::parse)]
    export: Vec<Target>,
    /// Have the report replace a file that is none, and exports replace files that are there
    #[arg(long)]
    force: bool,
    /// Compare with the truth.json of a simulation
    #[arg(long, value_name = "FILE.json")]
    truth: Option<PathBuf>,
    /// Threads; as many as there are processors if absent. The result does not depend on it
    #[arg(long, value_name = "N", value_parser = super::at_least_one)]
    threads: Option<usize>,
    /// Print numbers that are refused because the data contradict them; exit code 1 stays
    #[arg(long)]
    anyway: bool,
}

/// One method, or all of them side by side.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Named {
    One(Wanted),
    All,
}

fn parse_named(name: &str) -> Result<Named, String> {
    match name {
        "all" => Ok(Named::All),
        LIKELIHOOD => Ok(Named::One(Wanted::Likelihood)),
        name => parse_method(name, ", ml, and all").map(|m| Named::One(Wanted::Band(m))),
    }
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the reason.
pub fn run(arguments: &Arguments, verbosity: Verbosity) -> Result<(), Failure> {
    let setup = Setup::read(&arguments.setup)?;
    let truth = arguments.truth.as_deref().map(read_truth).transpose()?;
    let truth = truth.map(|truth| truth.about(setup.reference_point));
    let choice = Choice {
        method: None,
        iterative: arguments.procedure.iterative,
        weighted: arguments.procedure.weighted(),
    };
    if arguments.force && arguments.report.is_none() && arguments.export.is_empty() {
        return Err(Failure::input(
            "--force is about the files of --report and --export; name one, or leave it out",
        ));
    }
    let wanted = match arguments.method {
        None => Wanted::Recommended,
        Some(Named::One(Wanted::Likelihood)) if choice.iterative => {
            return Err(Failure::input(
                "ml has no steps of a reference point: it fits all ten numbers at once, about any point alike; leave out --iterative, or name another method",
            ));
        }
        Some(Named::One(wanted)) => wanted,
        Some(Named::All) => {
            if !arguments.export.is_empty() {
                return Err(Failure::input(
                    "--export writes the result of one method; leave out `--method all`, or name the method to export",
                ));
            }
            if arguments.report.is_some() {
                return Err(Failure::input(
                    "--report shows one method; leave out `--method all`, or name the method to report",
                ));
            }
            let options = compare::Options {
                json: arguments.json,
                anyway: arguments.anyway,
            };
            let truth = in_frame(truth.as_ref(), &setup);
            return compare::run(&setup, &choice, truth.as_ref(), options, verbosity);
        }
    };
    check_outputs(arguments, &setup)?;
    let (answer, findings) = with_progress(&setup, wanted, &choice, arguments.threads, verbosity)?;
    let mut result = ResultDocument::new(&setup, &answer);
    if let Some(found) = &findings {
        result.findings = crate::result::findings(&setup, found);
    }
    // What was computed is shown even if a file cannot be written.
    let reported = arguments.report.as_ref().map_or(Ok(()), |path| {
        let truth = truth.as_ref().map(true_body);
        let page = report::render(&setup, &answer, &result, truth.as_ref());
        output::write(path, page.as_bytes())
    });
    let is_reported = reported.is_ok();
    let exported = export(arguments, &result, &answer, verbosity);
    let written = reported.map_err(Failure::from).and(exported);
    if arguments.json {
        print_json(&result)?;
        refuse(result.refused.as_deref())?;
        return written;
    }
    warn(&of_another(truth.as_ref(), &setup), verbosity);
    warn(&result.warnings, verbosity);
    if let Some(findings) = &findings {
        warn(&check::notes(findings), verbosity);
    }
    details::show(&setup, &answer, &result, verbosity);
    if result.refused.is_none() || arguments.anyway {
        show(&result, in_frame(truth.as_ref(), &setup).as_ref())?;
        if let Some(fit) = &result.likelihood {
            fitted::print(&mut anstream::stdout(), fit).map_err(|e| Failure::stdout(&e))?;
        }
    }
    if let Some(path) = &arguments.report
        && is_reported
        && !verbosity.quiet
    {
        eprintln!("report: {}", path.display());
    }
    refuse(result.refused.as_deref())?;
    written
}

/// A note on a truth that may be of another test.
fn of_another(truth: Option<&Truth>, setup: &Setup) -> Vec<String> {
    let other = |of: &&Truth| of.title != setup.title;
    let note = |of: &Truth| {
        format!(
            "--truth is of \"{}\", the setup of \"{}\": are they one test?",
            quoted(&of.title),
            quoted(&setup.title)
        )
    };
    truth.filter(other).map(note).into_iter().collect()
}

/// Checks that the files of `--report` and `--export` may be written.
fn check_outputs(arguments: &Arguments, setup: &Setup) -> Result<(), Failure> {
    let recordings = setup.runs.iter().map(|run| setup.recording_path(run));
    let recordings: Vec<PathBuf> = recordings.collect();
    let inputs = recordings.iter().chain([&arguments.setup]);
    let inputs = inputs.chain(&arguments.truth).map(PathBuf::as_path);
    if let Some(path) = &arguments.report {
        let existing = Existing::KeepUnlessReport.or_force(arguments.force);
        output::check(path, inputs.clone(), existing)?;
    }
    for (k, target) in arguments.export.iter().enumerate() {
        let existing = Existing::Keep.or_force(arguments.force);
        output::check(target.file(), inputs.clone(), existing)?;
        let mut others = arguments.export[..k].iter().map(Target::file);
        let mut others = others.by_ref().chain(arguments.report.as_deref());
        if others.any(|other| other == target.file()) {
            return Err(Failure::input(format!(
                "{}: two outputs have this name; give each its own",
                target.file().display()
            )));
        }
    }
    Ok(())
}

/// Writes the files of `--export`, as far as the result suits them; refused numbers only if they
/// are wanted anyway.
fn export(
    arguments: &Arguments,
    result: &ResultDocument,
    answer: &Answer,
    verbosity: Verbosity,
) -> Result<(), Failure> {
    if result.refused.is_some() && !arguments.anyway {
        let files = arguments
            .export
            .iter()
            .map(|t| t.file().display().to_string());
        let note = |file| {
            format!("{file}: not written, since the numbers are refused; --anyway exports them")
        };
        warn(&files.map(note).collect::<Vec<_>>(), verbosity);
        return Ok(());
    }
    let mut outcome = Ok(());
    for target in &arguments.export {
        outcome = outcome.and(target.write(result, answer, verbosity));
    }
    outcome
}

/// The answer to a setup on `threads` threads, of the method that is wanted, with a bar on the terminal meanwhile;
/// where the data contradict it, what they say of the sensors, too.
///
/// # Errors
/// As [`Session::wanted_with_modes`].
pub(super) fn with_progress(
    setup: &Setup,
    wanted: Wanted,
    choice: &Choice,
    threads: Option<usize>,
    verbosity: Verbosity,
) -> Result<(Answer, Option<Findings>), Failure> {
    let session = Session::new(setup).with_type_b();
    let mut session = session.on_threads(threads);
    reading(verbosity, |progress| {
        let method = match wanted {
            Wanted::Band(method) => Some(method),
            Wanted::Recommended | Wanted::Likelihood => None,
        };
        session.read_ahead(&Choice { method, ..*choice }, progress);
        let mut answer = session.wanted_with_modes(wanted, choice, progress)?;
        let doubtful = answer.refused.is_some()
            || answer
                .consistency
                .is_some_and(|test| test.probability < WARNED)
            // Delays pass for elasticity, whose terms take what a rigid body leaves.
            || answer.misses_modes(setup)
            // Sensors on the structure bend these methods, and no test of the balance tells.
            || !answer.method.interface_only()
            || detective::is_doubtful(setup, answer.identification.mass.map(|m| m.value))
            // A gain or a shift that all sensors of a kind share leaves a rigid body, too: another one.
            || (method.is_none() && session.is_contradicted(progress));
        // What cannot be examined has been answered all the same.
        let findings = doubtful.then(|| session.examine(progress).ok()).flatten();
        let findings = findings.filter(|findings| !findings.clean());
        if let Some(culprits) = findings.as_ref().and_then(Findings::culprits) {
            let remedy = if findings.as_ref().is_some_and(Findings::mends) {
                format!("{culprits}; `massline check` prints the lines that mend the setup")
            } else {
                culprits
            };
            if let Some(refused) = &mut answer.refused {
                refused.remedy = remedy;
            } else if findings.as_ref().is_some_and(Findings::of_all) {
                let fact = "the sensors contradict each other, and a fault that all of a kind share explains it, which bends the numbers by more than their error bars";
                answer.refused = Some(Refusal {
                    fact: fact.to_owned(),
                    remedy,
                });
            } else if answer.misses_modes(setup) {
                let fact = "no elastic mode is found in `mode_band`, and a fault of the sensors explains it";
                answer.refused = Some(Refusal {
                    fact: fact.to_owned(),
                    remedy,
                });
            }
        }
        // Positions in another unit contradict nothing: centre of gravity and inertia are wrong by powers of it.
        if let Some(whole) = findings.as_ref().and_then(Findings::impossible) {
            answer.refused.get_or_insert_with(|| Refusal {
                fact: "no body has the density that the positions of the sensors say".to_owned(),
                remedy: whole.text.clone(),
            });
        }
        // Of poses no error bar holds what sensors differ by.
        if let Some(findings) = &findings
            && (answer.refused.is_none() && !answer.is_dynamic())
            && findings.balance > GRAVE * GRAVE
        {
            let culprits = findings.culprits();
            answer.refused = Some(Refusal {
                fact: format!(
                    "the load cells and the accelerometers on the interface contradict each other by {} times what usual differences explain",
                    plain(findings.balance.sqrt(), 2)
                ),
                remedy: culprits.unwrap_or_else(|| CHECK.to_owned()),
            });
        }
        // Nothing of the sensors tells of a specimen that stood elsewhere.
        if let Some(refused) = &mut answer.refused
            && findings.is_none()
            && setup.runs.iter().any(Run::is_remounted)
        {
            refused.remedy.push_str(
                "; a wrong `rotation` or `translation` of a run's mounting does this, too",
            );
        }
        // What is missing is looked for in others.
        if let Some(refused) = &mut answer.refused
            && let Some(unlisted) = answer.measurement.unlisted_cells()
        {
            refused.remedy = format!("{unlisted}; or else: {}", refused.remedy);
        }
        Ok((answer, findings))
    })
}

pub(super) fn show(result: &ResultDocument, truth: Option<&Truth>) -> Result<(), Failure> {
    print_numbers(&mut anstream::stdout(), result, truth).map_err(|e| Failure::stdout(&e))
}

/// The truth in the frame of the results.
fn in_frame(truth: Option<&Truth>, setup: &Setup) -> Option<Truth> {
    truth.map(|truth| match &setup.frame {
        Some(frame) => truth.in_frame(frame),
        None => truth.clone(),
    })
}

fn read_truth(path: &Path) -> Result<Truth, Failure> {
    let wrong = |e: &dyn std::fmt::Display| {
        Failure::input(format!(
            "{}: {e}; expected the truth.json that `massline simulate` writes",
            path.display()
        ))
    };
    let text = read_document(path)?;
    serde_json::from_slice(&text).map_err(|e| wrong(&e))
}
