//! The set-up: pieces as they come in, and the whole once it has been checked.

use super::limits::{about, below, finite, fits, range, within};
use super::memory::{BLOCK_LENGTH, CHANNELS, LINES, RUNS, SENSORS, TRANSFORM};
use crate::calibration;
use crate::geometry::{
    self, Accelerometer, GeometryError, LoadCell, Placement, RunGeometry, RunSensor,
};
use crate::masslines::MIN_LINES;
use crate::spectra::{self, BlockSettings, SpectraError};
use crate::weighting::{join_peaks, weights_from_peaks};
use crate::wire::{
    Accelerations, Carries, Exact, Excitation, Field, Grid, Item, Mount, NAME_MAX, Plan, Problem,
    Processing, Quantity, Run, Scale, Sensor, SensorKind, Weighting, Weights, Window,
};
use core::ops::Range;
use nalgebra::Vector3;

/// Highest sample rate that is believed, Hz.
const SAMPLE_RATE_MAX: f64 = 1e6;

const NO_PLAN: Plan = Plan {
    sensors: 0,
    runs: 0,
    reference_point: [0.0; 3],
    fingerprint: 0,
};

/// A sensor as it was sent.
#[derive(Clone, Copy, Debug)]
struct SensorPiece {
    kind: SensorKind,
    position: [f64; 3],
    direction: [f64; 3],
    scale: Scale,
}

impl SensorPiece {
    fn accelerometer(&self) -> Option<Mount> {
        match self.kind {
            SensorKind::Accelerometer(mount) => Some(mount),
            SensorKind::LoadCell(_) => None,
        }
    }

    fn geometry(&self, weight: f64) -> Result<RunSensor, GeometryError> {
        let (position, direction) = (self.position.into(), self.direction.into());
        Ok(match self.kind {
            SensorKind::Accelerometer(mount) => {
                let mount = match mount {
                    Mount::Interface => geometry::Mount::Interface,
                    Mount::Structure => geometry::Mount::Structure,
                };
                let sensor = Accelerometer::new(position, direction, mount)?;
                RunSensor::Accelerometer(sensor, weight)
            }
            SensorKind::LoadCell(quantity) => {
                let quantity = match quantity {
                    Quantity::Force => geometry::Quantity::Force,
                    Quantity::Moment => geometry::Quantity::Moment,
                };
                RunSensor::LoadCell(LoadCell::new(position, direction, quantity)?)
            }
        })
    }
}

/// A run as it was sent.
#[derive(Clone, Debug)]
struct RunPiece {
    placement: Placement,
    channels: heapless::Vec<u8, CHANNELS>,
}

/// How samples become lines: what follows from the processing.
#[derive(Clone, Debug)]
pub(super) struct Lines {
    /// Blocks, window and kept lines.
    pub(super) settings: BlockSettings,
    /// The averaging band, as kept lines.
    pub(super) band: Range<usize>,
    /// The mode band, as kept lines.
    pub(super) modes: Option<Range<usize>>,
}

/// A set-up.
#[derive(Debug)]
pub(super) struct SetUp {
    plan: Plan,
    processing: Option<Processing>,
    sensors: [Option<SensorPiece>; SENSORS],
    runs: [Option<RunPiece>; RUNS],
    weights: [[f64; SENSORS]; RUNS],
    /// Runs whose weights were given, or found by a survey.
    weighted: [bool; RUNS],
    peaks: [[f64; SENSORS]; RUNS],
    surveyed: [bool; RUNS],
}

impl SetUp {
    /// None of its pieces are there yet.
    pub(super) const fn new() -> Self {
        Self {
            plan: NO_PLAN,
            processing: None,
            sensors: [const { None }; SENSORS],
            runs: [const { None }; RUNS],
            weights: [[1.0; SENSORS]; RUNS],
            weighted: [false; RUNS],
            peaks: [[0.0; SENSORS]; RUNS],
            surveyed: [false; RUNS],
        }
    }

    /// Forgets all pieces, and begins anew.
    pub(super) fn begin(&mut self, plan: &Plan) -> Result<(), Problem> {
        fits(Item::Sensor, usize::from(plan.sensors), SENSORS)?;
        fits(Item::Run, usize::from(plan.runs), RUNS)?;
        for x in plan.reference_point {
            finite(Field::ReferencePoint, 0, x)?;
        }
        self.clear();
        self.plan = *plan;
        Ok(())
    }

    /// Forgets all pieces.
    pub(super) fn clear(&mut self) {
        self.plan = NO_PLAN;
        self.processing = None;
        for sensor in &mut self.sensors {
            *sensor = None;
        }
        for run in &mut self.runs {
            *run = None;
        }
        self.weights.as_flattened_mut().fill(1.0);
        self.weighted = [false; RUNS];
        self.peaks.as_flattened_mut().fill(0.0);
        self.surveyed = [false; RUNS];
    }

    pub(super) fn fingerprint(&self) -> u32 {
        self.plan.fingerprint
    }

    pub(super) fn reference(&self) -> Vector3<f64> {
        self.plan.reference_point.into()
    }

    /// Number of sensors.
    pub(super) fn sensors(&self) -> usize {
        usize::from(self.plan.sensors)
    }

    pub(super) fn set_processing(&mut self, p: &Processing) -> Result<(), Problem> {
        lines(p)?;
        within(Field::MinimumWeight, 0, p.minimum_weight, 0.0, 1.0)?;
        self.processing = Some(*p);
        Ok(())
    }

    pub(super) fn set_sensor(&mut self, sensor: &Sensor<'_>) -> Result<(), Problem> {
        let at = below(Item::Sensor, sensor.sensor, self.plan.sensors)?;
        let index = u32::from(sensor.sensor);
        fits(Item::Byte, sensor.name.len(), NAME_MAX)?;
        for x in sensor.position {
            finite(Field::Position, index, x)?;
        }
        let length = Vector3::from(sensor.direction).norm();
        if !(length > 0.0 && length.is_finite()) {
            let (low, high) = (f64::MIN_POSITIVE, f64::MAX);
            return Err(range(Field::Direction, index, length, low, high));
        }
        calibration::Scale::given(&sensor.scale).map_err(|problem| about(problem, index))?;
        let piece = SensorPiece {
            kind: sensor.kind,
            position: sensor.position,
            direction: sensor.direction,
            scale: sensor.scale,
        };
        if let Some(slot) = self.sensors.get_mut(at) {
            *slot = Some(piece);
        }
        Ok(())
    }

    pub(super) fn set_run(&mut self, run: &Run<'_>) -> Result<(), Problem> {
        let at = below(Item::Run, run.run, self.plan.runs)?;
        let index = u32::from(run.run);
        fits(Item::Byte, run.name.len(), NAME_MAX)?;
        if run.excitation != Excitation::Random {
            return Err(Problem::Unsupported(Item::Excitation));
        }
        for x in run.rotation {
            finite(Field::Rotation, index, x)?;
        }
        for x in run.translation {
            finite(Field::Translation, index, x)?;
        }
        let Ok(placement) = Placement::new(run.rotation.into(), run.translation.into()) else {
            return Err(range(Field::Rotation, index, f64::NAN, f64::MIN, f64::MAX));
        };
        fits(Item::Channel, run.channels.len(), CHANNELS)?;
        for carried in run.carries() {
            match carried {
                Carries::Sensor(sensor) => {
                    below(Item::Sensor, sensor, self.plan.sensors)?;
                    once(run, carried, Item::Sensor)?;
                }
                Carries::Drive => once(run, carried, Item::Drive)?,
                Carries::Nothing => {}
            }
        }
        if run.drive().is_none() {
            // The cross-spectral matrix of 100 lines would take 112 KiB a run.
            return Err(Problem::Missing {
                item: Item::Drive,
                index,
            });
        }
        let channels = heapless::Vec::from_slice(run.channels).unwrap_or_default();
        if let Some(slot) = self.runs.get_mut(at) {
            *slot = Some(RunPiece {
                placement,
                channels,
            });
        }
        Ok(())
    }

    pub(super) fn set_weights(&mut self, weights: &Weights<'_>) -> Result<(), Problem> {
        let at = below(Item::Run, weights.run, self.plan.runs)?;
        let (found, expected) = (weights.weights.len(), self.sensors());
        if found != expected {
            return Err(Problem::Count {
                item: Item::Weight,
                found: found as u32,
                expected: expected as u32,
            });
        }
        for (sensor, weight) in weights.weights.iter().enumerate() {
            let accelerometer = self
                .piece(sensor)
                .is_none_or(|p| p.accelerometer().is_some());
            if accelerometer {
                within(Field::Weight, sensor as u32, weight, 0.0, f64::MAX)?;
            }
        }
        if let Some(all) = self.weights.get_mut(at) {
            for (slot, weight) in all.iter_mut().zip(weights.weights.iter()) {
                *slot = weight;
            }
        }
        if let Some(known) = self.weighted.get_mut(at) {
            *known = true;
        }
        Ok(())
    }

    /// Checks the whole. `geometry` serves for trying.
    pub(super) fn end(&self, geometry: &mut RunGeometry) -> Result<Lines, Problem> {
        let missing = |item, index: usize| Problem::Missing {
            item,
            index: index as u32,
        };
        let processing = self.processing.ok_or(missing(Item::Processing, 0))?;
        for sensor in 0..self.sensors() {
            self.piece(sensor).ok_or(missing(Item::Sensor, sensor))?;
        }
        for run in 0..usize::from(self.plan.runs) {
            let piece = self.run(run).ok_or(missing(Item::Run, run))?;
            for sensor in 0..self.sensors() {
                let carried = piece.channels.iter().any(|&c| usize::from(c) == sensor);
                if !carried {
                    return Err(missing(Item::Channel, sensor));
                }
            }
            self.geometry(run, processing.accelerations, geometry)?;
        }
        if self.plan.runs == 0 {
            return Err(missing(Item::Run, 0));
        }
        lines(&processing)
    }

    fn piece(&self, sensor: usize) -> Option<&SensorPiece> {
        self.sensors.get(sensor)?.as_ref()
    }

    fn run(&self, run: usize) -> Option<&RunPiece> {
        self.runs.get(run)?.as_ref()
    }

    /// Number of a run of this set-up as an index.
    pub(super) fn run_index(&self, run: u8) -> Result<usize, Problem> {
        below(Item::Run, run, self.plan.runs)
    }

    /// What each channel of a run's samples carries: codes of [`Carries`].
    pub(super) fn channels(&self, run: usize) -> &[u8] {
        self.run(run).map_or(&[], |r| &r.channels)
    }

    /// A sensor as geometry, with weight one.
    pub(super) fn sensor(&self, sensor: usize) -> Option<RunSensor> {
        self.piece(sensor)?.geometry(1.0).ok()
    }

    /// How the specimen stands in a run.
    pub(super) fn placement(&self, run: usize) -> Placement {
        self.run(run).map(|r| r.placement).unwrap_or_default()
    }

    /// How a sensor's readings become SI.
    pub(super) fn scale(&self, sensor: usize) -> Option<Scale> {
        self.piece(sensor).map(|p| p.scale)
    }

    /// Numbers of the accelerometers, ascending.
    pub(super) fn accelerometers(&self) -> impl Iterator<Item = usize> + Clone + '_ {
        let accelerates = |s: &usize| self.piece(*s).is_some_and(|p| p.accelerometer().is_some());
        (0..self.sensors()).filter(accelerates)
    }

    /// The accelerometers that a measuring pass uses.
    pub(super) fn accelerations(&self) -> Accelerations {
        self.processing
            .map_or(Accelerations::Interface, |p| p.accelerations)
    }

    /// Hz.
    pub(super) fn sample_rate(&self) -> f64 {
        self.processing.map_or(0.0, |p| p.sample_rate)
    }

    /// The geometry of a run with the weights as they are now.
    pub(super) fn geometry(
        &self,
        run: usize,
        accelerations: Accelerations,
        into: &mut RunGeometry,
    ) -> Result<(), Problem> {
        let weights = self.weights.get(run);
        let weight = |sensor: usize, piece: &SensorPiece| match accelerations {
            Accelerations::Interface => {
                f64::from(u8::from(piece.accelerometer() == Some(Mount::Interface)))
            }
            Accelerations::All => 1.0,
            Accelerations::Weighted => weights.and_then(|w| w.get(sensor)).copied().unwrap_or(1.0),
        };
        let sensors = (0..self.sensors()).filter_map(|sensor| {
            let piece = self.piece(sensor)?;
            // Each was checked when it came.
            piece.geometry(weight(sensor, piece)).ok()
        });
        let placement = self.placement(run);
        let index = run as u32;
        let found = into.describe(sensors, &placement, &self.reference(), |_| ());
        found.map_err(|e| match e {
            GeometryError::NoAccelerometer => Problem::Missing {
                item: Item::Accelerometer,
                index,
            },
            GeometryError::NoLoadCell => Problem::Missing {
                item: Item::LoadCell,
                index,
            },
            GeometryError::Weight => range(Field::Weight, index, f64::NAN, 0.0, f64::MAX),
            GeometryError::Direction => range(
                Field::Direction,
                index,
                f64::NAN,
                f64::MIN_POSITIVE,
                f64::MAX,
            ),
            GeometryError::TooManyChannels => Problem::Capacity {
                item: Item::Sensor,
                found: self.sensors() as u32,
                limit: SENSORS as u32,
            },
        })
    }

    /// Whether a run may be measured: its weights are known, where they count.
    pub(super) fn may_measure(&self, run: usize) -> Result<(), Problem> {
        let needs = self.processing.is_some_and(|p| {
            p.accelerations == Accelerations::Weighted && p.weighting != Weighting::Given
        });
        if needs && !self.weighted.get(run).copied().unwrap_or(false) {
            return Err(Problem::Missing {
                item: Item::Survey,
                index: run as u32,
            });
        }
        Ok(())
    }

    /// Weights of a run, one a sensor.
    pub(super) fn weights(&self, run: usize) -> &[f64] {
        let all = self.weights.get(run).map_or(&[][..], |w| &w[..]);
        all.get(..self.sensors()).unwrap_or(all)
    }

    /// What the survey of a run found, one number a sensor; `None` before it.
    pub(super) fn peaks(&self, run: usize) -> Option<&[f64]> {
        if !*self.surveyed.get(run)? {
            return None;
        }
        self.peaks.get(run)?.get(..self.sensors())
    }

    /// Bit k: run k was surveyed.
    pub(super) fn surveyed(&self) -> u32 {
        mask(self.surveyed)
    }

    /// Keeps what a survey found, and sets weights by it as the processing says.
    pub(super) fn set_peaks(&mut self, run: usize, peaks: &[f64; SENSORS]) {
        let (Some(slot), Some(surveyed)) = (self.peaks.get_mut(run), self.surveyed.get_mut(run))
        else {
            return;
        };
        *slot = *peaks;
        *surveyed = true;
        let Some(processing) = self.processing else {
            return;
        };
        match processing.weighting {
            Weighting::Given => {}
            Weighting::EachRun => {
                self.weigh(run..run + 1, peaks, processing.minimum_weight);
            }
            Weighting::Joined => {
                let mut joined = [0.0; SENSORS];
                let found = self.peaks.iter().zip(&self.surveyed);
                for (peaks, _) in found.filter(|(_, surveyed)| **surveyed) {
                    join_peaks(&mut joined, peaks);
                }
                self.weigh(
                    0..usize::from(self.plan.runs),
                    &joined,
                    processing.minimum_weight,
                );
            }
        }
    }

    /// Sets the weights of `runs` from peaks by sensor number.
    fn weigh(&mut self, runs: Range<usize>, peaks: &[f64; SENSORS], minimum: f64) {
        let mut list: heapless::Vec<f64, SENSORS> = self
            .accelerometers()
            .filter_map(|s| peaks.get(s).copied())
            .collect();
        weights_from_peaks(&mut list, minimum);
        let mut weights = [1.0; SENSORS];
        for (sensor, weight) in self.accelerometers().zip(list) {
            if let Some(slot) = weights.get_mut(sensor) {
                *slot = weight;
            }
        }
        for run in runs {
            if let (Some(slot), Some(known)) =
                (self.weights.get_mut(run), self.weighted.get_mut(run))
            {
                *slot = weights;
                *known = true;
            }
        }
    }
}

/// Lines of a processing, or what is wrong with it.
fn lines(p: &Processing) -> Result<Lines, Problem> {
    within(
        Field::SampleRate,
        0,
        p.sample_rate,
        f64::MIN_POSITIVE,
        SAMPLE_RATE_MAX,
    )?;
    let length = p.block_length as usize;
    if length > BLOCK_LENGTH || !length.is_power_of_two() || length < 16 {
        let most = BLOCK_LENGTH as f64;
        return Err(range(Field::BlockLength, 0, length as f64, 16.0, most));
    }
    let nyquist = p.sample_rate / 2.0;
    let bands = [
        (Field::KeptBand, Some(p.kept_band)),
        (Field::AveragingBand, Some(p.averaging_band)),
        (Field::ModeBand, p.mode_band),
    ];
    for (field, band) in bands {
        if let Some([low, high]) = band {
            within(field, 0, low, 0.0, nyquist)?;
            within(field, 0, high, low, nyquist)?;
        }
    }
    let window = match p.window {
        Window::Rectangular => spectra::Window::Rectangular,
        Window::Hann => spectra::Window::Hann,
        Window::Hamming => spectra::Window::Hamming,
        Window::Blackman => spectra::Window::Blackman,
        Window::BlackmanHarris => spectra::Window::BlackmanHarris,
        Window::FlatTop => spectra::Window::FlatTop,
    };
    let settings = BlockSettings::new(length, p.overlap, window, p.sample_rate, p.kept_band);
    let settings = settings.map_err(|e| match e {
        SpectraError::BlockLength(found) => {
            let most = BLOCK_LENGTH as f64;
            range(Field::BlockLength, 0, found as f64, 16.0, most)
        }
        SpectraError::Overlap(found) => range(Field::Overlap, 0, found, 0.0, 0.95),
        SpectraError::Band { last, usable, .. } => {
            let spacing = p.sample_rate / length as f64;
            let [found, high] = [last, usable].map(|line| line as f64 * spacing);
            range(Field::KeptBand, 0, found, spacing, high)
        }
        SpectraError::Storage { needed, given } => Problem::Capacity {
            item: Item::Line,
            found: needed as u32,
            limit: given as u32,
        },
    })?;
    let grid = settings.grid();
    fits(Item::Line, grid.count, LINES)?;
    // Lines far up in the spectrum leave less to decimate, so that a block takes more room.
    fits(Item::Sample, settings.transform_length(), TRANSFORM)?;
    let band = grid.within(p.averaging_band[0], p.averaging_band[1]);
    if band.len() < MIN_LINES {
        return Err(Problem::Count {
            item: Item::Line,
            found: band.len() as u32,
            expected: MIN_LINES as u32,
        });
    }
    let modes = p.mode_band.map(|[low, high]| grid.within(low, high));
    if modes.as_ref().is_some_and(Range::is_empty) {
        return Err(Problem::Missing {
            item: Item::ModeBand,
            index: 0,
        });
    }
    Ok(Lines {
        settings,
        band,
        modes,
    })
}

impl Lines {
    /// As the host is told.
    pub(super) fn grid(&self) -> Grid {
        let grid = self.settings.grid();
        Grid {
            first: grid.first as u32,
            count: grid.count as u32,
            spacing: Exact(grid.spacing),
            hop: self.settings.hop() as u32,
            band: [self.band.start as u32, self.band.end as u32],
        }
    }
}

/// Each sensor, and the drive, has one channel.
fn once(run: &Run<'_>, carried: Carries, item: Item) -> Result<(), Problem> {
    match run.carries().filter(|c| *c == carried).count() {
        1 => Ok(()),
        found => Err(Problem::Count {
            item,
            found: found as u32,
            expected: 1,
        }),
    }
}

/// Bits of the flags that are set.
pub(super) fn mask(flags: impl IntoIterator<Item = bool>) -> u32 {
    flags
        .into_iter()
        .enumerate()
        .filter(|(_, flag)| *flag)
        .fold(0, |bits, (k, _)| bits | 1 << k)
}
