//! Faults that are put into a set-up.

use crate::identification::estimates;
use crate::setup::{Mount, STANDARD_GRAVITY, Setup};
use crate::study::chance::Chance;
use crate::study::trial::{Trial, TrialError};
use massline_core::identify::{Estimate, Identification};
use massline_core::masslines::Method;
use nalgebra::{Matrix3, Vector3};

/// Kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A channel has the other sign.
    Inverted,
    /// Two channels are exchanged.
    Swapped,
    /// A sensor of several axes is turned by half a turn about one of them.
    UpsideDown,
    /// A channel reads too much or too little, by a usual factor or a free one.
    Factor,
    /// A position is off.
    Position,
    /// A position is in millimetres.
    PositionInMillimetres,
    /// A channel, or all load cells, come late.
    Delayed,
    /// A channel has no signal.
    Dead,
    /// A channel carries a share of another one of its kind.
    CrossTalk,
    /// All load cells have the other sign.
    Reversed,
    /// All accelerations are in g.
    InG,
    /// All positions are in millimetres.
    Millimetres,
}

impl Kind {
    /// `true` if all sensors of a kind share the fault.
    #[must_use]
    pub fn is_whole(self) -> bool {
        matches!(self, Self::Reversed | Self::InG | Self::Millimetres)
    }
}

/// All kinds.
pub const KINDS: [Kind; 12] = [
    Kind::Inverted,
    Kind::Swapped,
    Kind::UpsideDown,
    Kind::Factor,
    Kind::Position,
    Kind::PositionInMillimetres,
    Kind::Delayed,
    Kind::Dead,
    Kind::CrossTalk,
    Kind::Reversed,
    Kind::InG,
    Kind::Millimetres,
];

/// A fault of a set-up.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Spoilt {
    Inverted(usize),
    Swapped([usize; 2]),
    /// Channels, and the rotation that mends them.
    Turned(Vec<usize>, Matrix3<f64>),
    /// Found over expected.
    Factor(usize, f64),
    /// Channels, the position that is written, and the true one.
    Position(Vec<usize>, [Vector3<f64>; 2]),
    Delayed(Vec<usize>, usize),
    Dead(usize),
    /// A channel, the one that it carries, and the share.
    CrossTalk([usize; 2], f64),
    /// All load cells have the other sign.
    Reversed,
    /// All accelerations are in g.
    InG,
    /// All positions are in millimetres.
    Millimetres,
}

/// Kind, position and direction of a channel of a set-up.
pub(super) struct At {
    pub(super) cell: bool,
    pub(super) structure: bool,
    pub(super) position: Vector3<f64>,
    pub(super) direction: Vector3<f64>,
}

/// All channels: accelerometers, then load cells.
pub(super) fn channels(setup: &Setup) -> Vec<At> {
    let motion = setup.accelerometers.iter().map(|a| At {
        cell: false,
        structure: a.mount == Mount::Structure,
        position: a.position.into(),
        direction: a.direction.into(),
    });
    let force = setup.load_cells.iter().map(|c| At {
        cell: true,
        structure: false,
        position: c.position.into(),
        direction: c.direction.into(),
    });
    motion.chain(force).collect()
}

/// Names of all channels.
fn name(setup: &Setup, channel: usize) -> &str {
    let sensors = setup.accelerometers.len();
    match setup.accelerometers.get(channel) {
        Some(a) => &a.channel,
        None => &setup.load_cells[channel - sensors].channel,
    }
}

pub(super) fn position_of(
    setup: &mut Setup,
    channel: usize,
) -> (&mut [f64; 3], &mut [f64; 3], &mut f64) {
    let sensors = setup.accelerometers.len();
    if channel < sensors {
        let a = &mut setup.accelerometers[channel];
        (&mut a.position, &mut a.direction, &mut a.scale)
    } else {
        let c = &mut setup.load_cells[channel - sensors];
        (&mut c.position, &mut c.direction, &mut c.scale)
    }
}

/// The channels of one sensor: those of one kind at one place.
pub(super) fn places(setup: &Setup) -> Vec<Vec<usize>> {
    let all = channels(setup);
    let mut places: Vec<Vec<usize>> = Vec::new();
    for c in 0..all.len() {
        let here = |place: &&mut Vec<usize>| {
            let first = &all[place[0]];
            first.cell == all[c].cell
                && first.structure == all[c].structure
                && first.position == all[c].position
        };
        match places.iter_mut().find(here) {
            Some(place) => place.push(c),
            None => places.push(vec![c]),
        }
    }
    places
}

/// Median distance of the sensors from their middle, m.
fn size(all: &[At]) -> f64 {
    let middle = all.iter().map(|s| s.position).sum::<Vector3<f64>>() / all.len() as f64;
    let mut far: Vec<f64> = all.iter().map(|s| (s.position - middle).norm()).collect();
    far.sort_by(f64::total_cmp);
    far[far.len() / 2]
}

/// Draws a fault of this kind and puts it into a trial; `None` where this one does not exist, and where
/// it has channels of those before it.
pub(super) fn spoil(
    trial: &mut Trial,
    kind: Kind,
    chance: &mut Chance,
    before: &[Spoilt],
) -> Option<Spoilt> {
    let all = channels(&trial.setup);
    let places = places(&trial.setup);
    let any = |chance: &mut Chance| chance.whole(0, all.len() - 1);
    let a_place = |chance: &mut Chance| places[chance.whole(0, places.len() - 1)].clone();
    let fault = match kind {
        Kind::Inverted => Spoilt::Inverted(any(chance)),
        Kind::Swapped => {
            let pair = [any(chance), any(chance)];
            let [a, b] = pair.map(|c| &all[c]);
            if pair[0] == pair[1] || a.cell != b.cell {
                return None;
            }
            Spoilt::Swapped(pair)
        }
        Kind::UpsideDown => {
            let place = a_place(chance);
            let axis = all[place[chance.whole(0, place.len() - 1)]].direction;
            let turn = axis * axis.transpose() * 2.0 - Matrix3::identity();
            (place.len() > 1).then_some(Spoilt::Turned(place, turn))?
        }
        Kind::Factor => {
            const USUAL: [f64; 8] = [
                STANDARD_GRAVITY,
                1.0 / STANDARD_GRAVITY,
                1000.0,
                0.001,
                10.0,
                0.1,
                2.0,
                0.5,
            ];
            let factor = if chance.happens(0.5) {
                USUAL[chance.whole(0, USUAL.len() - 1)]
            } else {
                let free = chance.by_ratio(1.05, 1.5);
                if chance.happens(0.5) {
                    free
                } else {
                    1.0 / free
                }
            };
            Spoilt::Factor(any(chance), factor)
        }
        kind @ (Kind::Position | Kind::PositionInMillimetres) => {
            let place = a_place(chance);
            let truth = all[place[0]].position;
            let written = match kind {
                Kind::Position => {
                    truth + chance.direction() * size(&all) * chance.by_ratio(0.03, 0.5)
                }
                _ => truth * 1000.0,
            };
            Spoilt::Position(place, [written, truth])
        }
        Kind::Delayed => {
            let late = match chance.whole(0, 2) {
                0 => (0..all.len()).filter(|&c| all[c].cell).collect(),
                _ => vec![any(chance)],
            };
            Spoilt::Delayed(late, chance.whole(1, 10))
        }
        Kind::Dead => Spoilt::Dead(any(chance)),
        Kind::CrossTalk => {
            let pair = [any(chance), any(chance)];
            let [a, b] = pair.map(|c| &all[c]);
            if pair[0] == pair[1] || a.cell != b.cell || a.structure != b.structure {
                return None;
            }
            Spoilt::CrossTalk(pair, chance.by_ratio(0.05, 0.15))
        }
        Kind::Reversed => Spoilt::Reversed,
        Kind::InG => Spoilt::InG,
        Kind::Millimetres => Spoilt::Millimetres,
    };
    let overlaps = |other: &Spoilt| {
        fault.is_whole()
            || other
                .channels()
                .iter()
                .any(|c| fault.channels().contains(c))
    };
    if before.iter().any(overlaps) {
        return None;
    }
    fault.apply(trial);
    Some(fault)
}

impl Spoilt {
    pub(super) fn is_whole(&self) -> bool {
        matches!(self, Self::Reversed | Self::InG | Self::Millimetres)
    }

    /// Its channels; none where all sensors of a kind share it.
    pub(super) fn channels(&self) -> Vec<usize> {
        match self {
            Self::Inverted(c) | Self::Factor(c, _) | Self::Dead(c) => vec![*c],
            Self::Swapped(pair) => pair.to_vec(),
            Self::Turned(place, _) | Self::Position(place, _) | Self::Delayed(place, _) => {
                place.clone()
            }
            Self::CrossTalk([c, _], _) => vec![*c],
            Self::Reversed | Self::InG | Self::Millimetres => Vec::new(),
        }
    }

    /// `true` if one of these sentences says that the fault is not told.
    pub(super) fn is_untold(&self, setup: &Setup, untold: &[String]) -> bool {
        let says = |start: &str, channels: &[usize]| {
            let all = |line: &String| {
                let named = |c: &usize| line.contains(&format!("`{}`", name(setup, *c)));
                line.starts_with(start) && channels.iter().all(named)
            };
            untold.iter().any(all)
        };
        match self {
            Self::Inverted(c) => says("the sign of", &[*c]),
            Self::Turned(place, turn) => {
                let all = channels(setup);
                let turned =
                    |c: &&usize| (turn * all[**c].direction - all[**c].direction).norm() > 0.1;
                let turned: Vec<usize> = place.iter().filter(turned).copied().collect();
                says("the sign of", &turned)
            }
            Self::Swapped(pair) => says("which is which", pair),
            Self::Position(place, _) => says("the position of", &place[..1]),
            Self::Factor(c, _) | Self::Dead(c) | Self::CrossTalk([c, _], _) => {
                says("the gain of", &[*c])
            }
            Self::Delayed(late, _) => says("the gain of", late),
            Self::Reversed | Self::InG | Self::Millimetres => false,
        }
    }

    /// Puts the fault into a test.
    pub(super) fn apply(&self, trial: &mut Trial) {
        match self {
            Self::Swapped([a, b]) => trial.exchange(*a, *b),
            Self::Dead(c) => trial.silence(*c),
            Self::Delayed(late, samples) => trial.delay(late, *samples),
            Self::CrossTalk([c, from], share) => trial.leak(*c, *from, *share as f32),
            Self::InG => {
                for c in 0..trial.setup.accelerometers.len() {
                    trial.record_in(c, STANDARD_GRAVITY as f32);
                }
            }
            _ => self.misstate(&mut trial.setup),
        }
    }

    /// Puts the fault into a set-up, as far as it lies there.
    pub(super) fn misstate(&self, setup: &mut Setup) {
        match self {
            Self::Inverted(c) => *position_of(setup, *c).2 *= -1.0,
            Self::Factor(c, factor) => *position_of(setup, *c).2 *= factor,
            Self::Turned(place, turn) => {
                for &c in place {
                    let direction = position_of(setup, c).1;
                    *direction = (turn * Vector3::from(*direction)).into();
                }
            }
            Self::Position(place, [written, truth]) => {
                for &c in place {
                    let position = position_of(setup, c).0;
                    // Channels of one sensor differ a little.
                    *position = (Vector3::from(*position) - truth + written).into();
                }
            }
            Self::Reversed => {
                setup.load_cells.iter_mut().for_each(|c| c.scale *= -1.0);
            }
            Self::Millimetres => {
                let count = channels(setup).len();
                for c in 0..count {
                    position_of(setup, c)
                        .0
                        .iter_mut()
                        .for_each(|x| *x *= 1000.0);
                }
                setup.reference_point.iter_mut().for_each(|x| *x *= 1000.0);
            }
            Self::Swapped(_)
            | Self::Dead(_)
            | Self::Delayed(..)
            | Self::CrossTalk(..)
            | Self::InG => {}
        }
    }

    /// The fault in words.
    pub(super) fn text(&self, setup: &Setup) -> String {
        let list = |all: &[usize]| {
            all.iter()
                .map(|&c| name(setup, c))
                .collect::<Vec<_>>()
                .join(" ")
        };
        match self {
            Self::Inverted(c) => format!("{} inverted", name(setup, *c)),
            Self::Swapped(pair) => format!("{} exchanged", list(pair)),
            Self::Turned(place, _) => format!("{} upside down", list(place)),
            Self::Factor(c, factor) => format!("{} times {factor:.4}", name(setup, *c)),
            Self::Position(place, [written, truth]) => {
                format!("{} {:.4} m off", list(place), (written - truth).norm())
            }
            Self::Delayed(late, samples) => format!("{} late by {samples}", list(late)),
            Self::Dead(c) => format!("{} dead", name(setup, *c)),
            Self::CrossTalk([c, from], share) => format!(
                "{} carries {:.1} % of {}",
                name(setup, *c),
                100.0 * share,
                name(setup, *from)
            ),
            Self::Reversed => "all load cells reversed".to_owned(),
            Self::InG => "all accelerations in g".to_owned(),
            Self::Millimetres => "all positions in mm".to_owned(),
        }
    }
}

/// `true` if a number moves by more than its interval.
pub(super) fn counts(
    clean: &Trial,
    spoilt: &Trial,
    level: f64,
    fault: &Spoilt,
) -> Result<bool, TrialError> {
    let all = channels(&clean.setup);
    let on_structure = |c: &usize| all[*c].structure;
    let channels = fault.channels();
    // Only the free structure's methods use accelerometers on it.
    let only_structure = !channels.is_empty() && channels.iter().all(on_structure);
    let method = only_structure.then_some(Method::FreeResponsesSquared);
    let answer = |trial: &Trial| -> Result<Option<Identification>, TrialError> {
        Ok(trial
            .answers(level, &[method])?
            .into_iter()
            .next()
            .and_then(Result::ok))
    };
    let Some(before) = answer(clean)? else {
        return Ok(false);
    };
    let Some(after) = answer(spoilt)? else {
        return Ok(true);
    };
    let pairs = estimates(&before).into_iter().zip(estimates(&after));
    let moved = |pair: (Option<Estimate>, Option<Estimate>)| match pair {
        (Some(a), Some(b)) => (a.value - b.value).abs() > a.interval(before.freedom),
        (None, None) => false,
        _ => true,
    };
    Ok(pairs.into_iter().any(moved))
}
