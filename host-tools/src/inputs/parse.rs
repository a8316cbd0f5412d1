//! TOML to inputs.

use super::InputEntry;
use crate::printable::quoted;
use crate::setup::{DocumentError, Section, Source};
use massline_firmware::calibration::{Certificate, Limits, Preset};
use massline_firmware::wire::{Circuit, Date, Field, Input, Item, NAME_MAX, Problem};

/// Supply of bridges that the wiring page describes, V.
const SUPPLY: f64 = 3.3;

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

pub(super) fn document(source: &Source) -> Result<Vec<InputEntry>, DocumentError> {
    let document = source.parse()?;
    let root = Section::root(source, &document);
    root.only(&["input"])?;
    let found = root.count("input");
    if found > MOST {
        let expected = format!("at most {MOST}, one for each input");
        return Err(root.unexpected("input", format!("a list of {found}"), expected));
    }
    let sections = root.sections("input", "channel")?;
    if sections.is_empty() {
        return Err(root.missing("input", "one [[input]] for each input that is wired"));
    }
    let mut entries: Vec<InputEntry> = Vec::new();
    for section in &sections {
        let entry = input(section)?;
        if entries.iter().any(|e| e.input == entry.input) {
            let expected = "each input once";
            return Err(section.unexpected("input", entry.number(), expected));
        }
        if let Some(channel) = &entry.channel
            && entries.iter().any(|e| e.column() == *channel)
        {
            let expected = "a name that no other input has";
            return Err(section.unexpected(
                "channel",
                format!("\"{}\"", quoted(channel)),
                expected,
            ));
        }
        entries.push(entry);
    }
    Ok(entries)
}

fn input(section: &Section<'_>) -> Result<InputEntry, DocumentError> {
    let whole = |x: f64| x.fract() == 0.0 && (1.0..=256.0).contains(&x);
    let expected = "the number of an input, from 1";
    let number = section
        .number_where("input", expected, whole)?
        .ok_or_else(|| section.missing("input", "the number of the input, from 1"))?;
    let kind = section.choice("circuit", &KINDS)?.ok_or_else(|| {
        section.missing(
            "circuit",
            "\"bridge\", \"charge\", \"iepe\", \"voltage\", \"adxl355\", \"digital\" or \"unused\"",
        )
    })?;
    let preset = preset(section, kind)?;
    let number = (number - 1.0) as u8;
    let [serial, certificate] = [text(section, "serial")?, text(section, "certificate")?];
    let mut input = preset.input(number, &serial, &certificate, date(section)?, 0.0);
    if let Some(uncertainty) = section.number("uncertainty")? {
        input.uncertainty = uncertainty;
    }
    if let Some(per_count) = section.number("per_count")? {
        input.per_count = per_count;
    }
    if let Some(offset) = section.number("offset")? {
        input.offset = offset;
    }
    let power = |x: f64| (0..8).any(|k| f64::from(1 << k) == x);
    if let Some(gain) = section.number_where("gain", "1, 2, 4, 8, 16, 32, 64 or 128", power)? {
        input.gain = gain as u8;
    }
    if let Some(limits) = section.vector::<2>("limits")? {
        input.limits = limits.map(|x| x as i32);
    }
    Ok(InputEntry {
        input: number,
        channel: section.text("channel")?,
        certificate: Certificate::new(&input).map_err(|p| refused(section, &input, &p))?,
    })
}

/// Calibration that follows from the data sheet, or the circuit alone where `per_count` is given
/// in its place.
fn preset(section: &Section<'_>, kind: Kind) -> Result<Preset, DocumentError> {
    let sheet: &[&'static str] = match kind {
        Kind::Unused | Kind::Digital | Kind::Adxl355 => &[],
        Kind::Voltage => &["sensitivity", "range"],
        Kind::Bridge => &["rated_load", "rated_output", "supply"],
        Kind::Charge => &["sensitivity", "amplifier", "divider", "range"],
        Kind::Iepe => &["sensitivity", "divider", "range"],
    };
    let known: Vec<&str> = match kind {
        // An input that nothing is wired to has no calibration.
        Kind::Unused => vec!["input", "channel", "circuit"],
        _ => OWN.iter().chain(sheet).copied().collect(),
    };
    section.only(&known)?;
    let circuit = match kind {
        Kind::Unused => Circuit::Unused,
        Kind::Voltage => Circuit::Voltage,
        Kind::Bridge => Circuit::Bridge,
        Kind::Charge => Circuit::Charge,
        Kind::Iepe => Circuit::Iepe,
        Kind::Digital => Circuit::Digital,
        Kind::Adxl355 => return Ok(Preset::adxl355()),
    };
    let direct = section.has("per_count") && !sheet.iter().any(|key| section.has(key));
    if direct || kind == Kind::Unused {
        return Ok(Preset {
            circuit,
            per_count: 1.0,
            gain: 1,
            limits: Limits::CONVERTER,
        });
    }
    let positive = |key: &'static str, expected: &'static str| {
        let found = section.number_where(key, expected, |x| x > 0.0)?;
        found.ok_or_else(|| section.missing(key, expected))
    };
    let signed = |key: &'static str, expected: &'static str| {
        let found = section.number_where(key, expected, |x| x != 0.0)?;
        found.ok_or_else(|| section.missing(key, expected))
    };
    let share = || {
        let expected = "the share of the voltage that reaches the input, above 0 and at most 1";
        let found = section.number_where("divider", expected, |x| x > 0.0 && x <= 1.0)?;
        Ok(found.unwrap_or(1.0))
    };
    let range = || positive("range", "the largest value to be measured, SI");
    Ok(match kind {
        Kind::Bridge => {
            let supply = section.number_where("supply", "the bridge's supply, V", |x| x > 0.0)?;
            Preset::bridge(
                positive("rated_load", "the rated load, N or N m")?,
                signed(
                    "rated_output",
                    "V per V of supply at the rated load, such as 2e-3",
                )?,
                supply.unwrap_or(SUPPLY),
            )
        }
        Kind::Charge => Preset::charge(
            signed("sensitivity", "C per SI unit, such as 4e-12")?,
            positive("amplifier", "V per C of the charge amplifier, such as 1e9")?,
            share()?,
            range()?,
        ),
        Kind::Iepe => Preset::iepe(
            signed("sensitivity", "V per SI unit, such as 0.0102 for 100 mV/g")?,
            share()?,
            range()?,
        ),
        Kind::Voltage => Preset::voltage(
            circuit,
            signed("sensitivity", "V per SI unit, or V per V")?,
            range()?,
        ),
        _ => {
            let expected = "m/s², N or N m per count";
            return Err(section.missing("per_count", expected));
        }
    })
}

fn text(section: &Section<'_>, key: &str) -> Result<String, DocumentError> {
    let text = section.text(key)?.unwrap_or_default();
    if text.len() > NAME_MAX {
        let found = format!("{} bytes long", text.len());
        return Err(section.unexpected(key, found, format!("at most {NAME_MAX} bytes")));
    }
    Ok(text)
}

fn date(section: &Section<'_>) -> Result<Option<Date>, DocumentError> {
    let Some(text) = section.text("calibrated")? else {
        return Ok(None);
    };
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
    Err(section.unexpected("calibrated", format!("\"{}\"", quoted(&text)), expected))
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
            (2, Preset::bridge(500.0, -2e-3, 3.3)),
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
        for (text, words) in [
            (String::new(), &["`input` is missing", "[[input]]"][..]),
            (
                "[[input]]\ncircuit = \"iepe\"".to_owned(),
                &["line 1", "`input`"],
            ),
            ("[[input]]\ninput = 0".to_owned(), &["line 2", "from 1"]),
            (
                "[[input]]\ninput = 2".to_owned(),
                &["`circuit` is missing", "bridge"],
            ),
            (cell("range = 5"), &["line 6", "no key `range`"]),
            (cell("supply = -1"), &["line 6", "supply, V"]),
            (cell("calibrated = \"2.3.2026\""), &["line 6", "2026-03-02"]),
            (cell("calibrated = \"2026-02-30\""), &["line 6", "calendar"]),
            (cell("uncertainty = 2"), &["line 6", "0.2 %"]),
            (cell("limits = [5, 4]"), &["line 6", "in order"]),
            (cell("gain = 3"), &["line 6", "128"]),
            (cell("offset = 1e12"), &["line 6", "24 bits"]),
            (
                cell("serial = \"0123456789012345678901234567890123\""),
                &["line 6", "34 bytes long", "at most 32"],
            ),
            (twice, &["line 8", "each input once"]),
            (
                "[[input]]\ninput = 1\ncircuit = \"digital\"".to_owned(),
                &["`per_count` is missing"],
            ),
            (
                "[[input]]\ninput = 1\ncircuit = \"iepe\"\nsensitivity = 1".to_owned(),
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
