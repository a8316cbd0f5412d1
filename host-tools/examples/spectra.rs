//! Processor time of averaged spectra of samples in memory, for `cargo xtask bench host`.
//!
//! Usage: `spectra CHANNELS SAMPLES LINES BLOCK`. Channels are averaged against the first of them as their drive; 12
//! channels without one, with the whole matrix of their products, if CHANNELS is `matrix`. Prints the seconds.

use massline::measure::BlockStorage;
use massline_core::spectra::{
    Average, BlockSettings, CrossAverage, CrossSums, DriveAverage, Sum, Window,
};
use std::process::ExitCode;

/// Sample rate, Hz: lines are one hertz apart per block of as many samples.
const RATE: f64 = 1024.0;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [kind, rest @ ..] = arguments.as_slice() else {
        return ExitCode::from(2);
    };
    let numbers: Result<Vec<usize>, _> = rest.iter().map(|text| text.parse()).collect();
    let channels = if kind == "matrix" {
        Ok(12)
    } else {
        kind.parse()
    };
    match (channels, numbers.as_deref()) {
        (Ok(channels), Ok(&[samples, lines, block])) => {
            match seconds(kind == "matrix", channels, samples, lines, block) {
                Ok(seconds) => println!("{seconds}"),
                Err(error) => {
                    eprintln!("error: {error}");
                    return ExitCode::FAILURE;
                }
            }
            ExitCode::SUCCESS
        }
        _ => ExitCode::from(2),
    }
}

fn seconds(
    matrix: bool,
    channels: usize,
    samples: usize,
    lines: usize,
    block: usize,
) -> Result<f64, Box<dyn std::error::Error>> {
    let spacing = RATE / block as f64;
    let band = [spacing, spacing * lines as f64];
    let settings = BlockSettings::new(block, 0.5, Window::Hann, RATE, band)?;
    let mut storage = BlockStorage::new(settings, channels);
    let mut blocks = storage.blocks()?;
    let responses = channels.saturating_sub(1);
    let (mut sums, mut products);
    let mut average: Box<dyn Average> = if matrix {
        products = vec![CrossSums::default(); settings.grid().count];
        Box::new(CrossAverage::new(&settings, &mut products)?)
    } else {
        sums = vec![Sum::ZERO; DriveAverage::storage_len(&settings, responses)];
        Box::new(DriveAverage::new(&settings, responses, &mut sums)?)
    };
    let mut state = 1_u32;
    let made = (0..samples * channels).map(|_| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 23) as f32 - 1.0
    });
    let made: Vec<f32> = made.collect();
    let began = clock();
    for sample in made.chunks_exact(channels) {
        if let Some(block) = blocks.push(sample) {
            average.add(&block);
        }
    }
    let took = clock() - began;
    assert!(average.blocks() > 0, "too few samples for a block");
    Ok(took)
}

/// Processor time of this process, seconds.
#[cfg(unix)]
fn clock() -> f64 {
    use rustix::time::{ClockId, clock_gettime};
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Time, seconds.
#[cfg(not(unix))]
fn clock() -> f64 {
    use std::{sync::LazyLock, time::Instant};
    static BEGAN: LazyLock<Instant> = LazyLock::new(Instant::now);
    BEGAN.elapsed().as_secs_f64()
}
