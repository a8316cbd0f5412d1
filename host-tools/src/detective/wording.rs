//! Faults in words, and as lines of the set-up.

use nalgebra::{Matrix3, Vector3};

use super::evidence::Evidence;
use super::hypothesis::{Fault, Mistake};
use super::sensor::Sensor;
use super::untold::Untold;
use crate::format::plain;
use crate::setup::{Measured, Setup, Units};

/// Section, name and keys of a channel.
struct Entry<'s> {
    section: &'static str,
    channel: &'s str,
    measured: Measured,
    units: &'s Units,
    /// SI per recorded unit.
    total: f64,
    /// The key `scale`.
    scale: f64,
    delay: f64,
}

fn entry(setup: &Setup, channel: usize) -> Option<Entry<'_>> {
    if let Some(a) = setup.accelerometers.get(channel) {
        return Some(Entry {
            section: "accelerometer",
            channel: &a.channel,
            measured: Measured::Acceleration,
            units: &a.units,
            total: a.scale,
            scale: a.key_scale(),
            delay: a.delay,
        });
    }
    let cell = setup.load_cells.get(channel - setup.accelerometers.len())?;
    Some(Entry {
        section: "load_cell",
        channel: &cell.channel,
        measured: cell.quantity.into(),
        units: &cell.units,
        total: cell.scale,
        scale: cell.key_scale(),
        delay: cell.delay,
    })
}

fn name(setup: &Setup, channel: usize) -> String {
    entry(setup, channel).map_or_else(String::new, |e| format!("`{}`", e.channel))
}

fn names(setup: &Setup, channels: &[usize]) -> String {
    let all: Vec<String> = channels.iter().map(|&c| name(setup, c)).collect();
    all.join(", ")
}

fn vector(v: &Vector3<f64>) -> String {
    let all: Vec<String> = v
        .iter()
        .map(|x| plain(if x.abs() < 1e-9 { 0.0 } else { *x }, 6))
        .collect();
    format!("[{}]", all.join(", "))
}

/// A position as the value of a key: a set-up may state another unit of length than m.
pub(super) fn metres(position: &Vector3<f64>) -> String {
    format!("{}  # m", vector(position))
}

/// The axis of a rotation, as an axis of coordinates where it is one.
fn axis(rotation: &Matrix3<f64>) -> String {
    let skew = rotation - rotation.transpose();
    let mut axis = Vector3::new(skew.m32, skew.m13, skew.m21);
    if axis.norm() < 1e-6 {
        // By half a turn: the columns of R + 1 are along the axis.
        let twice = rotation + Matrix3::identity();
        let columns = twice.column_iter().map(|column| column.into_owned());
        axis = columns.fold(axis, |a, b| if b.norm() > a.norm() { b } else { a });
    }
    let axis = axis / axis.amax().max(f64::MIN_POSITIVE);
    let near = |a: Vector3<f64>| (axis - a).norm() < 0.03;
    for (name, along) in ["x", "y", "z"]
        .into_iter()
        .zip(Matrix3::identity().column_iter())
    {
        if near(along.into_owned()) {
            return name.to_owned();
        }
        if near(-along) {
            return format!("-{name}");
        }
    }
    vector(&axis.map(|x| (100.0 * x).round() / 100.0))
}

/// A fault in words.
pub(super) fn text(setup: &Setup, fault: &Fault) -> String {
    let name = |channel: &usize| name(setup, *channel);
    let names = |channels: &[usize]| names(setup, channels);
    let percent = |x: f64| plain(100.0 * x, 2);
    match fault {
        Fault::Inverted { channel } => format!("{} has the other sign", name(channel)),
        Fault::Factor { channel, factor } => {
            let unit =
                entry(setup, *channel).and_then(|e| e.units.plainest(e.measured, e.total / factor));
            format!(
                "{} reads {} times too {}{}",
                name(channel),
                plain(factor.max(1.0 / factor), 6),
                if *factor > 1.0 { "much" } else { "little" },
                unit.map_or_else(String::new, |unit| format!(": it is in {unit}"))
            )
        }
        Fault::Swapped { channels: [a, b] } => {
            format!("{} and {} are exchanged", name(a), name(b))
        }
        Fault::PlacesExchanged { places: [a, b] } => {
            format!("the places of {} and {} are exchanged", names(a), names(b))
        }
        Fault::Turned { place, rotation } => {
            let angle = ((rotation.trace() - 1.0) / 2.0).clamp(-1.0, 1.0).acos();
            format!(
                "{} is mounted turned by {}° about {}",
                names(place),
                plain(angle.to_degrees(), 3),
                axis(rotation)
            )
        }
        Fault::Position {
            place,
            position,
            mistake,
        } => {
            let what = match mistake {
                Mistake::Millimetres => "in millimetres",
                Mistake::Inches => "in inches",
                Mistake::Sign => "wrong in a sign",
                Mistake::Exchanged => "wrong in the order of its coordinates",
                Mistake::Offset => "wrong",
            };
            format!(
                "the position of {} is {what}: {} m",
                names(place),
                vector(position)
            )
        }
        Fault::Gain { channel, factor } => format!(
            "{} reads {} % too {}",
            name(channel),
            percent((factor - 1.0).abs()),
            if *factor > 1.0 { "much" } else { "little" }
        ),
        Fault::CrossTalk {
            channel,
            from,
            share,
        } => format!(
            "{} carries {} % of {}",
            name(channel),
            percent(*share),
            name(from)
        ),
        Fault::Dead { channel } => format!("{} has no signal", name(channel)),
        Fault::Delayed { channels, samples } => format!(
            "{}: {} samples {}",
            names(channels),
            plain(samples.abs(), 2),
            if *samples > 0.0 { "late" } else { "early" }
        ),
        Fault::Reversed { .. } => "all load cells, or all accelerometers, have the other sign: the body would have a negative mass. Turn the load cells if they measure the force that the structure exerts on the table".to_owned(),
        Fault::Unit { channels, factor } => {
            let few = channels.len() < setup.accelerometers.len();
            let by_structure = few && channels.iter().all(|&c| c < setup.accelerometers.len());
            let witness = if by_structure { "" } else { ", by the weighed mass" };
            format!("{}{witness}", unit(setup, channels, *factor))
        }
        Fault::Datum { channels, shift } => {
            let motion = channels.iter().all(|&c| c < setup.accelerometers.len());
            let (these, others) = match motion {
                true => ("accelerometers on the interface", "all other sensors"),
                false => ("load cells", "the accelerometers"),
            };
            format!(
                "all {these} lie elsewhere, beside {others}, by {} m: their positions were measured from another point",
                vector(&shift.map(|x| (1e4 * x).round() / 1e4))
            )
        }
        Fault::Unlisted { channel } => format!(
            "{} contradicts all others, in a way that is none of the usual mistakes",
            name(channel)
        ),
    }
}

/// Another unit of all these channels, in words.
fn unit(setup: &Setup, channels: &[usize], factor: f64) -> String {
    let motion = channels.iter().all(|&c| c < setup.accelerometers.len());
    let (these, others) = match motion {
        true if channels.len() < setup.accelerometers.len() => {
            ("accelerometers on the interface", "those on the structure")
        }
        true => ("accelerometers", "all load cells"),
        false => ("load cells", "all accelerometers"),
    };
    let factor_in = |c: &usize| {
        let entry = entry(setup, *c)?;
        entry.units.plainest(entry.measured, entry.total / factor)
    };
    let units: Vec<Option<&str>> = channels.iter().map(factor_in).collect();
    match units.first() {
        Some(Some(unit)) if units.iter().all(|u| *u == Some(unit)) => {
            format!("all {these} are in {unit}")
        }
        _ => {
            let [much, little] = match factor > 1.0 {
                true => ["much", "little"],
                false => ["little", "much"],
            };
            format!(
                "all {these} read {} times too {much}, or {others} too {little}",
                plain(factor.max(1.0 / factor), 6)
            )
        }
    }
}

/// A fault of one run in words: the other runs tell it.
pub(super) fn of_run(setup: &Setup, fault: &Fault) -> String {
    match fault {
        Fault::Reversed { .. } => {
            "all load cells, or all accelerometers, have the other sign".to_owned()
        }
        Fault::Unit { channels, factor } => unit(setup, channels, *factor),
        other => text(setup, other),
    }
}

/// A fault in words with its other names.
pub(super) fn texts(setup: &Setup, fault: &Fault, same: &[Fault]) -> String {
    let mut words = text(setup, fault);
    let others: Vec<String> = same.iter().map(|other| text(setup, other)).collect();
    if !others.is_empty() {
        words.push_str(&format!(" (the same as: {})", others.join("; ")));
    }
    words
}

/// Faults that the runs would not show, a sentence a kind.
pub(super) fn untold(setup: &Setup, untold: &Untold) -> Vec<String> {
    let mut all = Vec::new();
    if !untold.signs.is_empty() {
        all.push(format!("the sign of {}", names(setup, &untold.signs)));
    }
    if !untold.gains.is_empty() {
        all.push(format!("the gain of {}", names(setup, &untold.gains)));
    }
    // Channels of which none is told from any other are said once.
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for &[a, b] in &untold.pairs {
        let joins = |group: &&mut Vec<usize>| {
            let with = |c: usize| {
                let told = |&other: &usize| {
                    other == c
                        || untold.pairs.contains(&[other, c])
                        || untold.pairs.contains(&[c, other])
                };
                group.iter().all(told)
            };
            with(a) && with(b)
        };
        match groups.iter_mut().find(joins) {
            Some(group) => {
                for c in [a, b] {
                    if !group.contains(&c) {
                        group.push(c);
                    }
                }
            }
            None => groups.push(vec![a, b]),
        }
    }
    for group in groups {
        all.push(format!("which is which of {}", names(setup, &group)));
    }
    for place in &untold.places {
        all.push(format!("the position of {}", names(setup, place)));
    }
    all
}

/// Lines by which a channel's readings count so many times as much: its unit, where it is one, else
/// its scale.
pub(super) fn scaled(
    setup: &Setup,
    evidence: &Evidence,
    channel: usize,
    factor: f64,
) -> Vec<String> {
    let Some(entry) = entry(setup, channel) else {
        return Vec::new();
    };
    let scale = plain(entry.scale * factor, 7);
    let total = entry.total * factor;
    let head = [
        format!("[[{}]]", entry.section),
        format!("channel = \"{}\"", entry.channel),
    ];
    let Some(unit) = entry.units.plainest(entry.measured, total) else {
        return [head.to_vec(), vec![format!("scale = {scale}")]].concat();
    };
    let here = &evidence.sensors[channel];
    let shares = |(i, s): (usize, &Sensor)| {
        i != channel && s.kind == here.kind && (s.position - here.position).norm() < 1e-6
    };
    // A triaxial entry has one unit for all axes.
    let note = match evidence.sensors.iter().enumerate().any(shares) {
        true => format!("  # of one axis of a triaxial sensor: scale = {scale}"),
        false => String::new(),
    };
    let mut lines = [head.to_vec(), vec![format!("unit = \"{unit}\"{note}")]].concat();
    let sign = if total < 0.0 { -1.0 } else { 1.0 };
    if sign != entry.scale {
        lines.push(format!("scale = {sign}"));
    }
    lines
}

/// Lines of the set-up that mend a fault; comments say what stands there now.
pub(super) fn repair(setup: &Setup, evidence: &Evidence, fault: &Fault) -> Vec<String> {
    match fault {
        Fault::Factor { channel, factor } | Fault::Gain { channel, factor } => {
            return scaled(setup, evidence, *channel, 1.0 / factor);
        }
        Fault::Unit { channels, factor } => {
            let lines = |&c: &usize| scaled(setup, evidence, c, 1.0 / factor);
            return channels.iter().flat_map(lines).collect();
        }
        _ => {}
    }
    let mut lines = Vec::new();
    let mut add = |channel: usize, key: &str, value: String| {
        if let Some(entry) = entry(setup, channel) {
            lines.push(format!("[[{}]]", entry.section));
            lines.push(format!("channel = \"{}\"", entry.channel));
            lines.push(format!("{key} = {value}"));
        }
    };
    let scale = |channel: usize, factor: f64| {
        entry(setup, channel)
            .map(|e| plain(e.scale * factor, 7))
            .unwrap_or_default()
    };
    match fault {
        Fault::Inverted { channel } => add(*channel, "scale", scale(*channel, -1.0)),
        Fault::Reversed { channels } => {
            for &channel in channels {
                add(channel, "scale", scale(channel, -1.0));
            }
        }
        Fault::Turned { place, rotation } => {
            for &channel in place {
                let direction = rotation * evidence.sensors[channel].direction;
                add(channel, "direction", vector(&direction));
            }
        }
        Fault::Position {
            place, position, ..
        } => {
            for &channel in place {
                add(channel, "position", metres(position));
            }
        }
        Fault::Datum { channels, shift } => {
            for &channel in channels {
                let position = evidence.sensors[channel].position + shift;
                add(channel, "position", metres(&position));
            }
        }
        Fault::PlacesExchanged { places: [a, b] } => {
            for (here, there) in [(a, b), (b, a)] {
                let position = evidence.sensors[there[0]].position;
                for &channel in here {
                    add(channel, "position", metres(&position));
                }
            }
        }
        Fault::Swapped { channels: [a, b] } => {
            for (here, there) in [(*a, *b), (*b, *a)] {
                if let (Some(here), Some(there)) = (entry(setup, here), entry(setup, there)) {
                    lines.push(format!(
                        "channel = \"{}\"   # in the [[{}]] that has \"{}\" now",
                        there.channel, here.section, here.channel
                    ));
                }
            }
        }
        Fault::Delayed { channels, samples } => {
            for &channel in channels {
                let delay = entry(setup, channel).map_or(0.0, |e| e.delay) + samples;
                add(channel, "delay", plain(delay, 6));
            }
        }
        Fault::Factor { .. }
        | Fault::Gain { .. }
        | Fault::Unit { .. }
        | Fault::CrossTalk { .. }
        | Fault::Dead { .. }
        | Fault::Unlisted { .. } => {}
    }
    lines
}
