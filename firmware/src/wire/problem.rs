//! Why a request was refused: which one, what was found, what was expected.

use super::{
    Accelerations, Header, NoAnswer, PROTOCOL_VERSION, Refusal, Request, SettingKey, State,
};
use core::fmt::{Display, Formatter, Result};
use serde::{Deserialize, Serialize};

/// A request was refused, and changed nothing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Refused {
    /// Number of the request.
    pub request: u8,
    /// Why.
    pub problem: Problem,
}

/// Why a request was refused.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Problem {
    /// The request is of another version of the contract.
    Version {
        /// The request's.
        found: u8,
        /// The box's.
        expected: u8,
    },
    /// The box knows no request of this number.
    UnknownNumber,
    /// The content is not that of this number.
    Malformed,
    /// The request has no id.
    NoRequestId,
    /// Not while the box is doing what it does.
    State {
        /// What it does.
        found: State,
        /// What it would have to do.
        expected: State,
    },
    /// Still at work on an earlier request of this number. That of
    /// [`Request::Subscribe`]: samples are being sent to a recording, which the request would
    /// disturb.
    Busy(u8),
    /// This firmware does not do that.
    Unsupported(Item),
    /// There is none of this number.
    Index {
        /// Of what.
        item: Item,
        /// The number.
        found: u32,
        /// All are below this.
        limit: u32,
    },
    /// Not enough room.
    Capacity {
        /// For what.
        item: Item,
        /// How many there are.
        found: u32,
        /// How many fit.
        limit: u32,
    },
    /// A number of things that is not the right one.
    Count {
        /// Of what.
        item: Item,
        /// How many came.
        found: u32,
        /// How many were expected.
        expected: u32,
    },
    /// Something that has not been sent, stored or computed yet.
    Missing {
        /// What.
        item: Item,
        /// Its number, zero where there is only one.
        index: u32,
    },
    /// A value outside its range.
    Range {
        /// Of what.
        field: Field,
        /// Number of the sensor, run or input, zero where there is only one.
        index: u32,
        /// The value.
        found: f64,
        /// Lowest that is allowed.
        low: f64,
        /// Highest that is allowed.
        high: f64,
    },
    /// Samples begin behind a gap, and the run refuses gaps.
    Gap {
        /// Index of the first sample.
        found: u64,
        /// Index of the sample that is expected.
        expected: u64,
    },
    /// The method needs runs that were measured with other accelerometers.
    Accelerations {
        /// Of the stored runs.
        found: Accelerations,
        /// Of the method.
        expected: Accelerations,
        /// The first run at fault.
        run: u8,
    },
    /// The data give no answer.
    NoAnswer(NoAnswer),
    /// The flash has failed this setting.
    Storage(SettingKey),
    /// A converter of the box does not come up.
    Converter {
        /// Its number, from zero.
        converter: u8,
        /// What it did instead.
        fault: ConverterFault,
    },
}

/// What a converter did that does not come up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ConverterFault {
    /// The bus failed.
    Bus,
    /// Its data line stayed at one level.
    Stuck,
    /// Its frames came with wrong checksums.
    Checksum,
    /// It is another device.
    Identity {
        /// What it says it is.
        found: u16,
        /// What it should say.
        expected: u16,
    },
    /// A register does not keep what is written.
    Register {
        /// Its address.
        address: u8,
        /// What was read.
        found: u16,
        /// What was written.
        expected: u16,
    },
    /// It does not do as it is told.
    Command,
}

/// Things there can be too many of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Item {
    /// A sensor.
    Sensor,
    /// An accelerometer that gives the base acceleration.
    Accelerometer,
    /// A load cell.
    LoadCell,
    /// A run.
    Run,
    /// A channel of a sample.
    Channel,
    /// An input of the box's converters.
    Input,
    /// A drive channel.
    Drive,
    /// A line.
    Line,
    /// A sample.
    Sample,
    /// A weight.
    Weight,
    /// A byte of a text.
    Byte,
    /// The processing of a set-up.
    Processing,
    /// A mode band.
    ModeBand,
    /// A survey of a run.
    Survey,
    /// A finished run.
    Summary,
    /// An answer.
    Answer,
    /// A method.
    Method,
    /// A kind of excitation.
    Excitation,
    /// A source of samples.
    Source,
    /// A setting.
    Setting,
    /// A fault to be provoked.
    Provoke,
}

/// Numbers that have a range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Field {
    /// The reference point.
    ReferencePoint,
    /// The position of a sensor.
    Position,
    /// The direction of a sensor; its length was found.
    Direction,
    /// The scale of a sensor or an input.
    Scale,
    /// The offset of a sensor or an input.
    Offset,
    /// The rotation of a run.
    Rotation,
    /// The translation of a run.
    Translation,
    /// The weight of an accelerometer.
    Weight,
    /// The minimum weight.
    MinimumWeight,
    /// The sample rate.
    SampleRate,
    /// The block length.
    BlockLength,
    /// The overlap.
    Overlap,
    /// An end of the kept band.
    KeptBand,
    /// An end of the averaging band.
    AveragingBand,
    /// An end of the mode band.
    ModeBand,
    /// The known mass.
    KnownMass,
    /// The tolerance of the iteration.
    Tolerance,
    /// The number of elastic modes.
    Modes,
    /// The limit of a run.
    Limit,
    /// The rate of the link.
    LinkBaud,
    /// An amplifier's gain.
    Gain,
    /// A limit of an input's counts.
    CountLimit,
    /// The uncertainty of a calibration.
    Uncertainty,
    /// A part of a date.
    Date,
    /// The most iterations.
    Iterations,
    /// An end of the band in which modes are looked for.
    FitBand,
}

impl Refused {
    /// The answer to a frame that is no message. It goes to the request id of the
    /// frame's header, which is zero where the frame had none.
    #[must_use]
    pub const fn because(header: &Header, refusal: Refusal) -> Self {
        let problem = match refusal {
            Refusal::Version { found } => Problem::Version {
                found,
                expected: PROTOCOL_VERSION,
            },
            Refusal::UnknownNumber { .. } => Problem::UnknownNumber,
            Refusal::Malformed { .. } => Problem::Malformed,
            Refusal::RequestId { .. } => Problem::NoRequestId,
        };
        Self {
            request: header.number,
            problem,
        }
    }
}

impl Display for Refused {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match Request::name(self.request) {
            Some(name) => write!(f, "{name} was refused: {}", self.problem),
            None => write!(
                f,
                "request {:#04x} was refused: {}",
                self.request, self.problem
            ),
        }
    }
}

impl core::error::Error for Refused {}

impl Display for Problem {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::Version { found, expected } => write!(
                f,
                "it is of version {found} of the link, the box speaks version {expected}"
            ),
            Self::UnknownNumber => f.write_str("the box does not know it"),
            Self::Malformed => f.write_str("its content cannot be read"),
            Self::NoRequestId => f.write_str("it has no id"),
            Self::State { found, expected } => {
                write!(f, "the box is {found:?} and would have to be {expected:?}")
            }
            Self::Busy(number) if Request::name(*number) == Some("Subscribe") => {
                f.write_str("the box sends its samples to a recording; end that recording first")
            }
            Self::Busy(number) => write!(
                f,
                "the box is still at work on {}",
                Request::name(*number).unwrap_or("another request")
            ),
            Self::Unsupported(item) => write!(f, "this firmware lacks that: {item:?}"),
            Self::Index { item, found, limit } => {
                write!(f, "{item:?} {found} of {limit}, counted from zero")
            }
            Self::Capacity { item, found, limit } => {
                write!(f, "no room: {item:?}, {found} where {limit} fit")
            }
            Self::Count {
                item,
                found,
                expected,
            } => write!(f, "{item:?}: {found} came, {expected} were expected"),
            Self::Missing { item, index } => write!(f, "{item:?} {index} is missing"),
            Self::Range {
                field,
                index,
                found,
                low,
                high,
            } => write!(
                f,
                "{field:?} of number {index} is {}; expected {} to {}",
                found, low, high
            ),
            Self::Gap { found, expected } => write!(
                f,
                "the samples begin with number {found}, number {expected} is expected"
            ),
            Self::Accelerations {
                found,
                expected,
                run,
            } => write!(
                f,
                "run {run} was measured with {found:?} accelerometers, the method needs {expected:?}"
            ),
            Self::NoAnswer(why) => why.fmt(f),
            Self::Storage(key) => write!(f, "the flash failed at setting {key:?}"),
            Self::Converter { converter, fault } => {
                write!(f, "converter {converter} does not come up: {fault}")
            }
        }
    }
}

impl Display for ConverterFault {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::Bus => f.write_str("the SPI bus failed"),
            Self::Stuck => {
                f.write_str("its data line does not move; see its supply, its clock and its wires")
            }
            Self::Checksum => f.write_str("its frames are garbled; shorten or shield the wires"),
            Self::Identity { found, expected } => write!(
                f,
                "it says {found:#06x} where {expected:#06x} is expected; see which chip is selected"
            ),
            Self::Register {
                address,
                found,
                expected,
            } => write!(
                f,
                "register {address:#04x} reads {found:#06x} after {expected:#06x} was written"
            ),
            Self::Command => f.write_str("it does not do as it is told; see its RESET line"),
        }
    }
}
