//! Step 4: the search for the faults that explain the contradiction.

use nalgebra::Vector3;

use super::hypothesis::{Fault, Hypothesis, Mistake, SHORTEST, fixed, places};
use super::model::{Bench, Motion, Score};
use super::sensor::{Kind, Sensor};
use super::state::State;

/// Range of the tolerance of sensors, as a share of the usual one, squared: good laboratories get
/// sharper limits.
const TOLERANCES: [f64; 2] = [0.1, 1.0];
/// Cross-talks whose share is fitted by more than one parabola.
const REFINED: usize = 20;
/// Hypotheses that are looked at again with the tolerance that fits.
const SECOND: usize = 80;
/// Sum of squares that a fault must explain, and its part that goes with the square of the tolerance.
const GAIN_OF: [f64; 2] = [15.0, 25.0];
/// Sum of squares that a fault must explain at the usual tolerance: a third of what it takes to count as
/// visible. One of six accused a clean set-up.
const AT_LEAST: f64 = 10.0;
/// Faults that explain this much less than the best are as likely.
const TIE: f64 = 9.0;
/// Rounds in which a position is found.
const POLISHED: usize = 10;
/// Factor that leaves nothing of a reading.
const SILENCE: f64 = 1e6;
/// Usual cross-talk of a sensor, a share of the other channel.
const CROSS_TALK: f64 = 0.1;
/// Faults with which the search for a pair begins, and how many of them may concern one channel.
const FIRST: [usize; 2] = [8, 2];
/// Differences up to which two changes of a set-up are the same one: share of a direction or reading, m.
const SAME: [f64; 2] = [0.03, 1e-6];
/// Most faults that are named.
const MOST: usize = 2;
/// Sum of squares over its degrees of freedom that contradicts the set-up.
pub(super) const CONTRADICTS: f64 = 1.5;
/// Smallest errors that are named: gain, cross-talk.
const SMALLEST: [f64; 2] = [0.03, 0.03];

/// A fault with the sum of squares that is left without it, penalties included.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    pub(super) fault: Fault,
    pub(super) score: f64,
    pub(super) left: Score,
    pub(super) free: usize,
    /// Sum of squares that it had to explain besides.
    pub(super) doubt: f64,
    /// Other names of the same change: nothing that is recorded would tell them apart.
    pub(super) same: Vec<Fault>,
}

/// Result of the search.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// Named faults, each with those that explain the data as well.
    pub(super) named: Vec<Vec<Candidate>>,
    /// The contradiction at first and at the end, at the usual tolerance.
    pub(super) before: Score,
    pub(super) after: Score,
    /// The sensors after the repairs.
    pub(super) sensors: Vec<Sensor>,
    /// Faults that these runs would not show.
    pub(super) untold: Untold,
}

/// Faults that would contradict nothing, since the runs do not move what would show them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Untold {
    /// Channels whose sign nothing tells.
    pub(super) signs: Vec<usize>,
    /// Channels of which nothing tells a gain that is twice what it should be.
    pub(super) gains: Vec<usize>,
    /// Channels that nothing tells apart.
    pub(super) pairs: Vec<[usize; 2]>,
    /// Channels at a place, where a position that is off by a fifth of the distance between sensors,
    /// along any axis, shows nowhere.
    pub(super) places: Vec<Vec<usize>>,
}

impl Untold {
    /// Those that would contradict a state by less than a fault has to.
    /// Sensors differ by so much of the usual `tolerance`.
    pub(super) fn of(bench: &Bench, state: &State, tolerance: f64) -> Option<Self> {
        let base = bench.score(state, tolerance)?;
        let motion = bench.motion(state, tolerance)?;
        let least = GAIN_OF[0] + GAIN_OF[1] * tolerance * tolerance;
        let shows = |fault: &Fault| match mended(bench, state, fault, tolerance, &motion) {
            Some(left) => left.chi2 > base.chi2 + least,
            None => true,
        };
        let live = state.live();
        let mut untold = Self::default();
        for (n, &a) in live.iter().enumerate() {
            if !shows(&Fault::Inverted { channel: a }) {
                untold.signs.push(a);
            }
            let twice = Fault::Factor {
                channel: a,
                factor: 2.0,
            };
            if !shows(&twice) {
                untold.gains.push(a);
            }
            for &b in &live[n + 1..] {
                let alike = state.sensors[a].kind.is_cell() == state.sensors[b].kind.is_cell();
                if alike && !shows(&Fault::Swapped { channels: [a, b] }) {
                    untold.pairs.push([a, b]);
                }
            }
        }
        for place in places(&state.sensors, &|i| state.is_live(i)) {
            let moved = |axis: usize| Fault::Position {
                place: place.clone(),
                position: state.sensors[place[0]].position + Vector3::ith(axis, 0.2 * bench.length),
                mistake: Mistake::Offset,
            };
            if !(0..3).any(|axis| shows(&moved(axis))) {
                untold.places.push(place);
            }
        }
        Some(untold)
    }
}

impl Found {
    /// A fault that was found before the search.
    pub(super) fn certain(&self, fault: Fault) -> Candidate {
        Candidate {
            fault,
            score: self.before.chi2,
            left: self.before.clone(),
            free: 0,
            doubt: 0.0,
            same: Vec::new(),
        }
    }
}

fn penalty(hypothesis: &Hypothesis, state: &State, motions: usize) -> f64 {
    let count = (state.sensors.len() * motions) as f64;
    let free = hypothesis.free as f64 * count.ln();
    let choice = 2.0 * (hypothesis.class.max(1) as f64).ln() + hypothesis.doubt;
    match hypothesis.fault {
        // Seen by itself: the channel was not chosen from many.
        Fault::Dead { .. } => 0.0,
        // Free numbers imitate every other fault.
        Fault::Unlisted { .. } => free + choice + TIE,
        Fault::CrossTalk { share, .. } => free + choice + (share / CROSS_TALK).powi(2),
        _ => free + choice,
    }
}

fn without(state: &State, fault: &Fault) -> State {
    let mut other = state.clone();
    fault.repair(&mut other);
    other
}

/// Score without a fault. `motion` is that of the state, which load cells do not change.
fn mended(
    bench: &Bench,
    state: &State,
    fault: &Fault,
    tolerance: f64,
    motion: &[Motion],
) -> Option<Score> {
    let other = without(state, fault);
    let cells = |channel: &usize| state.sensors[*channel].kind.is_cell();
    if fault.channels().iter().all(cells) {
        bench.score_moved(&other, tolerance, motion)
    } else {
        bench.score(&other, tolerance)
    }
}

fn judged(
    bench: &Bench,
    state: &State,
    hypothesis: &Hypothesis,
    tolerance: f64,
    (motion, freedom): (&[Motion], f64),
) -> Option<Candidate> {
    let left = mended(bench, state, &hypothesis.fault, tolerance, motion)?;
    // A sensor that would tell a motion of which no other knows explains everything.
    let frees = left.of_motion < freedom;
    if frees
        && !matches!(
            hypothesis.fault,
            Fault::Unlisted { .. } | Fault::Dead { .. }
        )
    {
        return None;
    }
    // A motion that no other sensor knows of is a free number of its own.
    let count = (state.sensors.len() * bench.motions()) as f64;
    let motions = if frees { 0.0 } else { left.of_motion - freedom };
    Some(Candidate {
        fault: hypothesis.fault.clone(),
        score: left.chi2 + penalty(hypothesis, state, bench.motions()) - motions * count.ln(),
        left,
        free: hypothesis.free,
        doubt: hypothesis.doubt,
        same: Vec::new(),
    })
}

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
fn fitted(
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

/// All candidates at a tolerance, best first.
fn ranked(
    bench: &Bench,
    state: &State,
    hypotheses: &[Hypothesis],
    tolerance: f64,
) -> Vec<Candidate> {
    let motion = bench.motion(state, tolerance);
    let base = bench.score(state, tolerance);
    let (Some(motion), Some(base)) = (motion, base) else {
        return Vec::new();
    };
    let mut all: Vec<Candidate> = hypotheses
        .iter()
        .filter_map(|h| judged(bench, state, h, tolerance, (&motion, base.of_motion)))
        .collect();
    all.sort_by(|a, b| a.score.total_cmp(&b.score));
    all
}

/// `true` if one fault says the same as the other with more freedom.
fn generalises(wide: &Candidate, narrow: &Candidate) -> bool {
    // A reading of which nothing is left is explained by whatever takes it away.
    narrow.doubt == 0.0
        && wide.free > narrow.free
        && wide
            .fault
            .channels()
            .iter()
            .any(|c| narrow.fault.channels().contains(c))
}

/// `true` if one fault has a reading multiplied of which nothing is left, and the other one explains the
/// reading by another channel: noise and tilt of a sensor along which nothing moves tell neither.
fn rivals(a: &Candidate, b: &Candidate) -> bool {
    let leak = |c: &Candidate| matches!(c.fault, Fault::CrossTalk { .. });
    a.fault.channels() == b.fault.channels()
        && ((a.doubt > 0.0 && leak(b)) || (b.doubt > 0.0 && leak(a)))
}

/// `true` if two faults change a set-up alike.
fn alike(state: &State, a: &Fault, b: &Fault) -> bool {
    let (a, b) = (without(state, a), without(state, b));
    let [share, place] = SAME;
    (0..state.sensors.len()).all(|i| {
        let (here, there) = (&a.sensors[i], &b.sensors[i]);
        let turned = here.direction.dot(&there.direction);
        // A sensor that looks the other way and has the other sign is the same.
        let sign = turned.signum();
        let rows = a.mountings.iter().zip(&b.mountings);
        (here.direction - there.direction * sign).norm() < share
            && (here.position - there.position).norm() < place
            && rows
                .into_iter()
                .all(|(a, b)| match (&a.rows[i], &b.rows[i]) {
                    (Some(a), Some(b)) => {
                        let size = a.k.norm().max(b.k.norm());
                        let noise = [&a.noise, &b.noise].map(|n| n.trace());
                        (&a.k - &b.k * sign).norm() <= share * size
                            && noise[0].max(noise[1]) <= 2.0 * noise[0].min(noise[1])
                    }
                    (None, None) => true,
                    _ => false,
                })
    })
}

/// All hypotheses, best first at the usual tolerance, each at its best.
fn first(
    bench: &Bench,
    state: &State,
    quiet: &[usize],
) -> Option<(Vec<Hypothesis>, Vec<Candidate>)> {
    let mut hypotheses = fixed(state, quiet, bench.weighed.is_some());
    let motion = bench.motion(state, 1.0)?;
    hypotheses.extend(fitted(bench, state, quiet, 1.0, &motion));
    let silent = |channel: usize| {
        let factor = SILENCE;
        Some(mended(bench, state, &Fault::Gain { channel, factor }, 1.0, &motion)?.chi2)
    };
    let silent: Vec<Option<f64>> = (0..state.sensors.len()).map(silent).collect();
    for h in &mut hypotheses {
        if let Fault::Factor { channel, factor } | Fault::Gain { channel, factor } = h.fault
            && factor > 1.0
        {
            let left = mended(bench, state, &h.fault, 1.0, &motion).map(|left| left.chi2);
            // A reading that may as well be nothing says little of a factor.
            if matches!((left, silent[channel]), (Some(left), Some(silent)) if silent < left + TIE)
            {
                h.doubt = TIE;
            }
        }
    }
    let ranked = ranked(bench, state, &hypotheses, 1.0);
    Some((hypotheses, ranked))
}

/// Moves a position that was found to where it leaves least: its coordinates depend on each other.
fn polish(bench: &Bench, state: &State, tolerance: f64, candidate: &mut Candidate) {
    let Fault::Position {
        place,
        position,
        mistake: Mistake::Offset,
    } = candidate.fault.clone()
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
    candidate.fault = of(at);
}

/// One fault with those that explain the data as well; `None` if none does.
fn single(bench: &Bench, state: &State, quiet: &[usize]) -> Option<(Vec<Candidate>, Score)> {
    let now = bench.score(state, 1.0)?;
    let (hypotheses, first) = first(bench, state, quiet)?;
    let best = first.first()?;
    let ratio = best.left.ratio().min(now.ratio());
    let square = ratio.clamp(TOLERANCES[0], TOLERANCES[1]);
    let tolerance = square.sqrt();
    let again: Vec<Hypothesis> = first
        .iter()
        .take(SECOND)
        .filter_map(|c| hypotheses.iter().find(|h| h.fault == c.fault).cloned())
        .collect();
    let second = ranked(bench, state, &again, tolerance);
    let base = bench.score(state, tolerance)?;
    let mut best = second.first()?.clone();
    polish(bench, state, tolerance, &mut best);
    if base.chi2 - best.score <= GAIN_OF[0] + GAIN_OF[1] * square {
        return None;
    }
    // Sharp limits rest on how the sensors differ on average: at the usual ones it is to show as well.
    let after = bench.score(&without(state, &best.fault), 1.0)?;
    if now.chi2 - after.chi2 <= AT_LEAST {
        return None;
    }
    // A fault without a name is one only where the set-up is contradicted as a whole.
    let unlisted = |c: &Candidate| matches!(c.fault, Fault::Unlisted { .. });
    if unlisted(&best) && now.ratio() <= CONTRADICTS {
        return None;
    }
    let mut ties: Vec<Candidate> = Vec::new();
    // A channel without a signal is seen by itself, which no other fault explains.
    let dead = matches!(best.fault, Fault::Dead { .. });
    for c in second.iter().skip(1) {
        let near = c.score < best.score + TIE && !generalises(c, &best);
        let rival = || {
            let left = bench.score(&without(state, &c.fault), 1.0);
            rivals(c, &best) && left.is_some_and(|left| left.ratio() <= CONTRADICTS)
        };
        if dead || !(near || rival()) {
            continue;
        }
        let mut before = std::iter::once(&mut best).chain(&mut ties);
        match before.find(|other| alike(state, &other.fault, &c.fault)) {
            Some(other) => other.same.push(c.fault.clone()),
            // What has no name imitates what has one.
            None if unlisted(c) && !unlisted(&second[0]) => {}
            None => ties.push(c.clone()),
        }
    }
    ties.insert(0, best);
    Some((ties, after))
}

/// The rows anew, with the readings of these channels exchanged.
pub(super) type Anew<'a> = &'a dyn Fn(&[[usize; 2]], &State) -> Option<(State, Bench)>;

/// A set-up with the faults that were found mended.
struct Mended {
    bench: Bench,
    state: State,
    quiet: Vec<usize>,
}

/// The set-up as it was found, and the way to mend it.
struct Given<'a> {
    bench: &'a Bench,
    state: &'a State,
    quiet: &'a [usize],
    rows: Anew<'a>,
}

impl Given<'_> {
    /// The set-up without these faults.
    fn without(&self, faults: &[Fault]) -> Option<Mended> {
        let mut quiet = self.quiet.to_vec();
        let mut exchanged = Vec::new();
        for fault in faults {
            if let Fault::Swapped { channels } = fault {
                for channel in &mut quiet {
                    if let Some(at) = channels.iter().position(|c| c == channel) {
                        *channel = channels[1 - at];
                    }
                }
                exchanged.push(*channels);
            }
        }
        let (mut state, bench) = if exchanged.is_empty() {
            (self.state.clone(), self.bench.clone())
        } else {
            // The other channel was part of the motion, or not.
            (self.rows)(&exchanged, self.state)?
        };
        let others = |f: &&Fault| !matches!(f, Fault::Swapped { .. });
        faults
            .iter()
            .filter(others)
            .for_each(|f| f.repair(&mut state));
        Some(Mended {
            bench,
            state,
            quiet,
        })
    }

    /// An accelerometer of the interface that is exchanged with one of the structure, where that leaves no
    /// contradiction: a channel that is none of the interface's takes part in the motions, so that
    /// each exchange needs rows of its own.
    fn exchange(&self) -> Option<(Vec<Candidate>, Score)> {
        let sensors = &self.state.sensors;
        let of = |kind: Kind| -> Vec<usize> {
            let live = self.state.live().into_iter();
            live.filter(|&i| sensors[i].kind == kind).collect()
        };
        let mut all = Vec::new();
        for &a in &of(Kind::Interface) {
            for &b in &of(Kind::Structure) {
                let fault = Fault::Swapped { channels: [a, b] };
                let Some(mended) = self.without(std::slice::from_ref(&fault)) else {
                    continue;
                };
                let Some(left) = mended.bench.score(&mended.state, 1.0) else {
                    continue;
                };
                if left.ratio() <= CONTRADICTS {
                    all.push(Candidate {
                        fault,
                        score: left.chi2,
                        left,
                        free: 0,
                        doubt: 0.0,
                        same: Vec::new(),
                    });
                }
            }
        }
        all.sort_by(|a, b| a.score.total_cmp(&b.score));
        let least = all.first()?.score;
        all.retain(|c| c.score < least + TIE);
        let left = all[0].left.clone();
        Some((all, left))
    }

    /// The pair of faults that leaves least, where it leaves no contradiction and less than `single`: what
    /// is named first may be none of two.
    fn pair(&self, single_left: &Score) -> Option<([Vec<Candidate>; 2], Score)> {
        let (_, all) = first(self.bench, self.state, self.quiet)?;
        let [count, each] = FIRST;
        let mut chosen: Vec<&Candidate> = Vec::new();
        for c in all
            .iter()
            .filter(|c| !matches!(c.fault, Fault::Unlisted { .. }))
        {
            let channels = c.fault.channels();
            let about = |other: &&&Candidate| other.fault.channels() == channels;
            if chosen.len() < count && chosen.iter().filter(about).count() < each {
                chosen.push(c);
            }
        }
        let mut best: Option<([Vec<Candidate>; 2], Score, f64)> = None;
        for first in chosen {
            let Some(mended) = self.without(std::slice::from_ref(&first.fault)) else {
                continue;
            };
            let Some((second, after)) = single(&mended.bench, &mended.state, &mended.quiet) else {
                continue;
            };
            let unlisted = matches!(second[0].fault, Fault::Unlisted { .. });
            if unlisted || overlap(&first.fault, &second[0].fault) || after.ratio() > CONTRADICTS {
                continue;
            }
            // What both are charged for, with what they leave.
            let score = second[0].score + first.score - first.left.chi2;
            if after.chi2 + TIE < single_left.chi2
                && best.as_ref().is_none_or(|(.., least)| score < *least)
            {
                best = Some(([vec![first.clone()], second], after, score));
            }
        }
        best.map(|(pair, after, _)| (pair, after))
    }
}

/// `true` if two faults are about one channel; those of all sensors of a kind leave room for others.
fn overlap(a: &Fault, b: &Fault) -> bool {
    let both = a.channels();
    !a.is_whole() && !b.is_whole() && b.channels().iter().any(|c| both.contains(c))
}

/// Names faults one after the other, as long as each explains what the others do not; with the last
/// one mended, each is looked for once more. `rows` gives the rows anew for channels that were exchanged, and so many faults
/// were found `before`.
pub(super) fn search(
    bench: &Bench,
    state: &State,
    quiet: &[usize],
    rows: Anew<'_>,
    before: usize,
) -> Option<Found> {
    let score = bench.score(state, 1.0)?;
    let mut found = Found {
        named: Vec::new(),
        before: score.clone(),
        after: score,
        sensors: Vec::new(),
        untold: Untold::default(),
    };
    let given = Given {
        bench,
        state,
        quiet,
        rows,
    };
    let mut faults: Vec<Fault> = Vec::new();
    let mut mended = given.without(&faults)?;
    let most = MOST.saturating_sub(before);
    for _ in 0..most {
        let Some((candidates, after)) = single(&mended.bench, &mended.state, &mended.quiet) else {
            break;
        };
        let best = candidates[0].fault.clone();
        if faults.iter().any(|f| overlap(f, &best)) {
            break;
        }
        faults.push(best);
        let Some(next) = given.without(&faults) else {
            faults.pop();
            break;
        };
        found.named.push(candidates);
        (found.after, mended) = (after, next);
    }
    let unlisted = |f: &Fault| matches!(f, Fault::Unlisted { .. });
    let unexplained = |after: &Score, faults: &[Fault]| {
        after.ratio() > CONTRADICTS || faults.iter().any(unlisted)
    };
    if unexplained(&found.after, &faults)
        && let Some((exchanged, after)) = given.exchange()
    {
        faults = vec![exchanged[0].fault.clone()];
        mended = given.without(&faults)?;
        (found.named, found.after) = (vec![exchanged], after);
    }
    if most > 1
        && unexplained(&found.after, &faults)
        && let Some((pair, after)) = given.pair(&found.after)
    {
        let of = |c: &Vec<Candidate>| c[0].fault.clone();
        faults = pair.iter().map(of).collect();
        mended = given.without(&faults)?;
        (found.named, found.after) = (pair.into(), after);
    }
    for i in 0..faults.len() {
        if faults.len() < 2 {
            break;
        }
        // The first fault was named while the second one was still there.
        let mut others = faults.clone();
        others.remove(i);
        let Some(other) = given.without(&others) else {
            continue;
        };
        let Some((candidates, after)) = single(&other.bench, &other.state, &other.quiet) else {
            continue;
        };
        let mut all = faults.clone();
        all[i] = candidates[0].fault.clone();
        if after.chi2 > found.after.chi2 + TIE {
            continue;
        }
        let Some(next) = given.without(&all) else {
            continue;
        };
        found.named[i] = candidates;
        (found.after, faults, mended) = (after, all, next);
    }
    let square = found.after.ratio().clamp(TOLERANCES[0], TOLERANCES[1]);
    found.untold = Untold::of(&mended.bench, &mended.state, square.sqrt()).unwrap_or_default();
    found.sensors = mended.state.sensors;
    Some(found)
}
