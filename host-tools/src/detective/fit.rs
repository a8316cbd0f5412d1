//! Hypotheses with free numbers, each at its best: gains, positions, shares of cross-talk.

use nalgebra::Vector3;

use super::hypothesis::{Fault, Hypothesis, Mistake, SHORTEST, beside_structure, places};
use super::mend::{mended, without};
use super::model::{Bench, Motion};
use super::sensor::Kind;
use super::state::State;

/// Smallest errors that are named: gain, cross-talk.
const SMALLEST: [f64; 2] = [0.03, 0.03];
/// Cross-talks whose share is fitted by more than one parabola.
const REFINED: usize = 20;
/// Rounds in which a position is found.
const POLISHED: usize = 10;

/// Lowest point of a function of one number near `start`, by parabolas through three points.
fn lowest(f: &dyn Fn(f64) -> Option<f64>, start: f64, step: f64) -> Option<f64> {
    let (mut at, mut step) = (start, step);
    let mut value = f(at)?;
    for _ in 0..4 {
        let (left, right) = (f(at - step)?, f(at + step)?);
        let curvature = left + right - 2.0 * value;
        let move_by = if curvature > 0.0 {
            (0.5 * step * (left - right) / curvature).clamp(-8.0 * step, 8.0 * step)
        } else if left < right {
            -2.0 * step
        } else {
            2.0 * step
        };
        let next = f(at + move_by)?;
        if next < value {
            at += move_by;
            let small = (value - next) < 0.1;
            value = next;
            if small {
                break;
            }
        }
        step *= 0.4;
    }
    Some(at)
}

/// Hypotheses with free numbers, each at its best.
pub(super) fn fitted(
    bench: &Bench,
    state: &State,
    quiet: &[usize],
    tolerance: f64,
    motion: &[Motion],
) -> Vec<Hypothesis> {
    let trial = Trial {
        bench,
        state,
        quiet,
        tolerance,
        motion,
        live: state.live(),
    };
    let mut all = Vec::new();
    for &channel in &trial.live {
        if quiet.contains(&channel) {
            all.extend(trial.dead(channel));
        } else {
            all.extend(trial.gain(channel));
            all.push(trial.unlisted(channel));
        }
    }
    let places = places(&state.sensors, &|i| state.is_live(i));
    let moved = places.iter().filter_map(|place| trial.position(place));
    all.extend(moved.map(|fault| Hypothesis {
        fault,
        free: 3,
        class: places.len(),
        doubt: 0.0,
    }));
    all.extend(trial.data());
    all.extend(trial.interface());
    let cross = trial.cross_talks();
    let class = cross.len().max(trial.live.len() * 4);
    all.extend(cross.into_iter().map(|fault| Hypothesis {
        fault,
        free: 1,
        class,
        doubt: 0.0,
    }));
    all
}

/// A state of the set-up in which faults are tried.
struct Trial<'a> {
    bench: &'a Bench,
    state: &'a State,
    /// Channels without a signal.
    quiet: &'a [usize],
    tolerance: f64,
    motion: &'a [Motion],
    /// Channels that have rows.
    live: Vec<usize>,
}

impl Trial<'_> {
    /// χ² of the set-up without a fault.
    fn chi2(&self, fault: &Fault) -> Option<f64> {
        let mended = mended(self.bench, self.state, fault, self.tolerance, self.motion);
        Some(mended?.chi2)
    }

    /// A fault of a channel.
    fn of_channel(&self, fault: Fault, free: usize) -> Hypothesis {
        Hypothesis {
            fault,
            free,
            class: self.live.len(),
            doubt: 0.0,
        }
    }

    /// A quiet channel that is dead, where the others expect a signal of it.
    fn dead(&self, channel: usize) -> Option<Hypothesis> {
        let others = without(self.state, &Fault::Dead { channel });
        let motion = self.bench.motion(&others, self.tolerance)?;
        let expected = self.bench.expects(self.state, &motion, channel, self.quiet);
        expected.then(|| self.of_channel(Fault::Dead { channel }, 0))
    }

    /// A gain of a channel.
    fn gain(&self, channel: usize) -> Option<Hypothesis> {
        let of = |x: f64| Fault::Gain {
            channel,
            factor: x.exp(),
        };
        // What is left is nearly a square in the factor that mends it: three points tell it.
        let square = |x: f64| {
            self.chi2(&Fault::Gain {
                channel,
                factor: 1.0 / x,
            })
        };
        let start = match [0.5, 1.0, 1.5].map(square) {
            [Some(a), Some(b), Some(c)] if a + c > 2.0 * b => {
                let x = 1.0 + 0.25 * (a - c) / (a + c - 2.0 * b);
                -x.clamp(0.1, 10.0).ln()
            }
            _ => 0.0,
        };
        let x = lowest(&|x| self.chi2(&of(x)), start, 0.05)?;
        let is_large = (x.exp() - 1.0).abs() > SMALLEST[0];
        is_large.then(|| self.of_channel(of(x), 1))
    }

    /// A channel that contradicts the others in a way that is none of these.
    fn unlisted(&self, channel: usize) -> Hypothesis {
        self.of_channel(Fault::Unlisted { channel }, self.bench.motions())
    }

    /// Another position of the sensors of a place.
    fn position(&self, place: &[usize]) -> Option<Fault> {
        let here = self.state.sensors[place[0]].position;
        self.shifted(&|shift| Fault::Position {
            place: place.to_vec(),
            position: here + shift,
            mistake: Mistake::Offset,
        })
    }

    /// Other points from which the positions of all load cells, or of all accelerometers on the interface, were
    /// measured. Of sensors at a single place it is their position.
    fn data(&self) -> Vec<Hypothesis> {
        let sensors = &self.state.sensors;
        let of_kind = |wanted: &dyn Fn(Kind) -> bool| -> Vec<usize> {
            (0..sensors.len())
                .filter(|&i| wanted(sensors[i].kind))
                .collect()
        };
        let cells = of_kind(&Kind::is_cell);
        let interface = of_kind(&|kind| kind == Kind::Interface);
        let apart = |group: &Vec<usize>| {
            let first = group.first().map(|&i| sensors[i].position);
            group.iter().any(|&i| Some(sensors[i].position) != first)
        };
        let mut groups = [cells, interface].to_vec();
        groups.retain(apart);
        let faults = groups.iter().filter_map(|group| {
            self.shifted(&|shift| Fault::Datum {
                channels: group.clone(),
                shift,
            })
        });
        faults
            .map(|fault| Hypothesis {
                fault,
                free: 3,
                class: 2,
                doubt: 0.0,
            })
            .collect()
    }

    /// A gain that all accelerometers on the interface share.
    fn interface(&self) -> Option<Hypothesis> {
        let channels = beside_structure(self.state)?;
        let of = |x: f64| Fault::Unit {
            channels: channels.clone(),
            factor: x.exp(),
        };
        let x = lowest(&|x| self.chi2(&of(x)), 0.0, 0.05)?;
        let is_large = (x.exp() - 1.0).abs() > SMALLEST[0];
        is_large.then(|| Hypothesis {
            fault: of(x),
            free: 1,
            class: 1,
            doubt: 0.0,
        })
    }

    /// A fault of a shift where it leaves least, if that is far enough to be one.
    fn shifted(&self, of: &dyn Fn(Vector3<f64>) -> Fault) -> Option<Fault> {
        let mut shift = Vector3::zeros();
        // One coordinate after the other, and again: they are nearly independent.
        for round in 0..2 {
            for axis in 0..3 {
                let along = |x: f64| {
                    let mut other = shift;
                    other[axis] = x;
                    self.chi2(&of(other))
                };
                let step = if round == 0 { 0.02 } else { 0.005 };
                if let Some(x) = lowest(&along, shift[axis], step) {
                    shift[axis] = x;
                }
            }
        }
        (shift.norm() > SHORTEST).then(|| of(shift))
    }

    /// Cross-talks from one channel to another of its kind, those that explain most first.
    fn cross_talks(&self) -> Vec<Fault> {
        let mut cross: Vec<(f64, [usize; 2], f64)> = Vec::new();
        let of = |[channel, from]: [usize; 2], share: f64| Fault::CrossTalk {
            channel,
            from,
            share,
        };
        let sensors = &self.state.sensors;
        let none = self
            .bench
            .score_moved(self.state, self.tolerance, self.motion);
        let Some(b) = none.map(|score| score.chi2) else {
            return Vec::new();
        };
        for &channel in &self.live {
            for &from in &self.live {
                let silent = [channel, from].iter().any(|c| self.quiet.contains(c));
                if silent || channel == from || sensors[channel].kind != sensors[from].kind {
                    continue;
                }
                let pair = [channel, from];
                // The first parabola tells if it is worth going on.
                let first = [-0.05, 0.05].map(|share| self.chi2(&of(pair, share)));
                let [Some(a), Some(c)] = first else {
                    continue;
                };
                let curvature = a + c - 2.0 * b;
                let x = 0.05 * 0.5 * (a - c) / curvature;
                if curvature > 0.0 && x.abs() > SMALLEST[1] && x.abs() < 0.5 {
                    cross.push(((a - c).powi(2) / (8.0 * curvature), pair, x));
                }
            }
        }
        // Those that explain most get their share to the last digit.
        cross.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (_, pair, share) in cross.iter_mut().take(REFINED) {
            if let Some(x) = lowest(&|x| self.chi2(&of(*pair, x)), *share, 0.01) {
                *share = x;
            }
        }
        let faults = cross.iter().map(|(_, pair, share)| of(*pair, *share));
        faults.collect()
    }
}

/// Moves a position or shift that was found to where it leaves least: its coordinates depend on each other.
pub(super) fn polish(bench: &Bench, state: &State, tolerance: f64, fault: &mut Fault) {
    let given = fault.clone();
    let position = match &given {
        Fault::Position {
            position,
            mistake: Mistake::Offset,
            ..
        } => *position,
        Fault::Datum { shift, .. } => *shift,
        _ => return,
    };
    let of = |position: Vector3<f64>| match &given {
        Fault::Datum { channels, .. } => Fault::Datum {
            channels: channels.clone(),
            shift: position,
        },
        _ => Fault::Position {
            place: given.channels(),
            position,
            mistake: Mistake::Offset,
        },
    };
    let chi2 =
        |position: Vector3<f64>| Some(bench.score(&without(state, &of(position)), tolerance)?.chi2);
    let mut at = position;
    for _ in 0..POLISHED {
        let before = at;
        for axis in 0..3 {
            let along = |x: f64| {
                let mut other = at;
                other[axis] = x;
                chi2(other)
            };
            if let Some(x) = lowest(&along, at[axis], 0.003) {
                at[axis] = x;
            }
        }
        if (at - before).norm() < 1e-4 {
            break;
        }
    }
    *fault = of(at);
}
