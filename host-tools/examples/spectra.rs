//! Processor time of averaged spectra of samples in memory, for `cargo xtask bench host`.
//!
//! Usage: `spectra CHANNELS SAMPLES LINES BLOCK`. Channels are averaged against the first of them as their drive; 12
//! channels without one, with the whole matrix of their products, if CHANNELS is `matrix`. Prints the seconds.

use massline_core::spectra::{
    Average, BlockSettings, Blocks, Complex32, CrossAverage, DriveAverage, Sum, Window,
};
use std::process::ExitCode;
use std::time::Instant;

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
    let zero = Complex32::new(0.0, 0.0);
    let mut history = vec![0.0; settings.history_len(channels)];
    let mut work = vec![zero; block];
    let mut kept = vec![zero; settings.lines_len(channels)];
    let mut blocks = Blocks::new(settings, channels, &mut history, &mut work, &mut kept)?;
    let responses = channels.saturating_sub(1);
    let (mut sums, mut products);
    let mut average: Box<dyn Average> = if matrix {
        products = vec![Sum::ZERO; CrossAverage::storage_len(&settings)];
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

/// Processor time of this process where the system tells it, seconds; else time.
fn clock() -> f64 {
    use std::sync::LazyLock;
    static BEGAN: LazyLock<Instant> = LazyLock::new(Instant::now);
    let began = *BEGAN;
    let told = std::fs::read_to_string("/proc/self/schedstat").ok();
    let told = told.and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
    told.map_or_else(
        || began.elapsed().as_secs_f64(),
        |nanoseconds| nanoseconds * 1e-9,
    )
}
