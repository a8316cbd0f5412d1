//! Names under which files of other programs state the sample rate.

/// Names of the sample rate, and of its inverse, in lower case and without underscores.
const RATES: [&str; 7] = [
    "fs",
    "samplerate",
    "samplingrate",
    "samplefrequency",
    "samplingfrequency",
    "srate",
    "fsamp",
];
const STEPS: [&str; 5] = ["dt", "ts", "deltat", "sampletime", "wfincrement"];

/// The sample rate in Hz that a number of this name states; `None` if it is none's name.
pub(super) fn stated(name: &str, number: impl FnOnce() -> Option<f64>) -> Option<f64> {
    let name = name.to_lowercase().replace(['_', ' '], "");
    let is_rate = RATES.contains(&name.as_str());
    if !is_rate && !STEPS.contains(&name.as_str()) {
        return None;
    }
    let value = number()?;
    let value = if is_rate { value } else { 1.0 / value };
    (value.is_finite() && value > 0.0).then_some(value)
}
