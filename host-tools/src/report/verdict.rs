//! The beginning of the report: what was found, how sure it is, what to look out for.

use super::TrueBody;
use super::markup::escape;
use super::number::{exact, in_words, significant, uncertain, with_unit};
use super::scales::{Natural, Unit};
use super::table::TERMS;
use crate::identification::{Answer, WARNED};
use crate::result::{Number, ResultDocument};
use crate::setup::Setup;
use std::fmt::Write;

/// Title, method, verdict and warnings.
pub(super) fn header(
    setup: &Setup,
    answer: &Answer,
    result: &ResultDocument,
    truth: Option<&TrueBody>,
) -> String {
    let title = title(setup);
    let mut html = format!(
        "<header><p class=\"kicker\">Rigid-body properties from a base-excitation test</p>\
         <h1>{}</h1><p class=\"method\">{}</p></header>",
        escape(title),
        method(answer, result)
    );
    let natural = Natural::new(result, None);
    let _ = write!(
        html,
        "<section class=\"verdict\"><p class=\"lead\">{}</p>{}</section>",
        sentence(result, &natural, truth),
        tiles(result, &natural)
    );
    html.push_str(&warnings(result));
    html
}

/// The setup's title, or something to call it.
pub(super) fn title(setup: &Setup) -> &str {
    let title = setup.title.trim();
    if title.is_empty() {
        "Untitled test"
    } else {
        title
    }
}

fn method(answer: &Answer, result: &ResultDocument) -> String {
    let measurement = &answer.measurement;
    let dynamic = answer.is_dynamic();
    let mut text = if !dynamic {
        "Static poses: resultants over specific force".to_owned()
    } else {
        let mut description = result.method_description().to_owned();
        if let Some(first) = description.get(..1).map(str::to_uppercase) {
            description.replace_range(..1, &first);
        }
        if !measurement.poses.is_empty() {
            description.push_str(", together with static poses");
        }
        description
    };
    text.push_str(if result.iterative {
        "; iterated to the centre of gravity"
    } else {
        "; direct"
    });
    if result.weighted {
        text.push_str(", accelerometers weighted");
    }
    text.push('.');
    let mut html = escape(&text);
    if let Some(why) = result.recommended_because.as_ref().filter(|_| dynamic) {
        let _ = write!(html, " Chosen because {}.", escape(why));
    }
    html
}

/// An error bar as a share, and whose it is.
struct Weakest {
    share: f64,
    name: String,
}

fn weakest(result: &ResultDocument, natural: &Natural) -> Option<Weakest> {
    let mut all: Vec<(String, &Number, Option<f64>)> = vec![match &result.indicator {
        Some(delta) => ("the indicator Δ".to_owned(), delta, Some(1.0)),
        None => ("the mass".to_owned(), &result.mass, natural.mass),
    }];
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let name = format!("the CG's {name}");
        all.push((name, &result.centre_of_gravity[axis], natural.length));
    }
    for (number, name) in result.inertia_cg.terms().into_iter().zip(TERMS) {
        let name = format!("Θ<sub>{name}</sub> about S");
        all.push((name, number, natural.inertia));
    }
    all.into_iter()
        .filter(|(_, number, _)| number.observable)
        .filter_map(|(name, number, whole)| {
            let share = number.half_width() / whole?.abs();
            share.is_finite().then_some(Weakest { share, name })
        })
        .max_by(|a, b| a.share.total_cmp(&b.share))
}

fn sentence(result: &ResultDocument, natural: &Natural, truth: Option<&TrueBody>) -> String {
    let refused = result.refused.as_ref().map_or(String::new(), |reason| {
        let reason = with_code(&format!("{reason}."));
        format!(
            "<strong class=\"bad\">Refused; the data do not allow an answer:</strong> {reason} "
        )
    });
    let count = result.observable();
    let mut text = if count == 10 {
        "<strong>All ten</strong> rigid-body properties are observable".to_owned()
    } else {
        let verb = if count == 1 { "is" } else { "are" };
        let words = capitalised(&in_words(count));
        format!("<strong>{words} of ten</strong> rigid-body properties {verb} observable")
    };
    if let Some(w) = weakest(result, natural) {
        let _ = write!(
            text,
            "; the weakest error bar is that of {}, ±{}",
            w.name,
            with_unit(&significant(100.0 * w.share, 2), "%")
        );
    }
    text.push_str(". ");
    let plausible = &result.plausible;
    let reason = plausible.reason.as_deref().map_or(String::new(), escape);
    match plausible.ok {
        Some(false) => {
            let _ = write!(
                text,
                "<strong class=\"bad\">No real body is like this:</strong> {reason}."
            );
        }
        None => {
            let _ = write!(
                text,
                "This test cannot judge if they are physically plausible: {reason}."
            );
        }
        Some(true) if contradicted(result) => text.push_str(
            "Such a body can exist, but <strong class=\"bad\">the data contradict a rigid body</strong>: see the notes.",
        ),
        Some(true) => text.push_str("The numbers are physically plausible."),
    }
    if let Some(truth) = truth {
        text.push_str(&covered(result, truth));
    }
    refused + &text
}

/// `true` if a rigid body leaves more than noise explains, or sensors are suspected.
fn contradicted(result: &ResultDocument) -> bool {
    let test = result.consistency_test;
    test.is_some_and(|test| test.probability < WARNED) || !result.findings.is_empty()
}

/// A sentence that counts the known true values within their 95\u{202f}% intervals.
fn covered(result: &ResultDocument, truth: &TrueBody) -> String {
    let mut pairs = vec![(&result.mass, truth.mass)];
    pairs.extend(result.centre_of_gravity.iter().zip(truth.centre_of_gravity));
    pairs.extend(result.inertia_cg.terms().into_iter().zip(truth.inertia_cg));
    let inside: Vec<bool> = pairs
        .into_iter()
        .filter(|(number, _)| number.std > Some(0.0))
        .filter_map(|(number, t)| Some((number.value?, number.half_width(), t?)))
        .filter(|(_, _, t)| t.is_finite())
        .map(|(value, half, t)| (value - t).abs() <= half)
        .collect();
    if inside.is_empty() {
        return String::new();
    }
    let hits = inside.iter().filter(|x| **x).count();
    let known = in_words(inside.len());
    let lie = match (hits == inside.len(), hits) {
        (true, 1) => "it lies in its 95\u{202f}% interval",
        (true, _) => "all lie in their 95\u{202f}% intervals",
        (false, 1) => "one lies in its 95\u{202f}% interval",
        (false, _) => &format!("{} lie in their 95\u{202f}% intervals", in_words(hits)),
    };
    if inside.len() == 1 {
        format!(" The true value of one of them is known: {lie}.")
    } else {
        format!(" The true values of {known} of them are known: {lie}.")
    }
}

pub(super) fn capitalised(word: &str) -> String {
    let mut letters = word.chars();
    letters.next().map_or(String::new(), |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

/// Mass, CG, inertia and plausibility at a glance.
fn tiles(result: &ResultDocument, natural: &Natural) -> String {
    let mass = result.mass.estimate().map_or_else(not_observable, |m| {
        let unit = Unit::of_mass(m.value);
        let half = result.mass.half_width();
        let indicator = result.indicator.as_ref();
        let below = match indicator.and_then(|delta| delta.value.zip(Some(delta.half_width()))) {
            Some((delta, half)) => format!("weighed; Δ = {}", uncertain(delta, half)),
            None if m.std == 0.0 => "weighed".to_owned(),
            None => percent(half, natural.mass, "of it"),
        };
        let text = uncertain(m.value / unit.si, half / unit.si);
        (with_unit(&text, unit.symbol), below)
    });
    let centre = if result.centre_of_gravity.iter().all(|n| !n.observable) {
        not_observable()
    } else {
        let halves = result.centre_of_gravity.iter().map(Number::half_width);
        let worst = halves.fold(0.0, f64::max);
        let decimals = super::number::decimals_of(worst * 1e3);
        let values = result.centre_of_gravity.each_ref().map(|n| {
            n.value.map_or_else(
                || super::number::NO_NUMBER.to_owned(),
                |value| super::number::fixed(value * 1e3, decimals),
            )
        });
        (
            with_unit(&format!("({})", values.join(", ")), "mm"),
            format!(
                "each within ±{}",
                with_unit(&significant(worst * 1e3, 2), "mm")
            ),
        )
    };
    let terms = result.inertia_cg.terms();
    let seen = terms.iter().filter(|t| t.observable).count();
    let inertia = if seen == 0 {
        not_observable()
    } else {
        let halves = terms.iter().map(|t| t.half_width());
        let worst = halves.fold(0.0, f64::max);
        let largest = natural.inertia.unwrap_or(f64::NAN);
        let unit = Unit::of_inertia(largest);
        let count = match seen {
            6 => "all six terms".to_owned(),
            n => format!("{} of six terms", in_words(n)),
        };
        (
            with_unit(
                &format!("±{}", significant(worst / unit.si, 2)),
                unit.symbol,
            ),
            format!(
                "{count}; {}",
                percent(worst, natural.inertia, "of the largest")
            ),
        )
    };
    let plausible = plausible(result);
    let mut html = String::from("<dl class=\"tiles\">");
    for (name, (value, below)) in [
        ("Mass", mass),
        ("Centre of gravity S", centre),
        ("Inertia about S", inertia),
        ("Plausible", plausible),
    ] {
        let _ = write!(
            html,
            "<div><dt>{name}</dt><dd><b>{value}</b><span>{below}</span></dd></div>"
        );
    }
    html.push_str("</dl>");
    html
}

fn plausible(result: &ResultDocument) -> (String, String) {
    let p = &result.plausible;
    match p.ok {
        Some(false) => ("no".to_owned(), "see above".to_owned()),
        None => ("cannot be judged".to_owned(), "see above".to_owned()),
        Some(true) if contradicted(result) => (
            "as a body, yes".to_owned(),
            "but the data contradict a rigid body".to_owned(),
        ),
        Some(true) => {
            let checked = p.triangle_margin.map_or_else(
                || "as far as this test can tell".to_owned(),
                |margin| {
                    let half = p.triangle_interval.unwrap_or(f64::INFINITY);
                    let (margin, half) = (100.0 * margin, 100.0 * half);
                    let margin = with_unit(&uncertain(margin, half), "%");
                    format!("positive definite; triangle margin {margin}")
                },
            );
            ("yes".to_owned(), checked)
        }
    }
}

fn not_observable() -> (String, String) {
    (
        super::number::NO_NUMBER.to_owned(),
        "not observable from this test".to_owned(),
    )
}

fn percent(half: f64, whole: Option<f64>, of: &str) -> String {
    match whole {
        Some(whole) if whole != 0.0 => {
            let text = significant(100.0 * half / whole.abs(), 2);
            format!("±{} {of}", with_unit(&text, "%"))
        }
        _ => format!("±{}", exact(half)),
    }
}

fn warnings(result: &ResultDocument) -> String {
    if result.warnings.is_empty() {
        return String::new();
    }
    let mut html = String::from("<section class=\"notes\"><h2>Please note</h2><ul>");
    for warning in &result.warnings {
        let text = capitalised(warning.trim_end_matches('.'));
        let _ = write!(html, "<li>{}.</li>", with_code(&text));
    }
    html.push_str("</ul></section>");
    html
}

/// Escaped text in which what stands between backquotes is code.
pub(super) fn with_code(text: &str) -> String {
    let mut html = String::new();
    let parts: Vec<&str> = text.split('`').collect();
    for (i, part) in parts.iter().enumerate() {
        let closed = i + 1 < parts.len();
        match (i % 2 == 1, closed) {
            (true, true) => {
                let _ = write!(html, "<code>{}</code>", escape(part));
            }
            (true, false) => {
                let _ = write!(html, "`{}", escape(part));
            }
            _ => html.push_str(&escape(part)),
        }
    }
    html
}
