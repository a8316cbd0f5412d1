//! Details of `--verbose`: samples, blocks, lines and fits.

use crate::commands::Verbosity;
use crate::format::plain;
use crate::identification::Answer;
use crate::result::ResultDocument;
use crate::setup::Setup;
use anstyle::Style;
use std::io::Write;

/// Says on stderr what an answer was made of, if the user wants to know.
pub(super) fn show(setup: &Setup, answer: &Answer, result: &ResultDocument, verbosity: Verbosity) {
    if !verbosity.verbose {
        return;
    }
    let dim = Style::new().dimmed();
    let mut err = anstream::stderr();
    for line in lines(setup, answer, result) {
        // Details that cannot be shown are no reason to withhold the result.
        let _ = writeln!(err, "{dim}{line}{dim:#}");
    }
}

fn lines(setup: &Setup, answer: &Answer, result: &ResultDocument) -> Vec<String> {
    let mut lines = Vec::new();
    let m = &answer.measurement;
    for run in &setup.runs {
        // They have just been read.
        let opened = setup.open_recording(run, &[]).ok();
        if let Some(form) = opened.and_then(|recording| recording.described()) {
            lines.push(format!("{}: read as {form}", run.recording.display()));
        }
    }
    for run in &m.runs {
        let settings = run.settings();
        let rate = settings.grid().spacing * settings.block_length() as f64;
        lines.push(format!(
            "run \"{}\": {} samples at {} Hz ({} s), {} blocks of {}, referred to {}",
            run.name,
            run.samples,
            plain(rate, 6),
            plain(run.samples as f64 / rate, 4),
            run.blocks,
            settings.block_length(),
            match run.responses() {
                Some(_) => "the drive",
                None => "the accelerometers",
            }
        ));
    }
    for run in &m.sines {
        lines.push(format!(
            "run \"{}\": {} frequencies",
            run.name,
            run.frequencies.len()
        ));
    }
    for run in &m.poses {
        lines.push(format!("run \"{}\": {} poses", run.name, run.rows.len()));
    }
    if let (Some(grid), Some(p)) = (&m.grid, &setup.processing) {
        lines.push(format!(
            "lines: {} from {} to {} Hz, {} Hz apart; {} of them in the averaging band from {} to {} Hz",
            grid.count,
            plain(grid.frequency(0), 4),
            plain(grid.frequency(grid.count.saturating_sub(1)), 4),
            plain(grid.spacing, 4),
            m.band.indices().len(),
            p.averaging_band[0],
            p.averaging_band[1]
        ));
    }
    for fit in &answer.fits {
        let poles: Vec<String> = fit
            .poles
            .iter()
            .map(|pole| format!("{} Hz", plain(pole.frequency, 4)))
            .collect();
        lines.push(format!(
            "elastic terms: {}; {} independent directions of base acceleration",
            if poles.is_empty() {
                "no mode in the lines".to_owned()
            } else {
                format!("modes at {}", poles.join(", "))
            },
            fit.excited
        ));
    }
    lines.push(format!(
        "normal equations: condition number {} after scaling of the columns; {} step(s)",
        plain(result.condition_number, 3),
        result.iterations
    ));
    if let Some(ratio) = result.consistency {
        lines.push(format!(
            "residual: {} times what the noise explains, {} % of the forces",
            plain(ratio.sqrt(), 3),
            plain(100.0 * result.misfit, 2)
        ));
    }
    lines
}
