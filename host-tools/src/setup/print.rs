//! A setup as a file that an engineer would like to read.

use std::fmt::Write as _;

use crate::recording::{Checksum, Form};

use super::parse::word_of;
use super::sensors::{MOUNTS, QUANTITIES};
use super::{Estimation, Mount, Processing, Quantity, Run, Setup, Units, uncertainty};

/// Writing to a `String` cannot fail, so results of `write!` are dropped throughout.
pub(super) fn setup(setup: &Setup) -> String {
    let mut out = String::new();
    let _ = writeln!(out, "title = {}", quoted(&setup.title));
    let _ = writeln!(
        out,
        "reference_point = {}  # m, starting point A of the identification",
        list(&setup.reference_point)
    );
    match setup.known_mass {
        Some(mass) => {
            let _ = writeln!(out, "known_mass = {mass:?}  # kg, weighed");
        }
        None => out.push_str("# known_mass = 1.0  # kg, if the specimen was weighed\n"),
    }
    if let Some(u) = setup.known_mass_uncertainty {
        let _ = writeln!(out, "known_mass_uncertainty = {u:?}  # kg, k = 1");
    }
    if let Some(processing) = &setup.processing {
        print_processing(&mut out, processing);
    }
    print_estimation(&mut out, &setup.estimation);
    uncertainty::print_defaults(&mut out, &setup.defaults);
    print_form(&mut out, &setup.form);
    if let Some(frame) = &setup.frame {
        let [x, _, z] = &frame.axes;
        out.push_str("\n[frame]\n");
        let _ = writeln!(out, "origin = {}  # m, of the results", list(&frame.origin));
        let _ = writeln!(out, "x = {}\nz = {}", list(x), list(z));
    }

    out.push_str(
        "\n# Accelerometers: position in m, positive along direction, scale in m/s² per unit.\n",
    );
    for entry in &setup.accelerometers {
        let _ = writeln!(out, "\n[[accelerometer]]");
        let _ = writeln!(out, "channel = {}", quoted(&entry.channel));
        let _ = writeln!(out, "position = {}", list(&entry.position));
        let _ = writeln!(out, "direction = {}", list(&entry.direction));
        if entry.mount != Mount::Structure {
            let _ = writeln!(out, "mount = \"{}\"", word_of(&MOUNTS, entry.mount));
        }
        print_units(&mut out, &entry.units, entry.key_scale());
        print_timing(&mut out, entry.delay, entry.ac_corner);
        uncertainty::print(&mut out, &entry.uncertainty, "m/s²");
    }

    out.push_str(
        "\n# Load cells: positive where the load acts ON the structure, scale in N or N m per unit.\n",
    );
    for entry in &setup.load_cells {
        let _ = writeln!(out, "\n[[load_cell]]");
        let _ = writeln!(out, "channel = {}", quoted(&entry.channel));
        let _ = writeln!(out, "position = {}", list(&entry.position));
        let _ = writeln!(out, "direction = {}", list(&entry.direction));
        if entry.quantity != Quantity::Force {
            let _ = writeln!(
                out,
                "quantity = \"{}\"",
                word_of(&QUANTITIES, entry.quantity)
            );
        }
        print_units(&mut out, &entry.units, entry.key_scale());
        print_timing(&mut out, entry.delay, entry.ac_corner);
        let unit = match entry.quantity {
            Quantity::Force => "N",
            Quantity::Moment => "N m",
        };
        uncertainty::print(&mut out, &entry.uncertainty, unit);
    }

    out.push_str("\n# Runs: recordings lie beside this file.\n");
    for run in &setup.runs {
        print_run(&mut out, run);
    }
    out
}

fn print_processing(out: &mut String, processing: &Processing) {
    out.push_str("\n[processing]\n");
    if let Some(rate) = processing.sample_rate {
        let _ = writeln!(out, "sample_rate = {rate:?}  # Hz");
    }
    let _ = writeln!(out, "block_length = {}  # samples", processing.block_length);
    let _ = writeln!(out, "overlap = {:?}", processing.overlap);
    let _ = writeln!(
        out,
        "averaging_band = {}  # Hz, below the first elastic natural frequency",
        list(&processing.averaging_band)
    );
    if let Some(band) = &processing.mode_band {
        let _ = writeln!(
            out,
            "mode_band = {}  # Hz, around the first elastic natural frequencies",
            list(band)
        );
    }
}

fn print_estimation(out: &mut String, estimation: &Estimation) {
    let default = Estimation::default();
    if *estimation == default {
        return;
    }
    out.push_str("\n[estimation]\n");
    let _ = writeln!(out, "minimum_weight = {:?}", estimation.minimum_weight);
    let _ = writeln!(out, "modes = {}", estimation.modes);
    if let Some(band) = &estimation.fit_band {
        let _ = writeln!(out, "fit_band = {}  # Hz", list(band));
    }
    if let Some(highest) = &estimation.rigid_up_to {
        let _ = writeln!(out, "rigid_up_to = {highest:?}  # Hz, the interface");
    }
    let _ = writeln!(out, "tolerance = {:?}  # m", estimation.tolerance);
    let _ = writeln!(out, "iterations = {}", estimation.iterations);
}

fn print_units(out: &mut String, units: &Units, scale: f64) {
    let texts = [("unit", &units.unit), ("sensitivity", &units.sensitivity)];
    for (key, text) in texts {
        if let Some(text) = text {
            let _ = writeln!(out, "{key} = {}", quoted(text));
        }
    }
    // A unit such as counts asks for a scale even where it is one.
    if scale != 1.0 || units.unit.is_some() {
        let _ = writeln!(out, "scale = {scale:?}");
    }
}

fn print_timing(out: &mut String, delay: f64, ac_corner: f64) {
    if delay != 0.0 {
        let _ = writeln!(
            out,
            "delay = {delay:?}  # samples that the channel comes late"
        );
    }
    if ac_corner != 0.0 {
        let _ = writeln!(
            out,
            "ac_corner = {ac_corner:?}  # Hz, of its coupling to alternating current"
        );
    }
}

fn print_form(out: &mut String, form: &Form) {
    if *form == Form::default() {
        return;
    }
    out.push_str("\n[recording]\n");
    for (key, value) in [("delimiter", form.delimiter), ("decimal", form.decimal)] {
        if let Some(value) = value {
            let _ = writeln!(out, "{key} = {}", quoted(&char::from(value).to_string()));
        }
    }
    for (key, value) in [("header", form.header), ("first_row", form.first_row)] {
        if let Some(value) = value {
            let _ = writeln!(out, "{key} = {value}  # line");
        }
    }
    if let Some(time) = &form.time {
        let _ = writeln!(out, "time = {}", quoted(time));
    }
}

fn print_run(out: &mut String, run: &Run) {
    let _ = writeln!(out, "\n[[run]]");
    let _ = writeln!(out, "name = {}", quoted(&run.name));
    let _ = writeln!(
        out,
        "recording = {}",
        quoted(&run.recording.to_string_lossy())
    );
    if let Some(Checksum { crc32, bytes }) = run.checksum {
        let _ = writeln!(
            out,
            "checksum = {{ crc32 = \"{crc32:08x}\", bytes = {bytes} }}  # of the recording; take this line out if you change it"
        );
    }
    let _ = writeln!(out, "excitation = \"{}\"", run.excitation.word());
    match run.references.as_slice() {
        [] => {}
        [one] => {
            let _ = writeln!(out, "reference = {}", quoted(one));
        }
        several => {
            let names: Vec<String> = several.iter().map(|name| quoted(name)).collect();
            let _ = writeln!(out, "reference = [{}]", names.join(", "));
        }
    }
    if let Some(unit) = &run.reference_unit {
        let _ = writeln!(out, "reference_unit = {}", quoted(unit));
    }
    if let Some(first) = &run.repeats {
        let _ = writeln!(out, "repeats = {}", quoted(first));
    }
    if !run.weights.is_empty() {
        let weights: Vec<String> = run
            .weights
            .iter()
            .map(|(channel, weight)| format!("{} = {weight:?}", quoted(channel)))
            .collect();
        let _ = writeln!(out, "weights = {{ {} }}", weights.join(", "));
    }
    if run.is_remounted() {
        let _ = writeln!(
            out,
            "rotation = {}  # degrees, rotation vector from specimen to interface axes",
            list(&run.rotation)
        );
        let _ = writeln!(
            out,
            "translation = {}  # m, the specimen's origin in interface coordinates",
            list(&run.translation)
        );
    }
}

fn list(numbers: &[f64]) -> String {
    // `{:?}` of an f64 is the shortest text that reads back to the same bits, and
    // always has a point or an exponent, so that TOML takes it for a float.
    let numbers: Vec<String> = numbers.iter().map(|n| format!("{n:?}")).collect();
    format!("[{}]", numbers.join(", "))
}

/// A TOML basic string.
pub(crate) fn quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for character in text.chars() {
        match character {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\t' => out.push_str("\\t"),
            '\r' => out.push_str("\\r"),
            c if c.is_control() => {
                let _ = write!(out, "\\u{:04X}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}
