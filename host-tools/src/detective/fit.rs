//! Hypotheses with free numbers, each at its best: gains, positions, shares of cross-talk.

use nalgebra::Vector3;

use super::hypothesis::{Fault, Hypothesis, Mistake, SHORTEST, places};
use super::mend::{mended, without};
use super::model::{Bench, Motion};
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
    let chi2 = |fault: &Fault| Some(mended(bench, state, fault, tolerance, motion)?.chi2);
    let live = state.live();
    let mut all = Vec::new();
    let class = live.len();
    for &channel in &live {
        if quiet.contains(&channel) {
            let dead = without(state, &Fault::Dead { channel });
            let others = bench.motion(&dead, tolerance);
            let expected = others.is_some_and(|m| bench.expects(state, &m, channel, quiet));
            if expected {
                all.push(Hypothesis {
                    fault: Fault::Dead { channel },
                    free: 0,
                    class,
                    doubt: 0.0,
                });
            }
            continue;
        }
        let of = |x: f64| Fault::Gain {
            channel,
            factor: x.exp(),
        };
        // What is left is nearly a square in the factor that mends it: three points tell it.
        let square = |x: f64| {
            chi2(&Fault::Gain {
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
        if let Some(x) = lowest(&|x| chi2(&of(x)), start, 0.05)
            && (x.exp() - 1.0).abs() > SMALLEST[0]
        {
            all.push(Hypothesis {
                fault: of(x),
                free: 1,
                class,
                doubt: 0.0,
            });
        }
        all.push(Hypothesis {
            fault: Fault::Unlisted { channel },
            free: bench.motions(),
            class,
            doubt: 0.0,
        });
    }
    let places = places(&state.sensors, &|i| state.is_live(i));
    for place in &places {
        let here = state.sensors[place[0]].position;
        let of = |shift: Vector3<f64>| Fault::Position {
            place: place.clone(),
            position: here + shift,
            mistake: Mistake::Offset,
        };
        let mut shift = Vector3::zeros();
        // One coordinate after the other, and again: they are nearly independent.
        for round in 0..2 {
            for axis in 0..3 {
                let along = |x: f64| {
                    let mut other = shift;
                    other[axis] = x;
                    chi2(&of(other))
                };
                let step = if round == 0 { 0.02 } else { 0.005 };
                if let Some(x) = lowest(&along, shift[axis], step) {
                    shift[axis] = x;
                }
            }
        }
        if shift.norm() > SHORTEST {
            all.push(Hypothesis {
                fault: of(shift),
                free: 3,
                class: places.len(),
                doubt: 0.0,
            });
        }
    }
    let mut cross: Vec<(f64, [usize; 2], f64)> = Vec::new();
    let of = |[channel, from]: [usize; 2], share: f64| Fault::CrossTalk {
        channel,
        from,
        share,
    };
    for &channel in &live {
        for &from in &live {
            let silent = [channel, from].iter().any(|c| quiet.contains(c));
            if silent || channel == from || state.sensors[channel].kind != state.sensors[from].kind
            {
                continue;
            }
            let pair = [channel, from];
            // The first parabola tells if it is worth going on.
            let first = [-0.05, 0.0, 0.05].map(|share| chi2(&of(pair, share)));
            let [Some(a), Some(b), Some(c)] = first else {
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
        if let Some(x) = lowest(&|x| chi2(&of(*pair, x)), *share, 0.01) {
            *share = x;
        }
    }
    let cross: Vec<Fault> = cross
        .iter()
        .map(|(_, pair, share)| of(*pair, *share))
        .collect();
    let class = cross.len().max(class * 4);
    all.extend(cross.into_iter().map(|fault| Hypothesis {
        fault,
        free: 1,
        class,
        doubt: 0.0,
    }));
    all
}

/// Moves a position that was found to where it leaves least: its coordinates depend on each other.
pub(super) fn polish(bench: &Bench, state: &State, tolerance: f64, fault: &mut Fault) {
    let Fault::Position {
        place,
        position,
        mistake: Mistake::Offset,
    } = fault.clone()
    else {
        return;
    };
    let of = |position: Vector3<f64>| Fault::Position {
        place: place.clone(),
        position,
        mistake: Mistake::Offset,
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
