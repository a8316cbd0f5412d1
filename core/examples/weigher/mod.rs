//! From samples to ten numbers in fixed memory: what `samples` runs on a host and `on_chip` builds
//! for a processor without an operating system.

use massline_core::geometry::{
    GeometryError, PackedNoise, Placement, RESULTANTS, RunGeometry, RunSensor,
};
use massline_core::identify::{self, Identification, IdentifyError, Question, identify_in};
use massline_core::masslines::{
    self, Bands, DriveLines, MasslineError, Masslines, Method, condense_into,
};
use massline_core::nalgebra::{Complex, Vector3};
use massline_core::spectra::{
    Average, BlockSettings, Complex32, DriveAverage, LineRange, Rings, RunResponses, SpectraError,
    Sum, Window,
};

/// Sample rate, Hz.
pub const SAMPLE_RATE: f64 = 256.0;
/// Runs, each with the table moving in another direction.
pub const RUNS: usize = 6;

const BLOCK_LENGTH: usize = 256;
const LINES: usize = 40;
/// The drive and the twelve resultants.
const CHANNELS: usize = 1 + RESULTANTS;
const HISTORY: usize = CHANNELS * 512;
const SUMS: usize = (1 + 3 * RESULTANTS) * LINES;
const NOTHING: Complex32 = Complex32::new(0.0, 0.0);

/// Reason why there is no answer.
#[derive(Debug)]
pub enum Refusal {
    /// The sensors.
    Sensors(GeometryError),
    /// The settings or the storage of the spectra.
    Spectra(SpectraError),
    /// The data, on their way to masslines.
    Masslines(MasslineError),
    /// The masslines.
    Identification(IdentifyError),
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Sensors(error) => error.fmt(f),
            Self::Spectra(error) => error.fmt(f),
            Self::Masslines(error) => error.fmt(f),
            Self::Identification(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for Refusal {}

macro_rules! refusal {
    ($($error:ty => $kind:ident),*) => {$(
        impl From<$error> for Refusal {
            fn from(error: $error) -> Self {
                Self::$kind(error)
            }
        }
    )*};
}

refusal!(
    GeometryError => Sensors,
    SpectraError => Spectra,
    MasslineError => Masslines,
    IdentifyError => Identification
);

/// Averages of one finished run.
#[derive(Clone, Copy)]
struct Stored {
    responses: [[Complex32; RESULTANTS]; LINES],
    drive: [f32; LINES],
    noise: PackedNoise,
    blocks: u32,
}

/// All memory of a test, some 100 KiB: a static on a chip.
pub struct Weigher {
    settings: BlockSettings,
    band: LineRange,
    geometry: RunGeometry,
    rings: Rings,
    history: [f32; HISTORY],
    work: [Complex32; BLOCK_LENGTH],
    sums: [Sum; SUMS],
    blocks: u32,
    stored: [Stored; RUNS],
    finished: usize,
    methods: masslines::Workspace,
    identification: identify::Workspace,
}

impl Weigher {
    /// A test with these sensors, m/s², N and N m in the order of the samples.
    ///
    /// # Errors
    /// [`Refusal::Sensors`] or [`Refusal::Spectra`].
    pub fn new(
        sensors: impl IntoIterator<Item = RunSensor, IntoIter: Clone>,
    ) -> Result<Self, Refusal> {
        let settings = BlockSettings::new(
            BLOCK_LENGTH,
            0.5,
            Window::Hann,
            SAMPLE_RATE,
            [1.0, LINES as f64],
        )?;
        let band = settings.grid().within([4.0, 30.0]);
        let mut history = [0.0; HISTORY];
        Ok(Self {
            settings,
            band: band.unwrap_or(LineRange::all(LINES)),
            geometry: RunGeometry::new(sensors, &Placement::default(), &Vector3::zeros())?,
            rings: Rings::new(settings, CHANNELS, &mut history)?,
            history,
            work: [NOTHING; BLOCK_LENGTH],
            sums: [Sum::ZERO; SUMS],
            blocks: 0,
            stored: [Stored {
                responses: [[NOTHING; RESULTANTS]; LINES],
                drive: [0.0; LINES],
                noise: [0.0; 42],
                blocks: 0,
            }; RUNS],
            finished: 0,
            methods: masslines::Workspace::EMPTY,
            identification: identify::Workspace::EMPTY,
        })
    }

    /// Takes one sample of the drive and of all sensors.
    ///
    /// # Errors
    /// [`Refusal::Spectra`] if the storage is too small for the settings.
    pub fn push(&mut self, drive: f32, sensors: &[f32]) -> Result<(), Refusal> {
        let mut sample = [drive; CHANNELS];
        sample[1..].copy_from_slice(&self.geometry.map.apply(sensors));
        if !self.rings.push(&mut self.history, &sample) {
            return Ok(());
        }
        let mut average = DriveAverage::resume(LINES, RESULTANTS, &mut self.sums, self.blocks)?;
        let (mut drive, mut response) = ([NOTHING; LINES], [NOTHING; LINES]);
        let mut transform = |channel: usize, lines: &mut [Complex32]| {
            let (history, work) = (&self.history, &mut self.work);
            self.rings.transform(channel, history, work, lines);
        };
        transform(0, &mut drive);
        average.add_drive(&drive);
        for c in 0..RESULTANTS {
            transform(1 + c, &mut response);
            average.add_response(c, &drive, &response);
        }
        self.blocks = average.blocks();
        Ok(())
    }

    /// Ends a run: keeps its averages, and begins the next one.
    ///
    /// # Errors
    /// [`Refusal::Spectra`].
    pub fn finish_run(&mut self) -> Result<(), Refusal> {
        let average = DriveAverage::resume(LINES, RESULTANTS, &mut self.sums, self.blocks)?;
        if let Some(stored) = self.stored.get_mut(self.finished) {
            let hop = self.settings.hop() as f64 / self.settings.block_length() as f64;
            let run = RunResponses::finish(
                &average,
                self.settings.grid(),
                self.band,
                self.settings.window().block_correlation(hop),
                &self.geometry.map,
                &mut stored.responses,
                &mut stored.drive,
            )?;
            (stored.noise, stored.blocks) = (run.noise, run.blocks);
            self.finished += 1;
        }
        self.sums.fill(Sum::ZERO);
        self.blocks = 0;
        self.rings.restart();
        Ok(())
    }

    /// The ten numbers, once all runs are there.
    ///
    /// # Errors
    /// [`Refusal::Masslines`] or [`Refusal::Identification`].
    pub fn identify(&mut self, method: Method) -> Result<Identification, Refusal> {
        let runs = self.stored.each_ref().map(|stored| RunResponses {
            grid: self.settings.grid(),
            responses: &stored.responses,
            drive: &stored.drive,
            noise: stored.noise,
            blocks: stored.blocks,
        });
        let (needed, found) = (RUNS, self.finished);
        let lines = DriveLines::new(&runs, self.settings.window())
            .filter(|_| found == needed)
            .ok_or(MasslineError::TooFewRuns { needed, found })?;
        let mut set: Masslines<6> = Masslines::new(Vector3::zeros(), self.geometry.equations);
        let mut work = [Complex::new(0.0, 0.0); 2 * LINES];
        let bands = Bands::new(self.band);
        condense_into(
            method,
            &lines,
            &bands,
            &mut set,
            &mut self.methods,
            &mut work,
        )?;
        Ok(identify_in(
            &[set],
            &Question::default(),
            &mut self.identification,
        )?)
    }
}
