//! Forces that are no linear functions of the motion: distortions that stand out of chance, and what they may do to
//! gains.
//!
//! # Design
//!
//! The measuring pass tells which share of each force follows its own square and cube, and where chance does not
//! explain one of them, by Student's t over all tests, a second pass tells it of each load cell. They are one source of
//! type B uncertainty: a distortion bends the gain, and what it was at calibration nobody knows.
//!
//! For normal samples of standard deviation σ, a force `x + a x³` has a gain of `1 + 3 a σ²` and a distortion of
//! `√6 a σ²`: the gain is off by 1.22 times the distortion. Of a play of `d ≪ σ` around zero the gain is
//! `1 - √(2/π) d/σ` and the part of the distortion that the cube tells is `√(2/π) d/σ / √6`: √6 times. Of a
//! stiffness that differs between push and pull the square tells `1/√π` times what the gain is off: √π times.
//! The last two are taken, of the upper end of what the share may be, and any gain up to them is as likely as any
//! other (GUM 4.3.7).
//!
//! The gain of a force is bent by what its cells carry of it. Where no cell is told by itself, as of a joint that slips,
//! the share of the force that tells most in a run is that of all its forces, unless their own is larger: distortions
//! that are alike cancel in a moment where their forces are opposite, and their gains do not.

use super::WARNED;
use super::mean::{Mean, NEIGHBOURS};
use super::predicted::{FORCES, measured};
use crate::format::with_std;
use crate::measure::{CellDistortions, Distortion, ForceGain, Measurement, Power};
use crate::setup::Setup;
use massline_core::geometry::RESULTANT_NAMES;
use massline_core::identify::Estimate;

/// Most signals that are named.
const SHOWN: usize = 4;

/// Distortions that chance does not explain.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Distorted {
    /// Of the forces.
    forces: Vec<OfSignal>,
    /// Of the load cells.
    cells: Vec<OfSignal>,
    /// Gains that they may bend, as limits.
    bent: Vec<ForceGain>,
}

/// The distortion of a signal in a run.
#[derive(Clone, Copy, Debug, PartialEq)]
struct OfSignal {
    /// Number of the run in the setup.
    run: usize,
    /// Number of the force, or of the load cell.
    signal: usize,
    /// Share of the power that tells most of it.
    most: Mean,
    /// Share of the gain that it may bend, with the sign of that one.
    gain: f64,
    /// Powers of which it is told.
    powers: [Option<Power>; Power::ALL.len()],
}

impl OfSignal {
    /// Standard deviations of chance by which it stands out.
    fn clearness(&self) -> f64 {
        self.most.value.abs() / self.most.std
    }

    /// Such as `1.52 ± 0.08 %`, with half of its 95 % interval.
    fn percent(&self) -> String {
        let estimate = Estimate {
            value: self.most.value,
            std: self.most.std,
        };
        let half = estimate.interval(self.most.freedom);
        let (share, half) = with_std(100.0 * self.most.value.abs(), 100.0 * half);
        format!("{share} ± {half} %")
    }
}

impl Distorted {
    /// Those of the forces of a measurement.
    pub(super) fn of_forces(measurement: &Measurement) -> Self {
        let runs = measurement.runs.iter();
        let all = runs.flat_map(|run| run.distortions.iter().map(|d| (run.number, *d)));
        let forces = clear(&all.collect::<Vec<_>>());
        let mut bent = Vec::new();
        for of_run in forces.chunk_by(|a, b| a.run == b.run) {
            let mut runs = measurement.runs.iter();
            let (Some(clearest), Some(run)) = (
                of_run
                    .iter()
                    .max_by(|a, b| a.clearness().total_cmp(&b.clearness())),
                runs.find(|run| of_run.first().is_some_and(|d| d.run == run.number)),
            ) else {
                continue;
            };
            bent.extend(measured(run).map(|force| {
                let own = of_run.iter().find(|d| d.signal == force);
                let own = own.filter(|d| d.gain.abs() > clearest.gain.abs());
                ForceGain {
                    run: run.number,
                    force,
                    share: own.unwrap_or(clearest).gain,
                }
            }));
        }
        Self {
            forces,
            bent,
            cells: Vec::new(),
        }
    }

    /// The same with those of the load cells, which tell more.
    pub(super) fn with_cells(self, of_cells: &[CellDistortions]) -> Self {
        let all = of_cells.iter().flat_map(|of_run| {
            let cells = of_run.cells.iter();
            cells.map(|d| (of_run.run, *d))
        });
        let cells = clear(&all.collect::<Vec<_>>());
        if cells.is_empty() {
            return self;
        }
        let mut bent = Vec::new();
        for of_run in of_cells {
            let mut shares = [0.0; FORCES];
            for (cell, carried) in of_run.carried.iter().enumerate() {
                // A cell that is distorted in one run is so in all, as far as the others tell.
                let own = of_run.cells.iter().filter(|d| d.signal == cell);
                let own = own.filter(|d| {
                    let mut told = cells.iter().filter(|told| told.signal == cell);
                    told.any(|told| told.powers.contains(&Some(d.power)))
                });
                let gain = together(own.map(gain));
                for (share, carried) in shares.iter_mut().zip(carried) {
                    *share += gain * carried;
                }
            }
            let shares = shares.into_iter().enumerate();
            let shares = shares.filter(|(_, share)| *share != 0.0);
            bent.extend(shares.map(|(force, share)| ForceGain {
                run: of_run.run,
                force,
                share,
            }));
        }
        Self {
            cells,
            bent,
            ..self
        }
    }

    /// `true` without any distortion.
    pub(super) fn is_empty(&self) -> bool {
        self.forces.is_empty() && self.cells.is_empty()
    }

    /// Standard uncertainties of the gains that are bent.
    pub(super) fn gains(&self) -> Vec<ForceGain> {
        let of = |bent: &ForceGain| ForceGain {
            share: bent.share / 3.0_f64.sqrt(),
            ..*bent
        };
        self.bent.iter().map(of).collect()
    }

    /// All distortions in words; `None` without any.
    pub(super) fn in_words(&self, setup: &Setup) -> Option<String> {
        if self.is_empty() {
            return None;
        }
        let of_cells = !self.cells.is_empty();
        let all = if of_cells { &self.cells } else { &self.forces };
        let name = |signal: usize| {
            let cell = setup.load_cells.get(signal).filter(|_| of_cells);
            let force = RESULTANT_NAMES.get(signal).copied();
            cell.map_or(force.unwrap_or_default(), |cell| cell.channel.as_str())
        };
        let mut clearest: Vec<&OfSignal> = Vec::new();
        for found in all {
            match clearest.iter_mut().find(|d| d.signal == found.signal) {
                Some(other) if other.clearness() < found.clearness() => *other = found,
                Some(_) => {}
                None => clearest.push(found),
            }
        }
        clearest.sort_by(|a, b| b.clearness().total_cmp(&a.clearness()));
        let words = clearest.iter().take(SHOWN).map(|found| {
            let run = setup
                .runs
                .get(found.run)
                .map_or("", |run| run.name.as_str());
            format!(
                "{} ({} in run \"{run}\")",
                name(found.signal),
                found.percent()
            )
        });
        let mut words: Vec<String> = words.collect();
        if let Some(more @ 1..) = clearest.len().checked_sub(SHOWN) {
            words.push(format!("and {more} more"));
        }
        let gain = clearest.iter().map(|d| d.gain.abs()).fold(0.0, f64::max);
        let (gain, _) = with_std(100.0 * gain, 10.0 * gain);
        Some(format!(
            "the square or the cube of a {} is in it, beside what is linear in the motion: {}. A load cell beyond its range does this, one with too little preload or with play, a joint that slips, or an accelerometer that is no longer linear; gains may be off by {gain} %. Shake less, check ranges, preload and fixing, and record again",
            if of_cells {
                "load cell's reading"
            } else {
                "force"
            },
            words.join(", "),
        ))
    }

    /// A warning of all distortions, and if intervals hold them: those with type B uncertainty.
    pub(super) fn notice(&self, setup: &Setup, held: bool, warnings: &mut Vec<String>) {
        let held = super::drift::held(held);
        warnings.extend(self.in_words(setup).map(|words| format!("{words}; {held}")));
    }
}

/// The share of a power, with what is known of it.
fn mean(found: &Distortion) -> Mean {
    Mean {
        value: found.share,
        std: NEIGHBOURS.sqrt() * found.std,
        freedom: found.freedom / NEIGHBOURS,
        noise: found.noise,
    }
}

/// Limit of the gain that a power may bend, of the upper end of its share's 95 % interval.
fn gain(found: &Distortion) -> f64 {
    let share = mean(found);
    let estimate = Estimate {
        value: share.value,
        std: share.std,
    };
    let limit = share.value.abs() + estimate.interval(share.freedom);
    let times = match found.power {
        Power::Square => std::f64::consts::PI.sqrt(),
        Power::Cube => 6.0_f64.sqrt(),
    };
    (limit * times).copysign(share.value)
}

/// Of all distortions with their runs those that chance does not explain, one a signal and run.
fn clear(all: &[(usize, Distortion)]) -> Vec<OfSignal> {
    let mut clear: Vec<OfSignal> = Vec::new();
    for (run, found) in all {
        let most = mean(found);
        if most.probability() * all.len() as f64 >= WARNED {
            continue;
        }
        let mut own = OfSignal {
            run: *run,
            signal: found.signal,
            most,
            gain: gain(found),
            powers: Power::ALL.map(|power| (power == found.power).then_some(power)),
        };
        let same = |d: &&mut OfSignal| (d.run, d.signal) == (own.run, own.signal);
        match clear.iter_mut().find(same) {
            Some(other) => {
                own.gain = together([other.gain, own.gain].into_iter());
                if own.most.value.abs() < other.most.value.abs() {
                    own.most = other.most;
                }
                own.powers = core::array::from_fn(|k| own.powers[k].or(other.powers[k]));
                *other = own;
            }
            None => clear.push(own),
        }
    }
    clear
}

/// Several bends of one gain, with the sign of the largest.
fn together(gains: impl Iterator<Item = f64>) -> f64 {
    let (mut all, mut largest) = (0.0_f64, 0.0_f64);
    for gain in gains {
        all = all.hypot(gain);
        if gain.abs() > largest.abs() {
            largest = gain;
        }
    }
    all.copysign(largest)
}
