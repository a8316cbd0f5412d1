//! Forces that are no linear functions of the motion: distortions that stand out of chance, and what they may do to
//! gains.
//!
//! # Design
//!
//! The measuring pass tells which share of each force follows its own square and cube, and where chance does not
//! explain one of them, by Student's t over all tests, a second pass tells it of each sensor. They are one source of type B
//! uncertainty: a distortion bends the gain, and what it was at calibration nobody knows.
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
//! that are alike cancel in a moment where their forces are opposite, and their gains do not. An accelerometer that is not
//! linear bends the forces for a given motion just as cells do that carry its share, and is counted by them; where none of
//! them tells it, nothing is known of what it bends.

use super::WARNED;
use super::mean::{Mean, NEIGHBOURS};
use super::predicted::{FORCES, measured};
use crate::format::with_std;
use crate::measure::{Distortion, ForceGain, Measurement, Power, SensorDistortions};
use crate::setup::Setup;
use massline_core::geometry::RESULTANT_NAMES;
use massline_core::identify::Estimate;

/// Standard deviations of the sensors that tell most, of load cells over accelerometers or the other way round, beyond
/// which only these are named: a fault of one sensor is in all of the other kind, and in each of them a fraction of it.
const OTHERWISE: f64 = 1.5;

/// Most signals that are named.
const SHOWN: usize = 4;

/// Distortions that chance does not explain.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Distorted {
    /// Of the forces.
    forces: Vec<OfSignal>,
    /// Of the load cells.
    cells: Vec<OfSignal>,
    /// Of the accelerometers on the interface.
    accelerometers: Vec<OfSignal>,
    /// Gains that they may bend, as limits.
    bent: Vec<ForceGain>,
}

/// The distortion of a signal in a run.
#[derive(Clone, Copy, Debug, PartialEq)]
struct OfSignal {
    /// Number of the run in the setup.
    run: usize,
    /// Number of the force, of the load cell or of the accelerometer.
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
            ..Self::default()
        }
    }

    /// The same with those of single sensors, which tell more.
    pub(super) fn with_sensors(self, of_sensors: &[SensorDistortions]) -> Self {
        let of = |own: fn(&SensorDistortions) -> &[Distortion]| {
            let all = of_sensors.iter();
            let all = all.flat_map(|of_run| own(of_run).iter().map(|d| (of_run.run, *d)));
            clear(&all.collect::<Vec<_>>())
        };
        let (cells, accelerometers) = (of(|run| &run.cells), of(|run| &run.accelerometers));
        if cells.is_empty() {
            return Self {
                accelerometers,
                ..self
            };
        }
        let mut bent = Vec::new();
        for of_run in of_sensors {
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
            accelerometers,
            bent,
            ..self
        }
    }

    /// `true` without any distortion.
    pub(super) fn is_empty(&self) -> bool {
        self.forces.is_empty() && self.cells.is_empty() && self.accelerometers.is_empty()
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
        let cell = |k: usize| setup.load_cells.get(k).map(|cell| cell.channel.as_str());
        let sensor = |k: usize| setup.accelerometers.get(k).map(|a| a.channel.as_str());
        let force = |k: usize| RESULTANT_NAMES.get(k).copied();
        let (cells, accelerometers) = (clearest(&self.cells), clearest(&self.accelerometers));
        let clearness = |all: &[&OfSignal]| all.first().map_or(0.0, |first| first.clearness());
        let (of_cells, of_sensors) = (clearness(&cells), clearness(&accelerometers));
        let (mut words, mut told) = (Vec::new(), Vec::<&OfSignal>::new());
        if of_cells > 0.0 && OTHERWISE * of_cells > of_sensors {
            words.push(list("load cells", &cells, setup, &cell));
            told.extend(&cells);
        }
        if of_sensors > 0.0 && OTHERWISE * of_sensors > of_cells {
            words.push(list("accelerometers", &accelerometers, setup, &sensor));
            told.extend(&accelerometers);
        }
        if words.is_empty() {
            let forces = clearest(&self.forces);
            if forces.is_empty() {
                return None;
            }
            words.push(list("forces", &forces, setup, &force));
            told.extend(forces);
        }
        let bent = told.iter().map(|d| d.gain.abs()).fold(0.0, f64::max);
        let (gain, _) = with_std(100.0 * bent, 10.0 * bent);
        Some(format!(
            "these readings are not linear in the motion, since their own square or cube is in them: {}. A sensor beyond its range does this, a load cell with too little preload or with play, or a joint that slips; gains may be off by {gain} %. Shake less, check ranges, preload and fixing, and record again",
            words.join("; or else "),
        ))
    }

    /// A warning of all distortions, and if intervals hold them: those with type B uncertainty, where it is known what
    /// they bend.
    pub(super) fn notice(&self, setup: &Setup, held: bool, warnings: &mut Vec<String>) {
        let held = super::drift::held(held && !self.bent.is_empty());
        warnings.extend(self.in_words(setup).map(|words| format!("{words}; {held}")));
    }
}

/// Of each signal the run that tells most, those first that are told best.
fn clearest(all: &[OfSignal]) -> Vec<&OfSignal> {
    let mut clearest: Vec<&OfSignal> = Vec::new();
    for found in all {
        match clearest.iter_mut().find(|d| d.signal == found.signal) {
            Some(other) if other.clearness() < found.clearness() => *other = found,
            Some(_) => {}
            None => clearest.push(found),
        }
    }
    clearest.sort_by(|a, b| b.clearness().total_cmp(&a.clearness()));
    clearest
}

/// Such as `load cells cell1.z (1.52 ± 0.08 % in run "Z")`.
fn list<'n>(
    kind: &str,
    clearest: &[&OfSignal],
    setup: &Setup,
    name: &dyn Fn(usize) -> Option<&'n str>,
) -> String {
    let words = clearest.iter().take(SHOWN).map(|found| {
        let run = setup.runs.get(found.run).map_or("", |run| &run.name);
        let name = name(found.signal).unwrap_or_default();
        format!("{name} ({} in run \"{run}\")", found.percent())
    });
    let mut words: Vec<String> = words.collect();
    if let Some(more @ 1..) = clearest.len().checked_sub(SHOWN) {
        words.push(format!("and {more} more"));
    }
    format!("{kind} {}", words.join(", "))
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
