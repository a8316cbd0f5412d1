//! Step 6: a run that contradicts all others, which agree without it. Between runs cables are patched, amplifiers set and
//! specimens mounted anew, and what went wrong there is a fault of no sensor.

use super::Fault;
use super::evidence::Evidence;
use super::hypothesis::{FACTORS, OF_FORCE, OF_MOTION, cube, places};
use super::model::{Mass, Mounting};
use super::search::{CONTRADICTS, Found, TIE};
use super::sensor::Kind;
use super::state::State;
use super::whole::{Whole, WholeFault};
use super::wording;
use crate::format::plain;
use crate::measure::{Channels, Measurement};
use crate::setup::Setup;
use massline_core::geometry::Placement;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Standard deviation of a mass, as a share of it, above which a run does not tell it.
const UNTOLD: f64 = 0.1;
/// Difference of two masses, as the logarithm of their ratio, up to which they may be the same.
const SAME: f64 = 0.2;
/// Most faults of one run that are said.
const SAID: usize = 3;
/// What to do with a run in which no usual fault is found.
const GENERAL: &str = "compare its cables, units, sensors and mounting with theirs, or leave it out; or a sensor that hardly moves in others is wrong";

/// Runs apart: one, or all of one mounting.
pub(super) struct Apart {
    /// What is to be said of them.
    pub(super) whole: Whole,
    /// The findings of all other runs.
    pub(super) others: Found,
    /// What mends it.
    pub(super) mend: Option<Mend>,
}

/// A change of runs with which they agree with all others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mend {
    /// A usual fault, or another body, so that no sensor of all runs has to be wrong.
    Fault,
    /// Another rotation of the specimen, which may be what a sensor on it seems to have.
    Rotation,
}

/// The runs without which the set-up contradicts nothing; `None` where it is none, or several are.
pub(super) fn apart(
    setup: &Setup,
    measurement: &Measurement,
    channels: &Channels,
) -> Option<Apart> {
    let of = |wanted: &dyn Fn(usize) -> bool| {
        Evidence::of_runs(setup, measurement, channels, wanted).ok()
    };
    let mut sound = groups(setup).into_iter().filter_map(|runs| {
        let others = of(&|other| !runs.contains(&other))?;
        let agree = others.score()?.ratio() <= CONTRADICTS;
        agree.then_some((runs, others))
    });
    let (runs, others) = sound.next()?;
    if sound.next().is_some() {
        return None;
    }
    let own = of(&|other| runs.contains(&other))?;
    let of_others = others.search().ok()?;
    let turned = is_mounting(setup, &runs)
        .then(|| turned(setup, &runs, &others, &own))
        .flatten();
    let mends = match &turned {
        Some(_) => Vec::new(),
        None => mends(&others, &own),
    };
    let (mend, what) = match (&turned, &mends[..]) {
        (Some(rotation), _) => {
            // Zero has no sign.
            let [x, y, z] = rotation.map(|x| plain((10.0 * x).round() / 10.0 + 0.0, 4));
            let words = format!(
                "with `rotation = [{x}, {y}, {z}]` they would agree, too; look how the specimen stood"
            );
            (Some(Mend::Rotation), words)
        }
        (None, []) => (own.search().ok())
            .and_then(|alone| difference(alone.after.mass?, of_others.after.mass?))
            .map_or_else(
                || (None, GENERAL.to_owned()),
                |words| (Some(Mend::Fault), words),
            ),
        (None, all) => {
            let said = all.iter().take(SAID);
            let said: Vec<String> = said.map(|f| wording::of_run(setup, f)).collect();
            let more = match all.len().saturating_sub(SAID) {
                0 => String::new(),
                more => format!(", or one of {more} others"),
            };
            let words = format!("in it {}{more}", said.join(", or "));
            (Some(Mend::Fault), words)
        }
    };
    let names: Vec<String> = (runs.iter())
        .map(|&run| format!("\"{}\"", setup.runs[run].name))
        .collect();
    let verb = match &names[..] {
        [name] => format!("run {name} contradicts"),
        names => format!("runs {} contradict", names.join(", ")),
    };
    let text = format!(
        "{verb} the others, which agree without it within {} times what usual differences explain: {what}",
        plain(of_others.before.ratio().sqrt(), 2)
    );
    Some(Apart {
        whole: Whole::new(WholeFault::RunApart, text),
        others: of_others,
        mend,
    })
}

/// The runs of the mounting that a run is of.
fn mounted_alike(setup: &Setup, run: usize) -> Vec<usize> {
    let pose = |run: usize| (setup.runs[run].rotation, setup.runs[run].translation);
    let all = 0..setup.runs.len();
    all.filter(|&other| pose(other) == pose(run)).collect()
}

/// `true` of all runs of a mounting, where there are others.
fn is_mounting(setup: &Setup, runs: &[usize]) -> bool {
    let mounted = runs.first().map(|&run| mounted_alike(setup, run));
    runs.len() < setup.runs.len() && mounted.is_some_and(|alike| alike == runs)
}

/// Each run, and the runs of each mounting that has several.
fn groups(setup: &Setup) -> Vec<Vec<usize>> {
    let all = 0..setup.runs.len();
    let mut groups: Vec<Vec<usize>> = all.clone().map(|run| vec![run]).collect();
    for run in all {
        let alike = mounted_alike(setup, run);
        if alike[0] == run && (2..setup.runs.len()).contains(&alike.len()) {
            groups.push(alike);
        }
    }
    groups
}

/// The rotation of a mounting with which its runs agree with the others, degrees: its sign is wrong, or it is off by quarters of a
/// turn.
fn turned(setup: &Setup, runs: &[usize], others: &Evidence, own: &Evidence) -> Option<[f64; 3]> {
    let stated = Vector3::from(setup.runs[*runs.first()?].rotation);
    let rotation = own.mountings.first()?.rotation;
    let vector = |m: &Matrix3<f64>| {
        // Of half a turn, too, which the antisymmetric part of a matrix does not tell.
        let turn = Rotation3::from_matrix_unchecked(*m);
        let axis = UnitQuaternion::from_rotation_matrix(&turn).scaled_axis();
        axis.map(f64::to_degrees)
    };
    let opposite = Placement::new(-stated, Vector3::zeros()).ok()?.rotation();
    let quarters = cube().into_iter().map(|turn| turn * rotation);
    let (state, bench) = others.beside(own).state(&own.sensors, &[])?;
    let before = bench.score(&state, 1.0)?;
    let count = own.state(&own.sensors, &[])?.0.mountings.len();
    let first = bench.mountings.len().saturating_sub(count);
    let mut best: Option<(f64, Matrix3<f64>)> = None;
    for rotation in std::iter::once(opposite).chain(quarters) {
        let mut bench = bench.clone();
        for (mounting, own) in bench.mountings[first..].iter_mut().zip(&own.mountings) {
            let way = (rotation, own.translation);
            *mounting = Mounting::new(mounting.motions, way, bench.length);
        }
        let Some(score) = bench.score(&state, 1.0) else {
            continue;
        };
        let agrees = score.ratio() <= CONTRADICTS && score.freedom >= before.freedom;
        // The opposite rotation comes first, and one that is as good is told from it by nothing.
        if agrees
            && best
                .as_ref()
                .is_none_or(|(least, _)| score.chi2 + TIE < *least)
        {
            best = Some((score.chi2, rotation));
        }
    }
    best.map(|(_, rotation)| vector(&rotation).into())
}

/// The changes of one run after which it agrees with the others, the plainest first.
fn mends(others: &Evidence, own: &Evidence) -> Vec<Fault> {
    let count = own
        .state(&own.sensors, &[])
        .map_or(0, |(state, _)| state.mountings.len());
    let Some((state, bench)) = others.beside(own).state(&own.sensors, &[]) else {
        return Vec::new();
    };
    let Some(before) = bench.score(&state, 1.0) else {
        return Vec::new();
    };
    let first = state.mountings.len().saturating_sub(count);
    let mut found: Vec<(f64, Fault)> = changes(own)
        .into_iter()
        .filter_map(|fault| {
            let score = bench.score(&mended(&state, first, &fault), 1.0)?;
            // A change that leaves less to compare explains nothing.
            let agrees = score.ratio() <= CONTRADICTS && score.freedom >= before.freedom;
            agrees.then_some((score.chi2, fault))
        })
        .collect();
    found.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let best = found.first().map_or(0.0, |(chi2, _)| *chi2);
    found.retain(|(chi2, _)| *chi2 < best + TIE);
    found.into_iter().map(|(_, fault)| fault).collect()
}

/// The rows with those from a mounting on as they are without a fault.
fn mended(state: &State, first: usize, fault: &Fault) -> State {
    let mut mended = state.clone();
    let mut own = State {
        sensors: state.sensors.clone(),
        mountings: mended.mountings.split_off(first),
    };
    match fault {
        // Readings were exchanged, and the sensors have stayed where they are.
        Fault::PlacesExchanged { places: [a, b] } => {
            a.iter().zip(b).for_each(|(&a, &b)| own.swap([a, b]));
        }
        _ => fault.repair(&mut own),
    }
    mended.mountings.append(&mut own.mountings);
    mended
}

/// Changes that are made between two runs: cables, amplifiers and units.
fn changes(run: &Evidence) -> Vec<Fault> {
    let sensors = &run.sensors;
    let live = |channel: usize| !run.quiet.contains(&channel);
    let channels = || (0..sensors.len()).filter(|&i| live(i));
    let is_cell = |i: &usize| sensors[*i].kind.is_cell();
    let (cells, motion): (Vec<usize>, Vec<usize>) = (0..sensors.len()).partition(is_cell);
    let mut all: Vec<Fault> = channels()
        .map(|channel| Fault::Inverted { channel })
        .collect();
    for channel in channels() {
        all.extend(FACTORS.map(|factor| Fault::Factor { channel, factor }));
    }
    for (n, &a) in [&cells, &motion].into_iter().flatten().enumerate() {
        let after = [&cells, &motion].into_iter().flatten().skip(n + 1);
        let pairs = after.filter(|b| is_cell(&a) == is_cell(b) && (live(a) || live(**b)));
        all.extend(pairs.map(|&b| Fault::Swapped { channels: [a, b] }));
    }
    let places = places(sensors, &|_| true);
    for (n, a) in places.iter().enumerate() {
        let alike =
            |b: &&Vec<usize>| a.len() > 1 && a.len() == b.len() && is_cell(&a[0]) == is_cell(&b[0]);
        all.extend(places[n + 1..].iter().filter(alike).map(|b| {
            let places = [a.clone(), b.clone()];
            Fault::PlacesExchanged { places }
        }));
    }
    let unit = |channels: &[usize], factor: f64| Fault::Unit {
        channels: channels.to_vec(),
        factor,
    };
    if !cells.is_empty() {
        let interface = |i: &usize| sensors[*i].kind == Kind::Interface;
        let interface: Vec<usize> = motion.iter().copied().filter(interface).collect();
        if interface.len() < motion.len() {
            all.extend(OF_MOTION.map(|factor| unit(&interface, factor)));
        }
        all.extend(OF_MOTION.map(|factor| unit(&motion, factor)));
        all.extend(OF_FORCE.map(|factor| unit(&cells, factor)));
        all.push(Fault::Reversed { channels: cells });
    }
    all
}

/// A body that is not theirs.
fn difference(own: Mass, theirs: Mass) -> Option<String> {
    let told = |mass: &Mass| mass.value > 0.0 && mass.error < UNTOLD * mass.value;
    if !told(&own) || !told(&theirs) {
        return None;
    }
    let other = (own.value / theirs.value).ln().abs() > SAME;
    other.then(|| {
        format!(
            "it says a mass of {} kg, and they say {} kg; compare its units, gains and specimen with theirs, or leave it out",
            plain(own.value, 4),
            plain(theirs.value, 4)
        )
    })
}
