//! Signals as Simcenter Testlab exports them to MATLAB: a struct for each, or for several side by side.
//!
//! | field | holds |
//! | --- | --- |
//! | `x_values.increment` | time from one sample to the next, s |
//! | `x_values.quantity.label` | unit of that, absent or `s` |
//! | `y_values.values` | samples, a column for each channel |
//! | `y_values.quantity.label` | unit of the samples |
//! | `function_record.name` | names of the channels: a text, or a cell of texts |

use super::elements::{Contents, Numbers, Variable};
use super::inflater::Places;
use crate::recording::RecordingError;
use crate::recording::bytes::Bytes;
use crate::recording::columns::Series;
use std::collections::HashMap;
use std::rc::Rc;

const VALUES: &str = ".y_values.values";

/// Signals of a file by the names of their structs.
pub(super) struct Signals(HashMap<String, Signal>);

/// A struct of samples.
pub(super) struct Signal {
    /// Samples per second; `None` where the abscissa is no time.
    pub(super) rate: Option<f64>,
    /// Unit of the abscissa.
    pub(super) abscissa: String,
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
    /// The signals of a file.
    ///
    /// # Errors
    /// [`RecordingError`] if an increment cannot be read.
    pub(super) fn of(
        bytes: &Rc<Bytes>,
        contents: &Contents,
        places: &Places,
    ) -> Result<Self, RecordingError> {
        let owners = |part: &'static str| {
            let names = contents.variables.iter();
            names.filter_map(move |v| Some((v.name.strip_suffix(part)?, v)))
        };
        let increments: HashMap<&str, &Variable> = owners(".x_values.increment").collect();
        let texts = contents.texts.iter();
        let texts: HashMap<&str, &str> = texts.map(|(name, text)| (&**name, &**text)).collect();
        let mut signals = HashMap::new();
        for (owner, _) in owners(VALUES) {
            let Some(increment) = increments.get(owner) else {
                continue;
            };
            let text = |field: &str| {
                let text = texts.get(&*format!("{owner}.{field}"))?.trim();
                (!text.is_empty()).then(|| text.to_owned())
            };
            let rate =
                1.0 / Numbers::new(bytes, increment, (0, 1), &increment.name, places)?.next()?;
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
