//! Lines, modes and tests of a maximum likelihood fit on the terminal.

use crate::format::plain;
use crate::printable::printable;
use crate::result::LikelihoodDocument;
use anstyle::Style;
use std::io::{Result, Write};

/// Prints which lines the numbers come from, with the modes and the tests of the fit.
///
/// # Errors
/// If the terminal is gone.
pub(super) fn print(out: &mut dyn Write, fit: &LikelihoodDocument) -> Result<()> {
    let dim = Style::new().dimmed();
    if !fit.used {
        // What a fit fails is in a note.
        let why = match &fit.stepped_back {
            Some(why) if fit.band.is_none() && fit.rejected.is_empty() => {
                format!(", not of maximum likelihood: {}", printable(why))
            }
            _ => String::new(),
        };
        return writeln!(
            out,
            "\n{dim}the numbers are those of apparent-mass in the averaging band{why}{dim:#}"
        );
    }
    let [low, high] = fit.band.unwrap_or_default();
    writeln!(
        out,
        "\n{dim}fitted: {} lines from {} to {} Hz{dim:#}",
        fit.lines,
        plain(low, 4),
        plain(high, 4)
    )?;
    for mode in &fit.modes {
        writeln!(
            out,
            "{dim}  mode at {} Hz, damping {} %{}{dim:#}",
            plain(mode.frequency, 6),
            plain(100.0 * mode.damping, 3),
            if mode.among_lines {
                ""
            } else {
                " (beyond the lines)"
            }
        )?;
    }
    let ratio = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), |x| plain(x, 3));
    writeln!(
        out,
        "{dim}residuals: {} times the power of the noise; error bars: {} times {}{dim:#}",
        ratio(fit.residual_ratio),
        ratio(fit.over_bound),
        fit.bound_in_words()
    )
}
