//! The study as a page: what holds, tables 1 to 4, frequency responses, errors over noise.

mod plots;
mod tables;

use super::{NoiseKind, Range, Study, WeightRule};
use crate::report::number::{exact, fixed};
use crate::report::page::{Section, page};
use std::fmt::Write;

/// The study as one self-contained HTML file.
#[must_use]
pub fn render(study: &Study) -> String {
    let noise = (!study.levels.is_empty()).then(|| ("noise", "Error over noise", noise(study)));
    let direct = tables::direct(study);
    let iterative = tables::iterative(study);
    let frequencies = tables::frequencies(study);
    let sections: Vec<Section> = [
        ("pattern", "The pattern", pattern(study)),
        ("frequencies", "Natural frequencies", frequencies),
        ("responses", "Frequency responses", plots::responses(study)),
        ("table-3", "Table 3: direct estimation", direct),
        ("table-4", "Table 4: direct and iterative", iterative),
    ]
    .into_iter()
    .chain(noise)
    .chain([("choices", "What the paper leaves open", choices(study))])
    .map(|(id, heading, html)| Section::new(id, heading, html))
    .collect();
    page(
        "The paper’s tuning fork, row by row",
        &header(study),
        &sections,
        &format!(
            "Made by <code>massline study tuning-fork</code>, massline {}.",
            env!("CARGO_PKG_VERSION")
        ),
    )
}

fn header(study: &Study) -> String {
    let holding = study.checks.iter().filter(|c| c.holds).count();
    let mut html = String::from(
        "<header><p class=\"kicker\">Numerical example of Schedlinski and Link, \
         <i>Identification of rigid body properties using base excitation and measured \
         interface forces</i></p><h1>The paper’s tuning fork, row by row</h1>\
         <p class=\"method\">All methods of the paper and three more on a numerical twin of its \
         plane tuning fork, whose true properties are known exactly.</p></header>",
    );
    let _ = write!(
        html,
        "<section class=\"verdict\"><p class=\"lead\">{holding} of {} claims hold on the \
         twin.</p><dl class=\"tiles\">",
        study.checks.len()
    );
    let list = study.exact.list();
    let tiles = [
        (
            "Mass, weighed",
            fixed(1e3 * study.twin.truth.mass, 2),
            "g",
            "the paper’s 630.76 g",
        ),
        (
            "Centre of gravity",
            format!("{}, {}", fixed(1e3 * list[0], 2), fixed(1e3 * list[1], 2)),
            "mm",
            "x and z, from A",
        ),
        (
            "Inertia about A",
            fixed(1e3 * list[2], 3),
            "g m²",
            "about the y axis",
        ),
        (
            "Inertia about S",
            fixed(1e3 * list[3], 3),
            "g m²",
            "about the y axis",
        ),
    ];
    for (name, value, unit, note) in tiles {
        let _ = write!(
            html,
            "<div><dt>{name}</dt><dd><b>{value}\u{202f}{unit}</b><span>{note}</span></dd></div>"
        );
    }
    html.push_str("</dl></section>");
    html
}

/// Claims with their figures.
fn pattern(study: &Study) -> String {
    let mut html = String::from(
        "<div class=\"wide\"><table class=\"plain\"><thead><tr><th scope=\"col\">Holds</th>\
         <th scope=\"col\">Claim</th><th scope=\"col\">Measured</th></tr></thead><tbody>",
    );
    for check in &study.checks {
        let word = if check.holds {
            "yes"
        } else {
            "<span class=\"outside\">no</span>"
        };
        let _ = write!(
            html,
            "<tr><td>{word}</td><td class=\"wrap\">{}</td><td class=\"wrap\">{}</td></tr>",
            tables::typeset(&check.claim),
            tables::typeset(&check.measured)
        );
    }
    html.push_str("</tbody></table></div>");
    html
}

fn noise(study: &Study) -> String {
    let o = &study.options;
    let how = match o.noise_kind {
        NoiseKind::Recordings => format!(
            "White noise on every channel of recordings of {} s, averaged as a measurement \
             would be",
            exact(o.duration)
        ),
        NoiseKind::Responses => {
            "Complex Gaussian noise on every line of the exact frequency responses".to_owned()
        }
    };
    let mut html = format!(
        "<p>{how}; its size is a share of each channel’s root mean square over all runs. \
         Root mean square errors of {} draws, in per cent of the true value. The rotational run \
         shakes at {}\u{202f}rad/s². At the left, set apart, are the same rows without noise: \
         what the averaging of finite recordings leaves.</p>",
        o.draws,
        exact(o.noise_rotation)
    );
    let fits = study.levels.iter().find_map(|level| level.fits.as_ref());
    if let Some(fits) = fits {
        let _ = write!(
            html,
            "<p>The maximum likelihood fit takes all lines to where the interface is rigid, of {} draws; it averages \
             no range, and is the same in both. The bound is what no unbiased estimator can better on these lines.</p>",
            fits.fit.answered + fits.fit.failed
        );
    }
    html.push_str(&plots::noise(study));
    html.push_str(&tables::noise(study));
    html
}

/// The options, each with what was taken.
fn choices(study: &Study) -> String {
    let o = &study.options;
    let band = |[low, high]: [f64; 2], unit: &str| {
        format!("{} to {}\u{202f}{unit}", exact(low), exact(high))
    };
    let shares = o
        .ranges
        .map(|share| format!("{}\u{202f}%", exact(100.0 * share)));
    let rule = match o.weights {
        WeightRule::ByMethod => "each run its own for method a, one set for b to e",
        WeightRule::PerRun => "each run its own",
        WeightRule::Joined => "one set for all runs",
    };
    let rows = [
        (
            "--translation, --rotation",
            "Amplitudes of the noise-free runs",
            format!(
                "{}\u{202f}m/s², {}\u{202f}rad/s²",
                exact(o.translation),
                exact(o.rotation)
            ),
        ),
        (
            "--spacing, --highest",
            "Frequency lines",
            format!(
                "every {}\u{202f}Hz up to {}\u{202f}Hz",
                exact(o.spacing),
                exact(o.highest)
            ),
        ),
        (
            "--ranges",
            "Ends of ranges I and II, shares of the first fixed frequency",
            format!(
                "{} and {}: {} and {}",
                shares[0],
                shares[1],
                band(study.range(Range::I), "Hz"),
                band(study.range(Range::II), "Hz")
            ),
        ),
        (
            "--mode-band, --minimum-weight",
            "Where the weighting looks, and the least weight",
            format!("{}, {}", band(o.mode_band, "Hz"), exact(o.minimum_weight)),
        ),
        ("--weights", "Runs that share weights", rule.to_owned()),
        (
            "--fit-band, --modes",
            "Where d and e fit elastic modes, and how many at most",
            format!(
                "{}, {}",
                o.fit_band
                    .map_or_else(|| "all lines".to_owned(), |b| band(b, "Hz")),
                o.modes
            ),
        ),
        (
            "--pole-band",
            "Where the apparent mass looks for poles",
            band(o.pole_band, "Hz"),
        ),
        (
            "--tolerance, --iterations",
            "When the iteration ends",
            format!(
                "A and S within {}\u{202f}m, at most {} solutions",
                crate::report::number::significant(o.tolerance, 1),
                o.iterations
            ),
        ),
        (
            "--noise, --draws, --fits, --seed",
            "Noise",
            format!(
                "{}\u{202f}%, {} draws, {} of them fitted by maximum likelihood, from seed {}",
                o.noise
                    .iter()
                    .map(|n| exact(100.0 * n))
                    .collect::<Vec<_>>()
                    .join(", "),
                o.draws,
                o.fits.unwrap_or(o.draws).min(o.draws),
                o.seed
            ),
        ),
        (
            "--duration, --noise-rotation",
            "Recordings under noise",
            format!(
                "{}\u{202f}s, rotation at {}\u{202f}rad/s²",
                exact(o.duration),
                exact(o.noise_rotation)
            ),
        ),
    ];
    let mut html = String::from(
        "<p>The published numbers do not determine the fork’s geometry, sensor places, \
         excitation or frequency lines. The twin was made from mass, centre of gravity, inertia \
         and the nine natural frequencies; the rest are options of the command, with these \
         values here.</p><div class=\"wide\"><table class=\"plain\"><thead><tr>\
         <th scope=\"col\">Choice</th><th scope=\"col\">Value</th>\
         <th scope=\"col\">Option</th></tr></thead><tbody>",
    );
    for (option, what, value) in rows {
        let _ = write!(
            html,
            "<tr><td>{what}</td><td class=\"wrap\">{value}</td><td><code>{option}</code></td></tr>"
        );
    }
    html.push_str("</tbody></table></div>");
    html
}

#[cfg(test)]
mod tests {
    use super::super::{Options, run};
    use super::*;

    #[test]
    fn the_page_is_well_formed_and_fetches_nothing() {
        let options = Options {
            draws: 1,
            noise: vec![0.01],
            // With lines to 195 Hz it takes seconds: tests of the whole study have it.
            fits: Some(0),
            ..Options::default()
        };
        let study = run(&options, &mut |_| ()).unwrap();
        let html = render(&study);
        let xml = html.replace("<!DOCTYPE html>", "");
        let page = roxmltree::Document::parse(&xml).unwrap();
        for section in [
            "pattern",
            "frequencies",
            "responses",
            "table-3",
            "table-4",
            "noise",
        ] {
            let there = |n: roxmltree::Node<'_, '_>| n.attribute("id") == Some(section);
            assert!(page.descendants().any(there), "{section}");
        }
        for name in ["src", "href"] {
            let outside = page
                .descendants()
                .filter_map(|n| n.attribute(name))
                .find(|link| !link.starts_with('#'));
            assert_eq!(outside, None);
        }
        // Every row of table 3 and those beyond, by name.
        for (row, _) in study.rows() {
            assert!(html.contains(&row.name()), "{}", row.name());
        }
        // 3 + 3 + 3 responses, 2 x 6 errors over noise.
        let charts = page.descendants().filter(|n| n.has_tag_name("figure"));
        assert_eq!(charts.count(), 21);
    }
}
