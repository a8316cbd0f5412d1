//! Counting which intervals hold the truth.

use crate::simulate::Truth;
use crate::study::trial::Outcome;
use massline_core::identify::{Estimate, Identification};

/// The numbers that are counted: mass, centre of gravity, six terms of inertia about S, six
/// about A.
pub const NUMBERS: usize = 16;

/// Their names in the order of the tallies.
pub const NAMES: [&str; NUMBERS] = [
    "mass", "CG x", "CG y", "CG z", "Θxx S", "Θyy S", "Θzz S", "Θxy S", "Θxz S", "Θyz S", "Θxx A",
    "Θyy A", "Θzz A", "Θxy A", "Θxz A", "Θyz A",
];

/// A number with half its 95 % interval, in the same unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The value.
    pub value: f64,
    /// One standard deviation.
    pub std: f64,
    /// Half of the 95 % interval.
    pub half: f64,
}

impl Interval {
    /// As `massline identify` prints it, of an estimate whose standard deviation has so many
    /// degrees of freedom.
    fn new(estimate: Estimate, freedom: f64) -> Self {
        Self {
            value: estimate.value,
            std: estimate.std,
            half: estimate.interval(freedom),
        }
    }
}

/// The numbers of an answer; `None` where there is none.
#[must_use]
pub fn numbers(found: &Identification) -> [Option<Interval>; NUMBERS] {
    let [x, y, z] = found.centre_of_gravity;
    let mut all = [None; NUMBERS];
    let list = [found.mass, x, y, z].into_iter();
    let list = list.chain(found.inertia_cg).chain(found.inertia_reference);
    for (slot, number) in all.iter_mut().zip(list) {
        *slot = number.map(|estimate| Interval::new(estimate, found.freedom));
    }
    all
}

/// The truth in the same order; `None` where the model says nothing.
#[must_use]
pub fn truths(truth: &Truth) -> [Option<f64>; NUMBERS] {
    let mut all = [None; NUMBERS];
    all[0] = Some(truth.mass);
    all[1..4].copy_from_slice(&truth.centre_of_gravity);
    all[4..10].copy_from_slice(&truth.inertia_cg.terms());
    all[10..].copy_from_slice(&truth.inertia_reference.terms());
    all
}

/// Outcome of one draw for one number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// `true` if the interval holds the truth.
    pub holds: bool,
    /// Error over standard deviation.
    pub error: f64,
}

/// Outcome of one draw: the refusal in words, or a hit or miss for each number that it has.
pub type Scored = Result<[Option<Hit>; NUMBERS], String>;

/// Holds one answer against the truth.
pub(super) fn score(outcome: &Outcome, truth: &Truth) -> Scored {
    let found = outcome.as_ref().map_err(String::clone)?;
    let mut hits = [None; NUMBERS];
    let pairs = numbers(found).into_iter().zip(truths(truth));
    for (slot, (number, truth)) in hits.iter_mut().zip(pairs) {
        // A number where the model knows no truth, such as y of a plane model, is no hit.
        *slot = number.map(|n| match truth {
            Some(t) => Hit {
                holds: (n.value - t).abs() <= n.half,
                error: if n.std > 0.0 {
                    (n.value - t) / n.std
                } else {
                    f64::INFINITY
                },
            },
            None => Hit {
                holds: false,
                error: f64::INFINITY,
            },
        });
    }
    Ok(hits)
}

/// Counts of one number in one cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Count {
    /// Draws with a number.
    pub given: usize,
    /// Numbers whose interval holds the truth.
    pub held: usize,
    /// Sum of error over standard deviation.
    pub errors: f64,
    /// Sum of its squares.
    pub squares: f64,
}

impl Count {
    fn add(&mut self, hit: Hit) {
        self.given += 1;
        self.held += usize::from(hit.holds);
        self.errors += hit.error;
        self.squares += hit.error * hit.error;
    }

    /// Share of intervals that hold the truth, 0 to 1; `None` without any.
    #[must_use]
    pub fn share(&self) -> Option<f64> {
        (self.given > 0).then(|| self.held as f64 / self.given as f64)
    }

    /// Mean of error over standard deviation: the bias, 0 where there is none.
    #[must_use]
    pub fn bias(&self) -> Option<f64> {
        (self.given > 0).then(|| self.errors / self.given as f64)
    }

    /// Standard deviation of error over standard deviation, from draw to draw: 1 where bars
    /// are right, apart from the bias.
    #[must_use]
    pub fn scatter(&self) -> Option<f64> {
        let (ratio, bias) = (self.ratio()?, self.bias()?);
        Some((ratio * ratio - bias * bias).max(0.0).sqrt())
    }

    /// Root mean square of error over standard deviation, 1 where bars are right.
    #[must_use]
    pub fn ratio(&self) -> Option<f64> {
        (self.given > 0).then(|| (self.squares / self.given as f64).sqrt())
    }
}

/// Counts of one cell: a case, a level of noise, a method.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    /// By number, in the order of [`NAMES`].
    pub numbers: [Count; NUMBERS],
    /// The ten of them: mass, centre of gravity, inertia about S.
    pub ten: Count,
    /// All draws.
    pub draws: usize,
    /// Draws without an answer.
    pub refused: usize,
    /// Why the first of them has none.
    pub reason: Option<String>,
    /// Sum over draws of the squared difference of held and 95 % of given, among the ten:
    /// numbers of one draw share its noise, so that their chance is that of draws.
    pub scatter: f64,
}

impl Tally {
    /// Adds one draw.
    pub fn add(&mut self, scored: &Scored) {
        self.draws += 1;
        match scored {
            Ok(hits) => {
                let mut off = 0.0;
                for (number, hit) in hits.iter().enumerate() {
                    let Some(hit) = hit else { continue };
                    self.numbers[number].add(*hit);
                    if number < 10 {
                        self.ten.add(*hit);
                        off += f64::from(u8::from(hit.holds)) - 0.95;
                    }
                }
                self.scatter += off * off;
            }
            Err(reason) => {
                self.refused += 1;
                self.reason.get_or_insert_with(|| reason.clone());
            }
        }
    }

    /// Adds the counts of another cell.
    pub fn merge(&mut self, other: &Self) {
        let add = |into: &mut Count, from: &Count| {
            into.given += from.given;
            into.held += from.held;
            into.errors += from.errors;
            into.squares += from.squares;
        };
        for (into, from) in self.numbers.iter_mut().zip(&other.numbers) {
            add(into, from);
        }
        add(&mut self.ten, &other.ten);
        self.draws += other.draws;
        self.refused += other.refused;
        self.scatter += other.scatter;
        if self.reason.is_none() {
            self.reason.clone_from(&other.reason);
        }
    }

    /// `true` if a number of this cell lies outside 92 to 98 %, or outside what chance alone
    /// does to fewer than 300 draws: 2.4 standard deviations of a share of 95 %, which are
    /// those 3 % at 300.
    #[must_use]
    pub fn is_outside(count: &Count) -> bool {
        let Some(share) = count.share() else {
            return false;
        };
        let chance = 2.4 * (0.95 * 0.05 / count.given as f64).sqrt();
        (share - 0.95).abs() > chance.max(0.03) + 1e-12
    }

    /// Standard deviation of the share of the ten, from draw to draw.
    #[must_use]
    pub fn uncertainty(&self) -> f64 {
        self.scatter.sqrt() / self.ten.given.max(1) as f64
    }

    /// `true` if all together lie outside 94 to 96 %.
    #[must_use]
    pub fn total_is_outside(&self) -> bool {
        self.ten
            .share()
            .is_some_and(|share| (share - 0.95).abs() > 0.01 + 1e-12)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use massline_core::identify::half_width_95;

    fn hit(error: f64) -> Option<Hit> {
        Some(Hit {
            holds: error.abs() <= half_width_95(f64::INFINITY),
            error,
        })
    }

    #[test]
    fn shares_and_ratios_are_those_of_the_draws() {
        let mut tally = Tally::default();
        let mut hits = [None; NUMBERS];
        hits[0] = hit(1.0);
        hits[12] = hit(3.0);
        tally.add(&Ok(hits));
        hits[0] = hit(-2.0);
        tally.add(&Ok(hits));
        tally.add(&Err("no".to_owned()));
        assert_eq!((tally.draws, tally.refused), (3, 1));
        assert_eq!(tally.reason.as_deref(), Some("no"));
        assert_eq!(tally.numbers[0].share(), Some(0.5));
        assert_eq!(tally.numbers[0].ratio(), Some(2.5_f64.sqrt()));
        assert_eq!(tally.numbers[0].bias(), Some(-0.5));
        // A root of a difference of squares, both rounded.
        let scatter = tally.numbers[0].scatter().unwrap_or(f64::NAN);
        assert!((scatter - 1.5).abs() < 4.0 * f64::EPSILON, "{scatter}");
        assert_eq!(tally.numbers[1].share(), None);
        // About A counts by itself, not among the ten.
        assert_eq!(tally.ten.given, 2);
        assert_eq!(tally.numbers[12].share(), Some(0.0));
    }

    #[test]
    fn chance_is_forgiven_where_draws_are_few() {
        let count = |held, given| Count {
            given,
            held,
            errors: 0.0,
            squares: 0.0,
        };
        assert!(!Tally::is_outside(&count(276, 300)));
        assert!(Tally::is_outside(&count(275, 300)));
        assert!(Tally::is_outside(&count(300, 300)));
        // Of 20 draws, 20 and 17 are within 2.4 standard deviations of 19.
        assert!(!Tally::is_outside(&count(20, 20)));
        assert!(!Tally::is_outside(&count(17, 20)));
        assert!(Tally::is_outside(&count(16, 20)));
    }
}
