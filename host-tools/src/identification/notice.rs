//! Warnings that follow from the numbers.

use super::refusal::{notice_weighed, refusal};
use super::{Judged, WARNED};
use crate::format::plain;
use crate::measure::{MeasuredRun, Measurement, Spectra};
use crate::setup::Setup;
use massline_core::masslines::ApparentMass;
use massline_core::rigid_body::{Margin, Verdict};

/// Adds what the user should know of an answer.
pub(super) fn notice(judged: &Judged<'_>, measurement: &Measurement, warnings: &mut Vec<String>) {
    notice_numbers(judged, warnings);
    let cross = |r: &MeasuredRun| matches!(r.spectra, Spectra::Cross { .. });
    if measurement.runs.iter().any(cross) {
        warnings.push(
            "without a drive channel (`reference`) the noise of the accelerometers biases the result; record the generator's signal if you can".to_owned(),
        );
    }
}

/// Adds what the ten numbers themselves say, if they are not refused: what refuses them is
/// said instead.
pub(crate) fn notice_numbers(judged: &Judged<'_>, warnings: &mut Vec<String>) {
    let identification = judged.identification;
    let refused = refusal(judged).is_some();
    let missing: Vec<&str> = identification.unobservable().map(|p| p.name()).collect();
    if !missing.is_empty() {
        warnings.push(format!(
            "not observable from this test: {}",
            missing.join(", ")
        ));
    }
    if refused {
        return;
    }
    let plausibility = &identification.plausibility;
    if let Some(reason) = plausibility.reason() {
        let conditions = [
            plausibility.mass,
            plausibility.positive_definite,
            plausibility.triangle,
        ];
        let near = |m: &Margin| m.verdict() == Verdict::Undecided;
        if plausibility.verdict() == Verdict::Violated {
            warnings.push(format!("no real body has these properties: {reason}"));
        } else if conditions.iter().flatten().any(near) {
            warnings.push(format!(
                "it cannot be judged if a real body has these properties: {reason}"
            ));
        }
    }
    warnings.extend(notice_weighed(judged));
    if let Some(test) = judged.consistency
        && test.probability < WARNED
    {
        let (place, bars) = if judged.widened {
            ("", "error bars were widened")
        } else {
            (" in the averaging band", "the error bars do not know of it")
        };
        let usual = judged.type_b.and_then(|b| b.times_usual);
        let bars = usual.map_or_else(
            || bars.to_owned(),
            |times| {
                format!(
                    "{bars}, and type B uncertainty holds errors of sensors that explain it: {} times 0.5 % of gain, 1 mm and 0.5°",
                    plain(times, 2)
                )
            },
        );
        warnings.push(format!(
            "a rigid body leaves {:.1} times more{place} than the noise explains, which chance does in {}; {bars}. Check sensor positions, directions and scales",
            test.ratio.sqrt(),
            one_in(test.probability)
        ));
    }
    if identification.attenuation > 0.25 {
        warnings.push(
            "noise in the base acceleration pulls some results towards zero by as much as their error bars say; shake harder in rotation".to_owned(),
        );
    }
}

/// A probability in words: one in so many.
fn one_in(probability: f64) -> String {
    let decades = -probability.max(1e-300).log10();
    if decades < 6.0 {
        format!("one test of {}", plain(10_f64.powf(decades), 1))
    } else {
        format!("less than one test of 10^{}", decades.floor())
    }
}

/// The mode band, where fits find no elastic modes in it.
pub(super) fn misses_modes(setup: &Setup, fits: &[ApparentMass]) -> Option<[f64; 2]> {
    let band = setup.processing.as_ref()?.mode_band?;
    let none = !fits.is_empty() && fits.iter().all(|fit| fit.poles.is_empty());
    none.then_some(band)
}

/// Adds what the user should know of a fit without elastic modes where there should be some.
pub(super) fn notice_missing_modes(
    setup: &Setup,
    fits: &[ApparentMass],
    warnings: &mut Vec<String>,
) {
    if let Some([low, high]) = misses_modes(setup, fits) {
        warnings.push(format!(
            "method apparent-mass: no elastic mode was found up to {high} Hz, though `mode_band` expects one from {low} Hz; a term in ω² and a pseudo-mode above the band take its place, which is good for lines up to 0.7 times the first mode. Extend `mode_band` to where the structure rings, or leave it out if it is rigid; of many modes that overlap this method finds none, and of random runs --method ml finds them one by one"
        ));
    }
}
