//! Findings compared with the faults that were put into a set-up.

use super::Outcome;
use super::spoil::{Spoilt, channels, places};
use super::trace::{self, Scene};
use crate::detective::{Explanation, Fault, Findings, Whole, WholeFault};
use crate::setup::{STANDARD_GRAVITY, Setup};
use crate::study::trial::Trial;
use nalgebra::Vector3;

/// Findings in words.
pub(super) fn said(found: &Findings) -> Vec<String> {
    let suspects = found.suspects.iter().map(|s| {
        let all: Vec<&str> = s.explanations.iter().map(|e| e.text.as_str()).collect();
        all.join("; or ")
    });
    let whole = found.whole.iter().map(|w| w.fault.name().to_owned());
    let more = found
        .more_is_wrong()
        .then(|| format!("{:.1} left of {:.1}", found.repaired, found.contradiction));
    suspects.chain(whole).chain(more).collect()
}

/// Findings compared with the faults that are there.
pub(super) fn outcome(setup: &Setup, faults: &[Spoilt], found: Option<&Findings>) -> Outcome {
    let Some(found) = found else {
        return Outcome::Silent;
    };
    let mut told = vec![false; faults.len()];
    let (mut tied, mut sensor, mut wrong) = (false, false, false);
    let mut asked = false;
    for suspect in &found.suspects {
        let hit = |fault: &Spoilt| suspect.explanations.iter().any(|e| fault.is_said(setup, e));
        if let Some(number) = faults.iter().position(hit) {
            let fault = &faults[number];
            told[number] = true;
            let all = &suspect.explanations;
            tied |= all.len() > 1 || !all.iter().any(|e| fault.is(setup, &e.fault));
            continue;
        }
        let vague = suspect.explanations.iter().any(|e| match &e.fault {
            Fault::Unlisted { channel } => faults.iter().any(|f| f.channels().contains(channel)),
            _ => false,
        });
        sensor |= vague;
        wrong |= !vague;
    }
    let mut by_size = false;
    for (fault, told) in faults.iter().zip(&mut told) {
        if !*told && fault.is_told_by(&found.whole) {
            (*told, by_size) = (true, true);
            asked |= *fault == Spoilt::InG;
        }
    }
    // What only asks accuses nobody, and positions far away are what they are.
    let accuses = |w: &Whole| {
        let position = |f: &Spoilt| matches!(f, Spoilt::Position(..));
        let right = faults.iter().any(|f| f.is_told_by(std::slice::from_ref(w)));
        match w.fault {
            WholeFault::PerhapsInG
            | WholeFault::NoUnit
            | WholeFault::Weighed
            | WholeFault::RunApart => false,
            WholeFault::Outlying => !faults.iter().any(position),
            WholeFault::ReferencePoint => !faults.contains(&Spoilt::Millimetres),
            _ => !right,
        }
    };
    wrong |= found.whole.iter().any(accuses);
    let of_run = |w: &Whole| w.fault == WholeFault::RunApart;
    let count = told.iter().filter(|t| **t).count();
    if wrong {
        Outcome::Wrong
    } else if count == faults.len() && count > 0 {
        match (by_size, tied) {
            (true, _) if asked => Outcome::Asked,
            (true, _) => Outcome::BySize,
            (_, true) => Outcome::Tied,
            _ => Outcome::Named,
        }
    } else if count > 0 {
        Outcome::Half
    } else if sensor {
        Outcome::Sensor
    } else if found.more_is_wrong() || found.whole.iter().any(of_run) {
        Outcome::Unnamed
    } else {
        Outcome::Silent
    }
}

/// `true` if, by exact data, all explanations of a tie mend the set-up alike, the others being mended as
/// the first ones say.
pub(super) fn tied_in_principle(
    clean: &Trial,
    level: f64,
    faults: &[Spoilt],
    found: &Findings,
) -> bool {
    let faults: Vec<&Spoilt> = faults.iter().collect();
    let setup = &clean.setup;
    let hits = |e: &Explanation| faults.iter().any(|fault| fault.is_said(setup, e));
    let right: Vec<Option<&Explanation>> = (found.suspects.iter())
        .map(|s| s.explanations.iter().find(|e| hits(e)))
        .collect();
    found.suspects.iter().enumerate().all(|(n, suspect)| {
        suspect.explanations.iter().all(|e| {
            let others = right.iter().enumerate().filter(|(other, _)| *other != n);
            let others = others.filter_map(|(_, right)| right.map(|e| &e.fault));
            let mended: Vec<&Fault> = others.chain([&e.fault]).collect();
            trace::contradiction(&Scene {
                clean,
                level,
                faults: &faults,
                mended: &mended,
            }) < trace::LIMIT
        })
    })
}

impl Spoilt {
    /// `true` if one name of an explanation is this fault.
    fn is_said(&self, setup: &Setup, explanation: &Explanation) -> bool {
        let mut names = std::iter::once(&explanation.fault).chain(&explanation.same);
        names.any(|found| self.is(setup, found))
    }

    /// `true` if the repair of an explanation takes this fault away and changes nothing else.
    fn is(&self, setup: &Setup, found: &Fault) -> bool {
        let clean = states(setup);
        let mut state = clean.clone();
        self.change(&mut state);
        mend(&mut state, found);
        let places = places(setup);
        let alone = |c: usize| places.iter().any(|place| place.as_slice() == [c]);
        let leak = match self {
            Self::CrossTalk(_, share) => *share,
            _ => 0.0,
        };
        let off = match self {
            Self::Position(_, [written, truth]) => (written - truth).norm(),
            _ => 0.0,
        };
        state
            .iter()
            .zip(&clean)
            .enumerate()
            .all(|(c, (found, truth))| {
                let mut shift = found.position - truth.position;
                let axis = truth.axis.normalize();
                if alone(c) {
                    // Nothing tells where along its axis a single sensor sits.
                    shift -= axis * axis.dot(&shift);
                }
                // A position that is found is good to a tenth of what it was off by, or two centimetres.
                (found.axis - truth.axis).norm() < 0.04 * truth.axis.norm()
                    && shift.norm() < (0.1 * off.min(1.0)).max(0.02)
                    && found.source == truth.source
                    && (found.late - truth.late).abs() <= 0.5
                    && found.dead == truth.dead
                    // A share that is found is good to two hundredths, or a quarter.
                    && found.leaks.iter().all(|left| left.abs() < (0.25 * leak).max(0.02))
            })
    }

    /// Puts the fault into the state of all channels.
    fn change(&self, all: &mut [State]) {
        match self {
            Self::Inverted(c) => all[*c].axis *= -1.0,
            Self::Factor(c, factor) => all[*c].axis *= *factor,
            Self::Turned(place, turn) => {
                place.iter().for_each(|&c| all[c].axis = turn * all[c].axis)
            }
            Self::Position(place, [written, truth]) => place
                .iter()
                .for_each(|&c| all[c].position += written - truth),
            Self::Swapped([a, b]) => {
                let source = all[*a].source;
                all[*a].source = all[*b].source;
                all[*b].source = source;
            }
            Self::Delayed(late, samples) => {
                late.iter().for_each(|&c| all[c].late += *samples as f64)
            }
            Self::Dead(c) => all[*c].dead = true,
            Self::CrossTalk([c, from], share) => all[*c].leaks[*from] += share,
            Self::Reversed => all
                .iter_mut()
                .filter(|s| s.cell)
                .for_each(|s| s.axis *= -1.0),
            Self::InG => all
                .iter_mut()
                .filter(|s| !s.cell)
                .for_each(|s| s.axis /= STANDARD_GRAVITY),
            Self::Millimetres => all.iter_mut().for_each(|s| s.position *= 1000.0),
        }
    }

    fn is_told_by(&self, whole: &[Whole]) -> bool {
        let told = |fault: WholeFault| whole.iter().any(|w| w.fault == fault);
        match self {
            Self::InG => told(WholeFault::PerhapsInG) || told(WholeFault::NoUnit),
            Self::Millimetres => told(WholeFault::Millimetres),
            Self::Position(place, _) => whole
                .iter()
                .any(|w| w.fault == WholeFault::Outlying && w.channels == *place),
            _ => false,
        }
    }
}

/// Properties of a channel that faults change and repairs mend.
#[derive(Clone, Debug)]
struct State {
    /// Direction times scale.
    axis: Vector3<f64>,
    position: Vector3<f64>,
    /// The channel whose readings it has.
    source: usize,
    late: f64,
    dead: bool,
    /// Shares of all channels that it carries.
    leaks: Vec<f64>,
    cell: bool,
}

fn states(setup: &Setup) -> Vec<State> {
    let all = channels(setup);
    let count = all.len();
    all.into_iter()
        .enumerate()
        .map(|(source, at)| State {
            axis: at.direction,
            position: at.position,
            source,
            late: 0.0,
            dead: false,
            leaks: vec![0.0; count],
            cell: at.cell,
        })
        .collect()
}

/// Mends what an explanation says is wrong.
fn mend(all: &mut [State], fault: &Fault) {
    match fault {
        Fault::Inverted { channel } => all[*channel].axis *= -1.0,
        Fault::Factor { channel, factor } | Fault::Gain { channel, factor } => {
            all[*channel].axis /= *factor;
        }
        Fault::Swapped { channels: [a, b] } => {
            let source = all[*a].source;
            all[*a].source = all[*b].source;
            all[*b].source = source;
        }
        Fault::PlacesExchanged { places: [a, b] } => {
            let (here, there) = (all[a[0]].position, all[b[0]].position);
            a.iter().for_each(|&c| all[c].position = there);
            b.iter().for_each(|&c| all[c].position = here);
        }
        Fault::Turned { place, rotation } => {
            place
                .iter()
                .for_each(|&c| all[c].axis = rotation * all[c].axis);
        }
        Fault::Position {
            place, position, ..
        } => {
            place.iter().for_each(|&c| all[c].position = *position);
        }
        Fault::Delayed { channels, samples } => {
            channels.iter().for_each(|&c| all[c].late -= samples);
        }
        Fault::Dead { channel } => all[*channel].dead = !all[*channel].dead,
        Fault::CrossTalk {
            channel,
            from,
            share,
        } => all[*channel].leaks[*from] -= share,
        Fault::Reversed { channels } => channels.iter().for_each(|&c| all[c].axis *= -1.0),
        Fault::Unit { channels, factor } => channels.iter().for_each(|&c| all[c].axis /= *factor),
        Fault::Datum { channels, shift } => {
            channels.iter().for_each(|&c| all[c].position += shift);
        }
        // Nothing is mended by it.
        Fault::Unlisted { channel } => all[*channel].late = 1e9,
    }
}
