//! Signals as Simcenter Testlab exports them to MATLAB: a struct for each, or for several side by side.
//!
//! | field | holds |
//! | --- | --- |
//! | `x_values.increment` | time from one sample to the next, s |
//! | `x_values.quantity.label` | unit of that, absent or `s` |
//! | `y_values.values` | samples, a column for each channel |
//! | `y_values.quantity.label` | unit of the samples |
//! | `function_record.name` | names of the channels: a text, or a cell of texts |

use super::RecordingError;
use crate::format::plain;
use crate::printable::quoted;
use std::collections::HashMap;

const VALUES: &str = ".y_values.values";
/// Relative difference of two sample rates that are the same.
const SAME: f64 = 1e-6;

/// Signals of a file by the names of their structs.
pub(super) struct Signals(HashMap<String, Signal>);

/// A struct of samples.
pub(super) struct Signal {
    /// Samples per second; `None` where the abscissa is no time.
    rate: Option<f64>,
    /// Unit of the abscissa.
    abscissa: String,
    unit: Option<String>,
    names: Vec<String>,
}

/// Part that a variable has in a signal.
pub(super) enum Part<'a> {
    /// Its samples; the name of its struct.
    Samples(&'a str, &'a Signal),
    /// A number or a list beside them.
    Beside,
}

impl Signals {
    /// The signals of a file with variables of these names and these texts. `number` gives the value of a scalar by its
    /// name, and `None` where there is none.
    ///
    /// # Errors
    /// Those of `number`.
    pub(super) fn of<'n>(
        names: impl Iterator<Item = &'n str>,
        texts: &[(String, String)],
        number: impl Fn(&str) -> Result<Option<f64>, RecordingError>,
    ) -> Result<Self, RecordingError> {
        let texts = texts.iter().map(|(name, text)| (&**name, &**text));
        let texts: HashMap<&str, &str> = texts.collect();
        let mut signals = HashMap::new();
        for owner in names.filter_map(|name| name.strip_suffix(VALUES)) {
            let Some(increment) = number(&format!("{owner}.x_values.increment"))? else {
                continue;
            };
            let text = |field: &str| {
                let text = texts.get(&*format!("{owner}.{field}"))?.trim();
                (!text.is_empty()).then(|| text.to_owned())
            };
            let rate = 1.0 / increment;
            let abscissa = text("x_values.quantity.label").unwrap_or_else(|| "s".to_owned());
            let is_time = abscissa == "s" && rate.is_finite() && rate > 0.0;
            let name = "function_record.name";
            let several = (1..).map_while(|n| text(&format!("{name}{{{n}}}")));
            let signal = Signal {
                rate: is_time.then_some(rate),
                abscissa,
                unit: text("y_values.quantity.label"),
                names: text(name).into_iter().chain(several).collect(),
            };
            signals.insert(owner.to_owned(), signal);
        }
        Ok(Self(signals))
    }

    /// Part of the variable of a name; `None` if it belongs to no signal.
    pub(super) fn part<'a>(&'a self, name: &'a str) -> Option<Part<'a>> {
        let samples = name.strip_suffix(VALUES);
        if let Some((owner, signal)) = samples.and_then(|owner| self.0.get_key_value(owner)) {
            return Some(Part::Samples(owner, signal));
        }
        let mut owners = name.match_indices('.').filter_map(|(at, _)| name.get(..at));
        owners
            .any(|owner| self.0.contains_key(owner))
            .then_some(Part::Beside)
    }
}

impl Signal {
    /// Samples per second, if they are those of the signals before it; else the reason why it is not read with them.
    pub(super) fn rate(&self, before: Option<f64>) -> Result<f64, String> {
        let Some(rate) = self.rate else {
            let unit = quoted(&self.abscissa);
            return Err(format!("its numbers are those over {unit}, of no time"));
        };
        match before {
            Some(before) if (rate / before - 1.0).abs() > SAME => Err(format!(
                "{} samples per second, and those before it have {}",
                plain(rate, 7),
                plain(before, 7)
            )),
            _ => Ok(rate),
        }
    }

    /// Name and unit of each of `count` channels of the struct `owner`.
    pub(super) fn labels(&self, owner: &str, count: usize) -> Vec<(String, Option<String>)> {
        let name = |n: usize| match self.names.get(n) {
            Some(name) if self.names.len() == count => name.clone(),
            _ if count == 1 => owner.to_owned(),
            _ => format!("{owner}:{}", n + 1),
        };
        (0..count).map(|n| (name(n), self.unit.clone())).collect()
    }
}
