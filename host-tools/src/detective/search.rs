//! Step 4: the search for the faults that explain the contradiction.

use super::fit::{fitted, polish};
use super::hypothesis::{Fault, Hypothesis, fixed};
use super::mend::{AT_LEAST, GAIN_OF, mended, without};
use super::model::{Bench, Motion, Score};
use super::sensor::{Kind, Sensor};
use super::state::State;
use super::untold::Untold;
use crate::parallel;
use std::convert::Infallible;

/// Range of the tolerance of sensors, as a share of the usual one, squared: good laboratories get
/// sharper limits.
const TOLERANCES: [f64; 2] = [0.1, 1.0];
/// Hypotheses that are looked at again with the tolerance that fits.
const SECOND: usize = 80;
/// Faults that explain this much less than the best are as likely.
pub(super) const TIE: f64 = 9.0;
/// Factor that leaves nothing of a reading.
const SILENCE: f64 = 1e6;
/// Factor of a reading below which its repair may swamp all others.
const MULTIPLIED: f64 = 0.6;
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

/// `true` if a fault has a reading multiplied by so much that what sensors usually differ by covers all others: twice the
/// factor explains as much then. A channel that is truly in another unit fits no other factor.
fn swamps(bench: &Bench, state: &State, hypothesis: &Hypothesis, motion: &[Motion]) -> bool {
    let (Fault::Factor { channel, factor } | Fault::Gain { channel, factor }) = hypothesis.fault
    else {
        return false;
    };
    let left = |factor: f64| {
        let fault = Fault::Gain { channel, factor };
        Some(mended(bench, state, &fault, 1.0, motion)?.chi2)
    };
    factor < MULTIPLIED
        && left(0.5 * factor)
            .zip(left(factor))
            .is_some_and(|(twice, once)| twice < once + TIE)
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
    hypotheses.retain(|h| !swamps(bench, state, h, &motion));
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
    polish(bench, state, tolerance, &mut best.fault);
    if base.chi2 - best.score <= GAIN_OF[0] + GAIN_OF[1] * square {
        return None;
    }
    // Sharp limits rest on how the sensors differ on average: at the usual ones it is to show as well.
    let after = bench.score(&without(state, &best.fault), 1.0)?;
    if now.chi2 - after.chi2 <= AT_LEAST {
        return None;
    }
    // A fault without a name is one only where the set-up is contradicted as a whole.
    let unlisted = |c: &Candidate| !c.fault.is_usual();
    if unlisted(&best) && now.ratio() <= CONTRADICTS {
        return None;
    }
    let mut ties: Vec<Candidate> = Vec::new();
    // A channel without a signal is seen by itself, which no other fault explains.
    let dead = best.fault.is_dead();
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
pub(super) struct Given<'a> {
    pub(super) bench: &'a Bench,
    pub(super) state: &'a State,
    /// Channels without a signal.
    pub(super) quiet: &'a [usize],
    pub(super) rows: Anew<'a>,
    /// Threads for what takes long, as many as there are processors if `None`.
    pub(super) threads: Option<usize>,
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
        let mended: Vec<(&Candidate, Mended)> = (chosen.into_iter())
            .filter_map(|first| Some((first, self.without(std::slice::from_ref(&first.fault))?)))
            .collect();
        let second = |n: usize| {
            let (_, mended) = &mended[n];
            Ok::<_, Infallible>(single(&mended.bench, &mended.state, &mended.quiet))
        };
        let Ok((seconds, _)) = parallel::each(mended.len(), self.threads, &second, &mut |_, _| ());
        for ((first, _), second) in mended.iter().zip(seconds) {
            let Some((second, after)) = second else {
                continue;
            };
            if !second[0].fault.is_usual()
                || overlap(&first.fault, &second[0].fault)
                || after.ratio() > CONTRADICTS
            {
                continue;
            }
            // What both are charged for, with what they leave.
            let score = second[0].score + first.score - first.left.chi2;
            if after.chi2 + TIE < single_left.chi2
                && best.as_ref().is_none_or(|(.., least)| score < *least)
            {
                best = Some(([vec![(*first).clone()], second], after, score));
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
/// one mended, each is looked for once more. So many faults were found `before`. Pairs of faults, which take longest, are not
/// looked for where something else is `known` to explain the data.
pub(super) fn search(given: &Given<'_>, before: usize, known: &dyn Fn() -> bool) -> Option<Found> {
    let score = given.bench.score(given.state, 1.0)?;
    let mut found = Found {
        named: Vec::new(),
        before: score.clone(),
        after: score,
        sensors: Vec::new(),
        untold: Untold::default(),
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
    let unexplained = |after: &Score, faults: &[Fault]| {
        after.ratio() > CONTRADICTS || !faults.iter().all(Fault::is_usual)
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
        && !known()
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
