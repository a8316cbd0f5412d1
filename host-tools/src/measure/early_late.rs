//! The first and the second half of a random run, side by side.
//!
//! A gain that drifts during a run leaves averages that look like those of another body. Sums of the run up to a
//! few moments are kept, at most [`MOMENTS`] of them whatever its length, and the one nearest to its middle
//! parts it in two.

use super::drives::DrivesAverage;
use super::sums::Sums;
use super::{Measurement, Spectra};
use massline_core::geometry::RESULTANTS;
use massline_core::spectra::{Complex32, CrossAverage, CrossSums};
use nalgebra::{Complex, SMatrix, SVector};
use std::ops::Range;

/// Most moments that are kept.
const MOMENTS: usize = 16;
/// Blocks of the shorter half from which the halves tell a change.
const LEAST: u32 = 8;

/// Products of the twelve resultants at a line, summed over blocks: the part that is coherent with the drives, or
/// all of it without any.
pub(crate) type Products = SMatrix<Complex<f64>, RESULTANTS, RESULTANTS>;

/// Both halves of a run.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct EarlyLate {
    /// Line by line of the averaging band, in the first half.
    pub(crate) early: Vec<Products>,
    /// The same in the second half.
    pub(crate) late: Vec<Products>,
    /// Blocks of the shorter half.
    blocks: u32,
}

impl EarlyLate {
    /// `true` if both halves are long enough to be held against each other.
    pub(crate) fn tell_changes(&self) -> bool {
        self.blocks >= LEAST
    }
}

/// Sums of a run up to several moments.
pub(super) struct Moments {
    band: Range<usize>,
    /// Blocks from one moment to the next.
    every: u32,
    kept: Vec<(u32, DrivesAverage)>,
}

impl Moments {
    /// None yet, over the lines of the averaging band.
    pub(super) fn new(band: Range<usize>) -> Self {
        Self {
            band,
            // Every fourth one meets the middle to two blocks.
            every: 4,
            kept: Vec::new(),
        }
    }

    /// Keeps the sums if it is time to: after each block.
    pub(super) fn look(&mut self, sums: &Sums<'_>) {
        let blocks = sums.blocks();
        if !blocks.is_multiple_of(self.every) {
            return;
        }
        if self.kept.len() == MOMENTS {
            self.every = self.every.saturating_mul(2);
            let every = self.every;
            self.kept.retain(|(blocks, _)| blocks.is_multiple_of(every));
            if !blocks.is_multiple_of(every) {
                return;
            }
        }
        self.kept.push((blocks, of_band(sums, &self.band)));
    }

    /// Both halves; `None` of a run of four blocks or fewer.
    pub(super) fn halves(self, sums: &Sums<'_>) -> Option<EarlyLate> {
        let all = sums.blocks();
        let near = |(blocks, _): &(u32, DrivesAverage)| blocks.abs_diff(all / 2);
        let (blocks, early) = self.kept.into_iter().min_by_key(near)?;
        let shorter = blocks.min(all - blocks);
        if shorter == 0 {
            return None;
        }
        let late = of_band(sums, &self.band).since(&early);
        Some(EarlyLate {
            early: products(&early),
            late: products(&late),
            blocks: shorter,
        })
    }
}

/// The sums of some lines, whatever the number of drives; without any the resultants themselves are the drives.
fn of_band(sums: &Sums<'_>, band: &Range<usize>) -> DrivesAverage {
    let complex = |(re, im): (f64, f64)| Complex::new(re, im);
    match sums {
        Sums::Several(average) => average.of_lines(band),
        Sums::One(average) => {
            DrivesAverage::of_sums(band, (1, RESULTANTS), sums.blocks(), &|k, at| match at
                .checked_sub(1)
            {
                None => average.drive_power(k).into(),
                Some(at) if at % 2 == 0 => complex(average.cross(at / 2, k)),
                Some(at) => average.power(at / 2, k).into(),
            })
        }
        Sums::Cross(average) => {
            DrivesAverage::of_sums(band, (RESULTANTS, 0), sums.blocks(), &|k, at| {
                complex(average.cross(at / RESULTANTS, at % RESULTANTS, k))
            })
        }
    }
}

/// Products of the resultants line by line.
fn products(sums: &DrivesAverage) -> Vec<Products> {
    let lines = 0..sums.lines();
    if sums.has_no_channels() {
        let of = |line| Products::from_fn(|i, j| sums.between(line, i, j));
        return lines.map(of).collect();
    }
    if sums.has_one_drive() {
        // As below, without the rest of what is known of parts.
        let of = |line| {
            let power = sums.between(line, 0, 0).re;
            let x = SVector::<_, RESULTANTS>::from_fn(|c, _| sums.with(line, c, 0));
            match power > 0.0 {
                true => x * x.adjoint() / Complex::from(power),
                false => Products::zeros(),
            }
        };
        return lines.map(of).collect();
    }
    let mut found = sums.parts(lines.clone());
    let mut all = vec![Products::zeros(); lines.len()];
    for mut part in std::mem::take(&mut found.parts) {
        let Ok(average) = found.average(&mut part) else {
            // Storage that was large enough to be averaged in is large enough.
            continue;
        };
        for (line, all) in all.iter_mut().enumerate() {
            let power = average.drive_power(line);
            let x = SVector::<_, RESULTANTS>::from_fn(|c, _| {
                let (re, im) = average.cross(c, line);
                Complex::new(re, im)
            });
            if power > 0.0 {
                *all += x * x.adjoint() / Complex::from(power);
            }
        }
    }
    all
}

/// A change of the gain of one force or moment in a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ForceGain {
    /// Number of the run in the setup.
    pub(crate) run: usize,
    /// 0 to 5: forces, then moments.
    pub(crate) force: usize,
    /// Its share.
    pub(crate) share: f64,
}

impl Measurement {
    /// The measurement as it would be with `factor` times these changes.
    pub(crate) fn with_gains(&self, gains: &[ForceGain], factor: f64) -> Self {
        let mut changed = self.clone();
        for run in &mut changed.runs {
            let own = gains.iter().filter(|gain| gain.run == run.number);
            let mut of = [1.0; RESULTANTS];
            for gain in own {
                if let Some(slot) = of.get_mut(RESULTANTS / 2 + gain.force) {
                    *slot += gain.share * factor;
                }
            }
            match &mut run.spectra {
                Spectra::Drive { responses, .. } => {
                    for (x, gain) in responses
                        .iter_mut()
                        .flat_map(|line| line.iter_mut().zip(&of))
                    {
                        let scaled = |x: f32| (f64::from(x) * gain) as f32;
                        *x = Complex32::new(scaled(x.re), scaled(x.im));
                    }
                }
                Spectra::Cross { sums } => {
                    let Ok(average) = CrossAverage::resume(&run.settings, sums, run.blocks) else {
                        // Storage that was large enough to be averaged in is large enough.
                        continue;
                    };
                    let lines = 0..run.settings.grid().count;
                    let scaled = lines.map(|line| {
                        CrossSums::of(|i, j| {
                            let (re, im) = average.cross(i, j, line);
                            (re * of[i] * of[j], im * of[i] * of[j])
                        })
                    });
                    *sums = scaled.collect();
                }
            }
        }
        changed
    }
}

#[cfg(test)]
mod tests {
    use super::super::stream::{Signal, Sink, stream};
    use super::super::sums::SumStorage;
    use super::super::{BlockStorage, stream::Seen};
    use super::*;
    use crate::draws::Draws;
    use crate::parallel::Idle;
    use crate::recording::Recording;
    use massline_core::spectra::{Average, BlockSettings, Window};
    use std::fmt::Write as _;

    /// Twelve channels behind drives.
    struct Twelve<'s> {
        drives: usize,
        sums: Sums<'s>,
        moments: Moments,
    }

    impl Sink for Twelve<'_> {
        fn channels(&self) -> Vec<Signal<'_>> {
            let all = self.drives..self.drives + RESULTANTS;
            all.map(|channel| Signal::Channel(channel, 1.0)).collect()
        }

        fn is_alone(&self) -> bool {
            true
        }

        fn add(&mut self, block: &Seen<'_>) {
            self.sums.add(block);
            self.moments.look(&self.sums);
        }
    }

    const LENGTH: usize = 256;

    /// Halves of a recording with so many blocks, whose channels follow the drives, or the first channel, with a gain
    /// of 1 up to the middle and of 2 from there on; and the products of all of it.
    fn halves(drives: usize, blocks: usize) -> (Option<EarlyLate>, Vec<Products>) {
        let settings = BlockSettings::new(LENGTH, 0.5, Window::Hann, 256.0, [4.0, 60.0]).unwrap();
        let rows = settings.support() + (blocks - 1) * LENGTH / 2;
        let mut rng = Draws::new(1);
        let names = (0..drives + RESULTANTS).map(|c| format!("c{c}"));
        let names: Vec<String> = names.collect();
        let mut text = names.join(",") + "\n";
        for row in 0..rows {
            let gain = if row < rows / 2 { 1.0 } else { 2.0 };
            let own: Vec<f32> = (0..drives.max(1)).map(|_| rng.normal() as f32).collect();
            let sum: f32 = own.iter().sum();
            let channels = (0..RESULTANTS).map(|c| match (drives, c) {
                (0, 0) => sum,
                _ => gain * sum * (1 + c) as f32,
            });
            let all = own.iter().take(drives).copied().chain(channels);
            let fields: Vec<String> = all.map(|x| x.to_string()).collect();
            let _ = writeln!(text, "{}", fields.join(","));
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.csv");
        std::fs::write(&path, text).unwrap();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let mut recording = Recording::open(&path, &names).unwrap();
        let mut storage = SumStorage::default();
        let band = 4..40;
        let mut twelve = Twelve {
            drives,
            sums: Sums::new(&settings, drives, RESULTANTS, &mut storage).unwrap(),
            moments: Moments::new(band.clone()),
        };
        let numbers: Vec<usize> = (0..drives).collect();
        let sinks: &mut [&mut dyn Sink] = &mut [&mut twelve];
        stream(
            &mut recording,
            &settings,
            &numbers,
            sinks,
            &mut |_| {},
            &Idle::none(),
            &mut |_| {},
        )
        .unwrap();
        assert_eq!(twelve.sums.blocks() as usize, blocks);
        let whole = products(&of_band(&twelve.sums, &band));
        (twelve.moments.halves(&twelve.sums), whole)
    }

    /// The gain of channel 7 to channel 0 in a half.
    fn gain(half: &[Products]) -> f64 {
        let sum = |i: usize, j: usize| half.iter().map(|line| line[(i, j)].re).sum::<f64>();
        sum(7, 0) / sum(0, 0)
    }

    #[test]
    fn halves_are_parted_in_the_middle() {
        for drives in [0, 1, 2] {
            for blocks in [8 * 2 + 2, 33, 64, 65, 100, 333] {
                let (found, whole) = halves(drives, blocks);
                let found = found.unwrap();
                assert_eq!(found.early.len(), 36);
                // With a drive the channel's own gain is that of a half.
                let gains = match drives {
                    0 => [gain(&found.early), gain(&found.late)],
                    _ => [&found.early, &found.late].map(|half| {
                        let of = |products: &[Products]| {
                            products.iter().map(|line| line[(7, 7)].re).sum::<f64>()
                        };
                        8.0 * (2.0 * of(half) / of(&whole) * 2.5).sqrt()
                    }),
                };
                // A block or two hold both gains, and the middle is met to a part of sixteen; powers of a half
                // scatter like those of its blocks and lines.
                let near = match drives {
                    0 => 0.15,
                    _ => 0.15 + 2.0 / (36.0 * blocks as f64 / 3.0).sqrt(),
                };
                for (found, expected) in gains.into_iter().zip([8.0, 16.0]) {
                    assert!(
                        (found / expected - 1.0).abs() < near,
                        "{drives} {blocks}: {found}, expected {expected}"
                    );
                }
                if drives == 0 {
                    let sums = found.early.iter().zip(&found.late).zip(&whole);
                    for ((early, late), whole) in sums {
                        // Sums in single precision.
                        let off = (early + late - whole).camax() / whole.camax();
                        assert!(off < 1e-5, "{off}");
                    }
                }
            }
        }
    }

    #[test]
    fn halves_of_a_short_run_tell_no_changes() {
        for drives in [0, 1, 2] {
            assert_eq!(halves(drives, 1).0, None);
            assert_eq!(halves(drives, 4).0, None);
            for (blocks, tell) in [(5, false), (15, false), (16, true), (17, true), (21, true)] {
                let found = halves(drives, blocks).0.unwrap();
                assert_eq!(found.tell_changes(), tell, "{drives} {blocks}");
            }
        }
    }

    #[test]
    fn moments_are_few_and_even() {
        let settings = BlockSettings::new(LENGTH, 0.5, Window::Hann, 256.0, [4.0, 60.0]).unwrap();
        let mut storage = SumStorage::default();
        let mut sums = Sums::new(&settings, 1, RESULTANTS, &mut storage).unwrap();
        let mut moments = Moments::new(0..1);
        let mut blocks = BlockStorage::new(settings, 1 + RESULTANTS);
        let mut blocks = blocks.blocks().unwrap();
        let mut count = 0;
        while count < 1000 {
            if let Some(block) = blocks.push(&[1.0; 1 + RESULTANTS]) {
                match &mut sums {
                    Sums::One(average) => average.add(&block),
                    _ => panic!("one drive"),
                }
                moments.look(&sums);
                count += 1;
                let kept: Vec<u32> = moments.kept.iter().map(|(at, _)| *at).collect();
                let even = (1..).map(|k| k * moments.every).take(kept.len());
                assert!(
                    kept.len() <= MOMENTS && even.eq(kept.iter().copied()),
                    "{kept:?}"
                );
                assert!(
                    count < 4 * MOMENTS || kept.len() >= MOMENTS / 2,
                    "{count} {kept:?}"
                );
            }
        }
    }
}
