//! Rows to a recording that `identify` reads.

use super::file::Growing;
use super::follow::{Course, Taker, follow, sample_rate};
use super::{AcquireError, Intake, Level};
use crate::device::{Client, Port};
use crate::inputs::{InputEntry, day, to_toml};
use crate::limits;
use crate::output::part_of;
use crate::recording::{About, Firmware, Preamble, Traceability, TrueRate};
use crate::sample_rate::SampleRate;
use massline_firmware::wire::{Event, Fault, Health};
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Name of the clock that the true rate is measured against.
const CLOCK: &str = "host";

/// A recording that is to be made.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// The inputs, each with the name of its column.
    pub inputs: Vec<InputEntry>,
    /// For how long, s; `None`: until it is stopped.
    pub seconds: Option<f64>,
    /// The file to write, `.csv`, `.csv.gz` or `.parquet`.
    pub file: PathBuf,
    /// The box, for the facts that a Parquet file states.
    pub firmware: Option<Firmware>,
    /// `true` if a file of that name may be replaced.
    pub replace: bool,
}

/// Progress of a recording.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// Seconds recorded.
    pub seconds: f64,
    /// Share of what is to be recorded, if that is known.
    pub share: Option<f64>,
    /// Faulty rows so far.
    pub faulty: u64,
    /// Levels since the last time.
    pub levels: &'a [Level],
    /// Faults of the box so far.
    pub box_faults: &'a [Fault],
}

/// Why a recording ended.
#[derive(Debug)]
pub enum Ending {
    /// It has all its samples.
    Complete,
    /// It was stopped.
    Stopped,
    /// Something went wrong; what came before is recorded.
    Failed(AcquireError),
}

/// A recording that was made.
#[derive(Debug)]
pub struct Recorded {
    /// The file.
    pub file: PathBuf,
    /// Names of its channels.
    pub channels: Vec<String>,
    /// Rows.
    pub samples: u64,
    /// By the rate that the converters are set to, s.
    pub seconds: f64,
    /// Rows in which a channel has a fault.
    pub faulty: u64,
    /// Rows that never came, among them.
    pub missing: u64,
    /// Rows with each fault, by the bits of [`Health`].
    pub by_fault: [u64; Health::KINDS],
    /// Rows with a fault, channel by channel, and all faults there were.
    pub by_channel: Vec<(u64, Health)>,
    /// The rate that the converters are set to, Hz.
    pub nominal: f64,
    /// The true one; `None` if it was too short to tell.
    pub sample_rate: Option<TrueRate>,
    /// Faults of the box itself, at most [`limits::LISTED_FAULTS`].
    pub box_faults: Vec<Fault>,
    /// Further ones.
    pub more_box_faults: u64,
    /// Frames of the box that were lost meanwhile.
    pub lost: u64,
    /// Why it ended.
    pub ending: Ending,
    /// New path of the rows of an earlier recording that a killed program had left in the way.
    pub set_aside: Option<PathBuf>,
    /// A file of the same rows that could not be removed.
    pub left_over: Option<PathBuf>,
}

struct Recorder {
    intake: Intake,
    growing: Growing,
    clock: SampleRate,
    limit: Option<u64>,
    rate: f64,
    levels: Vec<Level>,
    rows: u64,
    faulty: u64,
    missing: u64,
    by_fault: [u64; Health::KINDS],
    by_channel: Vec<(u64, Health)>,
    box_faults: Vec<Fault>,
    more_box_faults: u64,
}

impl Taker for Recorder {
    fn take(&mut self, event: &Event<'_>, seconds: f64) -> Result<bool, AcquireError> {
        let Self {
            intake,
            growing,
            clock,
            limit,
            levels,
            rows,
            faulty,
            missing,
            by_fault,
            by_channel,
            ..
        } = self;
        let mut written = Ok(());
        let last = intake.take(event, &mut |row| {
            if written.is_err() || limit.is_some_and(|limit| *rows >= limit) {
                return;
            }
            let all = row.all();
            written = growing.row(row.si, all, || clock.estimate(CLOCK));
            if written.is_err() {
                return;
            }
            *rows += 1;
            Level::add(levels, row);
            if all.is_good() {
                return;
            }
            *faulty += 1;
            *missing += u64::from(row.health.iter().all(|h| h.contains(Health::MISSING)));
            for (kind, rows) in by_fault.iter_mut().enumerate() {
                *rows += u64::from(all.contains(Health(1 << kind)));
            }
            for ((rows, faults), health) in by_channel.iter_mut().zip(row.health) {
                *rows += u64::from(!health.is_good());
                *faults = faults.union(*health);
            }
        })?;
        written?;
        if let Some(last) = last {
            self.clock.arrival(last, seconds);
        }
        Ok(last.is_some())
    }

    fn fault(&mut self, fault: &Fault) {
        if self.box_faults.len() < limits::LISTED_FAULTS {
            self.box_faults.push(*fault);
        } else {
            self.more_box_faults += 1;
        }
    }

    fn is_done(&self) -> bool {
        self.limit.is_some_and(|limit| self.rows >= limit)
    }
}

/// Records the box's inputs. `watch` is told how far it is some times a second, and ends the
/// recording by `false`. The rows that it is told of are with the system by then: should this
/// program be killed, they are in the file beside the recording's place whose name ends in
/// `.part`.
///
/// # Errors
/// [`AcquireError`] if there is no recording. One that ended before its time is one: see
/// [`Recorded::ending`].
pub fn record<P: Port>(
    client: &mut Client<'_, P>,
    order: &Order,
    watch: &mut dyn FnMut(&Progress<'_>) -> bool,
) -> Result<Recorded, AcquireError> {
    if !order.replace && order.file.exists() {
        return Err(AcquireError::Present {
            file: order.file.clone(),
        });
    }
    let rate = sample_rate(client)?;
    let channels: Vec<String> = order.inputs.iter().map(InputEntry::column).collect();
    let known = order.inputs.iter().map(traceability);
    let mut preamble = Preamble {
        sample_rate: None,
        channel: channels.iter().cloned().zip(known).collect(),
    };
    let mut about = About {
        nominal_sample_rate: Some(rate),
        firmware: order.firmware.clone(),
        setup: to_toml(&order.inputs),
        ..About::of_names(channels.iter().map(String::as_str))
    };
    about.state(&preamble);
    let recorder = Recorder {
        intake: Intake::new(&order.inputs, rate),
        growing: Growing::create(&order.file, &about, rate, order.replace)?,
        clock: SampleRate::default(),
        limit: order.seconds.map(|s| ((s * rate).round() as u64).max(1)),
        rate,
        levels: Level::of(&order.inputs),
        rows: 0,
        faulty: 0,
        missing: 0,
        by_fault: [0; Health::KINDS],
        by_channel: vec![(0, Health::GOOD); channels.len()],
        box_faults: Vec::new(),
        more_box_faults: 0,
    };
    let lost = client.link().received.lost;
    let recorder = Rc::new(RefCell::new(recorder));
    let course = Course {
        rate,
        seconds: order.seconds,
    };
    let mut unwritten = None;
    let result = follow(client, course, &recorder, &mut |recorder| {
        if let Err(error) = recorder.growing.flush() {
            unwritten = Some(error);
            return false;
        }
        let more = watch(&Progress {
            seconds: recorder.rows as f64 / recorder.rate,
            share: recorder.limit.map(|l| recorder.rows as f64 / l as f64),
            faulty: recorder.faulty,
            levels: &recorder.levels,
            box_faults: &recorder.box_faults,
        });
        recorder.levels.iter_mut().for_each(Level::restart);
        more
    });
    let mut recorder = recorder.borrow_mut();
    let result = unwritten.map_or(result, Err);
    let ending = match result {
        // All that was wanted is there.
        _ if recorder.is_done() => Ending::Complete,
        result if recorder.rows == 0 => {
            recorder.growing.discard();
            return Err(result.err().unwrap_or(AcquireError::Nothing));
        }
        Ok(()) => Ending::Stopped,
        Err(error) => Ending::Failed(error),
    };
    let sample_rate = recorder.clock.estimate(CLOCK);
    preamble.sample_rate.clone_from(&sample_rate);
    about.state(&preamble);
    let left_over = recorder.growing.finish(&about)?;
    Ok(Recorded {
        file: order.file.clone(),
        channels,
        samples: recorder.rows,
        seconds: recorder.rows as f64 / rate,
        faulty: recorder.faulty,
        missing: recorder.missing,
        by_fault: recorder.by_fault,
        by_channel: std::mem::take(&mut recorder.by_channel),
        box_faults: std::mem::take(&mut recorder.box_faults),
        more_box_faults: recorder.more_box_faults,
        nominal: rate,
        sample_rate,
        lost: client.link().received.lost - lost,
        ending,
        set_aside: recorder.growing.set_aside().map(Path::to_owned),
        left_over,
    })
}

pub(crate) fn traceability(entry: &InputEntry) -> Traceability {
    let input = entry.setting();
    Traceability {
        serial: input.serial.to_owned(),
        certificate: input.certificate.to_owned(),
        calibrated: input.calibrated.map(day),
        // Zero says that nobody has said.
        uncertainty: (input.uncertainty > 0.0).then_some(input.uncertainty),
    }
}

/// The first name `recording-1.csv`, `recording-2.csv` and so on that is free in a folder, and
/// that no unfinished recording waits for.
#[must_use]
pub fn free_name(folder: &Path) -> PathBuf {
    let name = |k: u32| folder.join(format!("recording-{k}.csv"));
    (1..)
        .map(name)
        .find(|file| !file.exists() && !part_of(file).exists())
        .unwrap_or_else(|| name(0))
}
