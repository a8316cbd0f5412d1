//! Faults in words, and as lines of the set-up.

use nalgebra::Vector3;

use super::evidence::Evidence;
use super::hypothesis::{Fault, Mistake};
use crate::format::plain;
use crate::setup::Setup;

/// Section, name and keys of a channel.
struct Entry<'s> {
    section: &'static str,
    channel: &'s str,
    scale: f64,
    delay: f64,
}

fn entry(setup: &Setup, channel: usize) -> Option<Entry<'_>> {
    if let Some(a) = setup.accelerometers.get(channel) {
        return Some(Entry {
            section: "accelerometer",
            channel: &a.channel,
            scale: a.key_scale(),
            delay: a.delay,
        });
    }
    let cell = setup.load_cells.get(channel - setup.accelerometers.len())?;
    Some(Entry {
        section: "load_cell",
        channel: &cell.channel,
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
fn metres(position: &Vector3<f64>) -> String {
    format!("{}  # m", vector(position))
}

/// A fault in words.
pub(super) fn text(setup: &Setup, fault: &Fault) -> String {
    let name = |channel: &usize| name(setup, *channel);
    let names = |channels: &[usize]| names(setup, channels);
    let percent = |x: f64| plain(100.0 * x, 2);
    match fault {
        Fault::Inverted { channel } => format!("{} has the other sign", name(channel)),
        Fault::Factor { channel, factor } if *factor > 1.0 => {
            format!(
                "{} reads {} times too much",
                name(channel),
                plain(*factor, 6)
            )
        }
        Fault::Factor { channel, factor } => format!(
            "{} reads {} times too little{}",
            name(channel),
            plain(1.0 / factor, 6),
            if (factor * 9.806_65 - 1.0).abs() < 1e-6 && *channel < setup.accelerometers.len() {
                ": it is in g"
            } else {
                ""
            }
        ),
        Fault::Swapped { channels: [a, b] } => {
            format!("{} and {} are exchanged", name(a), name(b))
        }
        Fault::PlacesExchanged { places: [a, b] } => {
            format!("the places of {} and {} are exchanged", names(a), names(b))
        }
        Fault::Turned { place, rotation } => {
            let angle = ((rotation.trace() - 1.0) / 2.0).clamp(-1.0, 1.0).acos();
            format!(
                "{} is mounted turned by {}°",
                names(place),
                plain(angle.to_degrees(), 3)
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
        Fault::Unlisted { channel } => format!(
            "{} contradicts all others, in a way that is none of the usual mistakes",
            name(channel)
        ),
    }
}

/// Lines of the set-up that mend a fault; comments say what stands there now.
pub(super) fn repair(setup: &Setup, evidence: &Evidence, fault: &Fault) -> Vec<String> {
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
        Fault::Factor { channel, factor } | Fault::Gain { channel, factor } => {
            add(*channel, "scale", scale(*channel, 1.0 / factor));
        }
        Fault::Turned { place, rotation } => {
            for &channel in place {
                let direction = rotation * evidence.sensors[channel].direction;
                add(
                    channel,
                    "direction",
                    vector(&evidence.turned_back(channel, direction)),
                );
            }
        }
        Fault::Position {
            place, position, ..
        } => {
            for &channel in place {
                add(
                    channel,
                    "position",
                    metres(&evidence.moved_back(channel, *position)),
                );
            }
        }
        Fault::PlacesExchanged { places: [a, b] } => {
            for (here, there) in [(a, b), (b, a)] {
                let position = evidence.sensors[there[0]].position;
                for &channel in here {
                    add(
                        channel,
                        "position",
                        metres(&evidence.moved_back(channel, position)),
                    );
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
        Fault::CrossTalk { .. } | Fault::Dead { .. } | Fault::Unlisted { .. } => {}
    }
    lines
}
