//! What the numbers themselves say about the test.

use crate::measure::{MeasuredRun, Measurement, Spectra};
use crate::setup::Setup;
use massline_core::identify::Identification;
use massline_core::masslines::ApparentMass;

/// Adds what the user should know of an answer.
pub(super) fn notice(
    identification: &Identification,
    measurement: &Measurement,
    warnings: &mut Vec<String>,
) {
    notice_numbers(identification, warnings);
    let cross = |r: &MeasuredRun| matches!(r.spectra, Spectra::Cross { .. });
    if measurement.runs.iter().any(cross) {
        warnings.push(
            "without a drive channel (`reference`) the noise of the accelerometers biases the result; record the generator's signal if you can".to_owned(),
        );
    }
}

/// Adds what the ten numbers themselves say.
pub(crate) fn notice_numbers(identification: &Identification, warnings: &mut Vec<String>) {
    let missing: Vec<&str> = identification.unobservable().map(|p| p.name()).collect();
    if !missing.is_empty() {
        warnings.push(format!(
            "not observable from this test: {}",
            missing.join(", ")
        ));
    }
    if let Some(reason) = identification.plausibility.first_violation() {
        warnings.push(format!("no real body has these properties: {reason}"));
    }
    if let Some(ratio) = identification.consistency
        && ratio > 4.0
    {
        warnings.push(format!(
            "a rigid body leaves {:.1} times more than the noise explains; error bars were widened. Check sensor positions, directions and scales",
            ratio.sqrt()
        ));
    }
    if identification.attenuation > 0.25 {
        warnings.push(
            "noise in the base acceleration pulls some results towards zero by as much as their error bars say; shake harder in rotation".to_owned(),
        );
    }
}

/// Adds what the user should know of a fit without elastic modes where there should be some.
pub(super) fn notice_missing_modes(
    setup: &Setup,
    fits: &[ApparentMass],
    warnings: &mut Vec<String>,
) {
    let band = setup.processing.as_ref().and_then(|p| p.mode_band);
    if let Some([low, high]) = band
        && !fits.is_empty()
        && fits.iter().all(|fit| fit.poles.is_empty())
    {
        warnings.push(format!(
            "method apparent-mass: no elastic mode was found up to {high} Hz, though `mode_band` expects one from {low} Hz; a term in ω² takes its place, which is good far below the first mode only. Extend `mode_band` to where the structure rings, or leave it out if it is rigid"
        ));
    }
}
