//! The setup as text, with a comment in place of each value that is not known.

use super::channels::{Found, Sensor};
use super::names::Kind;
use crate::printable::printable;
use crate::setup::{Excitation, Mount, is_electric, measured_in, toml_text};
use std::collections::HashSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Values that sensors share, written once as a `[[sensor_type]]`.
#[derive(Clone, Debug, PartialEq)]
struct Shared {
    kind: Kind,
    unit: Option<String>,
    sensitivity: Option<String>,
    in_header: Option<String>,
}

impl Shared {
    fn of(sensor: &Sensor) -> Self {
        Self {
            kind: sensor.kind.unwrap_or(Kind::Acceleration),
            unit: sensor.unit.clone(),
            sensitivity: sensor.sensitivity.clone(),
            in_header: sensor.in_header.clone(),
        }
    }
}

/// The text of a setup in the folder of `out`. Writing to a `String` cannot fail, so results of
/// `write!` are dropped.
#[must_use]
pub fn draft(found: &Found, out: &Path) -> String {
    let mut text = String::from(
        "# Drafted by `massline init` from the channels of the recordings. Lines with `fill in` wait for\n\
         # what no recording says; `massline identify` names the first of them that it misses.\n\n",
    );
    let _ = writeln!(
        text,
        "length_unit = {}  # of all lengths here: m, mm, cm or in\n\
         # reference_point = [0.0, 0.0, 0.0]\n\
         # known_mass = 1.0  # kg, if the specimen was weighed\n",
        toml_text(&found.length_unit)
    );
    processing(&mut text, found);
    let mut types: Vec<Shared> = Vec::new();
    for sensor in &found.sensors {
        let shared = Shared::of(sensor);
        if !types.contains(&shared) {
            types.push(shared);
        }
    }
    for (number, shared) in types.iter().enumerate() {
        sensor_type(&mut text, shared, &type_name(&types, number));
    }
    let load = |s: &&Sensor| matches!(s.kind, Some(Kind::Force | Kind::Moment));
    let motion: Vec<&Sensor> = found.sensors.iter().filter(|s| !load(s)).collect();
    let forces: Vec<&Sensor> = found.sensors.iter().filter(load).collect();
    text.push_str("\n# Accelerometers, those with mount = \"interface\" on the table.\n");
    for sensor in motion {
        entry(&mut text, sensor, &types, "accelerometer");
    }
    text.push_str("\n# Load cells; positive: the load acts ON the structure.\n");
    if forces.is_empty() {
        text.push_str(
            "# fill in: no channel is known to be a load cell. Turn the [[accelerometer]] of each that is one into [[load_cell]].\n",
        );
    }
    for sensor in forces {
        entry(&mut text, sensor, &types, "load_cell");
    }
    if !found.left_out.is_empty() {
        text.push_str("\n# Channels without an entry: of another quantity, not in every recording or not in the table of sensors:\n");
        for channel in &found.left_out {
            let _ = writeln!(text, "#   {channel}");
        }
    }
    runs(&mut text, found, out);
    text
}

fn processing(text: &mut String, found: &Found) {
    text.push_str("[processing]\n");
    match found.band {
        Some([low, high]) => {
            let _ = writeln!(text, "averaging_band = [{low:?}, {high:?}]  # Hz");
        }
        None => text.push_str(
            "# averaging_band = [2.0, 20.0]  # fill in: Hz, lower and upper end, below the first elastic natural frequency\n",
        ),
    }
    text.push_str(
        "# mode_band = [30.0, 75.0]  # Hz, where the structure first rings, if you know it\n",
    );
    if let Some(rate) = found.sample_rate {
        let _ = writeln!(text, "sample_rate = {rate:?}  # Hz");
    } else if !found.has_rate {
        text.push_str("# sample_rate = 1000.0  # fill in: Hz, for the recordings do not say it\n");
    }
}

fn type_name(types: &[Shared], number: usize) -> String {
    let word = |shared: &Shared| match shared.kind {
        Kind::Acceleration => "accelerometer",
        Kind::Force => "force",
        Kind::Moment => "moment",
    };
    let own = word(&types[number]);
    let before = types[..number].iter().filter(|t| word(t) == own).count();
    match before {
        0 => own.to_owned(),
        more => format!("{own} {}", more + 1),
    }
}

fn sensor_type(text: &mut String, shared: &Shared, name: &str) {
    let _ = writeln!(text, "\n[[sensor_type]]\nname = {}", toml_text(name));
    let units = match shared.kind {
        Kind::Acceleration => "\"m/s²\", \"g\", \"mm/s²\"",
        Kind::Force => "\"N\", \"kN\", \"lbf\"",
        Kind::Moment => "\"N m\", \"kN m\", \"lbf in\", \"lbf ft\"",
    };
    if shared.kind == Kind::Moment {
        text.push_str("quantity = \"moment\"\n");
    }
    let unit = shared.unit.as_ref().or(shared.in_header.as_ref());
    match (&shared.unit, &shared.in_header) {
        (Some(unit), _) => {
            let _ = writeln!(text, "unit = {}", toml_text(unit));
        }
        (None, Some(unit)) if measured_in(unit) == Some(shared.kind) || is_electric(unit) => {
            let _ = writeln!(text, "unit = {}  # as the recordings say", toml_text(unit));
        }
        (None, _) => {
            let _ = writeln!(
                text,
                "unit = \"?\"  # fill in, for the recordings do not say it: {units}, \"V\", \"mV\", \"pC\" or \"counts\""
            );
        }
    }
    match (&shared.sensitivity, unit) {
        (Some(sensitivity), _) => {
            let _ = writeln!(text, "sensitivity = {}", toml_text(sensitivity));
        }
        (None, Some(unit)) if is_electric(unit) => {
            text.push_str(
                "# sensitivity = \"100 mV/g\"  # fill in: by the data sheet or the certificate\n",
            );
        }
        _ => {}
    }
}

fn entry(text: &mut String, sensor: &Sensor, types: &[Shared], list: &str) {
    let shared = Shared::of(sensor);
    let number = types.iter().position(|t| *t == shared).unwrap_or(0);
    let _ = writeln!(text, "\n[[{list}]]");
    if sensor.kind.is_none() {
        text.push_str("# fill in: its name does not say that it is an accelerometer; for a load cell write [[load_cell]] and another type\n");
    }
    let axes = ["X", "Y", "Z"].map(|axis| format!("{}:{axis}", sensor.name));
    let list_of = |words: &[String]| {
        let all: Vec<String> = words.iter().map(|word| toml_text(word)).collect();
        format!("[{}]", all.join(", "))
    };
    match sensor.channels.as_slice() {
        [one] => {
            let _ = writeln!(text, "channel = {}", toml_text(one));
        }
        three => {
            let _ = writeln!(text, "triaxial = {}", toml_text(&sensor.name));
            if *three != axes {
                let _ = writeln!(text, "channels = {}", list_of(three));
            }
        }
    }
    let _ = writeln!(text, "type = {}", toml_text(&type_name(types, number)));
    match sensor.position {
        Some(position) => {
            let _ = writeln!(text, "position = {position:?}");
        }
        None if sensor.kind == Some(Kind::Moment) => {}
        None => text.push_str(
            "# position = [0.0, 0.0, 0.0]  # fill in: x, y, z in the unit of length above\n",
        ),
    }
    match (sensor.channels.len(), sensor.directions.as_slice()) {
        (1, [one]) => {
            let _ = writeln!(text, "direction = {}", toml_text(one));
        }
        (1, _) => text
            .push_str("# direction = \"+z\"  # fill in: the axis along which it reads positive\n"),
        (_, directions) if directions.is_empty() || *directions == ["+x", "+y", "+z"] => {
            text.push_str(
                "# rotation = [0, 0, 90]  # degrees, if its axes are not those of the table\n",
            );
        }
        (_, directions) => {
            let _ = writeln!(text, "directions = {}", list_of(directions));
        }
    }
    if list == "accelerometer" {
        text.push_str(match sensor.mount {
            Some(Mount::Interface) => "mount = \"interface\"\n",
            Some(Mount::Structure) => "mount = \"structure\"\n",
            None => "# mount = \"interface\"  # fill in if it sits on the table or the adapter\n",
        });
    }
}

fn runs(text: &mut String, found: &Found, out: &Path) {
    text.push_str("\n# Runs, one a recording.\n");
    let mut taken = HashSet::new();
    for run in &found.runs {
        let stem = stem_of(&run.file);
        let mut name = stem.clone();
        let mut number = 2;
        while !taken.insert(name.clone()) {
            name = format!("{stem} {number}");
            number += 1;
        }
        let recording = seen_from(&run.file, out);
        let _ = writeln!(
            text,
            "\n[[run]]\nname = {}\nrecording = {}",
            toml_text(&name),
            toml_text(&recording.to_string_lossy())
        );
        if run.excitation != Excitation::Random {
            let _ = writeln!(text, "excitation = \"{}\"", run.excitation.word());
        }
        match run.references.as_slice() {
            [] if run.excitation == Excitation::Random => {
                text.push_str(
                    "# reference = \"drive\"  # the generator's signal, if it was recorded\n",
                );
            }
            [] => {}
            [one] => {
                let _ = writeln!(text, "reference = {}", toml_text(one));
            }
            several => {
                let all: Vec<String> = several.iter().map(|name| toml_text(name)).collect();
                let _ = writeln!(
                    text,
                    "# reference = {}  # fill in: the generator's signal; a list of them, [{}], only where drives shake by themselves",
                    toml_text(&several[0]),
                    all.join(", ")
                );
            }
        }
    }
}

/// Name of a file without `.csv`, `.gz` and the like.
fn stem_of(file: &Path) -> String {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let stem = match name.find('.') {
        None | Some(0) => &name,
        Some(at) => &name[..at],
    };
    printable(stem).into_owned()
}

/// A recording's path as a setup in the folder of `out` has to name it.
fn seen_from(file: &Path, out: &Path) -> PathBuf {
    let folder = out.parent().unwrap_or(Path::new(""));
    if folder.as_os_str().is_empty() || file.is_absolute() {
        return file.to_owned();
    }
    match file.strip_prefix(folder) {
        Ok(below) => below.to_owned(),
        Err(_) => std::path::absolute(file).unwrap_or_else(|_| file.to_owned()),
    }
}
