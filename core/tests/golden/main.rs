//! The numbers of one noisy test, to the last bit: samples of an elastic body through every method,
//! referred to a drive and without one, direct and iterative, with and without weights.
//!
//! Core computes the same bits on every machine, so that they can be written down. Other tests hold
//! them against the truth; this one notices that they change. Where a change is meant,
//! `MASSLINE_ACCEPT=1 cargo test -p massline-core --test golden` writes the new numbers, and the commit
//! says why.

mod specimen;

use massline_core::geometry::{Placement, RESULTANTS, ResultantMap, RunGeometry, RunSensor};
use massline_core::identify::{
    self, Identification, IdentifyError, Procedure, Question, identify_in,
};
use massline_core::masslines::{
    Bands, CrossLines, DriveLines, EquationWeights, Lines, Method, condense, excited_directions,
    fixed_modes, lines_between,
};
use massline_core::nalgebra::{Complex, Matrix6, Vector3};
use massline_core::spectra::{
    Average, BlockSettings, Blocks, Complex32, CrossAverage, CrossSums, DriveAverage, LineRange,
    RunResponses, Sum, Window,
};
use massline_core::weighting::{MINIMUM_WEIGHT, join_peaks, peak_response, weights_from_peaks};
use specimen::{ACCELEROMETERS, Specimen};
use std::fmt::Write as _;

const RUNS: usize = 6;
/// 15 blocks of 256 that overlap by half.
const SAMPLES: usize = 2048;
const SAMPLE_RATE: f64 = 512.0;

/// Settings, and the averaging band.
fn settings() -> (BlockSettings, LineRange) {
    let settings = BlockSettings::new(256, 0.5, Window::Hann, SAMPLE_RATE, [2.0, 80.0]).unwrap();
    (settings, settings.grid().within([4.0, 20.0]).unwrap())
}

/// Notes a value by a number (FNV-1a) that changes with any bit of it: spelt out, all of them would
/// be half a megabyte.
fn note(notes: &mut String, name: &str, value: &dyn std::fmt::Debug) {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for byte in format!("{value:?}").bytes() {
        hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    }
    let _ = writeln!(notes, "{name}: {hash:016x}");
}

/// Notes the ten numbers, and all that is said about them.
fn note_answer(notes: &mut String, name: &str, answer: &Result<Identification, IdentifyError>) {
    note(notes, name, answer);
    if let Ok(found) = answer {
        let ten = [found.mass]
            .into_iter()
            .chain(found.centre_of_gravity)
            .chain(found.inertia_cg);
        for (number, estimate) in ten.enumerate() {
            let gap = if number == 4 { "\n   " } else { "" };
            match estimate {
                Some(e) => write!(notes, "{gap} {} ± {},", e.value, e.std),
                None => write!(notes, "{gap} none,"),
            }
            .unwrap();
        }
        notes.push('\n');
    }
}

/// The averages of all runs.
struct Averages {
    map: ResultantMap,
    geometry: RunGeometry,
    drive: Vec<Vec<Sum>>,
    cross: Vec<Vec<CrossSums>>,
    blocks: u32,
}

impl Averages {
    fn new(specimen: &Specimen, weights: &[f64; ACCELEROMETERS]) -> Self {
        let (settings, _) = settings();
        let accelerometers = specimen.accelerometers.iter().zip(weights);
        let sensors = accelerometers
            .map(|(a, weight)| RunSensor::Accelerometer(*a, *weight))
            .chain(specimen.cells.iter().map(|c| RunSensor::LoadCell(*c)));
        let sensors: Vec<_> = sensors.collect();
        let geometry = RunGeometry::new(
            sensors,
            &Placement::default(),
            &Vector3::new(0.1, -0.05, 0.02),
        )
        .unwrap();
        let mut averages = Self {
            map: geometry.map.clone(),
            geometry,
            drive: vec![vec![Sum::ZERO; DriveAverage::storage_len(&settings, RESULTANTS)]; RUNS],
            cross: vec![vec![CrossSums::default(); settings.grid().count]; RUNS],
            blocks: 0,
        };
        for run in 0..RUNS {
            let (mut of_drive, mut of_runs) =
                (Stream::new(1 + RESULTANTS), Stream::new(RESULTANTS));
            let mut drive = of_drive.blocks(1 + RESULTANTS);
            let mut cross = of_runs.blocks(RESULTANTS);
            let mut drives =
                DriveAverage::new(&settings, RESULTANTS, &mut averages.drive[run]).unwrap();
            let mut crosses = CrossAverage::new(&settings, &mut averages.cross[run]).unwrap();
            for (signal, sample) in specimen.samples(run, SAMPLES) {
                let resultants = averages.map.apply(&sample);
                let mut all = [signal; 1 + RESULTANTS];
                all[1..].copy_from_slice(&resultants);
                if let Some(block) = drive.push(&all) {
                    drives.add(&block);
                }
                if let Some(block) = cross.push(&resultants) {
                    crosses.add(&block);
                }
            }
            assert_eq!(drives.blocks(), crosses.blocks());
            averages.blocks = drives.blocks();
        }
        averages
    }

    /// Lets `look` see the runs as responses to their drives.
    fn driven<R>(&mut self, look: impl FnOnce(&DriveLines<'_>) -> R) -> R {
        let (settings, band) = settings();
        let (grid, count) = (settings.grid(), settings.grid().count);
        let correlation = settings.window().block_correlation(0.5);
        let mut memory: Vec<_> = (0..RUNS)
            .map(|_| {
                (
                    vec![[Complex32::new(0.0, 0.0); RESULTANTS]; count],
                    vec![0.0; count],
                )
            })
            .collect();
        let mut runs = Vec::new();
        for (sums, (responses, drive)) in self.drive.iter_mut().zip(&mut memory) {
            let average = DriveAverage::resume(count, RESULTANTS, sums, self.blocks).unwrap();
            let run = RunResponses::finish(
                &average,
                grid,
                band,
                correlation,
                &self.map,
                responses,
                drive,
            );
            runs.push(run.unwrap());
        }
        look(&DriveLines::new(&runs, settings.window()).unwrap())
    }

    /// Lets `look` see the runs as cross-spectral matrices.
    fn undriven<R>(&mut self, look: impl FnOnce(&CrossLines<'_, '_>) -> R) -> R {
        let (settings, band) = settings();
        let blocks = self.blocks;
        let runs: Vec<_> = self
            .cross
            .iter_mut()
            .map(|sums| CrossAverage::resume(&settings, sums, blocks).unwrap())
            .collect();
        let maps = vec![self.map.clone(); RUNS];
        let lines = CrossLines::new(&runs, settings.grid(), band, settings.window(), 0.5, &maps);
        look(&lines.unwrap())
    }
}

/// Memory of the blocks of a stream.
struct Stream {
    history: Vec<f32>,
    work: Vec<Complex32>,
    lines: Vec<Complex32>,
}

impl Stream {
    fn new(channels: usize) -> Self {
        let (settings, _) = settings();
        let nothing = Complex32::new(0.0, 0.0);
        let [history, work, lines] = Blocks::<f32>::storage_len(&settings, channels);
        Self {
            history: vec![0.0; history],
            work: vec![nothing; work],
            lines: vec![nothing; lines],
        }
    }

    fn blocks(&mut self, channels: usize) -> Blocks<'_> {
        let (settings, _) = settings();
        Blocks::new(
            settings,
            channels,
            &mut self.history,
            &mut self.work,
            &mut self.lines,
        )
        .unwrap()
    }
}

/// Notes what a method finds in lines.
fn condensed(
    notes: &mut String,
    lines: &dyn Lines,
    geometry: &RunGeometry,
    method: Method,
    equations: EquationWeights,
    questions: &[Question],
) {
    let (_, band) = settings();
    let mut bands = Bands::new(band);
    bands.equations = equations;
    bands.modes = 2;
    let mut work = vec![Complex::new(0.0, 0.0); 2 * lines.count()];
    let name = method.name();
    let at = geometry.reference;
    let found = condense(method, lines, &bands, at, &geometry.equations, &mut work);
    let found = match found {
        Ok(found) => found,
        Err(why) => {
            let _ = writeln!(notes, "{name}: {why}");
            return;
        }
    };
    note(notes, name, &found.masslines);
    if let Some(fit) = &found.apparent_mass {
        note(notes, name, fit);
        note(notes, "at 12.5 Hz", &fit.at(12.5));
    }
    if let Some(modes) = &found.free_modes {
        note(notes, name, &modes.poles);
    }
    let mut space = identify::Workspace::EMPTY;
    for question in questions {
        let answer = identify_in(std::slice::from_ref(&found.masslines), question, &mut space);
        note_answer(notes, &format!("{name}, {question:?}"), &answer);
        note(notes, "covariance", &space.covariance());
    }
}

/// Notes what all methods find with such accelerations.
fn all_methods(notes: &mut String, averages: &mut Averages, interface_only: bool) {
    let geometry = averages.geometry.clone();
    let direct = Question::default();
    let iterative = Question::new(None, Procedure::ITERATIVE);
    let weighed = Question::new(Some(100.0), Procedure::Direct);
    let methods = Method::ALL
        .into_iter()
        .filter(|method| method.interface_only() == interface_only);
    for method in methods {
        averages.driven(|lines| {
            let questions = [direct, iterative, weighed];
            condensed(
                notes,
                lines,
                &geometry,
                method,
                EquationWeights::Noise,
                &questions,
            );
            condensed(
                notes,
                lines,
                &geometry,
                method,
                EquationWeights::Unit,
                &[iterative],
            );
        });
        averages.undriven(|lines| {
            notes.push_str("without a drive\n");
            condensed(
                notes,
                lines,
                &geometry,
                method,
                EquationWeights::Noise,
                &[direct],
            );
        });
    }
    let noted = |notes: &mut String, lines: &dyn Lines| {
        let (_, band) = settings();
        let fit = lines_between(lines, [4.0, 70.0]).unwrap();
        let mut work = vec![Complex::new(0.0, 0.0); 2 * lines.count()];
        let modes = fixed_modes(lines, band, fit, &geometry.equations, &mut work);
        note(notes, "fixed modes", &modes);
        for run in [0, 4] {
            note(notes, "noise", &lines.noise(run));
            let mut moments = massline_core::masslines::Moments::default();
            lines.add_moments(run, 9, 0.75, &mut moments);
            note(notes, "moments", &moments);
            let noise: Matrix6<f64> = lines.noise(run).acceleration;
            let powers = moments.aa.map(|z| z.re);
            note(notes, "excited", &excited_directions(&powers, &noise));
        }
    };
    averages.driven(|lines| noted(notes, lines));
    averages.undriven(|lines| noted(notes, lines));
}

/// Weights of the accelerometers from their responses to the drive in the band of the modes.
fn weights(specimen: &Specimen, notes: &mut String) -> [f64; ACCELEROMETERS] {
    let (settings, _) = settings();
    let band = settings.grid().within([24.0, 60.0]).unwrap();
    let mut joined = [0.0; ACCELEROMETERS];
    for run in 0..RUNS {
        let mut stream = Stream::new(1 + ACCELEROMETERS);
        let mut blocks = stream.blocks(1 + ACCELEROMETERS);
        let mut sums = vec![Sum::ZERO; DriveAverage::storage_len(&settings, ACCELEROMETERS)];
        let mut average = DriveAverage::new(&settings, ACCELEROMETERS, &mut sums).unwrap();
        for (signal, sample) in specimen.samples(run, SAMPLES) {
            let mut all = [signal; 1 + ACCELEROMETERS];
            all[1..].copy_from_slice(&sample[..ACCELEROMETERS]);
            if let Some(block) = blocks.push(&all) {
                average.add(&block);
            }
        }
        let peaks: [f64; ACCELEROMETERS] =
            std::array::from_fn(|c| peak_response(&average, c, band.indices()));
        note(notes, "peaks", &peaks);
        let coherence: [(f64, f32); ACCELEROMETERS] =
            std::array::from_fn(|c| (average.coherence(c, 20), average.mean_coherence(c, band)));
        note(notes, "coherence", &coherence);
        join_peaks(&mut joined, &peaks);
    }
    weights_from_peaks(&mut joined, MINIMUM_WEIGHT);
    note(notes, "weights", &joined);
    joined
}

#[test]
fn numbers_to_the_last_bit() {
    let specimen = Specimen::new();
    let mut found = String::from("== interface accelerometers\n");
    let mut interface = [1.0; ACCELEROMETERS];
    interface[ACCELEROMETERS - 2..].fill(0.0);
    all_methods(&mut found, &mut Averages::new(&specimen, &interface), true);
    found.push_str("== all accelerometers\n");
    all_methods(
        &mut found,
        &mut Averages::new(&specimen, &[1.0; ACCELEROMETERS]),
        false,
    );
    found.push_str("== weighted accelerometers\n");
    let weights = weights(&specimen, &mut found);
    all_methods(&mut found, &mut Averages::new(&specimen, &weights), false);
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/numbers.txt");
    if std::env::var_os("MASSLINE_ACCEPT").is_some_and(|value| value == "1") {
        std::fs::write(file, &found).unwrap();
    }
    let kept = std::fs::read_to_string(file).unwrap_or_default();
    for (line, (found, kept)) in (1..).zip(found.lines().zip(kept.lines())) {
        assert_eq!(found, kept, "{file}:{line}");
    }
    assert_eq!(
        found.len(),
        kept.len(),
        "{file} has other lines than were found"
    );
}
