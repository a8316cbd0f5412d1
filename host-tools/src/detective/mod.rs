//! The detective: which sensor of a set-up has which fault, from the recordings alone.
//!
//! At low frequency the interface is rigid, every accelerometer follows it, and the load cells
//! balance one rigid body. A sensor that is inverted, exchanged, turned, scaled or shifted
//! contradicts all others, and of the changes that would mend the set-up usually a single one
//! explains the data. It is named with what speaks for it, and the lines of the set-up that
//! mend it are printed; nothing is ever repaired silently.
//!
//! | file | step |
//! | --- | --- |
//! | `evidence` | recordings to products of all channels at the low lines |
//! | `delay` | channels that are late |
//! | `table` | products to rows: responses at 0 Hz to the motions of the interface |
//! | `sensor` | one channel as the set-up describes it |
//! | `state` | sensors with their rows, which a hypothesis changes |
//! | `model` | contradiction of the rows with one rigid interface and one rigid body |
//! | `kronecker` | products of matrices in blocks |
//! | `hypothesis` | faults as changes of rows and sensors |
//! | `mend` | contradiction without a fault |
//! | `fit` | faults with free numbers at their best |
//! | `search` | the faults that explain the contradiction |
//! | `untold` | faults that these runs would not show |
//! | `plan` | faults that a test cannot show, from the set-up alone |
//! | `whole` | what is wrong with all sensors together |
//! | `runs` | a run that contradicts all others |
//! | `wording` | faults in words, and as lines of the set-up |
//!
//! # Limits
//!
//! * Nothing is found without accelerometers on the interface.
//! * Delays are found in random runs only.
//! * With translations only, positions and exchanges of parallel channels leave no trace.
//! * Two load cells on one line of action cannot be told apart.
//! * A common gain of all sensors, a mirrored set-up and positions that are all in millimetres
//!   contradict nothing; only the size, the density and a weighed mass speak against them.

mod delay;
mod evidence;
mod fit;
mod hypothesis;
mod kronecker;
mod mend;
mod model;
mod plan;
mod runs;
mod search;
mod sensor;
mod state;
mod table;
#[cfg(test)]
mod tests;
mod untold;
mod whole;
mod wording;

pub use hypothesis::{Fault, Mistake};
pub use plan::{Axis, foresee};
pub(crate) use whole::is_doubtful;
pub use whole::{Whole, WholeFault};

use crate::measure::{Channels, Measurement};
use crate::setup::{Run, Setup};
use evidence::Evidence;
use model::Mass;
use runs::Mend;
use search::{CONTRADICTS, Candidate, Found};
use std::cell::OnceCell;

/// Reason why nothing can be said of a set-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Undecided {
    /// No run that is long enough.
    #[error(
        "the sensors were not examined: that takes a random run, a stepped sine with lines in `averaging_band`, or static poses"
    )]
    NoRun,
    /// No accelerometers that span the motion.
    #[error(
        "the sensors were not examined: that takes accelerometers with `mount = \"interface\"` that move"
    )]
    NoInterface,
    /// The rows determine no motion.
    #[error("the sensors were not examined: their readings determine no motion")]
    NoMotion,
    /// A placement that is no rotation.
    #[error("the sensors were not examined: `rotation` or `translation` of the run is no number")]
    Placement,
}

/// One way to explain the data.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// The fault.
    pub fault: Fault,
    /// Other names of the same change: nothing that was recorded tells them apart.
    pub same: Vec<Fault>,
    /// The fault in words, with its other names.
    pub text: String,
    /// Lines of the set-up that mend it; empty where none do.
    pub repair: Vec<String>,
}

/// A fault, or several of which the data do not tell which one it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Suspect {
    /// The best explanation first, then those that explain the data as well.
    pub explanations: Vec<Explanation>,
}

/// Findings of the examination of a set-up.
#[derive(Clone, Debug, PartialEq)]
pub struct Findings {
    /// Faults, the plainest first; none if nothing contradicts the set-up.
    pub suspects: Vec<Suspect>,
    /// Faults in words that come nearest to an explanation, where none explains all: with three
    /// mistakes at once the best pair may be none of them.
    pub nearest: Vec<String>,
    /// Faults of all sensors together, and questions.
    pub whole: Vec<Whole>,
    /// Properties of the set-up that these runs cannot tell, in words: a fault in one of them
    /// contradicts nothing.
    pub untold: Vec<String>,
    /// Contradiction of the set-up as it is: a sum of squares over its degrees of freedom, about one
    /// or less if sensors differ by no more than 0.5 %, 0.5° and 1 mm.
    pub contradiction: f64,
    /// The same after the repairs.
    pub repaired: f64,
    /// The contradiction without the accelerometers on the structure.
    pub balance: f64,
    /// Degrees of freedom.
    pub freedom: f64,
}

impl Findings {
    /// `true` if the data contradict the set-up, and the suspects do not explain all of it.
    #[must_use]
    pub fn more_is_wrong(&self) -> bool {
        self.repaired > CONTRADICTS
    }

    /// The faults that explain all of the contradiction, in words; `None` where something is left of it.
    #[must_use]
    pub fn culprits(&self) -> Option<String> {
        let of_run = self.whole.iter().any(|w| w.fault == WholeFault::RunApart);
        let explains = (!self.suspects.is_empty() || of_run) && !self.more_is_wrong();
        let words = |suspect: &Suspect| {
            let all: Vec<&str> = suspect.explanations.iter().map(|e| &*e.text).collect();
            all.join(", or ")
        };
        explains.then(|| {
            let other = |w: &&Whole| matches!(w.fault, WholeFault::Weighed | WholeFault::RunApart);
            let others = self.whole.iter().filter(other).map(|w| w.text.clone());
            let all = self.suspects.iter().map(words).chain(others);
            all.collect::<Vec<_>>().join("; ")
        })
    }

    /// `true` if lines of the set-up mend each of the suspects.
    #[must_use]
    pub fn mends(&self) -> bool {
        let mends = |s: &Suspect| s.explanations.iter().any(|e| !e.repair.is_empty());
        !self.suspects.is_empty() && self.suspects.iter().all(mends)
    }

    /// The evidence in words.
    #[must_use]
    pub fn evidence(&self) -> String {
        let times = |x: f64| crate::format::plain(x.sqrt(), 3);
        if self.suspects.is_empty() {
            let mut text = format!(
                "the sensors contradict each other by {} times what usual differences explain, and no single fault, nor a pair of them, mends it: more is wrong",
                times(self.contradiction)
            );
            if !self.nearest.is_empty() {
                text.push_str(&format!(
                    ". Nearest comes, with {} times left: {}",
                    times(self.repaired),
                    self.nearest.join("; and ")
                ));
            }
            return text;
        }
        format!(
            "the sensors contradict each other by {} times what usual differences explain, {} times after the repair{}",
            times(self.contradiction),
            times(self.repaired),
            if self.more_is_wrong() {
                ": more is wrong"
            } else {
                ""
            }
        )
    }

    /// `true` if all sensors of a kind share a fault: what they say of the body is wrong, and its error bars do not know.
    #[must_use]
    pub fn of_all(&self) -> bool {
        let mut best = self.suspects.iter().filter_map(|s| s.explanations.first());
        best.any(|explanation| explanation.fault.is_whole())
    }

    /// The fault of the whole set-up with which no body can be as it says; `None` without one.
    #[must_use]
    pub fn impossible(&self) -> Option<&Whole> {
        self.whole.iter().find(|whole| whole.impossible)
    }

    /// `true` if nothing was found.
    #[must_use]
    pub fn clean(&self) -> bool {
        let questions = |w: &Whole| w.fault == WholeFault::NoUnit;
        self.suspects.is_empty() && self.whole.iter().all(questions) && !self.more_is_wrong()
    }
}

/// Share of the weighed mass, and standard deviations of the one in the data, by which they must differ: what refuses the numbers of
/// `identify`, too.
const MISWEIGHED: f64 = 0.05;
const CERTAIN: f64 = 5.0;

/// Examines the sensors of a set-up on `threads` threads, as many as there are processors if `None`; the findings do not
/// depend on their number.
///
/// # Errors
/// [`Undecided`].
pub(crate) fn examine(
    setup: &Setup,
    measurement: &Measurement,
    channels: &Channels,
    threads: Option<usize>,
) -> Result<Findings, Undecided> {
    let evidence = Evidence::new(setup, measurement, channels)?;
    let apart = OnceCell::new();
    let find_apart = || apart.get_or_init(|| runs::apart(setup, measurement, channels));
    let mend = || find_apart().as_ref().and_then(|apart| apart.mend);
    let mut found = evidence.search_unless(threads, &|| mend().is_some())?;
    let mut weighed = None;
    if let Some(alone) = alone(&evidence, &found) {
        let explained = !found.named.is_empty() && found.after.ratio() <= CONTRADICTS;
        weighed = whole::weighed(setup, &alone, explained);
        if !explained {
            found.named.clear();
            found.after = alone.after;
        }
    }
    // A usual fault of a sensor explains more than a run does.
    let usual = |all: &Vec<Candidate>| all.first().is_some_and(|c| c.fault.is_usual());
    let explained = found.after.ratio() <= CONTRADICTS && found.named.iter().all(usual);
    // A specimen that stood otherwise than stated seems to have sensors that are turned.
    let remounted = setup.runs.iter().any(Run::is_remounted);
    let tells = !explained || found.before.ratio() > CONTRADICTS && remounted;
    let apart = tells.then(find_apart).and_then(Option::as_ref);
    let apart = apart.filter(|apart| !explained || apart.mend == Some(Mend::Rotation));
    if let Some(apart) = apart
        && !explained
        && (apart.mend.is_some() || found.after.ratio() > CONTRADICTS)
    {
        found
            .named
            .retain(|all| matches!(&all[..], [one] if one.fault.is_dead()));
        found.after = apart.others.after.clone();
        found.untold = apart.others.untold.clone();
    }
    let mut suspects: Vec<Suspect> = found
        .named
        .iter()
        .map(|candidates| Suspect {
            explanations: candidates
                .iter()
                .map(|candidate| Explanation {
                    fault: candidate.fault.clone(),
                    same: candidate.same.clone(),
                    text: wording::texts(setup, &candidate.fault, &candidate.same),
                    repair: wording::repair(setup, &evidence, &candidate.fault),
                })
                .collect(),
        })
        .collect();
    let mut nearest = Vec::new();
    if found.after.ratio() > CONTRADICTS {
        let dead = |s: &Suspect| matches!(&s.explanations[..], [one] if one.fault.is_dead());
        let best = |s: &Suspect| s.explanations.first().map(|e| e.text.clone());
        nearest = suspects
            .iter()
            .filter(|s| !dead(s))
            .filter_map(best)
            .collect();
        suspects.retain(dead);
    }
    Ok(Findings {
        suspects,
        nearest,
        untold: wording::untold(setup, &found.untold),
        whole: whole::judge(setup, &evidence, &found, measurement.units_in_recordings)
            .into_iter()
            .chain(weighed)
            .chain(apart.map(|apart| apart.whole.clone()))
            .collect(),
        contradiction: found.before.ratio(),
        repaired: found.after.ratio(),
        balance: evidence.balance().unwrap_or(0.0),
        freedom: found.before.freedom,
    })
}

/// `true` if the sensors contradict each other or are late, so that it is worth to [`examine`] them; `false` where
/// nothing can be said.
pub(crate) fn is_contradicted(
    setup: &Setup,
    measurement: &Measurement,
    channels: &Channels,
) -> bool {
    Evidence::new(setup, measurement, channels).is_ok_and(|evidence| evidence.is_contradicted())
}

/// The findings without the weighed mass, where it alone contradicts the set-up.
fn alone(evidence: &Evidence, found: &Found) -> Option<Found> {
    let weighed = evidence.weighed?;
    let without = evidence.without_mass();
    let score = without.score()?;
    // One equation of many hardly shows in the sum.
    let is_far = |mass: Mass| {
        let off = (mass.value - weighed).abs();
        off > MISWEIGHED * weighed && off > CERTAIN * mass.error
    };
    let contradicts = found.before.ratio() > CONTRADICTS || score.mass.is_some_and(is_far);
    if !contradicts || score.ratio() > CONTRADICTS {
        // Where sensors contradict each other, a search would only name faults of theirs.
        return None;
    }
    let alone = without.search().ok()?;
    (alone.named.is_empty() && alone.before.ratio() <= CONTRADICTS).then_some(alone)
}
