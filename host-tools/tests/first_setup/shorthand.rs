//! Triaxial sensors, directions as words and types of sensors, each held against the long form.

use massline::setup::Setup;
use std::path::Path;

const SHORT: &str = r#"
[processing]
averaging_band = [2.0, 20.0]

[[sensor_type]]
name = "triax"
unit = "mV"
sensitivity = "100 mV/g"
noise = 0.02
position_uncertainty = 0.001
mount = "interface"

[[accelerometer]]
triaxial = "T1"
type = "triax"
position = [0.6, 0.5, 0.0]

[[accelerometer]]
triaxial = "T2"
channels = ["7", "8", "9"]
type = "triax"
position = [-0.6, 0.5, 0.0]
rotation = [0, 0, 90]
sensitivity = ["98 mV/g", "101 mV/g", "10.2 mV/(m/s²)"]
scale = [1, -1, 1]
noise = 0.03
mount = "structure"
ac_corner = [0.1, 0.2, 0.3]

[[accelerometer]]
channel = "a1"
position = [0, 0, 0]
direction = "-z"

[[load_cell]]
triaxial = "F"
position = [0, 0, 0]
unit = "kN"
directions = ["-x", "+y", [0, 0, -2]]

[[load_cell]]
channel = "My"
quantity = "moment"
direction = "Y"
unit = "pC"
sensitivity = "4 pC/N m"
delay = 2.5

[[run]]
name = "x"
recording = "x.csv"
reference = "drive"
reference_unit = "V"
"#;

fn read(text: &str) -> Setup {
    Setup::from_str(text, Path::new("bench/setup.toml")).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn the_short_form_is_the_long_one() {
    let setup = read(SHORT);
    let g = 9.80665;
    let found: Vec<_> = setup
        .accelerometers
        .iter()
        .map(|a| {
            (
                a.channel.as_str(),
                a.direction,
                a.scale,
                a.uncertainty.noise,
            )
        })
        .collect();
    let noise = (Some(0.02), Some(0.03));
    let expected = [
        ("T1:X", [1.0, 0.0, 0.0], g / 100.0, noise.0),
        ("T1:Y", [0.0, 1.0, 0.0], g / 100.0, noise.0),
        ("T1:Z", [0.0, 0.0, 1.0], g / 100.0, noise.0),
        // By 90° about z the sensor's x axis points along y, its y axis against x.
        ("7", [0.0, 1.0, 0.0], g / 98.0, noise.1),
        ("8", [-1.0, 0.0, 0.0], -(g / 101.0), noise.1),
        ("9", [0.0, 0.0, 1.0], 1.0 / 10.2, noise.1),
        ("a1", [0.0, 0.0, -1.0], 1.0, None),
    ];
    assert_eq!(found, expected);
    let mounts: Vec<_> = setup.accelerometers.iter().map(|a| a.mount).collect();
    let words: Vec<String> = mounts.iter().map(|m| format!("{m:?}")).collect();
    assert_eq!(words[..3], ["Interface", "Interface", "Interface"]);
    assert_eq!(words[3..], ["Structure"; 4]);
    let cells: Vec<_> = setup
        .load_cells
        .iter()
        .map(|c| (c.channel.as_str(), c.direction, c.scale, c.delay))
        .collect();
    let expected = [
        ("F:X", [-1.0, 0.0, 0.0], 1000.0, 0.0),
        ("F:Y", [0.0, 1.0, 0.0], 1000.0, 0.0),
        ("F:Z", [0.0, 0.0, -1.0], 1000.0, 0.0),
        ("My", [0.0, 1.0, 0.0], 0.25, 2.5),
    ];
    assert_eq!(cells, expected);
    assert_eq!(setup.accelerometers[3].uncertainty.position, Some(0.001));
    let corners = setup.accelerometers.iter().map(|a| a.ac_corner);
    let corners: Vec<f64> = corners.collect();
    assert_eq!(corners, [0.0, 0.0, 0.0, 0.1, 0.2, 0.3, 0.0]);
    // Printed entry by entry, and the same again.
    assert_eq!(read(&setup.to_toml()), setup);
    // A box's inputs are SI and in step: only the signs stay.
    let si = setup.with_readings_in_si();
    let scales: Vec<f64> = si.accelerometers.iter().map(|a| a.scale).collect();
    assert_eq!(scales, [1.0, 1.0, 1.0, 1.0, -1.0, 1.0, 1.0]);
    assert_eq!((si.load_cells[0].scale, si.load_cells[3].delay), (1.0, 0.0));
    // Its inputs do not know of the couplings before them.
    assert_eq!(si.accelerometers[4].ac_corner, 0.2);
}

/// The rotation is a rotation vector, as that of a run: along the vector (1, 1, 1) by 120° x goes
/// to y, y to z, z to x.
#[test]
fn a_rotation_is_a_vector_of_degrees() {
    let third = 120.0 / f64::sqrt(3.0);
    let text = SHORT.replace("[0, 0, 90]", &format!("[{third}, {third}, {third}]"));
    let directions: Vec<_> = read(&text).accelerometers[3..6]
        .iter()
        .map(|a| a.direction)
        .collect();
    for (found, expected) in
        directions
            .iter()
            .zip([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    {
        for (f, e) in found.iter().zip(expected) {
            // Rounding of 120/√3 degrees and of a cosine.
            assert!((f - e).abs() < 1e-14, "{directions:?}");
        }
    }
}

#[test]
fn lengths_of_all_kinds_are_converted_once() {
    let text = SHORT.replacen("\n[processing]", "length_unit = \"in\"\nreference_point = [1, 10, -100]\n[estimation]\ntolerance = 10\n[defaults]\nposition_uncertainty = 0.5\n[processing]", 1)
        .replace("reference_unit = \"V\"", "translation = [50, 0, 0]")
        .replace("position = [0.6, 0.5, 0.0]", "position = [2.5, 5, 0.1]");
    let setup = read(&text);
    assert_eq!(setup.reference_point, [0.0254, 0.254, -2.54]);
    assert_eq!(setup.estimation.tolerance, 0.254);
    assert_eq!(setup.defaults.all.position, Some(0.0127));
    assert_eq!(setup.runs[0].translation, [1.27, 0.0, 0.0]);
    assert_eq!(setup.accelerometers[0].position, [0.0635, 0.127, 0.00254]);
    assert_eq!(
        setup.accelerometers[0].uncertainty.position,
        Some(0.0000254)
    );
    assert_eq!(read(&setup.to_toml()), setup);
}

/// Wrong changes of the short setup, each with words of its message.
const MISTAKES: &str = r#"
unit = "kN" => unit = "g" => line 38 | [[load_cell]] 1 (triaxial "F") | `unit` is "g" | "N", "kN", "lbf" for a force
quantity = "moment" => quantity = "force"\nposition = [0,0,0] => `sensitivity` is "4 pC/N m" | pC/N
unit = "pC" => unit = "N" => `unit` is "N" | "N m", "kN m", "lbf in", "lbf ft" for a moment
unit = "mV" => unit = "furlong" => line 7 | [[sensor_type]] 1 (name "triax") | `unit` is "furlong" | "m/s²", "g", "mm/s²"
unit = "mV" => unit = "N" => [[sensor_type]] 1 | `unit` is "N" | an acceleration
unit = "mV" => unit = "g" => `sensitivity` is "100 mV/g" | none beside the unit "g"
unit = "kN" => unit = "counts" => [[load_cell]] 1 | `scale` is missing | N per count
unit = "kN" => unit = "V" => `sensitivity` is missing | "V/N"
"100 mV/g" => "100 mV" => line 8 | `sensitivity` is "100 mV" | a number with V or mV/m/s²
"100 mV/g" => "0 mV/g" => `sensitivity` is "0 mV/g"
"100 mV/g" => "4 pC/g" => `sensitivity` is "4 pC/g"
rotation = [0, 0, 90] => rotation = [0, 0, 90]\ndirections = ["x", "y", "z"] => `rotation` is given, too
["-x", "+y", [0, 0, -2]] => ["-x", "+x", "z"] => `directions` is not at right angles
["-x", "+y", [0, 0, -2]] => ["-x", "+y"] => `directions` is a list of 2
direction = "-z" => direction = "up" => `direction` is "up" | "+z" or [0, 0, 1]
direction = "-z" => => [[accelerometer]] 3 (channel "a1") | `direction` is missing
channel = "a1" => channels = ["a1"] => [[accelerometer]] 3 | `channel` is missing | `triaxial`
channel = "a1" => channel = "a1"\ntriaxial = "a" => `channel` is given, too
channel = "a1" => channel = "T1:Y" => line 31 | "T1:Y" | [[accelerometer]] 1 (triaxial "T1")
["7", "8", "9"] => ["7", "8"] => `channels` is a list of 2
scale = [1, -1, 1] => scale = [1, 0, 1] => `scale` is 0
scale = [1, -1, 1] => scale = [1, 1] => `scale` is a list of 2
channel = "a1" => channel = "a1"\nscale = [1, 1, 1] => `scale` is a list of 3 | triaxial
type = "triax" => type = "triaxx" => line 15 | `type` is "triaxx" | did you mean `triax`
name = "triax" => => [[sensor_type]] 1 | `name` is missing
noise = 0.02 => nose = 0.02 => `nose` | did you mean `noise`
noise = 0.02 => position = [0, 0, 0] => [[sensor_type]] | no key `position`
unit = "kN" => mount = "interface" => [[load_cell]] 1 | no key `mount`
delay = 2.5 => delay = 5000 => `delay` is 5000 | -4096 to 4096
delay = 2.5 => delay = "3 ms" => `delay` is the text "3 ms"
reference = "drive" => excitation = "sine" => `delay` is 2.5 | sine
reference = "drive" => => `reference_unit` is "V" | beside a `reference`
[processing] => length_unit = "ft"\n[processing] => line 2 | `length_unit` is "ft" | "m" or "mm" or "cm" or "in"
[processing] => length_unit = "mm"\n[defaults]\nposition_uncertainty = 1001\n[processing] => line 4 | `position_uncertainty` is 1001
"#;

#[test]
fn mistakes_are_located_and_explained() {
    let mut wrong = Vec::new();
    for case in MISTAKES.trim().lines() {
        let case = case.replace("\\n", "\n");
        let [from, to, parts] = case.split("=>").collect::<Vec<_>>()[..] else {
            panic!("{case}");
        };
        let (from, to) = (from.trim_matches(' '), to.trim_matches(' '));
        assert!(SHORT.contains(from), "{from}");
        let mut text = SHORT.replacen(from, to, 1);
        if to.contains("sine") {
            text = text.replace("reference_unit = \"V\"", "");
        }
        let message = Setup::from_str(&text, Path::new("bench/setup.toml")).expect_err(&case);
        let message = message.to_string();
        let mut parts = parts.split('|').map(str::trim);
        if !parts.all(|part| message.contains(part)) || !message.starts_with("bench/setup.toml") {
            wrong.push(format!("{case}\n    {message}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
