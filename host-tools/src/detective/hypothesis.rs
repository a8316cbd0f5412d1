//! Step 3: the faults that a set-up may have, each as a change of rows and sensors.

use nalgebra::{Matrix3, Vector3};

use super::model::level;
use super::sensor::{Kind, Sensor};
use super::state::State;
use super::table::UNKNOWN;
use crate::setup::STANDARD_GRAVITY;
use massline_core::geometry::Quantity;

/// One fault of a set-up. Channels are numbered as the sensors: accelerometers, then load cells.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// The channel has the other sign.
    Inverted {
        /// The channel.
        channel: usize,
    },
    /// Readings are so many times too large.
    Factor {
        /// The channel.
        channel: usize,
        /// Found over expected.
        factor: f64,
    },
    /// Two channels are exchanged.
    Swapped {
        /// Both channels.
        channels: [usize; 2],
    },
    /// The sensors at two places are exchanged.
    PlacesExchanged {
        /// The channels at both.
        places: [Vec<usize>; 2],
    },
    /// A sensor of several axes is mounted the wrong way round.
    Turned {
        /// Its channels.
        place: Vec<usize>,
        /// From the directions of the set-up to those in truth.
        rotation: Matrix3<f64>,
    },
    /// A position has the wrong unit, a wrong sign, or exchanged coordinates.
    Position {
        /// The channels there.
        place: Vec<usize>,
        /// In truth, m.
        position: Vector3<f64>,
        /// The kind of mistake.
        mistake: Mistake,
    },
    /// The gain is off by a factor that is none of the usual ones.
    Gain {
        /// The channel.
        channel: usize,
        /// Found over expected.
        factor: f64,
    },
    /// A share of another channel is added.
    CrossTalk {
        /// The channel that is disturbed.
        channel: usize,
        /// The channel that disturbs it.
        from: usize,
        /// SI of the first per SI of the second.
        share: f64,
    },
    /// The channel does not follow what the others do.
    Dead {
        /// The channel.
        channel: usize,
    },
    /// Channels are late.
    Delayed {
        /// The channels.
        channels: Vec<usize>,
        /// Samples; negative: early.
        samples: f64,
    },
    /// All load cells have the other sign, or all accelerometers: both are the same to the data.
    Reversed {
        /// The load cells.
        channels: Vec<usize>,
    },
    /// All accelerometers, or all load cells, are in another unit, told by the weighed mass; or all accelerometers on the
    /// interface, told by those on the structure.
    Unit {
        /// The channels.
        channels: Vec<usize>,
        /// Found over expected.
        factor: f64,
    },
    /// All load cells, or all accelerometers on the interface, lie elsewhere by the same vector: their positions were
    /// measured from another point.
    Datum {
        /// The channels.
        channels: Vec<usize>,
        /// From where the set-up has them to where they are, m.
        shift: Vector3<f64>,
    },
    /// The channel contradicts all others in a way that is none of these.
    Unlisted {
        /// The channel.
        channel: usize,
    },
}

/// A mistake in a position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mistake {
    /// Millimetres for metres.
    Millimetres,
    /// Inches for metres.
    Inches,
    /// A sign.
    Sign,
    /// Two coordinates exchanged.
    Exchanged,
    /// Somewhere else.
    Offset,
}

/// A hypothesis: a fault, the number of its free parameters, and of hypotheses of its class.
#[derive(Clone, Debug)]
pub(super) struct Hypothesis {
    pub(super) fault: Fault,
    pub(super) free: usize,
    pub(super) class: usize,
    /// Sum of squares that it has to explain besides.
    pub(super) doubt: f64,
}

/// Distance from which a position is wrong, m.
pub(super) const SHORTEST: f64 = 0.010;

/// Factors between units that people mix up.
pub(super) const FACTORS: [f64; 10] = [
    STANDARD_GRAVITY,
    1.0 / STANDARD_GRAVITY,
    1000.0,
    0.001,
    10.0,
    0.1,
    2.0,
    0.5,
    100.0,
    0.01,
];

/// Units of all accelerometers that people mix up: g, mm/s².
pub(super) const OF_MOTION: [f64; 2] = [1.0 / STANDARD_GRAVITY, 1000.0];
/// Units of all load cells that people mix up: kgf, kN, mN, lbf, and lost factors. None is so near to one
/// of all accelerometers that a weighed mass does not tell them apart.
pub(super) const OF_FORCE: [f64; 8] = [
    1.0 / STANDARD_GRAVITY,
    0.001,
    1000.0,
    0.224_809,
    2.0,
    0.5,
    100.0,
    0.01,
];

/// Channels at one place, of one kind.
pub(super) fn places(sensors: &[Sensor], live: &dyn Fn(usize) -> bool) -> Vec<Vec<usize>> {
    let mut places: Vec<Vec<usize>> = Vec::new();
    for (i, sensor) in sensors.iter().enumerate() {
        if !live(i) || sensor.kind == Kind::Cell(Quantity::Moment) {
            continue;
        }
        let same = |place: &&mut Vec<usize>| {
            let first = &sensors[place[0]];
            first.kind == sensor.kind
                && (first.position - sensor.position).norm() < 1e-6
                && place
                    .iter()
                    .all(|&j| sensors[j].direction.dot(&sensor.direction).abs() < 0.1)
        };
        match places.iter_mut().find(same) {
            Some(place) => place.push(i),
            None => places.push(vec![i]),
        }
    }
    places
}

/// A place with the moments that are measured there.
fn with_moments(sensors: &[Sensor], place: &[usize]) -> Vec<usize> {
    let here = &sensors[place[0]];
    let moment = |i: &usize| {
        let s = &sensors[*i];
        here.kind.is_cell()
            && s.kind == Kind::Cell(Quantity::Moment)
            && (s.position - here.position).norm() < 1e-6
    };
    let moments = (0..sensors.len()).filter(moment);
    place.iter().copied().chain(moments).collect()
}

/// The 24 rotations of a cube but the identity.
pub(super) fn cube() -> Vec<Matrix3<f64>> {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let signed: Vec<Vector3<f64>> = axes.iter().flat_map(|&a| [a, -a]).collect();
    let mut all = Vec::new();
    for x in &signed {
        for y in &signed {
            if x.dot(y) == 0.0 {
                let m = Matrix3::from_columns(&[*x, *y, x.cross(y)]);
                if m != Matrix3::identity() {
                    all.push(m);
                }
            }
        }
    }
    all
}

/// All hypotheses without free parameters.
/// A channel that is `quiet` has no signal that a factor or a sign could be told from; with a mass that
/// is `weighed`, so is a unit of all accelerometers or of all load cells.
pub(super) fn fixed(state: &State, quiet: &[usize], weighed: bool) -> Vec<Hypothesis> {
    let sensors = &state.sensors;
    let live = state.live();
    let loud: Vec<usize> = live
        .iter()
        .copied()
        .filter(|i| !quiet.contains(i))
        .collect();
    let places = places(sensors, &|i| state.is_live(i));
    let mut all = Vec::new();
    let mut class = |faults: Vec<Fault>| {
        let class = faults.len();
        all.extend(faults.into_iter().map(|fault| Hypothesis {
            fault,
            free: 0,
            class,
            doubt: 0.0,
        }));
    };
    class(
        loud.iter()
            .map(|&channel| Fault::Inverted { channel })
            .collect(),
    );
    class(
        loud.iter()
            .flat_map(|&channel| FACTORS.map(|factor| Fault::Factor { channel, factor }))
            .collect(),
    );
    let mut swaps = Vec::new();
    for (n, &a) in live.iter().enumerate() {
        for &b in &live[n + 1..] {
            if sensors[a].kind.is_cell() == sensors[b].kind.is_cell() {
                swaps.push(Fault::Swapped { channels: [a, b] });
            }
        }
    }
    class(swaps);
    let mut exchanges = Vec::new();
    for (n, a) in places.iter().enumerate() {
        for b in &places[n + 1..] {
            let cells = |place: &[usize]| sensors[place[0]].kind.is_cell();
            if a.len() > 1 && a.len() == b.len() && cells(a) == cells(b) {
                exchanges.push(Fault::PlacesExchanged {
                    places: [a.clone(), b.clone()],
                });
            }
        }
    }
    class(exchanges);
    let cube = cube();
    // Turned about the sensor's own axes.
    let own = |place: &[usize]| {
        let x = sensors[place[0]].direction;
        let y = sensors[place[1]].direction;
        let z = x.cross(&y).normalize();
        Matrix3::from_columns(&[x, z.cross(&x), z])
    };
    class(
        places
            .iter()
            .filter(|place| place.len() > 1)
            .flat_map(|place| {
                let axes = own(place);
                let whole = with_moments(sensors, place);
                cube.iter().map(move |turn| Fault::Turned {
                    place: whole.clone(),
                    rotation: axes * turn * axes.transpose(),
                })
            })
            .collect(),
    );
    class(positions(sensors, &places));
    let (cells, motion): (Vec<usize>, Vec<usize>) =
        live.iter().partition(|&&i| sensors[i].kind.is_cell());
    let unit = |channels: &Vec<usize>, factors: &[f64]| -> Vec<Fault> {
        let unit = |&factor: &f64| Fault::Unit {
            channels: channels.clone(),
            factor,
        };
        factors.iter().map(unit).collect()
    };
    if let Some(interface) = beside_structure(state) {
        class(unit(&interface, &FACTORS));
    }
    if !cells.is_empty() {
        if weighed {
            class([unit(&motion, &OF_MOTION), unit(&cells, &OF_FORCE)].concat());
        }
        class(vec![Fault::Reversed { channels: cells }]);
    }
    all
}

/// The accelerometers on the interface, where several on the structure tell a gain that they share.
pub(super) fn beside_structure(state: &State) -> Option<Vec<usize>> {
    let live = state.live();
    let of = |kind: Kind| -> Vec<usize> {
        (live.iter().copied())
            .filter(|&i| state.sensors[i].kind == kind)
            .collect()
    };
    (of(Kind::Structure).len() > 1).then(|| of(Kind::Interface))
}

/// Positions in millimetres or inches that lie so far away that size alone tells it, with the
/// positions that they would be.
pub(super) fn outlying(sensors: &[Sensor], is_far: &dyn Fn(&Vector3<f64>) -> bool) -> Vec<Fault> {
    let places = places(sensors, &|_| true);
    let far = |place: &&Vec<usize>| is_far(&sensors[place[0]].position);
    let mut all = Vec::new();
    for place in places.iter().filter(far) {
        let written = sensors[place[0]].position;
        for (unit, mistake) in [(0.001, Mistake::Millimetres), (0.0254, Mistake::Inches)] {
            if !is_far(&(written * unit)) {
                all.push(Fault::Position {
                    place: place.clone(),
                    position: written * unit,
                    mistake,
                });
                break;
            }
        }
    }
    all
}

/// Positions that were written wrongly in a usual way.
fn positions(sensors: &[Sensor], places: &[Vec<usize>]) -> Vec<Fault> {
    let mut all = Vec::new();
    for place in places {
        let here = sensors[place[0]].position;
        let mut others: Vec<Vector3<f64>> = places
            .iter()
            .filter(|other| *other != place)
            .map(|other| sensors[other[0]].position)
            .collect();
        if others.len() < 2 {
            continue;
        }
        others.retain(|p| p.iter().all(|x| x.is_finite()));
        let low = others.iter().fold(others[0], |a, b| a.inf(b));
        let high = others.iter().fold(others[0], |a, b| a.sup(b));
        let margin = (high - low).norm() * 0.5;
        let outside =
            |p: &Vector3<f64>| (0..3).any(|i| p[i] < low[i] - margin || p[i] > high[i] + margin);
        let mut add = |position: Vector3<f64>, mistake| {
            if (position - here).norm() > SHORTEST {
                all.push(Fault::Position {
                    place: place.clone(),
                    position,
                    mistake,
                });
            }
        };
        for (unit, mistake) in [(0.001, Mistake::Millimetres), (0.0254, Mistake::Inches)] {
            if outside(&here) && !outside(&(here * unit)) {
                add(here * unit, mistake);
            }
        }
        for axis in 0..3 {
            let mut other = here;
            other[axis] = -other[axis];
            add(other, Mistake::Sign);
        }
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let mut other = here;
            other.swap_rows(i, j);
            add(other, Mistake::Exchanged);
        }
    }
    all
}

impl Fault {
    /// `false` of a channel that contradicts all others in a way that is none of the usual mistakes.
    pub(super) fn is_usual(&self) -> bool {
        !matches!(self, Self::Unlisted { .. })
    }

    /// `true` of a channel without a signal, which needs no other explanation.
    pub(super) fn is_dead(&self) -> bool {
        matches!(self, Self::Dead { .. })
    }

    /// Changes sensors and rows to what they would be without the fault.
    pub(super) fn repair(&self, state: &mut State) {
        let scale = |state: &mut State, channel: usize, factor: f64| {
            for row in state.rows_mut(channel) {
                row.k *= factor;
                row.noise *= factor * factor;
            }
        };
        match self {
            Self::Inverted { channel } => scale(state, *channel, -1.0),
            Self::Factor { channel, factor } | Self::Gain { channel, factor } => {
                scale(state, *channel, 1.0 / factor);
            }
            Self::Swapped { channels } => state.swap(*channels),
            Self::PlacesExchanged { places: [a, b] } => {
                let sensors = &mut state.sensors;
                let (here, there) = (sensors[a[0]].position, sensors[b[0]].position);
                a.iter().for_each(|&i| sensors[i].position = there);
                b.iter().for_each(|&i| sensors[i].position = here);
            }
            Self::Turned { place, rotation } => {
                for &i in place {
                    state.sensors[i].direction = rotation * state.sensors[i].direction;
                }
            }
            Self::Position {
                place, position, ..
            } => place
                .iter()
                .for_each(|&i| state.sensors[i].position = *position),
            Self::CrossTalk {
                channel,
                from,
                share,
            } => {
                for mounting in &mut state.mountings {
                    let Some(other) = mounting.rows[*from].clone() else {
                        continue;
                    };
                    if let Some(row) = &mut mounting.rows[*channel] {
                        row.k.axpy(-share, &other.k, 1.0);
                        row.noise += other.noise * (share * share);
                    }
                }
            }
            Self::Dead { channel } | Self::Unlisted { channel } => {
                if state.sensors[*channel].kind.is_cell() {
                    // Its load is unknown: the equations that need it have no weight.
                    let levels: Vec<f64> = state
                        .mountings
                        .iter()
                        .map(|m| level(&state.sensors, &m.rows, true))
                        .collect();
                    for (mounting, level) in state.mountings.iter_mut().zip(levels) {
                        if let Some(row) = &mut mounting.rows[*channel] {
                            let level = level.max(row.k.norm_squared()).max(f64::MIN_POSITIVE);
                            for j in 0..row.k.len() {
                                row.noise[(j, j)] += UNKNOWN * level;
                            }
                        }
                    }
                } else {
                    for mounting in &mut state.mountings {
                        mounting.rows[*channel] = None;
                    }
                }
            }
            Self::Reversed { channels } => {
                channels.iter().for_each(|&c| scale(state, c, -1.0));
            }
            Self::Unit { channels, factor } => {
                channels.iter().for_each(|&c| scale(state, c, 1.0 / factor));
            }
            Self::Datum { channels, shift } => {
                for &i in channels {
                    state.sensors[i].position += shift;
                }
            }
            // Delays are taken out before the rows are made.
            Self::Delayed { .. } => {}
        }
    }

    /// `true` if all sensors of a kind share the fault.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        matches!(
            self,
            Self::Reversed { .. } | Self::Unit { .. } | Self::Datum { .. }
        )
    }

    /// The channels that the fault is about.
    #[must_use]
    pub fn channels(&self) -> Vec<usize> {
        match self {
            Self::Inverted { channel }
            | Self::Factor { channel, .. }
            | Self::Gain { channel, .. }
            | Self::CrossTalk { channel, .. }
            | Self::Dead { channel }
            | Self::Unlisted { channel } => vec![*channel],
            Self::Swapped { channels } => channels.to_vec(),
            Self::Delayed { channels, .. }
            | Self::Reversed { channels }
            | Self::Unit { channels, .. }
            | Self::Datum { channels, .. } => channels.clone(),
            Self::PlacesExchanged { places: [a, b] } => [a.as_slice(), b].concat(),
            Self::Turned { place, .. } | Self::Position { place, .. } => place.clone(),
        }
    }
}
