//! TOML to inputs.

use super::InputEntry;
use crate::printable::quoted;
use crate::setup::keys::{self, outside};
use crate::setup::{Document, DocumentError, Keys, Section, Source};
use massline_firmware::calibration::{BRIDGE_SUPPLY_MAX, Certificate, Limits, Preset};
use massline_firmware::wire::{Circuit, Date, Field, Input, Item, NAME_MAX, Problem};
use serde::{Deserialize, Deserializer};

/// Most inputs of a box: their numbers go over the link as a byte.
const MOST: usize = 256;

/// Words for the circuits in the file.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Unused,
    Voltage,
    Bridge,
    Charge,
    Iepe,
    Digital,
    Adxl355,
}

const KINDS: [(&str, Kind); 7] = [
    ("bridge", Kind::Bridge),
    ("charge", Kind::Charge),
    ("iepe", Kind::Iepe),
    ("voltage", Kind::Voltage),
    ("adxl355", Kind::Adxl355),
    ("digital", Kind::Digital),
    ("unused", Kind::Unused),
];

/// Keys that all circuits have.
const OWN: [&str; 11] = [
    "input",
    "channel",
    "circuit",
    "serial",
    "certificate",
    "calibrated",
    "uncertainty",
    "per_count",
    "offset",
    "gain",
    "limits",
];

/// The file as a whole.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
struct File {
    input: Vec<InputKeys>,
}

impl Keys for File {
    const REQUIRED: &'static [(&'static str, &'static str)] = &[
        ("input", "the number of the input, from 1"),
        (
            "circuit",
            "\"bridge\", \"charge\", \"iepe\", \"voltage\", \"adxl355\", \"digital\" or \"unused\"",
        ),
    ];
}

/// An `[[input]]` as it is written; which keys of a data sheet it may have depends on the circuit.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct InputKeys {
    #[serde(deserialize_with = "number")]
    input: u16,
    #[serde(default, deserialize_with = "keys::text")]
    channel: Option<String>,
    #[serde(deserialize_with = "kind")]
    circuit: Kind,
    #[serde(default, deserialize_with = "name")]
    serial: String,
    #[serde(default, deserialize_with = "name")]
    certificate: String,
    #[serde(default, deserialize_with = "date")]
    calibrated: Option<Date>,
    #[serde(default, deserialize_with = "keys::any")]
    uncertainty: Option<f64>,
    #[serde(default, deserialize_with = "keys::any")]
    per_count: Option<f64>,
    #[serde(default, deserialize_with = "keys::any")]
    offset: Option<f64>,
    #[serde(default, deserialize_with = "gain")]
    gain: Option<f64>,
    #[serde(default, deserialize_with = "keys::pair")]
    limits: Option<[f64; 2]>,
    #[serde(default, deserialize_with = "rated_load")]
    rated_load: Option<f64>,
    #[serde(default, deserialize_with = "rated_output")]
    rated_output: Option<f64>,
    #[serde(default, deserialize_with = "supply")]
    supply: Option<f64>,
    #[serde(default, deserialize_with = "sensitivity")]
    sensitivity: Option<f64>,
    #[serde(default, deserialize_with = "amplifier")]
    amplifier: Option<f64>,
    #[serde(default, deserialize_with = "divider")]
    divider: Option<f64>,
    #[serde(default, deserialize_with = "range")]
    range: Option<f64>,
}

const RATED_LOAD: &str = "the rated load, N or N m";
const RATED_OUTPUT: &str = "V per V of supply at the rated load, such as 2e-3";
const AMPLIFIER: &str = "V per C of the charge amplifier, such as 1e9";
const RANGE: &str = "the largest value to be measured, SI";

keys::numbers! {
    gain:
        "1, 2, 4, 8, 16, 32, 64 or 128",
        |x| (0..8).any(|k| f64::from(1 << k) == x);
    rated_load: RATED_LOAD, |x| x > 0.0;
    rated_output: RATED_OUTPUT, |x| x != 0.0;
    supply: "the bridge's supply, V", |x| x > 0.0;
    sensitivity:
        "V (of a charge sensor C) per SI unit, such as 0.0102 for 100 mV/g or 4e-12 for 4 pC",
        |x| x != 0.0;
    amplifier: AMPLIFIER, |x| x > 0.0;
    divider:
        "the share of the voltage that reaches the input, above 0 and at most 1",
        |x| x > 0.0 && x <= 1.0;
    range: RANGE, |x| x > 0.0;
}

fn number<'de, D: Deserializer<'de>>(value: D) -> Result<u16, D::Error> {
    keys::whole(value, "the number of an input, from 1", |x| {
        (1..=256).contains(&x)
    })
}

fn kind<'de, D: Deserializer<'de>>(value: D) -> Result<Kind, D::Error> {
    keys::word(value, &KINDS)
}

/// Text that fits into the box.
fn name<'de, D: Deserializer<'de>>(value: D) -> Result<String, D::Error> {
    let text: String = keys::text(value)?;
    if text.len() > NAME_MAX {
        let found = format_args!("{} bytes long", text.len());
        return Err(outside(found, format_args!("at most {NAME_MAX} bytes")));
    }
    Ok(text)
}

fn date<'de, D: Deserializer<'de>>(value: D) -> Result<Option<Date>, D::Error> {
    let text: String = keys::text(value)?;
    let mut parts = text.split('-').map(str::parse::<u16>);
    let mut part = || parts.next().and_then(Result::ok);
    let date = (part(), part(), part());
    if let (Some(year), Some(month), Some(day)) = date
        && parts.next().is_none()
        && month < 256
        && day < 256
    {
        let (month, day) = (month as u8, day as u8);
        return Ok(Some(Date { year, month, day }));
    }
    let expected = "a day as year-month-day, such as \"2026-03-02\"";
    Err(outside(format_args!("\"{}\"", quoted(&text)), expected))
}

pub(super) fn document(source: &Source) -> Result<Vec<InputEntry>, DocumentError> {
    let document = Document::new(source)?;
    let found = document.count("input");
    if found > MOST {
        let expected = format_args!("at most {MOST}, one for each input");
        let found = format_args!("a list of {found}");
        return Err(document.top().unexpected("input", found, expected));
    }
    let file: File = document.read()?;
    if file.input.is_empty() {
        let expected = "one [[input]] for each input that is wired";
        return Err(document.top().missing("input", expected));
    }
    let mut entries: Vec<InputEntry> = Vec::new();
    for (section, keys) in document.sections("input").into_iter().zip(file.input) {
        let entry = input(&section, keys)?;
        if entries.iter().any(|e| e.input == entry.input) {
            return Err(section.unexpected("input", entry.number(), "each input once"));
        }
        if let Some(channel) = &entry.channel
            && entries.iter().any(|e| e.column() == *channel)
        {
            let found = format_args!("\"{}\"", quoted(channel));
            let expected = "a name that no other input has";
            return Err(section.unexpected("channel", found, expected));
        }
        entries.push(entry);
    }
    Ok(entries)
}

fn input(section: &Section<'_>, keys: InputKeys) -> Result<InputEntry, DocumentError> {
    let preset = preset(section, &keys)?;
    let number = (keys.input - 1) as u8;
    let mut input = preset.input(
        number,
        &keys.serial,
        &keys.certificate,
        keys.calibrated,
        0.0,
    );
    input.uncertainty = keys.uncertainty.unwrap_or(input.uncertainty);
    input.per_count = keys.per_count.unwrap_or(input.per_count);
    input.offset = keys.offset.unwrap_or(input.offset);
    input.gain = keys.gain.map_or(input.gain, |gain| gain as u8);
    input.limits = keys
        .limits
        .map_or(input.limits, |limits| limits.map(|x| x as i32));
    Ok(InputEntry {
        input: number,
        certificate: Certificate::new(&input).map_err(|p| refused(section, &input, &p))?,
        channel: keys.channel,
    })
}

/// Calibration that follows from the data sheet, or the circuit alone where `per_count` is given
/// in its place.
fn preset(section: &Section<'_>, keys: &InputKeys) -> Result<Preset, DocumentError> {
    let (circuit, sheet): (Circuit, &[&str]) = match keys.circuit {
        Kind::Unused => (Circuit::Unused, &[]),
        Kind::Voltage => (Circuit::Voltage, &["sensitivity", "range"]),
        Kind::Bridge => (Circuit::Bridge, &["rated_load", "rated_output", "supply"]),
        Kind::Charge => (
            Circuit::Charge,
            &["sensitivity", "amplifier", "divider", "range"],
        ),
        Kind::Iepe => (Circuit::Iepe, &["sensitivity", "divider", "range"]),
        Kind::Digital | Kind::Adxl355 => (Circuit::Digital, &[]),
    };
    let known: Vec<&str> = match keys.circuit {
        // An input that nothing is wired to has no calibration.
        Kind::Unused => vec!["input", "channel", "circuit"],
        _ => OWN.iter().chain(sheet).copied().collect(),
    };
    section.only(&known)?;
    let direct = keys.per_count.is_some() && !sheet.iter().any(|key| section.has(key));
    let given =
        |key, value: Option<f64>, expected| value.ok_or_else(|| section.missing(key, expected));
    let per_si = |expected| given("sensitivity", keys.sensitivity, expected);
    let range = || given("range", keys.range, RANGE);
    let divider = keys.divider.unwrap_or(1.0);
    Ok(match keys.circuit {
        Kind::Adxl355 => Preset::adxl355(),
        kind if direct || kind == Kind::Unused => Preset {
            circuit,
            per_count: 1.0,
            gain: 1,
            limits: Limits::CONVERTER,
        },
        Kind::Bridge => Preset::bridge(
            given("rated_load", keys.rated_load, RATED_LOAD)?,
            given("rated_output", keys.rated_output, RATED_OUTPUT)?,
            keys.supply.unwrap_or(BRIDGE_SUPPLY_MAX),
        )
        .map_err(|high| {
            let expected = format!("{BRIDGE_SUPPLY_MAX} V or less, so that the bridge's outputs stay within the converter's inputs");
            section.unexpected("supply", format!("{} V", high.found), expected)
        })?,
        Kind::Charge => Preset::charge(
            per_si("C per SI unit, such as 4e-12")?,
            given("amplifier", keys.amplifier, AMPLIFIER)?,
            divider,
            range()?,
        ),
        Kind::Iepe => Preset::iepe(
            per_si("V per SI unit, such as 0.0102 for 100 mV/g")?,
            divider,
            range()?,
        ),
        Kind::Voltage => Preset::voltage(circuit, per_si("V per SI unit, or V per V")?, range()?),
        _ => return Err(section.missing("per_count", "m/s², N or N m per count")),
    })
}

/// The box's reason to refuse a certificate, in the words of the file.
fn refused(section: &Section<'_>, input: &Input<'_>, problem: &Problem) -> DocumentError {
    let expected = |text: &str| text.to_owned();
    let (key, found, expected) = match problem {
        Problem::Range { field, .. } => match field {
            Field::Uncertainty => (
                "uncertainty",
                input.uncertainty.to_string(),
                expected("a share from 0 to below 1: 0.002 for 0.2 %"),
            ),
            Field::Date => (
                "calibrated",
                "no day".to_owned(),
                expected("a day of the calendar"),
            ),
            Field::CountLimit => (
                "limits",
                format!("{:?}", input.limits),
                expected("the lowest and the highest count, in order and within 24 bits"),
            ),
            Field::Offset => (
                "offset",
                input.offset.to_string(),
                expected("a count within 24 bits"),
            ),
            Field::Gain => (
                "gain",
                input.gain.to_string(),
                expected("a power of two up to 128"),
            ),
            _ => (
                "per_count",
                format!("{:e}", input.per_count),
                expected(
                    "a sensitivity between 1e-20 and 1e20, which follows from the data sheet's numbers",
                ),
            ),
        },
        Problem::Capacity {
            item: Item::Byte, ..
        } => (
            "serial",
            "too long".to_owned(),
            format!("at most {NAME_MAX} bytes"),
        ),
        other => ("input", other.to_string(), expected("what the box takes")),
    };
    section.unexpected(key, found, expected)
}

#[cfg(test)]
mod tests {
    use super::super::to_toml;
    use super::*;
    use std::path::Path;

    fn read(text: &str) -> Result<Vec<InputEntry>, DocumentError> {
        document(&Source::new(text, Path::new("inputs.toml")))
    }

    /// A cell whose sheet has all its numbers, and lines behind them.
    fn cell(more: &str) -> String {
        format!(
            "[[input]]\ninput = 3\ncircuit = \"bridge\"\nrated_load = 500\nrated_output = 2e-3\n{more}\n"
        )
    }

    #[test]
    fn data_sheets_become_what_the_core_makes_of_them() {
        let text = r#"
            [[input]]
            input = 3
            channel = "fx"
            circuit = "bridge"
            serial = "LC-0815"
            certificate = "K 2026-17"
            calibrated = "2026-03-02"
            uncertainty = 0.002
            rated_load = 500.0
            rated_output = -2e-3
            offset = 12.5
            [[input]]
            input = 1
            circuit = "iepe"
            sensitivity = 0.0102
            divider = 0.1
            range = 490
            [[input]]
            input = 2
            circuit = "charge"
            sensitivity = 4e-12
            amplifier = 1e9
            range = 2500
            [[input]]
            input = 12
            circuit = "voltage"
            sensitivity = 1
            range = 1
            per_count = 1.5e-7
            [[input]]
            input = 32
            circuit = "adxl355"
            [[input]]
            input = 8
            circuit = "unused"
        "#;
        let found = read(text).unwrap();
        let presets = [
            (2, Preset::bridge(500.0, -2e-3, 2.5).unwrap()),
            (0, Preset::iepe(0.0102, 0.1, 490.0)),
            (1, Preset::charge(4e-12, 1e9, 1.0, 2500.0)),
            (11, Preset::voltage(Circuit::Voltage, 1.0, 1.0)),
            (31, Preset::adxl355()),
        ];
        for (entry, (number, preset)) in found.iter().zip(presets) {
            assert_eq!(entry.input, number);
            let mut expected = preset.input(number, "", "", None, 0.0);
            let date = Date {
                year: 2026,
                month: 3,
                day: 2,
            };
            if number == 2 {
                expected.serial = "LC-0815";
                expected.certificate = "K 2026-17";
                expected.calibrated = Some(date);
                expected.uncertainty = 0.002;
                expected.offset = 12.5;
            }
            if number == 11 {
                expected.per_count = 1.5e-7;
            }
            assert_eq!(entry.setting(), expected);
        }
        assert_eq!((found.len(), found[5].is_used()), (6, false));
        assert_eq!(
            (&*found[0].column(), &*found[1].column()),
            ("fx", "input 1")
        );
    }

    #[test]
    fn what_is_written_is_read_again() {
        let text = cell(
            "channel = \"f \\\"x\\\"\"\ncalibrated = \"2024-02-29\"\nuncertainty = 1e-3",
        ) + "[[input]]\ninput = 4\ncircuit = \"digital\"\nper_count = -3.8e-5\nlimits = [-9, 7]\ngain = 4\n"
            + "[[input]]\ninput = 5\ncircuit = \"unused\"\n";
        let entries = read(&text).unwrap();
        let again = to_toml(&entries);
        assert_eq!(read(&again).unwrap(), entries, "{again}");
    }

    #[test]
    fn complaints_name_line_key_and_a_way_out() {
        let twice = cell("") + &cell("");
        let input = |keys: &str| format!("[[input]]\n{keys}");
        let long = "serial = \"0123456789012345678901234567890123\"";
        for (text, words) in [
            (String::new(), &["`input` is missing", "[[input]]"][..]),
            (input("circuit = \"iepe\""), &["line 1", "`input`"]),
            (input("input = 0"), &["line 2", "from 1"]),
            (input("input = 2"), &["`circuit` is missing", "bridge"]),
            (cell("range = 5"), &["line 6", "no key `range`"]),
            (cell("supply = -1"), &["line 6", "supply, V"]),
            (cell("calibrated = \"2.3.2026\""), &["line 6", "2026-03-02"]),
            (cell("calibrated = \"2026-02-30\""), &["line 6", "calendar"]),
            (cell("uncertainty = 2"), &["line 6", "0.2 %"]),
            (cell("limits = [5, 4]"), &["line 6", "in order"]),
            (cell("gain = 3"), &["line 6", "128"]),
            (cell("offset = 1e12"), &["line 6", "24 bits"]),
            (cell(long), &["line 6", "34 bytes long", "at most 32"]),
            (twice, &["line 8", "each input once"]),
            (
                input("input = 1\ncircuit = \"digital\""),
                &["`per_count` is missing"],
            ),
            (
                input("input = 1\ncircuit = \"iepe\"\nsensitivity = 1"),
                &["`range` is missing", "largest value"],
            ),
        ] {
            let error = read(&text).unwrap_err().to_string();
            for word in words {
                assert!(error.contains(word), "{word}: {error}");
            }
        }
    }
}
