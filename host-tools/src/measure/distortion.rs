//! Forces of a run, or readings of its load cells, that are no linear functions of its motion.
//!
//! # Design
//!
//! A load cell whose gain depends on the load, one that is loose between two stops, or a joint that slips bends
//! the numbers, and leaves a force whose rest looks like noise: it is not coherent with any acceleration. It is
//! coherent with powers of the force itself, though, which noise is not.
//!
//! * Each force x of the run is split at every line of the averaging band in what the six accelerations explain of
//!   it and the rest `r`. The same is done with its [`Powers`](super::powers) `c` in time.
//! * The mean of `α = ⟨r c*⟩ / ⟨c c*⟩` over the lines, weighted by their noise, is the coefficient of `c` in the
//!   force, whatever the part of its power that lies on these lines. Its variance is that of two independent signals.
//!   Only its real part counts: a distortion in the sensor has no delay.
//! * What the accelerations do not explain because they are noisy is left in `r` and, as far as `c` still has a
//!   linear part, in `c`. So no coefficient up to `|⟨c g*⟩| ⟨r r*⟩ / ⟨g g*⟩ ⟨c c*⟩` is told, where `g` is the part
//!   of the force that the accelerations explain. That is little for normal samples and much for sweeps and for
//!   signals that repeat themselves with the blocks.
//!
//! The measuring pass does this with the six resultants, which costs little. Where they are distorted, one more pass
//! does it with each load cell by itself, which tells the cells and how far the gain of each force is bent; and with each
//! accelerometer on the interface beside the six forces, since an accelerometer that is not linear is in all forces as the
//! motion that it tells.

use super::drives::{DrivesAverage, wide};
use super::geometry::RunGeometry;
use super::opened::Opened;
use super::powers::Power;
use super::stream::{Seen, Signal, Sink};
use super::{MeasureError, Measurement, Progress, survey};
use crate::parallel::Idle;
use crate::setup::{Excitation, Mount, Setup};
use massline_core::geometry::RESULTANTS;
use massline_core::spectra::{Average, BlockSettings};
use nalgebra::Complex;
use std::ops::Range;

/// Accelerations, which are as many as forces.
const SIX: usize = RESULTANTS / 2;
const POWERS: usize = Power::ALL.len();
/// Least number of independent blocks beyond one for each acceleration.
const LEAST: f64 = 6.0;
/// Share of a force's power that single precision may leave.
const ROUNDING: f64 = 1e-12;

/// A power of a signal in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Distortion {
    /// The signal: 0 to 5 of forces, then moments; or the number of a load cell or an accelerometer in the setup.
    pub(crate) signal: usize,
    /// The power.
    pub(crate) power: Power,
    /// Root mean square of what the power adds, beside its linear part, to normal samples of the signal, as a share of
    /// theirs; its sign is that of the power's coefficient.
    pub(crate) share: f64,
    /// Standard deviation of the share, if lines are independent.
    pub(crate) std: f64,
    /// Degrees of freedom of the standard deviation, if lines are independent.
    pub(crate) freedom: f64,
    /// Share that noise of the accelerations may make.
    pub(crate) noise: f64,
}

/// The load cells and the accelerometers on the interface of a run, each by itself.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SensorDistortions {
    /// Number of the run in the setup.
    pub(crate) run: usize,
    /// Powers of each cell's reading in it.
    pub(crate) cells: Vec<Distortion>,
    /// Of each cell, the share of each force and moment in the averaging band that is in phase with it and comes from
    /// this cell.
    pub(crate) carried: Vec<[f64; SIX]>,
    /// Powers of the reading of each accelerometer in it.
    pub(crate) accelerometers: Vec<Distortion>,
}

/// Signals that are tested.
#[derive(Clone, Debug, PartialEq)]
enum Tested {
    /// The six forces beside the accelerations.
    Forces,
    /// These channels of the recording, load cells, beside the accelerations.
    Cells(Vec<usize>),
    /// These channels, accelerometers, beside the forces.
    Accelerometers(Vec<usize>),
}

impl Tested {
    /// Channels of the recording.
    fn channels(&self) -> &[usize] {
        match self {
            Self::Forces => &[],
            Self::Cells(channels) | Self::Accelerometers(channels) => channels,
        }
    }

    /// Number of the first signal among the channels of the sums, and number of signals.
    fn signals(&self) -> (usize, usize) {
        match self {
            Self::Forces => (0, SIX),
            Self::Cells(channels) | Self::Accelerometers(channels) => (SIX, channels.len()),
        }
    }

    /// Number of load cells among the channels.
    fn cells(&self) -> usize {
        match self {
            Self::Cells(channels) => channels.len(),
            Self::Forces | Self::Accelerometers(_) => 0,
        }
    }
}

/// The consumer of a run that holds signals against their own powers.
pub(super) struct Distortions<'g> {
    geometry: &'g RunGeometry,
    tested: Tested,
    /// The six accelerations as drives; as channels the six forces, the channels that are tested, and the powers.
    /// Accelerations and forces are exchanged where accelerometers are tested.
    sums: DrivesAverage,
    band: Range<usize>,
    drives: usize,
    /// Line by line, products of each signal with its own powers.
    own: Vec<Complex<f64>>,
    /// Products of each load cell with each force, in phase, over all lines.
    with_forces: Vec<[f64; SIX]>,
}

impl<'g> Distortions<'g> {
    /// Of the forces: no blocks yet, over the lines of the averaging band, of blocks that begin with so many drives.
    pub(super) fn new(geometry: &'g RunGeometry, band: Range<usize>, drives: usize) -> Self {
        Self::of(geometry, Tested::Forces, band, drives)
    }

    fn of(geometry: &'g RunGeometry, tested: Tested, band: Range<usize>, drives: usize) -> Self {
        let (_, signals) = tested.signals();
        let channels = SIX + tested.channels().len() + signals * POWERS;
        Self {
            geometry,
            sums: DrivesAverage::within(band.clone(), drives, SIX, channels),
            own: vec![Complex::default(); band.len() * signals * POWERS],
            with_forces: vec![[0.0; SIX]; tested.cells()],
            tested,
            band,
            drives,
        }
    }

    /// Its sums: the six accelerations in place of drives; the first channels are the six forces.
    pub(super) fn sums(&self) -> &DrivesAverage {
        &self.sums
    }

    /// The shares of all powers in signals that are measured; none of a run that is too short for them.
    pub(super) fn finish(&self, settings: &BlockSettings) -> Vec<Distortion> {
        let hop = settings.hop() as f64 / settings.block_length() as f64;
        let correlation = settings.window().block_correlation(hop);
        let lines = 0..self.sums.lines();
        let (used, _) = self.sums.independent(lines.clone());
        let left = f64::from(self.sums.blocks()) / correlation - used.len() as f64;
        if left < LEAST || used.is_empty() {
            return Vec::new();
        }
        let split = lines.map(|line| Split::of(&self.sums, line, &used));
        let split: Vec<Split> = split.collect();
        let measured = |signal: &usize| {
            self.tested != Tested::Forces || self.geometry.equations.measured(*signal) > 0.5
        };
        let signals = (0..self.tested.signals().1).filter(measured);
        let powers = signals.flat_map(|s| (0..POWERS).map(move |power| s * POWERS + power));
        let shares = powers.filter_map(|own| self.share(&split, own, left));
        shares.collect()
    }

    /// The share of a power in its signal, of so many independent blocks beyond those for the accelerations.
    fn share(&self, split: &[Split], own: usize, left: f64) -> Option<Distortion> {
        let (first, signals) = self.tested.signals();
        let (x, c) = (first + own / POWERS, first + signals + own);
        let (mut together, mut powers, mut variance, mut noise) = (0.0, 0.0, 0.0, 0.0);
        for (line, products) in split.iter().zip(self.own.chunks(signals * POWERS)) {
            let motion = line.explained(x, x).re;
            let rest = line.left(x).max(ROUNDING * line.power[x]);
            if !(rest > 0.0 && motion > 0.0) {
                continue;
            }
            let weight = 1.0 / rest;
            let square = weight * line.left(c);
            together += weight * (products[own] - line.explained(x, c)).re;
            powers += square;
            noise += weight * line.explained(c, x).norm() / motion * rest;
            // Of sums over all blocks, whose rest is that of fewer.
            variance += 0.5 * square / left;
        }
        let power = Power::ALL[own % POWERS];
        let unit = power.of_normal() / powers;
        let found = Distortion {
            signal: own / POWERS,
            power,
            share: together * unit,
            std: variance.sqrt() * unit,
            freedom: left * split.len() as f64,
            noise: noise * unit,
        };
        (found.std > 0.0 && found.share.is_finite() && found.noise.is_finite()).then_some(found)
    }

    /// Of each cell, the share of each force that comes from it.
    fn carried(&self) -> Vec<[f64; SIX]> {
        let power = |force: usize| {
            let lines = 0..self.sums.lines();
            lines
                .map(|line| self.sums.with(line, force, SIX).re)
                .sum::<f64>()
        };
        let forces: [f64; SIX] = core::array::from_fn(power);
        let column = |channel: &usize| self.geometry.columns.get(*channel);
        let columns = self.tested.channels().iter().filter_map(column);
        let carried = columns.zip(&self.with_forces).map(|(column, with)| {
            core::array::from_fn(|force| {
                let share = column[SIX + force] * with[force] / forces[force];
                if share.is_finite() { share } else { 0.0 }
            })
        });
        carried.collect()
    }
}

/// The channels at a line, split in what the accelerations explain and the rest.
struct Split {
    /// Powers of the accelerations' own parts.
    motions: Vec<f64>,
    /// Products of each channel with these parts.
    products: Vec<Vec<Complex<f64>>>,
    /// Power of each channel.
    power: Vec<f64>,
}

impl Split {
    fn of(sums: &DrivesAverage, line: usize, used: &[usize]) -> Self {
        let (l, motions) = sums.factor(line, used);
        let channels = 0..sums.channels();
        let products = channels
            .clone()
            .map(|c| sums.conditioned(line, c, used, &l));
        Self {
            motions,
            products: products.collect(),
            power: channels.map(|c| sums.with(line, c, SIX).re).collect(),
        }
    }

    /// Product of the parts of two channels that the accelerations explain.
    fn explained(&self, a: usize, b: usize) -> Complex<f64> {
        let parts = self.products[a].iter().zip(&self.products[b]);
        let parts = parts.zip(&self.motions).filter(|(_, power)| **power > 0.0);
        parts.map(|((x, y), power)| x * y.conj() / *power).sum()
    }

    /// Power of the rest of a channel.
    fn left(&self, channel: usize) -> f64 {
        (self.power[channel] - self.explained(channel, channel).re).max(0.0)
    }
}

impl Sink for Distortions<'_> {
    fn channels(&self) -> Vec<Signal<'_>> {
        let first = match &self.tested {
            Tested::Accelerometers(_) => SIX,
            _ => 0,
        };
        let resultants = (0..RESULTANTS).map(|r| (first + r) % RESULTANTS);
        let resultants = resultants.map(|r| Signal::Resultant(self.geometry, r));
        let cells = self.tested.channels().iter();
        let cells = cells.map(|channel| Signal::Channel(*channel, 1.0));
        let (first, signals) = self.tested.signals();
        let first = SIX + first;
        let of = |signal| Power::ALL.map(|power| Signal::Power(signal, power));
        let powers = (first..first + signals).flat_map(of);
        resultants.chain(cells).chain(powers).collect()
    }

    fn add(&mut self, block: &Seen<'_>) {
        self.sums.add_channels(&|c| block.channel(c));
        let lines = |c: usize| {
            let lines = block.channel(self.drives + SIX + c).get(self.band.clone());
            lines.unwrap_or_default()
        };
        let (first, signals) = self.tested.signals();
        let powers = signals * POWERS;
        for power in 0..powers {
            let signal = lines(first + power / POWERS).iter();
            let pairs = signal.zip(lines(first + signals + power));
            for (own, (x, c)) in self.own.chunks_exact_mut(powers).zip(pairs) {
                own[power] += wide(x) * wide(c).conj();
            }
        }
        for (cell, with) in self.with_forces.iter_mut().enumerate() {
            for (force, with) in with.iter_mut().enumerate() {
                let pairs = lines(SIX + cell).iter().zip(lines(force));
                *with += pairs
                    .map(|(x, f)| (wide(x) * wide(f).conj()).re)
                    .sum::<f64>();
            }
        }
    }
}

/// Reads the random runs of a setup once more, for each load cell and each accelerometer on the interface by itself.
/// `limit` is that of the measurement.
///
/// # Errors
/// [`MeasureError`] that names file, line and channel.
pub(crate) fn sensor_distortions(
    setup: &Setup,
    measurement: &Measurement,
    limit: Option<u64>,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Vec<SensorDistortions>, MeasureError> {
    let mut settings = measurement.runs.first().map(|run| *run.settings());
    let mounts = setup.accelerometers.iter().map(|entry| entry.mount);
    let interface = mounts
        .enumerate()
        .filter(|(_, mount)| *mount == Mount::Interface);
    let interface: Vec<usize> = interface.map(|(number, _)| number).collect();
    let mut all = Vec::new();
    for (number, run) in setup.runs.iter().enumerate() {
        if run.excitation != Excitation::Random {
            continue;
        }
        let mut report = |share| progress(Progress::of(setup, number, share));
        let geometry = survey::geometry(setup, number)?;
        let mut opened = Opened::new(setup, number, limit, &mut settings, &mut |_| Ok(()))?;
        let (band, drives) = (opened.band()?.indices(), opened.drives.len());
        let cells = (geometry.accelerometers()..geometry.columns.len()).collect();
        let of = |tested| Distortions::of(&geometry, tested, band.clone(), drives);
        let mut cells = of(Tested::Cells(cells));
        let mut others = of(Tested::Accelerometers(interface.clone()));
        opened.read(&mut [&mut cells, &mut others], &Idle::none(), &mut report)?;
        let mut accelerometers = others.finish(&opened.settings);
        for found in &mut accelerometers {
            found.signal = interface.get(found.signal).copied().unwrap_or_default();
        }
        all.push(SensorDistortions {
            run: number,
            cells: cells.finish(&opened.settings),
            carried: cells.carried(),
            accelerometers,
        });
    }
    Ok(all)
}
