//! Why a test on the box cannot be done.

use crate::device::ClientError;
use crate::on_box::PlanError;
use massline_firmware::wire::{Field, Item, NoAnswer, Problem, Refused};

/// Why a test on the box cannot be done.
#[derive(Debug, thiserror::Error)]
pub enum BoxRunError {
    /// The box, or the way to it.
    #[error(transparent)]
    Client(ClientError),
    /// The set-up does not fit the box.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// A channel that no input is known to read.
    #[error(
        "no input of the box is known to read channel `{channel}`: name inputs by --inputs {channel}=1 and so on, by a file of inputs, or by the sensors' serial numbers; wired are {}",
        listed(.inputs)
    )]
    Channel {
        /// Its name.
        channel: String,
        /// The inputs that something is wired to, with the sensors' serial numbers.
        inputs: Vec<(u32, String)>,
    },
    /// Two channels of one input.
    #[error(
        "input {input} would be channel `{}` and channel `{}`; name another input for one of them", .channels[0], .channels[1]
    )]
    Twice {
        /// The input, from one.
        input: u32,
        /// The channels.
        channels: [String; 2],
    },
    /// Couplings to alternating current that differ.
    #[error(
        "`ac_corner` of channel `{}` and of channel `{}` differ, and the box does not correct that: have it recorded by `massline board record`, and `massline identify` the recordings", .channels[0], .channels[1]
    )]
    Coupled {
        /// The channels.
        channels: [String; 2],
    },
    /// Blocks and lines that do not fit the sample rate.
    #[error("at {rate} samples/s {reason}")]
    Processing {
        /// Hz.
        rate: f64,
        /// Reason and advice.
        reason: String,
    },
    /// A rate that the box does not have.
    #[error(
        "the box's converters do not sample at {found} Hz; the nearest that they have is {}: change `sample_rate` in the setup", nearest(*.low, *.high)
    )]
    Rate {
        /// Rate of the set-up, Hz.
        found: f64,
        /// Next one below, Hz.
        low: f64,
        /// Next one above, Hz.
        high: f64,
    },
    /// A box that does not sample.
    #[error(
        "this box has no converters of its own; `massline replay` sends it recordings in their place"
    )]
    NoInputs,
    /// A converter that does not answer.
    #[error("the box cannot sample: {0}")]
    Converter(Problem),
    /// Weights need more surveys.
    #[error(
        "weights come from surveys of all runs together, and {} not surveyed yet: leave out --run, or weigh all accelerometers alike by --no-weights", names(.runs)
    )]
    Unsurveyed {
        /// The runs.
        runs: Vec<String>,
    },
    /// A survey that saw too few good blocks.
    #[error(
        "the survey of run \"{run}\" saw too few good blocks: it looks at twelve accelerometers at a time and needs two blocks of each; let it last longer"
    )]
    Survey {
        /// The run.
        run: String,
    },
    /// Nothing comes.
    #[error(
        "run \"{run}\": no samples for {seconds:.0} s; `massline board info` says what the converters do. What was measured before is kept in the box"
    )]
    Silence {
        /// The run.
        run: String,
        /// For how long.
        seconds: f64,
    },
    /// Samples that come too slowly.
    #[error(
        "run \"{run}\" was not over after {seconds:.0} s: the converters sample more slowly than the setup says; look at `massline board info`. What was measured before is kept in the box"
    )]
    Overtime {
        /// The run.
        run: String,
        /// For how long it went on, s.
        seconds: f64,
    },
    /// Nothing is stored of this set-up.
    #[error(
        "the box holds no run of this setup that was measured with {base} and has a good block; `massline board measure` has it measure, `massline board monitor` shows what is wrong with the channels"
    )]
    NothingStored {
        /// The accelerometers of the base acceleration.
        base: &'static str,
    },
    /// The stored runs were measured for other methods.
    #[error(
        "the box holds runs of this setup that were measured with {found}, the method needs {expected}; measure again for it by `massline board measure --method`"
    )]
    OtherBase {
        /// As they were measured.
        found: &'static str,
        /// As the method needs them.
        expected: &'static str,
    },
    /// The data give no answer.
    #[error(
        "the box has no answer: {0}; measure longer, shake harder, or add the runs that are missing"
    )]
    NoAnswer(NoAnswer),
}

impl BoxRunError {
    /// 1 where the data do not allow an answer, 2 where the input or the box is unusable.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::NoAnswer(_) | Self::Survey { .. } | Self::NothingStored { .. } => 1,
            _ => 2,
        }
    }
}

impl From<ClientError> for BoxRunError {
    /// The refusal of the box in the words of its user.
    fn from(error: ClientError) -> Self {
        let ClientError::Refused(Refused { problem, .. }) = &error else {
            return Self::Client(error);
        };
        match *problem {
            Problem::Range {
                field: Field::SampleRate,
                found,
                low,
                high,
                ..
            } => Self::Rate { found, low, high },
            Problem::Unsupported(Item::Input | Item::Source) => Self::NoInputs,
            problem @ Problem::Converter { .. } => Self::Converter(problem),
            Problem::NoAnswer(why) => Self::NoAnswer(why),
            _ => Self::Client(error),
        }
    }
}

fn listed(inputs: &[(u32, String)]) -> String {
    let one = |(number, serial): &(u32, String)| match serial.as_str() {
        "" => number.to_string(),
        serial => format!("{number} ({serial})"),
    };
    let all: Vec<String> = inputs.iter().map(one).collect();
    if all.is_empty() {
        return "none".to_owned();
    }
    all.join(", ")
}

fn nearest(low: f64, high: f64) -> String {
    if low == high {
        format!("{low} Hz")
    } else {
        format!("{low} Hz or {high} Hz")
    }
}

fn names(runs: &[String]) -> String {
    let all: Vec<String> = runs.iter().map(|run| format!("\"{run}\"")).collect();
    let verb = if runs.len() == 1 { "is" } else { "are" };
    format!("{} {verb}", all.join(", "))
}
