//! Why there is no answer, and what to do about it.

use crate::detective::Undecided;
use crate::measure::{MeasureError, Measurement};
use massline_core::identify::IdentifyError;
use massline_core::masslines::MasslineError;
use massline_core::spectra::BandError;

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum AnswerError {
    /// The recordings cannot be measured.
    #[error(transparent)]
    Measure(#[from] MeasureError),
    /// The spectra do not give masslines.
    #[error("{method}: {source}; {advice}")]
    Masslines {
        /// Whose needs are not met, such as `method e`.
        method: String,
        /// Reason.
        source: MasslineError,
        /// Advice to the user.
        advice: &'static str,
    },
    /// A band that reaches beyond the lines.
    #[error("`{key}`: {source}; move its ends to where there are lines")]
    Band {
        /// The band's key in the setup.
        key: &'static str,
        /// Reason.
        source: BandError,
    },
    /// Drives were named that explain little of what moves.
    #[error("nothing of the ten can be told: {why}")]
    FewDrives {
        /// The drives, the run, and advice.
        why: String,
    },
    /// Sensors that see different things.
    #[error(
        "the accelerometers see {accelerations} of the reference point and the load cells measure {resultants}: nothing of the ten can be told from these together; add load cells until every load path is measured, and accelerometers on the interface"
    )]
    SensorsApart {
        /// The accelerations that are seen.
        accelerations: String,
        /// The resultants that are measured.
        resultants: String,
    },
    /// The masslines do not give an answer.
    #[error("{source}; {advice}")]
    Identify {
        /// Reason.
        source: IdentifyError,
        /// Advice to the user.
        advice: &'static str,
    },
}

/// Why sensors cannot be examined.
#[derive(Debug, thiserror::Error)]
pub enum ExamineError {
    /// The recordings cannot be measured.
    #[error(transparent)]
    Answer(#[from] AnswerError),
    /// The recordings say nothing of the sensors.
    #[error(transparent)]
    Undecided(#[from] Undecided),
}

impl AnswerError {
    /// 1 where the data do not allow an answer, 2 where the input is unusable.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Measure(e) if !e.is_data() => 2,
            Self::Band { .. } => 2,
            _ => 1,
        }
    }

    /// The same, said of the sensors where it is they that leave nothing to be told.
    pub(super) fn blame_sensors(self, measurement: &Measurement) -> Self {
        let nothing = matches!(
            self,
            Self::Identify {
                source: IdentifyError::NothingObservable,
                ..
            }
        );
        let few_drives = |w: &&String| w.contains("explains less");
        if let Some(why) = measurement
            .warnings
            .iter()
            .find(few_drives)
            .filter(|_| nothing)
        {
            return Self::FewDrives { why: why.clone() };
        }
        let runs = measurement.runs.iter().map(|r| &r.geometry);
        let sines = measurement.sines.iter().map(|r| &r.geometry);
        let poses = measurement.poses.iter().map(|r| &r.geometry);
        let Some(geometry) = runs.chain(sines).chain(poses).next().filter(|_| nothing) else {
            return self;
        };
        let (seen, measured) = geometry.seen();
        if seen.len() == 6 && measured.len() == 6 {
            return self;
        }
        Self::SensorsApart {
            accelerations: list(&seen),
            resultants: list(&measured),
        }
    }
}

fn list(names: &[&str]) -> String {
    match names {
        [] => "nothing".to_owned(),
        _ => names.join(", "),
    }
}

impl AnswerError {
    /// The error of `method`, named in words, that lacks data.
    pub(super) fn lacking(method: &str, source: MasslineError) -> Self {
        let advice = match source {
            MasslineError::TooFewLines(_) => {
                "widen `averaging_band` or lengthen `block_length` for finer lines"
            }
            MasslineError::NoExcitation => {
                "shake harder, record longer, or check that the interface accelerometers and the drive belong to this recording"
            }
            MasslineError::NoResultant => "add load cells until every load path is measured",
            MasslineError::TooManyPairs { .. } | MasslineError::TooManyRuns { .. } => {
                "identify from fewer runs"
            }
            MasslineError::NoReference => {
                "record the generator's signal and name it as `reference`, or use --method apparent-mass"
            }
            MasslineError::TooFewRuns { .. } => {
                "add runs that move the table in other directions, shake harder where a run hardly rises above its noise, or use --method apparent-mass, which needs fewer"
            }
            MasslineError::NoMode => {
                "extend `mode_band` to where the structure rings, or use --method c-squared, which needs no modes"
            }
            MasslineError::TooFewBlocks { .. } => {
                "record longer, shorten `block_length`, record the generator's signal and name it as `reference`, which needs fewer blocks, or state the sensors' `noise`"
            }
            MasslineError::TooFewPoses { .. } => "add poses that differ from these",
            MasslineError::Singular => "check the recordings for channels without signal",
            _ => "this is a mistake in the program: report it with the setup file",
        };
        Self::Masslines {
            method: method.to_owned(),
            source,
            advice,
        }
    }
}

impl From<IdentifyError> for AnswerError {
    fn from(source: IdentifyError) -> Self {
        let advice = match source {
            IdentifyError::NoMasslines => "the setup needs at least one run",
            IdentifyError::NothingObservable => {
                "check that load cells and accelerometers share one recording and that the table moved"
            }
            IdentifyError::KnownMass(_) => "correct `known_mass` or leave it out",
            IdentifyError::Diverged(_) | IdentifyError::NotConverged(_) => {
                "use --direct, or a reference point nearer to the specimen"
            }
            _ => "check the recordings for channels without signal",
        };
        Self::Identify { source, advice }
    }
}
