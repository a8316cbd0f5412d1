//! Channels that say nothing: dead, clipped, held, or still because nothing moved their way; and readings that stand alone.
//!
//! # Design
//!
//! A real sensor is never without noise: one that reads exactly the same throughout is
//! dead. A simulated sensor without noise may read exactly zero because the table does
//! not move its way. The two are told apart by witnesses, other sensors of the same kind
//! that look the same way: one that moves is proof of death, one that rests as well is
//! proof of rest. Without any witness the channel counts as dead.
//!
//! A channel that moves in one run and not in another has itself for a witness: if there
//! is a run in which all channels of the setup move, the sensors have noise, and this one
//! lost its plug.

use super::MeasureError;
use super::geometry::{Axis, axes, channel_names};
use crate::format::plain;
use crate::recording::{ChannelHealth, Complaint};
use crate::setup::{Excitation, Run, Setup};
use std::collections::BTreeSet;

/// Share of a channel's power from which one reading is all that it says.
const MOST: f64 = 0.5;

/// State of each run's channels, in the order of [`channel_names`].
pub(super) type Seen<'s> = Vec<(&'s Run, Vec<ChannelHealth>)>;

/// Refuses dead and clipped channels and those with a reading that is most of their power; notes those that rest, and
/// other readings that stand alone.
pub(super) fn check(
    setup: &Setup,
    seen: &Seen<'_>,
    warnings: &mut Vec<String>,
) -> Result<(), MeasureError> {
    for (run, channels) in seen {
        for (channel, health) in channel_names(setup, run).into_iter().zip(channels) {
            readings(setup, run, channel, health, warnings)?;
        }
    }
    let axes = axes(setup);
    for (run, channels) in seen {
        if run.excitation == Excitation::Random {
            warnings.extend(held(setup, &axes, run, channels));
        }
    }
    motion(setup, seen, &axes, warnings)
}

/// Refuses a channel that is clipped, and one with a reading that is most of its power; notes one that stands alone.
fn readings(
    setup: &Setup,
    run: &Run,
    channel: &str,
    health: &ChannelHealth,
    warnings: &mut Vec<String>,
) -> Result<(), MeasureError> {
    if let Some(Complaint::Clipped { limit, samples }) = health.complaint() {
        return Err(MeasureError::Clipped {
            file: setup.recording_path(run),
            channel: channel.to_owned(),
            limit,
            samples,
        });
    }
    if run.excitation == Excitation::Random
        && let Some(outlier) = health.outlier()
    {
        if outlier.share > MOST {
            return Err(MeasureError::Outlier {
                file: setup.recording_path(run),
                channel: channel.to_owned(),
                outlier,
            });
        }
        warnings.push(format!(
            "run \"{}\": sample {} of {channel}, counted from one, reads {}, {} times the channel's RMS: one such reading bends every line of its block. Look at the recording there, and cut it off or record the run again",
            run.name,
            outlier.sample + 1,
            plain(f64::from(outlier.reading), 4),
            plain(outlier.crest, 2)
        ));
    }
    Ok(())
}

/// The note on the sensors of a run that read one and the same for a while, if any. Drives are left out: a generator that
/// pauses is no recorder that stops.
fn held(setup: &Setup, axes: &[Axis<'_>], run: &Run, channels: &[ChannelHealth]) -> Option<String> {
    let is_sensor = |channel: &str| axes.iter().any(|axis| axis.channel == channel);
    let names = channel_names(setup, run).into_iter().zip(channels);
    let held: Vec<_> = names
        .filter(|(channel, _)| is_sensor(channel))
        .filter_map(|(channel, health)| Some((channel, health.held()?)))
        .collect();
    let (_, longest) = held.iter().max_by_key(|(_, held)| held.samples)?;
    let channels: Vec<&str> = held.iter().map(|(channel, _)| *channel).collect();
    Some(format!(
        "run \"{}\": one and the same reading for {} samples from sample {} on, counted from one, in {}: what the sensors read meanwhile is lost. Look at the recording there, and cut it off or record the run again",
        run.name,
        longest.samples,
        longest.sample + 1,
        channels.join(", ")
    ))
}

/// Refuses channels that are dead; notes those that rest, as their witnesses do.
fn motion(
    setup: &Setup,
    seen: &Seen<'_>,
    axes: &[Axis<'_>],
    warnings: &mut Vec<String>,
) -> Result<(), MeasureError> {
    let noisy = seen
        .iter()
        .any(|(_, channels)| channels.iter().all(|health| !dead(health)));
    let mut still = BTreeSet::new();
    for (run, channels) in seen {
        let mut resting = Vec::new();
        for (channel, health) in channel_names(setup, run).into_iter().zip(channels) {
            if !dead(health) {
                continue;
            }
            let anywhere = moves(setup, seen, channel);
            let Some(axis) = axes.iter().find(|axis| axis.channel == channel) else {
                return Err(MeasureError::SilentDrive {
                    file: setup.recording_path(run),
                    channel: channel.to_owned(),
                    reading: health.range[0],
                });
            };
            let excused = if anywhere {
                !noisy
            } else {
                rests(setup, seen, axes, axis)
            };
            if health.range[0] != 0.0 || !excused {
                return Err(MeasureError::Dead {
                    file: setup.recording_path(run),
                    channel: channel.to_owned(),
                    reading: health.range[0],
                });
            }
            if anywhere {
                resting.push(channel);
            } else {
                still.insert(channel);
            }
        }
        if !resting.is_empty() {
            warnings.push(format!(
                "run \"{}\": no reading changes in {}; either nothing moved their way in this run, or a plug came off",
                run.name,
                resting.join(", ")
            ));
        }
    }
    if !still.is_empty() {
        let still: Vec<&str> = still.into_iter().collect();
        warnings.push(format!(
            "no reading changes in {}; either the table never moved their way, or they are dead",
            still.join(", ")
        ));
    }
    Ok(())
}

fn dead(health: &ChannelHealth) -> bool {
    health.complaint() == Some(Complaint::Dead)
}

/// `true` if a channel moves in any run.
fn moves(setup: &Setup, seen: &Seen<'_>, channel: &str) -> bool {
    seen.iter().any(|(run, channels)| {
        let names = channel_names(setup, run);
        let mut of_run = names.iter().zip(channels);
        of_run.any(|(name, health)| *name == channel && health.complaint() != Some(Complaint::Dead))
    })
}

/// `true` if all others that look the same way rest too.
fn rests(setup: &Setup, seen: &Seen<'_>, axes: &[Axis<'_>], axis: &Axis<'_>) -> bool {
    let mut witnesses = axes
        .iter()
        .filter(|other| axis.looks_like(other))
        .peekable();
    witnesses.peek().is_some() && witnesses.all(|other| !moves(setup, seen, other.channel))
}
