//! Tests of whole simulations.

mod files;
mod fork;
mod signals;

use std::path::{Path, PathBuf};

use super::*;

/// The example models that the tool ships.
fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("models")
        .join(name)
}

fn run(model: &Model, options: &Options) -> Simulation {
    simulate(model, options, &mut |_| ()).unwrap()
}

/// A small specimen with one sprung mass, one run and a few sensors.
const SMALL: &str = r#"
title = "Small"

[[body]]
name = "block"
mass = 10.0
centre_of_gravity = [0.01, 0.02, 0.10]
inertia = { xx = 0.05, yy = 0.06, zz = 0.07, xy = 0.002 }

[[sprung_mass]]
name = "board"
mass = 1.0
position = [0.05, 0.0, 0.2]
direction = [0, 0, 2]
frequency = 40.0
damping = 0.02

[[accelerometer]]
name = "base"
position = [0.1, 0.1, 0.0]
on = "interface"

[[accelerometer]]
name = "board.z"
direction = [0, 0, 1]
on = "board"

[[load_cell]]
name = "left"
position = [-0.1, 0.0, 0.0]

[[load_cell]]
name = "right"
position = [0.1, 0.0, 0.0]

[[load_cell]]
name = "back"
position = [0.0, 0.1, 0.0]

[table]
cross_talk = 0.02
resonance = { frequency = 120.0, damping = 0.05 }

[measurement]
duration = 4.0
block_length = 256
averaging_band = [2.0, 20.0]
noise = 0.01

[[run]]
name = "Z"
motion = [0, 0, 1, 0, 0, 0]
"#;

fn small() -> Model {
    small_with("", "")
}

/// The small model after one replacement, which must apply.
fn small_with(from: &str, to: &str) -> Model {
    Model::from_toml(&text_with(from, to), Path::new("small.toml")).unwrap()
}

fn text_with(from: &str, to: &str) -> String {
    assert!(SMALL.contains(from), "{from}");
    SMALL.replacen(from, to, 1)
}
