//! The parts of a recording that are the same for all formats, with a source in memory.

use super::source::Source;
use super::*;
use massline_firmware::wire::Health as Faults;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// A recording of two channels and time in memory, whose records have numbers and no lines.
struct InMemory {
    channels: Vec<Channel>,
    samples: Vec<([f64; 3], Faults)>,
    next: usize,
    selected: Vec<usize>,
    preamble: Preamble,
    /// Number of the record that cannot be read.
    broken: usize,
    /// Largest block that was asked for.
    largest: &'static AtomicUsize,
}

impl Source for InMemory {
    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn sample_rate(&self) -> Option<StatedRate> {
        Some(StatedRate {
            value: 100.0,
            place: "its first record",
        })
    }

    fn preamble(&self) -> &Preamble {
        &self.preamble
    }

    fn select(&mut self, channels: &[usize]) {
        self.selected = channels.to_vec();
    }

    fn read(&mut self, block: &mut Block) -> Result<(), RecordingError> {
        self.largest.fetch_max(block.room(), Ordering::Relaxed);
        while block.room() > 0
            && let Some((readings, health)) = self.samples.get(self.next)
        {
            self.next += 1;
            let place = Place::Record(self.next as u64);
            if self.next == self.broken {
                return Err(RecordingError::Damaged {
                    file: PathBuf::from("x.records"),
                    place,
                    reason: "its sum is wrong".to_owned(),
                });
            }
            block.push(place, *health, |k| Ok(readings[self.selected[k]]))?;
        }
        Ok(())
    }
}

/// A thousand samples at 100 Hz, of which some are spoilt.
fn recording(
    spoil: impl Fn(usize, &mut [f64; 3], &mut Faults),
    broken: usize,
    largest: &'static AtomicUsize,
) -> Recording {
    let channel = |name: &str| Channel {
        name: name.to_owned(),
        unit: Some("m/s²".to_owned()),
        direction: Some([0.0, 0.0, 1.0]),
    };
    let samples = (0..1000).map(|n| {
        let (mut readings, mut health) = ([n as f64, 0.01 * n as f64, -1.0], Faults::GOOD);
        spoil(n, &mut readings, &mut health);
        (readings, health)
    });
    let source = InMemory {
        channels: ["a", "time", "b"].map(channel).to_vec(),
        samples: samples.collect(),
        next: 0,
        selected: Vec::new(),
        preamble: Preamble::default(),
        broken,
        largest,
    };
    Recording::from_memory(Box::new(source), Path::new("x.records"), &["b", "a"]).unwrap()
}

/// All samples of channel `a`, and the error that ends them.
fn read(mut recording: Recording) -> (Vec<f32>, Option<String>) {
    let mut sample = [0.0; 2];
    let mut all = Vec::new();
    loop {
        match recording.next_row(&mut sample) {
            Ok(true) => all.push(sample[1]),
            Ok(false) => return (all, None),
            Err(error) => return (all, Some(error.to_string())),
        }
    }
}

#[test]
fn samples_come_in_the_order_asked_for_and_blocks_do_not_grow() {
    static LARGEST: AtomicUsize = AtomicUsize::new(0);
    let recording = recording(|_, _, _| (), 0, &LARGEST);
    assert_eq!(recording.in_file()[2].unit.as_deref(), Some("m/s²"));
    let (all, error) = read(recording);
    assert_eq!(error, None);
    assert_eq!(all.len(), 1000);
    assert!(all.iter().enumerate().all(|(n, a)| *a == n as f32));
    assert_eq!(LARGEST.load(Ordering::Relaxed), 256);
}

/// A record that is at fault in the middle of a block ends nothing before it.
#[test]
fn the_samples_before_an_error_are_handed_out_first() {
    static LARGEST: AtomicUsize = AtomicUsize::new(0);
    let (all, error) = read(recording(|_, _, _| (), 300, &LARGEST));
    assert_eq!(all.len(), 299);
    let error = error.unwrap();
    assert!(error.starts_with("x.records, record 300: "), "{error}");
    // Not asked for, not found.
    let mut limited = recording(|_, _, _| (), 300, &LARGEST);
    limited.limit(Some(299));
    assert_eq!(read(limited), (all, None));
}

#[test]
fn a_reading_that_is_no_number_is_an_error_unless_its_sample_is_faulty() {
    static LARGEST: AtomicUsize = AtomicUsize::new(0);
    let spoil = |n: usize, readings: &mut [f64; 3], _: &mut Faults| {
        if n == 500 {
            readings[2] = f64::NAN;
        }
    };
    let (all, error) = read(recording(spoil, 0, &LARGEST));
    assert_eq!(all.len(), 500);
    let error = error.unwrap();
    assert!(
        error.starts_with("x.records, record 501, channel `b`: NaN"),
        "{error}"
    );
    let faulty = |n: usize, readings: &mut [f64; 3], health: &mut Faults| {
        if n == 500 {
            *readings = [f64::INFINITY; 3];
            *health = Faults::MISSING;
        }
    };
    let (all, error) = read(recording(faulty, 0, &LARGEST));
    assert_eq!((all.len(), all[500], error), (1000, 0.0, None));
}

#[test]
fn a_channel_that_is_not_there_is_named_without_a_line() {
    static LARGEST: AtomicUsize = AtomicUsize::new(0);
    let source = |names: [&str; 2]| InMemory {
        channels: names
            .map(|name| Channel {
                name: name.to_owned(),
                ..Channel::default()
            })
            .to_vec(),
        samples: Vec::new(),
        next: 0,
        selected: Vec::new(),
        preamble: Preamble::default(),
        broken: 0,
        largest: &LARGEST,
    };
    let open = |names| Recording::from_memory(Box::new(source(names)), Path::new("x"), &["a3"]);
    let error = open(["a1", "A3"]).err().unwrap().to_string();
    assert_eq!(error, "x: there is no channel `a3`; did you mean `A3`?");
    let error = open(["a3", "a3"]).err().unwrap().to_string();
    assert!(error.contains("stands there twice"), "{error}");
}
