//! Sensors at converters with other filters are in step with the others.

use crate::bench::{Bench, INPUTS, Said};
use crate::plan::Pieces;
use massline_firmware::models::random::Random;
use massline_firmware::models::setup;
use massline_firmware::sampling::lowpass;
use massline_firmware::wire::*;
use std::f64::consts::TAU;

/// The first input of the ADXL355, and of the sensors: three of the accelerometers are its.
const LATE: usize = 32;
/// Input of the drive, behind those of three accelerometers and six load cells.
const DRIVE: usize = 9;
/// Inputs that carry the translation z, and the resultant that it is.
const ALONG_Z: [usize; 3] = [1, 2, LATE + 2];
const Z: usize = 2;
/// Accelerations among the resultants.
const ACCELERATIONS: usize = 6;
/// Samples of a run.
const SAMPLES: u64 = 6000;
/// Smallest count of a tone that is measured: of all tones together 2^23 is not reached.
const TONE: f64 = 20_000.0;

/// A box whose first 32 inputs are three accelerometers, six load cells and the drive, and whose last three
/// are the other accelerometers.
fn ready(band: &Band) -> Bench {
    let mut bench = Bench::switch_on();
    let mut pieces = Pieces::new();
    pieces.plan = setup::plan(1, 0);
    pieces.processing = Processing {
        sample_rate: band.rate,
        block_length: band.block.into(),
        kept_band: band.ends(),
        averaging_band: band.ends(),
        mode_band: None,
        ..setup::PROCESSING
    };
    let unused = ChannelRole::Unused.code();
    pieces.channels = vec![unused; INPUTS.into()];
    pieces.channels[LATE..].copy_from_slice(&[0, 1, 2]);
    for (input, sensor) in (3..setup::SENSORS).enumerate() {
        pieces.channels[input] = sensor;
    }
    pieces.channels[DRIVE] = ChannelRole::Drive.code();
    pieces.send(&mut bench);
    let said = bench.ask(&Request::EndSetup);
    assert!(matches!(said, Said::Grid(_)), "{said:?}");
    bench
}

/// Lines of blocks at a sample rate, Hz.
#[derive(Clone, Debug)]
struct Band {
    rate: f64,
    block: u16,
    lines: core::ops::RangeInclusive<u16>,
}

impl Band {
    fn frequency(&self, line: u16) -> f64 {
        f64::from(line) * self.rate / f64::from(self.block)
    }

    fn ends(&self) -> [f64; 2] {
        [*self.lines.start(), *self.lines.end()].map(|line| self.frequency(line))
    }
}

/// Tones, one a line, of a translation along z and of the drive alike.
struct Tones {
    rate: f64,
    /// Frequency, Hz, and phase of each.
    tones: Vec<(f64, f64)>,
}

impl Tones {
    fn new(band: &Band) -> Self {
        let mut random = Random::new(7);
        let tone = |line| {
            let phase = TAU * random.below(1 << 16) as f64 / 65536.0;
            (band.frequency(line), phase)
        };
        Self {
            rate: band.rate,
            tones: band.lines.clone().map(tone).collect(),
        }
    }

    /// Counts of the input at each sample: the filters' response in closed form.
    fn counts(&self, input: usize) -> Vec<i32> {
        let filter = lowpass(input, self.rate).expect("a box's input");
        let responses: Vec<[f64; 3]> = self
            .tones
            .iter()
            .map(|(frequency, phase)| {
                let omega = TAU * frequency / self.rate;
                let amplitude = TONE * filter.magnitude(*frequency);
                [omega, phase - filter.lag(*frequency), amplitude]
            })
            .collect();
        let sample = |n: u64| {
            let tone =
                |[omega, phase, amplitude]: &[f64; 3]| amplitude * (omega * n as f64 + phase).cos();
            responses.iter().map(tone).sum::<f64>().round() as i32
        };
        (0..SAMPLES).map(sample).collect()
    }
}

/// Largest distance of the acceleration along z from that of the drive, and of all others from zero, of the
/// drive's; `late` is the input whose filters those behind the ADXL355 really are.
fn error(band: &Band, late: usize, spoil: impl Fn(u64) -> Option<Health>) -> f64 {
    let mut bench = ready(band);
    let tones = Tones::new(band);
    let [prompt, late] = [0, late].map(|input| tones.counts(input));
    bench.start(0, Source::Inputs, Gaps::Count, None);
    for (n, (prompt, late)) in (0..).zip(prompt.iter().zip(&late)) {
        let mut counts = [0; INPUTS as usize];
        let mut health = [Health::GOOD; INPUTS as usize];
        counts[DRIVE] = *prompt;
        for input in ALONG_Z {
            counts[input] = if input < LATE { *prompt } else { *late };
        }
        // Inputs that rest would be found stuck.
        for (input, count) in counts.iter_mut().enumerate() {
            *count += (n as i32 + input as i32) % 2;
        }
        match spoil(n) {
            Some(Health::MISSING) => continue,
            Some(fault) => {
                counts[LATE + 2] = 8_000_000;
                health[LATE + 2] = fault;
            }
            None => {}
        }
        bench.convert(n, &counts, &health);
    }
    let summary = bench.stop();
    assert!(summary.blocks >= 3, "{summary:?}");
    // The drive is in counts, the sensors' scale a tenth.
    let lines = bench.lines(0);
    let distance = |line: &Line| {
        let each = line.responses.iter().take(ACCELERATIONS).enumerate();
        each.map(|(k, [re, im])| {
            let wanted = if k == Z { 0.1 } else { 0.0 };
            10.0 * (re - wanted).hypot(*im)
        })
        .fold(0.0, f32::max)
    };
    lines
        .iter()
        .map(|line| f64::from(distance(line)))
        .fold(0.0, f64::max)
}

/// The lowest lines of long blocks, and all that the box may keep of short ones.
fn bands(rate: f64) -> [Band; 2] {
    [(1024, 1..=100), (256, 1..=99)].map(|(block, lines)| Band { rate, block, lines })
}

/// The taps are right to 1e-4 of the amplitude in the lowest lines and to 4e-4 in all that may be kept. A rotation
/// about places 0.4 m apart is 2.5 times as large, and counts are rounded to one of twenty thousand.
const BOUNDS: [f64; 2] = [3e-4, 1.05e-3];

#[test]
fn sensors_at_both_kinds_of_converters_are_in_step() {
    for rate in [128.0, 256.0, 512.0, 1024.0, 2048.0, 4096.0] {
        for (band, bound) in bands(rate).into_iter().zip(BOUNDS) {
            let found = error(&band, LATE, |_| None);
            println!("{band:?}: {found:.1e}");
            assert!(found < bound, "{band:?}: {found}");
        }
    }
}

#[test]
fn filters_that_are_not_those_of_the_data_sheet_show() {
    // As if the ADXL355 had the filters of the others: what the correction does is what it would err.
    let [low, _] = bands(512.0);
    let found = error(&low, 0, |_| None);
    assert!(found > 100.0 * BOUNDS[0], "{found}");
}

#[test]
fn a_fault_or_a_gap_of_a_late_sensor_does_not_outlive_its_blocks() {
    let [_, all] = bands(512.0);
    // Some of them lie in the samples before a block that its first readings rest on.
    for fault in (2500..2500 + 128).step_by(5) {
        let checksum = |n| (n == fault).then_some(Health::CHECKSUM);
        let gap = |n| match n {
            n if (fault - 20..fault).contains(&n) => Some(Health::CHECKSUM),
            n if (fault..fault + 10).contains(&n) => Some(Health::MISSING),
            _ => None,
        };
        let found = [error(&all, LATE, checksum), error(&all, LATE, gap)];
        assert!(
            found.iter().all(|found| *found < BOUNDS[1]),
            "{fault}: {found:?}"
        );
    }
}
