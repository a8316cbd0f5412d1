//! The report: one HTML file that an engineer can read, print and send.
//!
//! Inline style and inline SVG, no script, nothing fetched. Page assembly and drawing are
//! apart: `plot` knows nothing of rigid bodies and serves other pages as well, `sketch`
//! draws the three views, the other files say what a section contains.
//!
//! | file | section |
//! | --- | --- |
//! | `findings` | what the recordings contradict in the setup |
//! | `verdict` | title, method, verdict, warnings |
//! | `table` | the ten numbers with error bars |
//! | `budget` | what of them comes from noise, what from errors of sensors |
//! | `apparent_mass`, `response` | apparent mass with the fit |
//! | `likelihood` | lines, modes and residuals of the maximum likelihood fit |
//! | `modes` | modes with effective masses |
//! | `coherence`, `base_spectra` | was the excitation good enough |
//! | `poses` | static poses: loads, residuals |
//! | `sketch` | sensors, CG and inertia in three views |
//! | `runs`, `channels`, `traceability` | runs, processing, channels, what their sensitivities rest on, how to read it |
//!
//! | file | what sections are made of |
//! | --- | --- |
//! | `page`, `markup` | one HTML page, text into HTML and SVG |
//! | `plot/`, `style.css` | plots; their style and the pages' |
//! | `lines` | runs as the estimators see them |
//! | `number`, `scales` | numbers as text, units that suit them |
//! | `rigid`, `truth` | the rigid body of a result, true properties |

mod apparent_mass;
mod base_spectra;
mod budget;
mod channels;
mod coherence;
mod findings;
mod likelihood;
mod lines;
pub mod markup;
mod modes;
pub mod number;
pub mod page;
pub mod plot;
mod poses;
mod response;
mod rigid;
mod runs;
pub(crate) mod scales;
pub(crate) mod sketch;
mod table;
#[cfg(test)]
mod tests;
mod traceability;
mod truth;
mod verdict;

pub use truth::TrueBody;

use crate::identification::Answer;
use crate::result::ResultDocument;
use crate::setup::Setup;
use page::Section;

/// The report of a result as an HTML page: its numbers are those of `result`, its plots those of
/// the spectra in `answer`; `truth` are the true properties in the frame of the sensors, where they
/// are known. Plots and the sketch are along the axes of the sensors, whatever frame the numbers are
/// in.
#[must_use]
pub fn render(
    setup: &Setup,
    answer: &Answer,
    result: &ResultDocument,
    truth: Option<&TrueBody>,
) -> String {
    let framed = result.frame.as_ref();
    let framed_truth = framed.and_then(|frame| Some(truth?.in_frame(frame)));
    let true_numbers = framed_truth.as_ref().or(truth);
    let ten = Section::new("ten", "The ten numbers", table::table(result, true_numbers));
    let numbers = result;
    let of_sensors = framed.map(|_| {
        let frame = None;
        ResultDocument::new(
            &Setup {
                frame,
                ..setup.clone()
            },
            answer,
        )
    });
    let result = of_sensors.as_ref().unwrap_or(numbers);
    let mut sections: Vec<Section> = findings::section(numbers).into_iter().collect();
    sections.push(ten);
    sections.extend(budget::section(numbers));
    sections.extend(apparent_mass::section(answer, result));
    sections.extend(likelihood::section(result));
    sections.extend(modes::section(numbers));
    sections.extend(poses::section(answer, result));
    sections.extend(coherence::section(answer, result));
    sections.extend(base_spectra::section(answer));
    sections.push(sketch::section(setup, result, truth));
    sections.push(runs::section(setup, answer, result));
    sections.push(runs::reading(answer));
    page::page(
        verdict::title(setup),
        &verdict::header(setup, answer, numbers, true_numbers),
        &sections,
        &format!("Made by massline {}.", env!("CARGO_PKG_VERSION")),
    )
}
