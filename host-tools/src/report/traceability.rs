//! Calibrations and the true sample rate, as the recordings state them.

use super::markup::escape;
use super::number::significant;
use crate::format::with_std;
use crate::measure::MeasuredRun;
use massline_core::identify::half_width_95;
use std::collections::BTreeMap;
use std::fmt::Write;

/// The table; nothing where no recording tells anything.
pub(super) fn table(runs: &[MeasuredRun]) -> String {
    let mut html = String::new();
    for run in runs {
        if let Some(rate) = &run.preamble.sample_rate {
            let half = rate.uncertainty * half_width_95(f64::INFINITY);
            let (value, half) = with_std(rate.value, half);
            let _ = write!(
                html,
                "<p class=\"small\">Run {}: true sample rate {value} ± {half} Hz, by the clock of the {}.</p>",
                escape(&run.name),
                escape(&rate.clock)
            );
        }
    }
    // A sensor may be changed between runs; each of them is told then.
    let mut all: BTreeMap<(&str, [String; 4]), Vec<&str>> = BTreeMap::new();
    for run in runs {
        for (channel, known) in &run.preamble.channel {
            let text = [
                known.serial.clone(),
                known.certificate.clone(),
                known.calibrated.clone().unwrap_or_default(),
                known
                    .uncertainty
                    .map(|u| format!("{} %", significant(100.0 * u, 2)))
                    .unwrap_or_default(),
            ];
            all.entry((channel, text)).or_default().push(&run.name);
        }
    }
    if all.is_empty() {
        return html;
    }
    html.push_str(
        "<h3>Calibration</h3><div class=\"wide\"><table class=\"plain\"><thead><tr>\
         <th scope=\"col\">Channel</th><th scope=\"col\">Serial number</th>\
         <th scope=\"col\">Certificate</th><th scope=\"col\">Calibrated</th>\
         <th scope=\"col\" class=\"num\">Uncertainty</th><th scope=\"col\">Runs</th>\
         </tr></thead><tbody>",
    );
    for ((channel, text), of) in &all {
        let of = if of.len() == runs.len() {
            "all".to_owned()
        } else {
            of.join(", ")
        };
        let [serial, certificate, calibrated, uncertainty] = text.each_ref().map(|t| escape(t));
        let _ = write!(
            html,
            "<tr><th scope=\"row\">{}</th><td>{serial}</td><td>{certificate}</td>\
             <td>{calibrated}</td><td class=\"num\">{uncertainty}</td><td>{}</td></tr>",
            escape(channel),
            escape(&of)
        );
    }
    html.push_str("</tbody></table></div>");
    html
}
