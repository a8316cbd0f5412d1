//! Samples of a recording, handed from the thread that reads it to the one that takes them, which may be the same.

use super::MeasureError;
use crate::parallel::Idle;
use crate::recording::Recording;
use massline_firmware::wire::Health;
use std::sync::mpsc;

/// Rows between two reports of progress.
const REPORT_ROWS: u64 = 4096;
/// Rows of a batch at least, but for the last one: a few words between threads in a second of samples.
const BATCH_ROWS: usize = 256;
/// Batches that may wait for the thread that takes them.
const WAITING: usize = 4;

/// The rows of a recording that is read from here on.
pub(super) struct Rows<'r> {
    recording: &'r mut Recording,
    /// Room for a sample that is read by itself.
    sample: Vec<f32>,
}

/// Rows that go from thread to thread.
#[derive(Default)]
struct Batch {
    rows: Vec<f32>,
    /// Numbers of rows that were read together, and their faults: whoever takes them sees them as if there was one
    /// thread.
    pieces: Vec<(usize, Health)>,
    /// Share of the recording that is read, where it is due to be told.
    progress: Option<f64>,
}

/// Takes rows that follow one another and share their faults.
type Take<'a> = &'a mut (dyn FnMut(&[f32], Health) + Send);

impl<'r> Rows<'r> {
    pub(super) fn new(recording: &'r mut Recording) -> Self {
        let sample = vec![0.0; recording.channels()];
        Self { recording, sample }
    }

    /// Has all rows taken, by another thread as soon as one is idle.
    ///
    /// # Errors
    /// That of the recording, once the rows before it have been taken.
    pub(super) fn hand_out(
        mut self,
        take: Take<'_>,
        idle: &Idle,
        progress: &mut dyn FnMut(f64),
    ) -> Result<(), MeasureError> {
        loop {
            if let Some(_thread) = idle.take() {
                return self.hand_over(take, progress);
            }
            let before = self.recording.rows();
            if !self.next(take)? {
                return Ok(());
            }
            if let Some(share) = self.due(before) {
                progress(share);
            }
        }
    }

    /// Has the rest taken by a thread of its own.
    fn hand_over(
        mut self,
        take: Take<'_>,
        progress: &mut dyn FnMut(f64),
    ) -> Result<(), MeasureError> {
        std::thread::scope(|scope| {
            let (full, batches) = mpsc::sync_channel::<Batch>(WAITING);
            let (back, empty) = mpsc::channel::<Batch>();
            let taker = scope.spawn(move || {
                for mut batch in batches {
                    let mut rows = batch.rows.as_slice();
                    for (length, health) in &batch.pieces {
                        let (piece, rest) = rows.split_at_checked(*length).unwrap_or((rows, &[]));
                        take(piece, *health);
                        rows = rest;
                    }
                    batch.rows.clear();
                    batch.pieces.clear();
                    // The reader may have come to its end.
                    drop(back.send(batch));
                }
            });
            let read = loop {
                let mut batch = empty.try_recv().unwrap_or_default();
                let read = self.fill(&mut batch);
                if let Some(share) = batch.progress.take() {
                    progress(share);
                }
                let is_last = !matches!(read, Ok(true));
                // Nobody listens any more after a panic, which is handed on below.
                if full.send(batch).is_err() || is_last {
                    break read;
                }
            };
            drop(full);
            if let Err(panic) = taker.join() {
                std::panic::resume_unwind(panic);
            }
            read.map(|_| ())
        })
    }

    /// Adds rows to a batch until it is full. `false` if there are no more.
    fn fill(&mut self, batch: &mut Batch) -> Result<bool, MeasureError> {
        let full = BATCH_ROWS * self.sample.len().max(1);
        while batch.rows.len() < full {
            let before = self.recording.rows();
            let more = self.next(&mut |rows, health| {
                batch.rows.extend_from_slice(rows);
                batch.pieces.push((rows.len(), health));
            })?;
            if !more {
                return Ok(false);
            }
            batch.progress = self.due(before).or(batch.progress);
        }
        Ok(true)
    }

    /// Has the next rows taken. `false` at the end.
    fn next(&mut self, take: &mut dyn FnMut(&[f32], Health)) -> Result<bool, MeasureError> {
        let mut health = Health::GOOD;
        let rows = match self.recording.good_rows() {
            [] => {
                if !self.recording.next_row(&mut self.sample)? {
                    return Ok(false);
                }
                health = self.recording.health();
                self.sample.as_slice()
            }
            rows => rows,
        };
        take(rows, health);
        Ok(true)
    }

    /// Share of the recording that is read, if it is time to tell it since so many rows were read.
    fn due(&self, before: u64) -> Option<f64> {
        let now = self.recording.rows();
        (now / REPORT_ROWS != before / REPORT_ROWS).then(|| self.recording.progress())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::HEALTH_COLUMN;
    use std::fmt::Write as _;
    use std::path::Path;

    /// Rows of two channels with a fault now and then, of which one in the second file is no number.
    fn written(folder: &Path, wrong: Option<usize>) -> std::path::PathBuf {
        let mut text = format!("a,b,{HEALTH_COLUMN}\n");
        for row in 0..10_000 {
            let fault = if row % 1777 == 1000 { "overload" } else { "" };
            let b = match wrong {
                Some(at) if at == row => "none".to_owned(),
                _ => (row * row % 97).to_string(),
            };
            let _ = writeln!(text, "{row},{b},{fault}");
        }
        let path = folder.join("x.csv");
        std::fs::write(&path, text).unwrap();
        path
    }

    /// All that is taken of a recording.
    struct Taken {
        pieces: Vec<(Vec<f32>, Health)>,
        /// Words of progress.
        shares: Vec<f64>,
        outcome: String,
    }

    /// What is taken on two threads from the given piece on.
    fn taken(path: &Path, from: Option<usize>) -> Taken {
        let mut recording = Recording::open(path, &["b", "a"]).unwrap();
        let (mut pieces, mut shares) = (Vec::new(), Vec::new());
        let idle = Idle::new(usize::from(from == Some(0)));
        let mut take = |rows: &[f32], health| {
            pieces.push((rows.to_vec(), health));
            if from == Some(pieces.len()) {
                idle.add();
            }
        };
        let rows = Rows::new(&mut recording);
        let done = rows.hand_out(&mut take, &idle, &mut |share| shares.push(share));
        let outcome = done.map_or_else(|error| error.to_string(), |()| "read".to_owned());
        Taken {
            pieces,
            shares,
            outcome,
        }
    }

    #[test]
    fn another_thread_takes_the_same_pieces() {
        let folder = tempfile::tempdir().unwrap();
        for (wrong, expected) in [(None, "read"), (Some(7_500), "line 7502")] {
            let path = written(folder.path(), wrong);
            let alone = taken(&path, None);
            assert!(alone.outcome.contains(expected), "{}", alone.outcome);
            let rows: usize = alone.pieces.iter().map(|(rows, _)| rows.len() / 2).sum();
            assert_eq!(rows, wrong.unwrap_or(10_000));
            let faulty = alone.pieces.iter().filter(|(_, health)| !health.is_good());
            assert_eq!(faulty.count(), if wrong.is_some() { 4 } else { 6 });
            assert!(!alone.shares.is_empty() && alone.pieces.len() > 50);
            for from in [0, 1, 2, 50, alone.pieces.len() - 1] {
                let both = taken(&path, Some(from));
                assert!(
                    both.pieces == alone.pieces && both.outcome == alone.outcome,
                    "{}",
                    both.outcome
                );
                // Shares are of what was read, which another thread may not have taken yet.
                assert_eq!(both.shares.len(), alone.shares.len());
            }
        }
    }

    #[test]
    #[should_panic(expected = "too much")]
    fn a_panic_of_the_other_thread_is_handed_on() {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path(), None);
        let mut recording = Recording::open(&path, &["a"]).unwrap();
        let rows = Rows::new(&mut recording);
        let mut take = |rows: &[f32], _| assert!(rows.iter().all(|x| *x < 5_000.0), "too much");
        let _ = rows.hand_out(&mut take, &Idle::new(1), &mut |_| ());
    }
}
