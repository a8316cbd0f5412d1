//! Refusals of requests: the request, the found value and the expected value.

use super::{
    Accelerations, Header, NoAnswer, PROTOCOL_VERSION, Refusal, Request, SettingKey, State,
};
use core::fmt::{Display, Formatter, Result};
use serde::{Deserialize, Serialize};

/// Refusal of a request, which has changed nothing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Refused {
    /// Number of the request.
    pub request: u8,
    /// Reason of the refusal.
    pub problem: Problem,
}

/// Reason of a refusal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Problem {
    /// The request has another protocol version.
    Version {
        /// Version of the request.
        found: u8,
        /// Version of the box.
        expected: u8,
    },
    /// The box knows no request of this number.
    UnknownNumber,
    /// The content does not fit the number of the request.
    Malformed,
    /// The request has no identifier.
    NoRequestId,
    /// The box does not accept the request in its present state.
    State {
        /// Present state.
        found: State,
        /// State in which the request is accepted.
        expected: State,
    },
    /// The box is still working on an earlier request of this number. The number of
    /// [`Request::Subscribe`] means that samples are being recorded, which the request would
    /// disturb.
    Busy(u8),
    /// The firmware does not support this.
    Unsupported(Item),
    /// No item has this number.
    Index {
        /// Kind of the item.
        item: Item,
        /// Number in the request.
        found: u32,
        /// Limit that all numbers are below.
        limit: u32,
    },
    /// The box has not enough room.
    Capacity {
        /// Kind of the items.
        item: Item,
        /// Number of items in the request.
        found: u32,
        /// Number of items that fit.
        limit: u32,
    },
    /// The number of items is wrong.
    Count {
        /// Kind of the items.
        item: Item,
        /// Number of items in the request.
        found: u32,
        /// Expected number of items.
        expected: u32,
    },
    /// An item has not been sent, stored or computed yet.
    Missing {
        /// Kind of the item.
        item: Item,
        /// Number of the item; zero if there is only one.
        index: u32,
    },
    /// A value is outside its range.
    Range {
        /// Name of the value.
        field: Field,
        /// Number of the sensor, run or input; zero if there is only one.
        index: u32,
        /// Value in the request.
        found: f64,
        /// Lowest allowed value.
        low: f64,
        /// Highest allowed value.
        high: f64,
    },
    /// The samples begin behind a gap, and the run refuses gaps.
    Gap {
        /// Index of the first sample.
        found: u64,
        /// Index of the expected sample.
        expected: u64,
    },
    /// The method needs runs that were measured with other accelerometers.
    Accelerations {
        /// Accelerometers of the stored runs.
        found: Accelerations,
        /// Accelerometers that the method needs.
        expected: Accelerations,
        /// The first run at fault.
        run: u8,
    },
    /// The data give no answer.
    NoAnswer(NoAnswer),
    /// The flash failed to store this setting.
    Storage(SettingKey),
    /// A converter of the box does not start.
    Converter {
        /// Number of the converter, from zero.
        converter: u8,
        /// Fault of the converter.
        fault: ConverterFault,
    },
}

impl Problem {
    /// [`Self::Index`].
    #[must_use]
    pub fn index(item: Item, found: usize, limit: usize) -> Self {
        let [found, limit] = [found, limit].map(number);
        Self::Index { item, found, limit }
    }

    /// [`Self::Capacity`].
    #[must_use]
    pub fn capacity(item: Item, found: usize, limit: usize) -> Self {
        let [found, limit] = [found, limit].map(number);
        Self::Capacity { item, found, limit }
    }

    /// [`Self::Count`].
    #[must_use]
    pub fn count(item: Item, found: usize, expected: usize) -> Self {
        let [found, expected] = [found, expected].map(number);
        Self::Count {
            item,
            found,
            expected,
        }
    }

    /// [`Self::Missing`].
    #[must_use]
    pub fn missing(item: Item, index: usize) -> Self {
        let index = number(index);
        Self::Missing { item, index }
    }

    /// [`Self::Range`].
    #[must_use]
    pub const fn range(field: Field, index: u32, found: f64, [low, high]: [f64; 2]) -> Self {
        Self::Range {
            field,
            index,
            found,
            low,
            high,
        }
    }

    /// The same problem, of the sensor, run or input of this number.
    #[must_use]
    pub fn about(mut self, number: u32) -> Self {
        if let Self::Range { index, .. } = &mut self {
            *index = number;
        }
        self
    }
}

/// A number of items; the largest number that can be sent if there are more.
fn number(items: usize) -> u32 {
    u32::try_from(items).unwrap_or(u32::MAX)
}

/// Fault of a converter that does not start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ConverterFault {
    /// The bus failed.
    Bus,
    /// The data line stays at one level.
    Stuck,
    /// The frames have wrong checksums.
    Checksum,
    /// The device is another one.
    Identity {
        /// Identity of the device.
        found: u16,
        /// Identity of the converter.
        expected: u16,
    },
    /// A register does not keep the value that is written.
    Register {
        /// Address of the register.
        address: u8,
        /// Value that was read.
        found: u16,
        /// Value that was written.
        expected: u16,
    },
    /// The converter does not execute commands.
    Command,
}

/// Kind of an item of a request.
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
    /// A bus of the converters.
    Bus,
    /// A converter.
    Converter,
    /// A measurement of the board.
    Probe,
}

/// Name of a value that has a range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Field {
    /// The reference point.
    ReferencePoint,
    /// The position of a sensor.
    Position,
    /// The length of the direction of a sensor.
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
    /// The reply to a frame that is not a message. It is sent to the request identifier of the
    /// frame, which is zero if the frame has none.
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
            Self::Unsupported(item) => write!(f, "this firmware lacks that: {item}"),
            Self::Index { item, found, limit } => {
                write!(f, "{item} {found} of {limit}, counted from zero")
            }
            Self::Capacity { item, found, limit } => {
                write!(f, "no room: {item}, {found} where {limit} fit")
            }
            Self::Count {
                item,
                found,
                expected,
            } => write!(f, "{item}: {found} came, {expected} were expected"),
            Self::Missing { item, index } => match item {
                Item::Processing | Item::ModeBand | Item::Answer => {
                    write!(f, "{item} is missing")
                }
                _ => write!(f, "{item} {index} is missing"),
            },
            Self::Range {
                field,
                index,
                found,
                low,
                high,
            } => {
                field.fmt(f)?;
                if field.is_of_several() {
                    write!(f, " of number {index}, counted from zero,")?;
                }
                write!(f, " is {found}; expected {low} to {high}")
            }
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

impl Display for Item {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        f.write_str(match self {
            Self::Sensor => "sensor",
            Self::Accelerometer => "accelerometer",
            Self::LoadCell => "load cell",
            Self::Run => "run",
            Self::Channel => "channel",
            Self::Input => "input",
            Self::Drive => "drive",
            Self::Line => "line",
            Self::Sample => "sample",
            Self::Weight => "weight",
            Self::Byte => "byte",
            Self::Processing => "the processing",
            Self::ModeBand => "the mode band",
            Self::Survey => "survey of run",
            Self::Summary => "finished run",
            Self::Answer => "the answer",
            Self::Method => "method",
            Self::Excitation => "kind of excitation",
            Self::Source => "source of samples",
            Self::Setting => "setting",
            Self::Provoke => "fault to be provoked",
            Self::Bus => "bus",
            Self::Converter => "converter",
            Self::Probe => "measurement of the board",
        })
    }
}

impl Field {
    /// `true` if several items have a value of this name.
    const fn is_of_several(self) -> bool {
        matches!(
            self,
            Self::Position
                | Self::Direction
                | Self::Scale
                | Self::Offset
                | Self::Rotation
                | Self::Translation
                | Self::Weight
                | Self::Gain
                | Self::CountLimit
                | Self::Uncertainty
                | Self::Date
        )
    }
}

impl Display for Field {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        f.write_str(match self {
            Self::ReferencePoint => "the reference point",
            Self::Position => "the position",
            Self::Direction => "the length of the direction",
            Self::Scale => "the scale",
            Self::Offset => "the offset",
            Self::Rotation => "the rotation",
            Self::Translation => "the translation",
            Self::Weight => "the weight",
            Self::MinimumWeight => "the minimum weight",
            Self::SampleRate => "the sample rate",
            Self::BlockLength => "the block length",
            Self::Overlap => "the overlap",
            Self::KeptBand => "an end of the kept band",
            Self::AveragingBand => "an end of the averaging band",
            Self::ModeBand => "an end of the mode band",
            Self::KnownMass => "the known mass",
            Self::Tolerance => "the tolerance of the iteration",
            Self::Modes => "the number of modes",
            Self::Limit => "the limit of samples",
            Self::LinkBaud => "the rate of the link",
            Self::Gain => "the gain",
            Self::CountLimit => "a limit of counts",
            Self::Uncertainty => "the uncertainty",
            Self::Date => "a part of the date",
            Self::Iterations => "the most iterations",
            Self::FitBand => "an end of the band of the fit",
        })
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
