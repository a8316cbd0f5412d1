//! Reasons of refusals, drawn at random.

use crate::draw::Draw;
use crate::parts::{accelerations, key, state};
use massline_core::identify::IdentifyError;
use massline_core::masslines::MasslineError;
use massline_firmware::wire::*;

pub fn problem(d: &mut Draw<'_>) -> Problem {
    match d.pick(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 12, 13, 14, 15, 10, 16]) {
        0 => Problem::Version {
            found: d.u8(),
            expected: d.u8(),
        },
        1 => Problem::UnknownNumber,
        2 => Problem::Malformed,
        3 => Problem::NoRequestId,
        4 => Problem::State {
            found: state(d),
            expected: state(d),
        },
        5 => Problem::Busy(d.u8()),
        6 => Problem::Unsupported(item(d)),
        7 => Problem::Index {
            item: item(d),
            found: d.u32(),
            limit: d.u32(),
        },
        8 => Problem::Capacity {
            item: item(d),
            found: d.u32(),
            limit: d.u32(),
        },
        9 => Problem::Count {
            item: item(d),
            found: d.u32(),
            expected: d.u32(),
        },
        10 => Problem::Range {
            field: field(d),
            index: d.u32(),
            found: d.f64(),
            low: d.f64(),
            high: d.f64(),
        },
        11 => Problem::Missing {
            item: item(d),
            index: d.u32(),
        },
        12 => Problem::Gap {
            found: d.u64(),
            expected: d.u64(),
        },
        13 => Problem::Accelerations {
            found: accelerations(d),
            expected: accelerations(d),
            run: d.u8(),
        },
        14 => Problem::Storage(key(d)),
        16 => Problem::Converter {
            converter: d.u8(),
            fault: converter_fault(d),
        },
        _ => Problem::NoAnswer(no_answer(d)),
    }
}

fn converter_fault(d: &mut Draw<'_>) -> ConverterFault {
    let all = [
        ConverterFault::Bus,
        ConverterFault::Stuck,
        ConverterFault::Checksum,
        ConverterFault::Identity {
            found: d.u16(),
            expected: d.u16(),
        },
        ConverterFault::Register {
            address: d.u8(),
            found: d.u16(),
            expected: d.u16(),
        },
        ConverterFault::Command,
    ];
    d.pick(&all)
}

pub fn no_answer(d: &mut Draw<'_>) -> NoAnswer {
    let count = |d: &mut Draw<'_>| d.u32() as usize;
    let masslines = [
        MasslineError::TooFewLines(count(d)),
        MasslineError::NoExcitation,
        MasslineError::NoResultant,
        MasslineError::TooManyPairs {
            limit: count(d),
            found: count(d),
        },
        MasslineError::Singular,
        MasslineError::NoReference,
        MasslineError::TooFewRuns {
            needed: count(d),
            found: count(d),
        },
        MasslineError::NoMode,
        MasslineError::OtherLines {
            band: count(d),
            lines: count(d),
        },
        MasslineError::Work {
            needed: count(d),
            given: count(d),
        },
        MasslineError::TooManyRuns {
            limit: count(d),
            found: count(d),
        },
        MasslineError::TooFewPoses {
            needed: count(d),
            found: count(d),
        },
        MasslineError::TooFewBlocks {
            needed: d.u32(),
            found: d.u32(),
        },
    ];
    let identify = [
        IdentifyError::NoMasslines,
        IdentifyError::NothingObservable,
        IdentifyError::KnownMass(d.f64()),
        IdentifyError::Diverged(d.f64()),
        IdentifyError::NotConverged(d.f64()),
        IdentifyError::NotFinite,
    ];
    if d.bool() {
        NoAnswer::Masslines(d.pick(&masslines))
    } else {
        NoAnswer::Identify(d.pick(&identify))
    }
}

fn item(d: &mut Draw<'_>) -> Item {
    d.pick(&[
        Item::Sensor,
        Item::Accelerometer,
        Item::LoadCell,
        Item::Run,
        Item::Channel,
        Item::Input,
        Item::Drive,
        Item::Line,
        Item::Sample,
        Item::Weight,
        Item::Byte,
        Item::Processing,
        Item::ModeBand,
        Item::Survey,
        Item::Summary,
        Item::Answer,
        Item::Method,
        Item::Excitation,
        Item::Source,
        Item::Setting,
        Item::Provoke,
    ])
}

fn field(d: &mut Draw<'_>) -> Field {
    d.pick(&[
        Field::ReferencePoint,
        Field::Position,
        Field::Direction,
        Field::Scale,
        Field::Offset,
        Field::Rotation,
        Field::Translation,
        Field::Weight,
        Field::MinimumWeight,
        Field::SampleRate,
        Field::BlockLength,
        Field::Overlap,
        Field::KeptBand,
        Field::AveragingBand,
        Field::ModeBand,
        Field::KnownMass,
        Field::Tolerance,
        Field::Modes,
        Field::Limit,
        Field::LinkBaud,
        Field::Gain,
        Field::CountLimit,
        Field::Uncertainty,
        Field::Date,
        Field::Iterations,
        Field::FitBand,
    ])
}
