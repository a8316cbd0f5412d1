//! Samples of a continuous structure's steady random response, free of time-stepping error.
//!
//! A run is one period cut short: the drive is a sum of sines on the lines of a period that
//! is a quarter longer than the recording or more, with Gaussian amplitudes. Each line goes
//! through the exact frequency responses of the continuous system, and the inverse transform
//! gives samples without integration error, aliasing or starting transient. The part of the
//! period that is cut away keeps the end of the recording from flowing into its beginning.

use nalgebra::Complex;

use super::fourier::Fourier;
use super::interface::TableMotion;
use super::model::Resonance;
use super::random::Stream;
use super::specimen::{Gains, Mode, Specimen};

/// The drive ends at this share of the sample rate, as behind an anti-aliasing filter.
pub(super) const HIGHEST: f64 = 0.45;
/// Channels that share one evaluation of the modes' responses; bounds the memory.
const GROUP: usize = 8;

/// Frequency response of a channel to the drive signal:
/// H(ω) = steady + resonant ρ + Σ_r D_r (b_r + c_r ρ).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DriveResponse {
    steady: f64,
    resonant: f64,
    modal: Vec<[f64; 2]>,
}

impl DriveResponse {
    /// The drive signal itself.
    pub(super) fn drive() -> Self {
        Self {
            steady: 1.0,
            resonant: 0.0,
            modal: Vec::new(),
        }
    }

    /// A channel with these gains on a specimen whose origin moves as given.
    pub(super) fn new(gains: &Gains, specimen: &Specimen, motion: &TableMotion) -> Self {
        Self {
            steady: gains.rigid.dot(&motion.steady),
            resonant: gains.rigid.dot(&motion.resonant),
            modal: gains
                .modal
                .iter()
                .zip(&specimen.modes)
                .map(|(gain, mode)| {
                    [&motion.steady, &motion.resonant]
                        .map(|motion| gain * mode.participation.dot(motion))
                })
                .collect(),
        }
    }

    /// `true` if the channel rests whatever the drive does.
    fn is_silent(&self) -> bool {
        let modal = self.modal.iter().flatten().all(|gain| *gain == 0.0);
        modal && self.steady == 0.0 && self.resonant == 0.0
    }

    /// H at one frequency, from ρ and the D_r there.
    pub(super) fn at(&self, resonance: Complex<f64>, modes: &[Complex<f64>]) -> Complex<f64> {
        let mut direct = Complex::new(self.steady, 0.0);
        let mut coupled = Complex::new(self.resonant, 0.0);
        for ([b, c], response) in self.modal.iter().zip(modes) {
            direct += response * *b;
            coupled += response * *c;
        }
        direct + coupled * resonance
    }
}

/// D(ω) = ω² / (ω_r² - ω² + 2 j ζ_r ω_r² (ω/ω_r)^p), relative over base acceleration of a mode with
/// the damping exponent p; both frequencies in Hz.
pub(super) fn modal_response(mode: &Mode, frequency: f64) -> Complex<f64> {
    let damping = if mode.exponent == 1.0 {
        mode.damping
    } else {
        mode.damping * libm::pow(frequency / mode.frequency, mode.exponent - 1.0)
    };
    over_base(mode.frequency, damping, frequency)
}

/// ρ(ω) = ω_t² / (ω_t² - ω² + 2 j ζ_t ω_t ω) - 1: how far the table's coupling has grown
/// towards its resonance; zero at rest.
pub(super) fn table_resonance(table: &Resonance, frequency: f64) -> Complex<f64> {
    // ω_t² / N - 1 = (ω² - 2 j ζ ω_t ω) / N with the denominator N.
    let damping = 2.0 * table.damping * table.frequency / frequency;
    over_base(table.frequency, table.damping, frequency) * Complex::new(1.0, -damping)
}

fn over_base(natural: f64, damping: f64, frequency: f64) -> Complex<f64> {
    let square = frequency * frequency;
    let re = natural * natural - square;
    let im = 2.0 * damping * natural * frequency;
    Complex::new(re, -im) * (square / (re * re + im * im))
}

/// The drive of one run: RMS 1, Gaussian, white over its band.
pub(super) struct Drive {
    /// Lines 0 to the highest one that is not zero.
    lines: Vec<Complex<f64>>,
    /// Hz.
    spacing: f64,
    /// Samples of the period.
    period: usize,
    /// Samples of the recording.
    samples: usize,
}

impl Drive {
    /// `None` where no line lies in the band (Hz).
    pub(super) fn new(
        seed: u64,
        run: &str,
        band: Option<[f64; 2]>,
        sample_rate: f64,
        samples: usize,
    ) -> Option<Self> {
        let period = (samples + samples / 4).next_power_of_two().max(16);
        let spacing = sample_rate / period as f64;
        let [low, high] = band.unwrap_or([0.0, f64::INFINITY]);
        let first = libm::ceil(low / spacing).max(1.0) as usize;
        let last = libm::floor((high / spacing).min(HIGHEST * period as f64)) as usize;
        if last < first {
            return None;
        }
        // A line d and its mirror image carry 2 |d|²; with E|normal|² = 2 the sum is 1.
        let scale = 0.5 / libm::sqrt((last - first + 1) as f64);
        let mut stream = Stream::new(seed, &["drive", run]);
        let lines = (0..=last)
            .map(|line| match line < first {
                true => Complex::default(),
                false => stream.normal() * scale,
            })
            .collect();
        Some(Self {
            lines,
            spacing,
            period,
            samples,
        })
    }

    /// The recording of every channel; `done` hears the number of channels finished.
    pub(super) fn record(
        &self,
        channels: &[DriveResponse],
        modes: &[Mode],
        table: Option<&Resonance>,
        mut done: impl FnMut(usize),
    ) -> Vec<Vec<f32>> {
        let fourier = Fourier::new(self.period);
        let mut buffer = Vec::new();
        let mut recorded: Vec<Vec<f32>> = Vec::with_capacity(channels.len());
        let mut responses = vec![Complex::default(); modes.len()];
        for group in channels.chunks(GROUP) {
            let mut spectra = vec![vec![Complex::default(); self.lines.len()]; group.len()];
            for (line, drive) in self.lines.iter().enumerate().skip(1) {
                let frequency = line as f64 * self.spacing;
                for (response, mode) in responses.iter_mut().zip(modes) {
                    *response = modal_response(mode, frequency);
                }
                let resonance = table
                    .map(|table| table_resonance(table, frequency))
                    .unwrap_or_default();
                for (spectrum, channel) in spectra.iter_mut().zip(group) {
                    spectrum[line] = channel.at(resonance, &responses) * drive;
                }
            }
            for pair in spectra.chunks(2) {
                // An odd channel rides with itself.
                let (first, second) = (&pair[0], &pair[pair.len() - 1]);
                fourier.real_pair(first, second, &mut buffer);
                let cut = &buffer[..self.samples];
                recorded.push(cut.iter().map(|sample| sample.re as f32).collect());
                if pair.len() == 2 {
                    recorded.push(cut.iter().map(|sample| sample.im as f32).collect());
                }
            }
            // Two signals in one transform leak into each other by rounding; a channel that
            // rests is to rest exactly.
            let start = recorded.len() - group.len();
            for (samples, channel) in recorded[start..].iter_mut().zip(group) {
                if channel.is_silent() {
                    samples.fill(0.0);
                }
            }
            done(recorded.len());
        }
        recorded
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector6;

    const MODE: Mode = Mode {
        name: String::new(),
        frequency: 36.0,
        damping: 0.01,
        exponent: 1.0,
        participation: Vector6::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    #[test]
    fn responses_have_their_limits() {
        // At resonance D = 1/(2jζ); far above it -1; at rest ω²/ω_r².
        let peak = modal_response(&MODE, 36.0);
        assert!((peak - Complex::new(0.0, -50.0)).l1_norm() < 1e-12);
        let slow = modal_response(&MODE, 0.036);
        assert!((slow.re - 1e-6).abs() < 2e-12);
        let fast = modal_response(&MODE, 3.6e6);
        assert!((fast.re + 1.0).abs() < 1e-9);

        let table = Resonance {
            frequency: 100.0,
            damping: 0.05,
        };
        // Transmissibility without its damper: 1/(2jζ) at resonance, less the 1 of rest.
        let peak = table_resonance(&table, 100.0);
        assert!((peak - Complex::new(-1.0, -10.0)).l1_norm() < 1e-12);
        assert!(table_resonance(&table, 1e-6).l1_norm() < 1e-8);
    }

    #[test]
    fn the_drive_has_unit_rms_in_its_band() {
        let drive = Drive::new(1, "X", Some([20.0, 120.0]), 512.0, 30_000).unwrap();
        let signal = &drive.record(&[DriveResponse::drive()], &[], None, |_| ())[0];
        assert_eq!(signal.len(), 30_000);
        let power: f64 = signal.iter().map(|x| f64::from(*x).powi(2)).sum();
        // 100 Hz over 58.6 s are 5900 independent complex amplitudes of the mean power:
        // it scatters by 1/√5900 = 1.3 %; five of those.
        assert!((power / 30_000.0 - 1.0).abs() < 0.065);
        assert!(Drive::new(1, "X", Some([250.0, 255.0]), 512.0, 30_000).is_none());
    }

    /// A quasi-continuous check that nothing is lost on the way to time: the response of
    /// one mode obeys its differential equation at the samples, derivatives taken on a
    /// grid so fine that central differences are exact to the tolerance.
    #[test]
    fn samples_obey_the_differential_equation() {
        let rate = 65_536.0;
        let drive = Drive::new(7, "X", Some([1.0, 80.0]), rate, 60_000).unwrap();
        let specimen = Specimen {
            mass_matrix: nalgebra::Matrix6::zeros(),
            modes: vec![MODE],
            plane: false,
        };
        let motion = TableMotion {
            steady: Vector6::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            resonant: Vector6::zeros(),
        };
        let relative = DriveResponse::new(
            &Gains {
                rigid: Vector6::zeros(),
                modal: vec![1.0],
            },
            &specimen,
            &motion,
        );
        // q̈ + 2ζω q̇ + ω² q = -a, differentiated twice for the recorded w = q̈:
        // ẅ + 2ζω ẇ + ω² w + ä = 0.
        let signals = drive.record(
            &[DriveResponse::drive(), relative],
            &specimen.modes,
            None,
            |_| (),
        );
        let step = 1.0 / rate;
        let omega = 2.0 * std::f64::consts::PI * MODE.frequency;
        // Steps of 64 samples, 1/1024 s: rounding to f32 is amplified by 1/h² only so far.
        const STRIDE: usize = 64;
        let h = STRIDE as f64 * step;
        let at = |signal: usize, n: usize| f64::from(signals[signal][n]);
        let (mut error, mut size) = (0.0, 0.0);
        for n in STRIDE..60_000 - STRIDE {
            let second = |s| (at(s, n + STRIDE) - 2.0 * at(s, n) + at(s, n - STRIDE)) / (h * h);
            let first = |s| (at(s, n + STRIDE) - at(s, n - STRIDE)) / (2.0 * h);
            let left = second(1) + 2.0 * MODE.damping * omega * first(1) + omega * omega * at(1, n);
            error += (left + second(0)).powi(2);
            size += second(1).powi(2);
        }
        // Central differences err by (ωh)²/12 = 0.4 % at the resonance and 2 % at 80 Hz.
        assert!(error / size < 0.02_f64.powi(2), "{}", (error / size).sqrt());
    }
}
