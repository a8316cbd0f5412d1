//! The test in a model file: [table], [measurement] and [[run]].

use super::error::ModelError;
use super::model::{
    DEFAULT_DURATION, DEFAULT_SAMPLE_RATE, Measurement, Plan, Resonance, Shaking, Table,
};
use super::section::{Layers, Names, claim, positive, required_name, share};
use crate::setup::{
    BLOCK_LENGTHS, DEFAULT_BLOCK_LENGTH, DEFAULT_OVERLAP, OVERLAPS, Processing, Section,
};

/// Names of the table's axes in the order of the six accelerations.
const AXES: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

pub(super) fn table(layers: &Layers<'_>) -> Result<Table, ModelError> {
    let mut table = Table::default();
    let Some(section) = layers.with("table").section("table")? else {
        return Ok(table);
    };
    section.only(&[
        "axes",
        "cross_talk",
        "resonance",
        "lever_arm",
        "reference_point",
        "internal_forces",
    ])?;
    if let Some(words) = section.words("axes")? {
        table.axes = [false; 6];
        for word in words {
            match AXES.iter().position(|axis| *axis == word) {
                Some(axis) => table.axes[axis] = true,
                None => {
                    let expected = "some of \"x\", \"y\", \"z\", \"rx\", \"ry\", \"rz\"";
                    return Err(section
                        .unexpected("axes", format!("a list with \"{word}\""), expected)
                        .into());
                }
            }
        }
    }
    table.cross_talk = share(&section, "cross_talk")?;
    if let Some(resonance) = section.section("resonance")? {
        resonance.only(&["frequency", "damping"])?;
        table.resonance = Some(Resonance {
            frequency: positive(&resonance, "frequency")?,
            damping: positive(&resonance, "damping")?,
        });
    }
    if section.has("lever_arm") {
        table.lever_arm = positive(&section, "lever_arm")?;
    }
    table.reference_point = section.vector("reference_point")?.unwrap_or_default();
    table.internal_forces = share(&section, "internal_forces")?;
    Ok(table)
}

pub(super) fn measurement(layers: &Layers<'_>) -> Result<Measurement, ModelError> {
    let top = layers.with("measurement");
    let section = top
        .section("measurement")?
        .ok_or_else(|| top.missing("measurement", "a section with `averaging_band`"))?;
    section.only(&[
        "sample_rate",
        "duration",
        "noise",
        "dc_offset",
        "block_length",
        "overlap",
        "averaging_band",
        "mode_band",
    ])?;
    let or = |key, default| match section.has(key) {
        true => positive(&section, key),
        false => Ok(default),
    };
    let block_length = section.number_where(
        "block_length",
        "a power of two from 16 to 32768",
        |length| {
            let whole = length as usize;
            whole as f64 == length && whole.is_power_of_two() && BLOCK_LENGTHS.contains(&whole)
        },
    )?;
    let overlap = section.number_where("overlap", "a share from 0 to 0.95", |overlap| {
        OVERLAPS.contains(&overlap)
    })?;
    let band = |key| -> Result<Option<[f64; 2]>, ModelError> { ascending(&section, key) };
    let measurement = Measurement {
        sample_rate: or("sample_rate", DEFAULT_SAMPLE_RATE)?,
        duration: or("duration", DEFAULT_DURATION)?,
        noise: share(&section, "noise")?,
        dc_offset: share(&section, "dc_offset")?,
        block_length: block_length.map_or(DEFAULT_BLOCK_LENGTH, |length| length as usize),
        overlap: overlap.unwrap_or(DEFAULT_OVERLAP),
        averaging_band: band("averaging_band")?
            .ok_or_else(|| section.missing("averaging_band", "[low, high] in Hz"))?,
        mode_band: band("mode_band")?,
    };
    measurement
        .processing()
        .check_bands(measurement.sample_rate)
        .map_err(|source| ModelError::Band {
            place: section.place(),
            source,
        })?;
    Ok(measurement)
}

fn ascending(section: &Section<'_>, key: &'static str) -> Result<Option<[f64; 2]>, ModelError> {
    match section.vector::<2>(key)? {
        Some([low, high]) if low < 0.0 || high <= low => {
            let expected = "two frequencies in Hz, the lower first and not negative";
            Err(section
                .unexpected(key, format!("[{low}, {high}]"), expected)
                .into())
        }
        band => Ok(band),
    }
}

impl Measurement {
    /// The setup's section.
    pub(super) fn processing(&self) -> Processing {
        Processing {
            sample_rate: Some(self.sample_rate),
            block_length: self.block_length,
            overlap: self.overlap,
            averaging_band: self.averaging_band,
            mode_band: self.mode_band,
        }
    }
}

pub(super) fn runs(layers: &Layers<'_>, table: &Table) -> Result<Vec<Plan>, ModelError> {
    let mut names = Names::new();
    let mut runs = Vec::new();
    for section in layers.list("run")? {
        let run = run(&section, table)?;
        claim(&mut names, &run.name, &section)?;
        runs.push(run);
    }
    Ok(runs)
}

fn run(section: &Section<'_>, table: &Table) -> Result<Plan, ModelError> {
    section.only(&[
        "name",
        "motion",
        "band",
        "drive",
        "poses",
        "rotation",
        "translation",
    ])?;
    let excitation = match (section.vector::<6>("motion")?, section.vectors("poses")?) {
        (Some(motion), None) => {
            for (axis, level) in motion.iter().enumerate() {
                if *level != 0.0 && !table.axes[axis] {
                    return Err(ModelError::NoSuchAxis {
                        place: section.place_of("motion"),
                        axis: AXES[axis],
                    });
                }
            }
            Shaking::Random {
                motion,
                band: ascending(section, "band")?,
                drive: section.flag("drive")?.unwrap_or(true),
            }
        }
        (None, Some(poses)) => Shaking::Poses(poses),
        _ => {
            return Err(ModelError::MotionOrPoses {
                place: section.place(),
            });
        }
    };
    Ok(Plan {
        name: required_name(section)?,
        excitation,
        rotation: section.vector("rotation")?.unwrap_or_default(),
        translation: section.vector("translation")?.unwrap_or_default(),
    })
}
