//! A recording as the rest of the program reads it, whatever its format.

mod good_rows;

use super::around::Row;
use super::coupling::{Corners, Coupling};
use super::delay::Alignment;
use super::input::{self, Passed};
use super::names::{self, Names, some_of};
use super::source::{Block, Channel, Place, Source};
use super::time::{self, Clock, Times};
use super::{Checksum, FORMATS, Form, HEALTH_COLUMN, Preamble, RecordingError};
use crate::format::plain;
use crate::printable::quoted;
use massline_firmware::wire::Health;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Samples that are read from the file at a time.
const BLOCK: usize = 256;

/// Samples of which the time is looked at to learn the sample rate.
const RATE_SAMPLES: usize = 1000;

/// A recording that is being read.
pub struct Recording {
    file: PathBuf,
    source: Box<dyn Source>,
    /// Number of channels asked for.
    channels: usize,
    /// Positions of what is read: the channels asked for, then time once it is checked.
    selected: Vec<usize>,
    ignored: Vec<String>,
    /// Position of the channel of time.
    time: Option<usize>,
    /// Seconds of the unit of time.
    second: f64,
    clock: Option<Clock>,
    form: Form,
    notes: Vec<String>,
    block: Block,
    /// Samples of the block that were handed out.
    taken: usize,
    /// An error that is due when the samples before it have been handed out.
    pending: Option<RecordingError>,
    /// Place and faults of the sample read last.
    place: Place,
    health: Health,
    rows: u64,
    /// Samples after which the recording counts as ended.
    limit: Option<u64>,
    size: u64,
    passed: Passed,
    /// Checksum that the setup states, until it has been compared.
    expected: Option<Checksum>,
    /// Factor of the readings of each channel; one where there is none.
    factors: Vec<f64>,
    /// Channels that come late, if there are any.
    alignment: Option<Alignment>,
    /// Couplings to alternating current that differ, if there are any; filters once the sample rate is settled.
    corners: Option<Corners>,
    coupling: Option<Coupling>,
    /// Readings of the channels asked for in single precision, of samples that are handed out together.
    singles: Vec<f32>,
}

impl Recording {
    /// Opens a recording as [`Recording::open_in`] does, of which the setup states the checksum. Its
    /// length is compared now, its bytes when the last sample is asked for, or when something is
    /// wrong with a sample.
    ///
    /// # Errors
    /// [`RecordingError`]; [`RecordingError::OtherRecording`] before any other.
    pub fn open_as(
        file: &Path,
        channels: &[&str],
        expected: Option<Checksum>,
        form: &Form,
    ) -> Result<Self, RecordingError> {
        let is_other = |expected: &Checksum| {
            let found = std::fs::metadata(file);
            found.is_ok_and(|found| found.is_file() && found.len() != expected.bytes)
        };
        if let Some(other) = expected.filter(is_other) {
            compare(file, other)?;
        }
        let mut recording = Self::open_in(file, channels, form).or_else(|error| {
            expected.map_or(Ok(()), |expected| compare(file, expected))?;
            Err(error)
        })?;
        recording.expected = expected;
        Ok(recording)
    }

    /// Opens a recording, in the format that its content shows, and looks for `channels` in it;
    /// samples are then returned in the order asked for.
    ///
    /// # Errors
    /// [`RecordingError`] if the file cannot be read or lacks one of them.
    pub fn open(file: &Path, channels: &[&str]) -> Result<Self, RecordingError> {
        Self::open_in(file, channels, &Form::default())
    }

    /// The same of a recording whose form is stated, in full or in part.
    ///
    /// # Errors
    /// As [`Recording::open`].
    pub fn open_in(file: &Path, channels: &[&str], form: &Form) -> Result<Self, RecordingError> {
        let (input, size, passed) = input::open(file)?;
        let format = FORMATS.iter().find(|f| (f.recognises)(&input.start));
        let format = format.unwrap_or(&super::csv::FORMAT);
        let source = (format.open)(input, form)?;
        Self::of_source(source, file, channels, form, size, passed)
    }

    fn of_source(
        mut source: Box<dyn Source>,
        file: &Path,
        channels: &[&str],
        form: &Form,
        size: u64,
        passed: Passed,
    ) -> Result<Self, RecordingError> {
        let names = Names::new(source.channels(), source.names_at(), file)?;
        let selected: Vec<usize> = channels
            .iter()
            .map(|channel| names.position(channel, channels))
            .collect::<Result<_, _>>()?;
        let all = || source.channels().iter().map(|c| &c.name).enumerate();
        let asked: HashSet<usize> = selected.iter().copied().collect();
        let time = match form.time.as_deref() {
            Some(name) => names::position(source.channels(), name),
            None => source
                .time()
                .or_else(|| time::find(source.channels(), |i| asked.contains(&i))),
        };
        let time = time.filter(|i| !asked.contains(i));
        let second = time.and_then(|i| source.channels().get(i)).map(time::unit);
        let own =
            |i: usize, name: &str| asked.contains(&i) || time == Some(i) || name == HEALTH_COLUMN;
        let ignored = all().filter(|(i, name)| !own(*i, name));
        let ignored = ignored.map(|(_, name)| name.clone()).collect();
        source.select(&selected);
        Ok(Self {
            file: file.to_owned(),
            source,
            channels: channels.len(),
            selected,
            ignored,
            time,
            second: second.unwrap_or(1.0),
            clock: None,
            form: form.clone(),
            notes: Vec::new(),
            block: Block::default(),
            taken: 0,
            pending: None,
            place: Place::Record(0),
            health: Health::GOOD,
            rows: 0,
            limit: None,
            size,
            passed,
            expected: None,
            factors: Vec::new(),
            alignment: None,
            corners: None,
            coupling: None,
            singles: Vec::new(),
        })
    }

    /// A recording of a source that reads no file.
    #[cfg(test)]
    pub(super) fn from_memory(
        source: Box<dyn Source>,
        file: &Path,
        channels: &[&str],
    ) -> Result<Self, RecordingError> {
        let passed = Passed::new(std::io::empty());
        Self::of_source(source, file, channels, &Form::default(), 0, passed)
    }

    /// Has each channel asked for multiplied by a factor, brought into step where it is late by a number of
    /// samples, and behind one coupling to alternating current with the others where these differ. To be called before
    /// the sample rate is settled.
    pub(crate) fn correct(&mut self, factors: Vec<f64>, delays: &[f64], corners: Option<Corners>) {
        self.factors = factors;
        self.alignment = Alignment::new(delays);
        self.corners = corners;
    }

    /// `false` if the head of the file has no row of numbers below a row of names.
    pub(crate) fn looks_recorded(&self) -> bool {
        self.source.looks_recorded()
    }

    /// Place of the channels' units, for messages about them.
    pub(crate) fn units_at(&self) -> Option<Place> {
        self.source.units_at()
    }

    /// `true` if readings are shares of the full scale of a converter, which is no unit.
    pub(crate) fn is_share_of_full_scale(&self) -> bool {
        self.source.is_share_of_full_scale()
    }

    /// The error of a channel whose unit cannot be used, for this reason.
    pub(crate) fn unit_error(&self, channel: &str, reason: String) -> RecordingError {
        RecordingError::Unit {
            file: self.file.clone(),
            place: self.source.units_at(),
            channel: channel.to_owned(),
            reason,
        }
    }

    /// Adds a note to the user on the columns that nothing asked for, before the first sample is
    /// read.
    pub fn notice_columns(&self, warnings: &mut Vec<String>) {
        if !self.ignored.is_empty() {
            let (count, list) = (self.ignored.len(), some_of(self.ignored.iter()));
            let of = if list.ends_with('…') {
                format!(" ({count} of them)")
            } else {
                String::new()
            };
            let file = self.file.display();
            warnings.push(format!("{file}: columns not used: {list}{of}"));
        }
        let note = |note| format!("{}: {note}", self.file.display());
        warnings.extend(self.source.notes().iter().map(note));
    }

    /// Adds a note to the user on the end of the file once the last sample was read, where it may
    /// be cut within its last number. A sample that lacks a number as well is an error when it is
    /// read.
    pub fn notice_end(&self, warnings: &mut Vec<String>) {
        if let Some([begin, end]) = self.alignment.as_ref().map(Alignment::lost) {
            warnings.push(format!(
                "{}: the first {begin} and the last {end} samples are not used, since a channel with a `delay` has no reading there",
                self.file.display()
            ));
        }
        if let Some([begin, end]) = self.coupling.as_ref().map(Coupling::lost) {
            warnings.push(format!(
                "the first {begin} and the last {end} samples of each recording are not used: sensors whose `ac_corner` differ are brought behind the same coupling, which takes that long"
            ));
        }
        if let Some(note) = self.source.end_note() {
            warnings.push(format!("{}: {note}", self.file.display()));
        }
        warnings.extend(self.notes.iter().cloned());
    }

    /// The form in which the file is read, in words, where it was guessed.
    #[must_use]
    pub fn described(&self) -> Option<String> {
        let form = self.source.described()?;
        let time = self.time.and_then(|time| self.in_file().get(time));
        let time = time.map(|c| match self.second {
            1.0 => format!(", time in s in `{}`", quoted(&c.name)),
            second => format!(", time in units of {second} s in `{}`", quoted(&c.name)),
        });
        Some(format!("{form}{}", time.unwrap_or_default()))
    }

    /// Place of the sample read last; record 0 before the first one.
    #[must_use]
    pub fn place(&self) -> Place {
        self.place
    }

    /// The file that is read.
    #[must_use]
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Number of channels asked for.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// All channels of the file, with their units and directions where it states them.
    #[must_use]
    pub fn in_file(&self) -> &[Channel] {
        self.source.channels()
    }

    /// `true` if the file states its sample rate, by a number or by a channel of time.
    #[must_use]
    pub fn states_rate(&self) -> bool {
        self.time.is_some() || self.source.sample_rate().is_some()
    }

    /// Position in m of the sensor of a channel of the file, where the file states it.
    #[must_use]
    pub fn position(&self, channel: &str) -> Option<[f64; 3]> {
        let position = names::position(self.source.channels(), channel)?;
        self.source.position(position)
    }

    /// Unit of a channel, which may be named with it or without, where the file states it.
    #[must_use]
    pub fn unit(&self, channel: &str) -> Option<&str> {
        let channels = self.source.channels();
        let position = names::position(channels, channel)?;
        channels.get(position)?.unit.as_deref()
    }

    /// Channels that nothing asked for.
    #[must_use]
    pub fn ignored(&self) -> &[String] {
        &self.ignored
    }

    /// True sample rate and calibrations that the recording states.
    #[must_use]
    pub fn preamble(&self) -> &Preamble {
        self.source.preamble()
    }

    /// Faults of the sample read last; good in a recording that states none. The readings of a
    /// faulty sample are not to be used.
    #[must_use]
    pub fn health(&self) -> Health {
        self.health
    }

    /// Samples handed out so far.
    #[must_use]
    pub fn rows(&self) -> u64 {
        let late = self.alignment.as_ref().map_or([0; 2], Alignment::lost);
        let coupled = self.coupling.as_ref().map_or([0; 2], Coupling::lost);
        let lost: usize = late.iter().chain(&coupled).sum();
        self.rows.saturating_sub(lost as u64)
    }

    /// Has the recording end after `rows` samples, if it is not shorter; `None`: not before
    /// its end. To be called before the first sample.
    pub fn limit(&mut self, rows: Option<u64>) {
        self.limit = rows;
    }

    /// Share of what is to be read that was read, 0 to 1.
    #[must_use]
    pub fn progress(&self) -> f64 {
        if let Some(limit) = self.limit.or(self.source.samples()) {
            return self.rows as f64 / limit.max(1) as f64;
        }
        self.passed.checksum().bytes as f64 / self.size.max(1) as f64
    }

    /// Settles the sample rate from the setup's, the file's and the time column's, whichever
    /// is there first. The setup's goes before the true one of the file, so that lines lie
    /// where they were planned; the two must agree to what converters' clocks are off by. From
    /// here on every sample's time is checked against it. To be called before the first sample.
    ///
    /// # Errors
    /// [`RecordingError::NoRate`] if none of them tells, [`RecordingError::WrongRate`] if they
    /// contradict each other.
    pub fn settle_rate(&mut self, stated: Option<f64>) -> Result<f64, RecordingError> {
        let rate = self.settled(stated)?;
        let corners = self.corners.as_ref();
        self.coupling = corners.map(|corners| Coupling::new(corners, rate));
        Ok(rate)
    }

    fn settled(&mut self, stated: Option<f64>) -> Result<f64, RecordingError> {
        let own = self.source.sample_rate();
        let Some(times) = self.first_times()? else {
            let rate = stated.or(own.map(|own| own.value));
            let rate = rate.ok_or_else(|| RecordingError::NoRate {
                file: self.file.clone(),
            })?;
            return match own {
                // Crystals keep to 1e-4; a box without one to a percent.
                Some(own) if !((own.value / rate - 1.0).abs() <= 2e-2 && own.value > 0.0) => {
                    Err(RecordingError::WrongRate {
                        file: self.file.clone(),
                        place: own.place,
                        found: own.value,
                        stated: rate,
                    })
                }
                _ => Ok(rate),
            };
        };
        let known = stated.or(own.map(|own| own.value));
        let rate = match known {
            Some(rate) => rate,
            None => self.rate_of_rounded(&times)?,
        };
        // A thousand rows of times with three decimals tell the rate to about 1e-3.
        let allowed = 2e-3 + times.rate_error(times.steps);
        if (times.rate / rate - 1.0).abs() > allowed {
            return Err(RecordingError::WrongRate {
                file: self.file.clone(),
                place: "its time column",
                found: times.rate,
                stated: rate,
            });
        }
        self.clock = Some(times.clock(rate));
        self.selected.truncate(self.channels);
        self.selected.extend(self.time);
        self.source.select(&self.selected);
        Ok(rate)
    }

    /// Times of the first samples, read from a second opening.
    fn first_times(&self) -> Result<Option<Times>, RecordingError> {
        let Some(mut probe) = self.times()? else {
            return Ok(None);
        };
        let mut times = Vec::with_capacity(RATE_SAMPLES + 1);
        let mut found = 0.0;
        let mut descent = None;
        while times.len() <= RATE_SAMPLES && probe.next_row_f64(|_, time| found = time)? {
            if let Some(&before) = times.last()
                && found <= before
            {
                descent.get_or_insert((probe.place, before, found));
            }
            times.push(found);
        }
        let (Some(&first), Some(&last)) = (times.first(), times.last()) else {
            return Ok(None);
        };
        if times.len() == 1 {
            return Ok(None);
        }
        let file = self.file.clone();
        let error = match descent {
            Some((place, before, found)) => RecordingError::TimeDescends {
                file,
                place,
                before: self.second * before,
                found: self.second * found,
            },
            None => RecordingError::TimeJump {
                file,
                place: probe.place,
                found: self.second * last,
                expected: self.second * first,
            },
        };
        Times::new(times, self.second).map(Some).ok_or(error)
    }

    /// A second opening that reads the channel of time alone.
    fn times(&self) -> Result<Option<Self>, RecordingError> {
        if let (Some(name), None) = (self.form.time.as_deref(), self.time)
            && !name.is_empty()
        {
            let names = Names::new(self.source.channels(), self.source.names_at(), &self.file)?;
            names.position(name, &[])?;
        }
        let channel = self.time.and_then(|time| self.source.channels().get(time));
        let open = |channel: &Channel| Self::open_in(&self.file, &[&channel.name], &self.form);
        channel.map(open).transpose()
    }

    /// The rate that the times tell: that of the first ones, or where these are rounded the mean
    /// over the whole file, with a note.
    fn rate_of_rounded(&mut self, times: &Times) -> Result<f64, RecordingError> {
        if times.rate_error(times.steps) <= 1e-5 {
            return Ok(times.rate);
        }
        let Some(mut all) = self.times()? else {
            return Ok(times.rate);
        };
        let mut last = 0.0;
        while all.next_row_f64(|_, time| last = time)? {}
        let steps = all.rows().saturating_sub(1) as f64;
        let rate = steps / (self.second * last - times.first);
        if !(rate.is_finite() && rate > 0.0) {
            return Ok(times.rate);
        }
        self.notes.push(format!(
            "{}: its times are rounded to {} s, so that the sample rate, {} Hz, is the mean over the file and known to {} %; write the true `sample_rate` into [processing] if you know it",
            self.file.display(),
            times.rounding,
            plain(rate, 6),
            plain(100.0 * times.rate_error(steps), 2)
        ));
        Ok(rate)
    }

    /// Reads the next sample in the order of the channels asked for. `false` at the end.
    ///
    /// # Errors
    /// [`RecordingError`] that names place and channel.
    pub fn next_row(&mut self, sample: &mut [f32]) -> Result<bool, RecordingError> {
        self.next_row_f64(|i, value| {
            if let Some(slot) = sample.get_mut(i) {
                *slot = value as f32;
            }
        })
    }

    /// The same in double precision: calls `store` with channel and reading.
    ///
    /// # Errors
    /// [`RecordingError`] that names place and channel.
    pub fn next_row_f64(
        &mut self,
        mut store: impl FnMut(usize, f64),
    ) -> Result<bool, RecordingError> {
        let row = self.in_step(&mut store);
        if !matches!(row, Ok(true))
            && let Some(expected) = self.expected.take()
        {
            // All of it has passed by, unless reading stopped early.
            if self.passed.checksum() != expected {
                compare(&self.file, expected)?;
            }
        }
        row
    }

    fn in_step(&mut self, store: &mut impl FnMut(usize, f64)) -> Result<bool, RecordingError> {
        let Some(mut coupling) = self.coupling.take() else {
            return self.in_time(store);
        };
        let found = self.through(
            |recording, mut store| recording.in_time(&mut store),
            |row| coupling.push(row),
        );
        let found = match found {
            Ok(true) => {
                (self.place, self.health) = coupling.sample(store);
                Ok(true)
            }
            Ok(false) if !coupling.is_settled() => Err(RecordingError::NotSettled {
                file: self.file.clone(),
                samples: self.rows,
                needed: coupling.lost().iter().sum(),
            }),
            found => found,
        };
        self.coupling = Some(coupling);
        found
    }

    /// The next sample whose channels are in step.
    fn in_time(&mut self, store: &mut impl FnMut(usize, f64)) -> Result<bool, RecordingError> {
        let Some(mut alignment) = self.alignment.take() else {
            return self.sample(store);
        };
        let found = self.through(
            |recording, mut store| recording.sample(&mut store),
            |row| alignment.push(row),
        );
        if matches!(found, Ok(true)) {
            (self.place, self.health) = alignment.sample(store);
        }
        self.alignment = Some(alignment);
        found
    }

    /// Hands samples to `push` until that is content; `false` at the end.
    fn through(
        &mut self,
        mut next: impl FnMut(&mut Self, &mut dyn FnMut(usize, f64)) -> Result<bool, RecordingError>,
        mut push: impl FnMut(Row) -> bool,
    ) -> Result<bool, RecordingError> {
        loop {
            let mut readings = vec![0.0; self.channels];
            let more = next(self, &mut |i, x| readings[i] = x)?;
            let row = Row {
                readings,
                place: self.place,
                health: self.health,
            };
            if !more || push(row) {
                return Ok(more);
            }
        }
    }

    #[inline]
    fn sample(&mut self, store: &mut impl FnMut(usize, f64)) -> Result<bool, RecordingError> {
        if self.limit.is_some_and(|limit| self.rows >= limit) {
            return Ok(false);
        }
        if self.taken == self.block.len() && !self.refill()? {
            return if self.rows == 0 {
                Err(RecordingError::HeaderOnly {
                    file: self.file.clone(),
                })
            } else {
                Ok(false)
            };
        }
        let Some((readings, place, health)) = self.block.sample(self.taken) else {
            return Ok(false);
        };
        self.taken += 1;
        (self.place, self.health) = (place, health);
        let (readings, time) = readings.split_at(self.channels.min(readings.len()));
        for (i, &reading) in readings.iter().enumerate() {
            if (reading as f32).is_finite() {
                store(i, reading * self.factors.get(i).copied().unwrap_or(1.0));
            } else if health.is_good() {
                return Err(self.not_finite(i, reading, place));
            } else {
                store(i, 0.0);
            }
        }
        if let Some(&time) = time.first() {
            self.check_time(time, place)?;
        }
        self.rows += 1;
        Ok(true)
    }

    /// Reads the next block; `false` at the end.
    fn refill(&mut self) -> Result<bool, RecordingError> {
        if let Some(error) = self.pending.take() {
            return Err(error);
        }
        let left = self.limit.map_or(u64::MAX, |limit| limit - self.rows);
        let most = usize::try_from(left).map_or(BLOCK, |left| left.min(BLOCK));
        self.block.begin(self.selected.len(), most);
        self.taken = 0;
        match self.source.read(&mut self.block) {
            Ok(()) => {}
            Err(error) if self.block.is_empty() => return Err(error),
            Err(error) => self.pending = Some(error),
        }
        Ok(!self.block.is_empty())
    }

    fn not_finite(&self, channel: usize, found: f64, place: Place) -> RecordingError {
        let position = self.selected.get(channel);
        let channel = position.and_then(|&position| self.source.channels().get(position));
        RecordingError::NotFinite {
            file: self.file.clone(),
            place,
            channel: channel.map_or_else(String::new, |c| c.name.clone()),
            found: found.to_string(),
        }
    }

    /// `true` if the next sample may have this time.
    fn is_due(&self, found: f64) -> bool {
        // A sample that never came may have no time either.
        let clock = self.clock.as_ref().filter(|_| !found.is_nan());
        clock.is_none_or(|clock| {
            let (expected, allowed) = clock.due(self.rows);
            let late = (self.second * found - expected).abs();
            late <= allowed || late.is_nan()
        })
    }

    fn check_time(&self, found: f64, place: Place) -> Result<(), RecordingError> {
        match &self.clock {
            Some(clock) if !self.is_due(found) => Err(RecordingError::TimeJump {
                file: self.file.clone(),
                place,
                found: self.second * found,
                expected: clock.due(self.rows).0,
            }),
            _ => Ok(()),
        }
    }
}

/// Compares a file with the checksum that the setup states. What is no regular file has none.
fn compare(file: &Path, expected: Checksum) -> Result<(), RecordingError> {
    if !std::fs::metadata(file).is_ok_and(|found| found.is_file()) {
        return Ok(());
    }
    let found = Checksum::of_file(file).map_err(|source| RecordingError::Unreadable {
        file: file.to_owned(),
        source,
    })?;
    if found == expected {
        return Ok(());
    }
    Err(RecordingError::OtherRecording {
        file: file.to_owned(),
        expected,
        found,
    })
}
