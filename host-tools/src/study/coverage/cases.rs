//! The tests whose intervals are counted.

use crate::simulate::{Measurement, Model, ModelError, Plan, Resonance, Shaking, Table};
use crate::study::chance::Chance;
use crate::study::structures::{Structure, elastic, load_cells, motion_sensors};
use crate::study::trial::Conditions;
use massline_core::masslines::Method;
use massline_core::spectra::{BlockSettings, SpectraError};
use std::path::Path;

/// Data from which a case is drawn.
pub(in crate::study) type Drawn = Result<(Model, Conditions), CaseError>;

/// Why a case cannot be drawn: a fault of this program.
#[derive(Debug, thiserror::Error)]
pub enum CaseError {
    /// A model that the program carries with it cannot be read.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Blocks that do not suit the recording.
    #[error(transparent)]
    Spectra(#[from] SpectraError),
}

/// One kind of test.
pub(super) struct Case {
    /// As given to `--case`.
    pub(super) name: &'static str,
    /// Description, one sentence.
    pub(super) what: &'static str,
    /// Methods that apply; `None` is the recommended one.
    pub(super) methods: &'static [Option<Method>],
    /// The model and how it is recorded, from the choices of one draw.
    pub(super) draw: fn(&mut Chance) -> Drawn,
}

const RECOMMENDED: &[Option<Method>] = &[None];
const THREE: &[Option<Method>] = &[
    None,
    Some(Method::FreeResponsesSquared),
    Some(Method::Synthesis),
];

/// All cases, in the order of the table.
pub(super) const CASES: [Case; 11] = [
    Case {
        name: "fork",
        what: "the tuning fork, plane: three runs of 40 s with a drive channel, 512 samples a block at 256 Hz, all sensors alike",
        methods: THREE,
        draw: fork,
    },
    Case {
        name: "satellite",
        what: "the satellite of 800 kg on a six-axis table: six runs of 40 s with a drive channel, all sensors alike",
        methods: THREE,
        draw: satellite,
    },
    Case {
        name: "elastic",
        what: "a random elastic structure and random sensors in each draw, 5 to 500 kg, first mode at two to three times the band's end: six runs of 40 s with a drive channel, sensors' noise unlike up to four times",
        methods: THREE,
        draw: elastic_structure,
    },
    Case {
        name: "remounted",
        what: "the satellite on a vertical shaker, mounted three ways with random angles and shifts: three runs of 40 s with a drive channel, sensors' noise unlike",
        methods: RECOMMENDED,
        draw: remounted,
    },
    Case {
        name: "sine",
        what: "the satellite under stepped sine: six runs, 2 to 75 Hz in steps of 0.5 Hz, each reading once, noise of a share of each channel's RMS in the averaging band",
        methods: THREE,
        draw: sine,
    },
    Case {
        name: "poses",
        what: "a random body, 24 static poses with random tilts, load cells with offsets, sensors' noise unlike",
        methods: RECOMMENDED,
        draw: poses,
    },
    Case {
        name: "no-drive",
        what: "the satellite, six runs of 40 s, the drive not recorded",
        methods: THREE,
        draw: no_drive,
    },
    Case {
        name: "few-lines",
        what: "the satellite, six runs of 40 s, the drive not recorded, an averaging band of seven lines, 5 to 8 Hz",
        methods: RECOMMENDED,
        draw: few_lines,
    },
    Case {
        name: "unseen-modes",
        what: "the satellite, six runs of 40 s, the drive not recorded, an averaging band of 15 to 20 Hz and a mode band of 21 to 30 Hz, below its first mode at 37.5 Hz",
        methods: RECOMMENDED,
        draw: unseen_modes,
    },
    Case {
        name: "vertical-cells",
        what: "the satellite on four vertical load cells, runs along z, about x and about y of 40 s with a drive channel: the table leaks into the other axes by 2 %, more towards its resonance",
        methods: RECOMMENDED,
        draw: vertical_cells,
    },
    Case {
        name: "twelve-blocks",
        what: "the satellite, six runs of 12 blocks (13 s) with a drive channel",
        methods: THREE,
        draw: twelve_blocks,
    },
];

/// Samples per second, Hz.
const RATE: f64 = 256.0;
/// Samples of one transform.
const BLOCK: usize = 512;
/// Length of a run, s.
const DURATION: f64 = 40.0;

fn shorter(measurement: &mut Measurement) {
    measurement.sample_rate = RATE;
    measurement.block_length = BLOCK;
    measurement.duration = DURATION;
}

pub(in crate::study) fn fork(_: &mut Chance) -> Drawn {
    let mut model = Model::fork()?;
    shorter(&mut model.measurement);
    Ok((model, Conditions::default()))
}

fn satellite_model() -> Result<Model, ModelError> {
    const SATELLITE: &str = include_str!("../../../models/satellite.toml");
    let mut model = Model::from_toml(SATELLITE, Path::new("satellite.toml"))?;
    shorter(&mut model.measurement);
    Ok(model)
}

pub(in crate::study) fn satellite(_: &mut Chance) -> Drawn {
    Ok((satellite_model()?, Conditions::default()))
}

fn unlike() -> Conditions {
    Conditions {
        unlike: 4.0,
        ..Conditions::default()
    }
}

/// The averaging band of random structures, Hz.
const BAND: [f64; 2] = [2.0, 20.0];

pub(in crate::study) fn elastic_structure(chance: &mut Chance) -> Drawn {
    let first = BAND[1] * chance.between(2.0, 3.0);
    let structure = elastic(chance, first);
    Ok((six_runs(chance, &structure), unlike()))
}

/// Six runs, one for each axis, on random sensors.
fn six_runs(chance: &mut Chance, structure: &Structure) -> Model {
    let radius = structure.size * chance.between(0.3, 0.5);
    let first = structure.specimen.modes.first().map(|mode| mode.frequency);
    let level = chance.between(0.5, 3.0);
    let runs = (0..6)
        .map(|axis| {
            let mut motion = [0.0; 6];
            // The ring's sensors move about as much when it turns as when it moves.
            motion[axis] = match axis {
                0..3 => level,
                _ => level / radius * chance.between(0.5, 1.5),
            };
            Plan::new(format!("axis {}", axis + 1), Shaking::random(motion, true))
        })
        .collect();
    Model {
        title: "Random elastic structure".to_owned(),
        reference_point: [0.0; 3],
        specimen: structure.specimen.clone(),
        accelerometers: motion_sensors(chance, structure, radius),
        load_cells: load_cells(chance, radius),
        table: Table {
            cross_talk: chance.between(0.0, 0.05),
            resonance: Some(Resonance {
                frequency: chance.between(90.0, 150.0),
                damping: 0.05,
            }),
            lever_arm: radius,
            internal_forces: 0.1,
            ..Table::default()
        },
        measurement: Measurement {
            sample_rate: RATE,
            duration: DURATION,
            noise: 0.0,
            dc_offset: 0.0,
            block_length: BLOCK,
            overlap: 0.5,
            averaging_band: BAND,
            mode_band: first.map(|f| [0.85 * f, 100.0]),
            rigid_up_to: None,
        },
        runs,
    }
}

pub(in crate::study) fn remounted(chance: &mut Chance) -> Drawn {
    let mut model = satellite_model()?;
    model.table.axes = [false, false, true, false, false, false];
    model.table.cross_talk = 0.0;
    model.table.resonance = None;
    let ways = [
        ("upright", [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
        ("on its side", [90.0, 0.0, 0.0], [0.05, 0.92, 0.75]),
        ("on its back", [0.0, 90.0, 0.0], [-0.90, -0.04, 0.80]),
    ];
    model.runs = ways
        .map(|(name, rotation, translation)| Plan {
            name: name.to_owned(),
            excitation: Shaking::random([0.0, 0.0, 2.0, 0.0, 0.0, 0.0], true),
            rotation: rotation.map(|angle: f64| angle + chance.between(-10.0, 10.0)),
            translation: translation.map(|x: f64| x + chance.between(-0.1, 0.1)),
        })
        .into();
    Ok((model, unlike()))
}

pub(in crate::study) fn sine(_: &mut Chance) -> Drawn {
    let conditions = Conditions {
        sines: (4..=150).map(|k| 0.5 * f64::from(k)).collect(),
        ..Conditions::default()
    };
    Ok((satellite_model()?, conditions))
}

pub(in crate::study) fn poses(chance: &mut Chance) -> Drawn {
    let structure = crate::study::structures::rigid(chance);
    let mut model = six_runs(chance, &structure);
    let tilts = (0..24)
        .map(|_| {
            let turn = chance.direction() * chance.between(10.0, 170.0);
            turn.into()
        })
        .collect();
    model.runs = vec![Plan::new("poses", Shaking::Poses(tilts))];
    model.measurement.dc_offset = 0.02;
    Ok((model, unlike()))
}

fn no_drive(_: &mut Chance) -> Drawn {
    let mut model = satellite_model()?;
    for run in &mut model.runs {
        if let Shaking::Random { drive, .. } = &mut run.excitation {
            *drive = false;
        }
    }
    Ok((model, Conditions::default()))
}

fn few_lines(chance: &mut Chance) -> Drawn {
    let (mut model, conditions) = no_drive(chance)?;
    model.measurement.averaging_band = [5.0, 8.0];
    Ok((model, conditions))
}

fn unseen_modes(chance: &mut Chance) -> Drawn {
    let (mut model, conditions) = no_drive(chance)?;
    model.measurement.averaging_band = [15.0, 20.0];
    model.measurement.mode_band = Some([21.0, 30.0]);
    Ok((model, conditions))
}

fn vertical_cells(_: &mut Chance) -> Drawn {
    let mut model = satellite_model()?;
    model
        .load_cells
        .retain(|cell| cell.direction == [0.0, 0.0, 1.0]);
    let told = ["Z", "about X", "about Y"];
    model.runs.retain(|run| told.contains(&run.name.as_str()));
    Ok((model, Conditions::default()))
}

fn twelve_blocks(_: &mut Chance) -> Drawn {
    let mut model = satellite_model()?;
    let m = &mut model.measurement;
    let highest = m.mode_band.map_or(m.averaging_band[1], |band| band[1]);
    let band = [m.averaging_band[0], highest];
    let settings = BlockSettings::new(
        m.block_length,
        m.overlap,
        crate::measure::WINDOW,
        m.sample_rate,
        band,
    )?;
    let samples = settings.support() + 11 * settings.hop();
    m.duration = samples as f64 / m.sample_rate;
    Ok((model, Conditions::default()))
}
