//! Sources of type B uncertainty: errors of sensors that a setup states, with their sizes.

use crate::identification::refusal::NOTED;
use crate::measure::{Change, ForceGain, Measurement};
use crate::setup::{Mount, Setup, Uncertainty};
use massline_core::identify::Identification;
use nalgebra::Vector3;
use std::f64::consts::FRAC_1_SQRT_2;

/// One independent error.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Source {
    /// In words, such as `position of a1 along y`.
    pub(super) name: String,
    /// By one standard uncertainty.
    pub(super) error: Error,
}

/// Target of an error.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Error {
    /// Properties of sensors, all at once.
    Sensors(Vec<Change>),
    /// The weighed mass, kg.
    Mass(f64),
    /// The same by as much as the mass in the data is another one, which is no error of that.
    Weighed(f64),
    /// Gains of forces in single runs.
    Forces(Vec<ForceGain>),
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// A channel as far as its errors are concerned.
struct Channel {
    name: String,
    /// Kind of its mounting: sensors of one kind at one place are one block.
    kind: u8,
    place: [u64; 3],
    stated: Uncertainty,
}

/// The error of gains that the data tell, under a name.
pub(super) fn of_gains(name: &str, gains: Vec<ForceGain>) -> Option<Source> {
    (!gains.is_empty()).then(|| Source {
        name: name.to_owned(),
        error: Error::Forces(gains),
    })
}

/// All errors of a setup. Sensitivities that neither the sensor nor its kind states have the
/// uncertainty of their certificate, where a recording carries it.
pub(super) fn sources(setup: &Setup, measurement: &Measurement) -> Vec<Source> {
    let mut sources = of_channels(&channels(setup, measurement));
    if let Some(u) = setup.known_mass_uncertainty {
        sources.push(Source {
            name: "mass on the balance".to_owned(),
            error: Error::Mass(u),
        });
    }
    sources
}

/// A weighed mass that the data contradict: either it is wrong, or the gains of all sensors are, and the truth lies at
/// one of two places. The deviation of one of them from either is the distance over √2, root mean square.
pub(super) fn of_weighed(setup: &Setup, i: &Identification) -> Option<Source> {
    let (mass, delta) = (setup.known_mass?, i.indicator?);
    let apart = (delta.value - 1.0).abs();
    let stated = 2.0 * setup.known_mass_uncertainty.unwrap_or(0.0) / mass;
    (apart > NOTED * (delta.interval(i.freedom) + stated)).then(|| Source {
        name: "the mass on the balance is not that in the data".to_owned(),
        error: Error::Weighed(apart * mass * FRAC_1_SQRT_2),
    })
}

/// Differences that sensors usually have from what is said of them: gain as a share, position in m, direction in
/// degrees.
const USUAL: Uncertainty = Uncertainty {
    noise: None,
    calibration: Some(0.005),
    position: Some(0.001),
    direction: Some(0.5),
};

/// Usual errors of all sensors that count: of each by itself, and of all accelerometers or load cells together,
/// whose gain may be that of one direction.
pub(super) fn usual(setup: &Setup, interface_only: bool) -> Vec<Source> {
    let mut channels = channels(setup, &Measurement::default());
    let counts = |channel: &Channel| !interface_only || channel.kind > 0;
    let directions: Vec<Vector3<f64>> = (setup.accelerometers.iter().map(|a| a.direction))
        .chain(setup.load_cells.iter().map(|c| c.direction))
        .map(Vector3::from)
        .collect();
    for channel in &mut channels {
        channel.stated = if counts(channel) {
            USUAL
        } else {
            Uncertainty::default()
        };
    }
    let mut sources = of_channels(&channels);
    let common = |name: String, changes: Vec<Change>| Source {
        name,
        error: Error::Sensors(changes),
    };
    for (kind, name) in [
        (0, "accelerometers on the structure"),
        (1, "accelerometers on the interface"),
        (2, "load cells"),
    ] {
        let of_kind = |number: &usize| channels[*number].kind == kind && counts(&channels[*number]);
        let members: Vec<usize> = (0..channels.len()).filter(of_kind).collect();
        if members.len() < 2 {
            continue;
        }
        for (axis, letter) in AXES.into_iter().enumerate() {
            let along = |number: &&usize| directions[**number].iamax() == axis;
            let gains = members.iter().filter(along);
            let gain =
                |number: &usize| Change::Gain(*number, USUAL.calibration.unwrap_or_default());
            sources.push(common(
                format!("calibration of all {name} along {letter}"),
                gains.map(gain).collect(),
            ));
            let mut by = Vector3::zeros();
            by[axis] = USUAL.position.unwrap_or_default();
            sources.push(common(
                format!("position of all {name} along {letter}"),
                vec![Change::Position(members.clone(), by)],
            ));
            by[axis] = USUAL.direction.unwrap_or_default().to_radians();
            sources.push(common(
                format!("direction of all {name} about {letter}"),
                vec![Change::Direction(members.clone(), by)],
            ));
        }
    }
    sources
}

/// The errors that channels state.
fn of_channels(channels: &[Channel]) -> Vec<Source> {
    let mut sources = Vec::new();
    for (number, channel) in channels.iter().enumerate() {
        if let Some(share) = channel.stated.calibration.filter(|u| *u > 0.0) {
            sources.push(Source {
                name: format!("calibration of {}", channel.name),
                error: Error::Sensors(vec![Change::Gain(number, share)]),
            });
        }
    }
    for (what, word, of) in [
        ("position", "along", position as fn(&Channel) -> Option<f64>),
        ("direction", "about", direction),
    ] {
        for (members, size) in blocks(channels, of) {
            let names: Vec<&str> = members.iter().map(|&k| &*channels[k].name).collect();
            for (axis, name) in AXES.into_iter().enumerate() {
                let mut by = Vector3::zeros();
                by[axis] = size;
                let members = members.clone();
                sources.push(Source {
                    name: format!("{what} of {} {word} {name}", names.join(", ")),
                    error: Error::Sensors(vec![match what {
                        "position" => Change::Position(members, by),
                        _ => Change::Direction(members, by),
                    }]),
                });
            }
        }
    }
    sources
}

fn position(channel: &Channel) -> Option<f64> {
    channel.stated.position
}

/// Radians.
fn direction(channel: &Channel) -> Option<f64> {
    channel.stated.direction.map(f64::to_radians)
}

fn channels(setup: &Setup, measurement: &Measurement) -> Vec<Channel> {
    let bits = |place: [f64; 3]| place.map(|x| (x + 0.0).to_bits());
    let certificate = |channel: &str| {
        let runs = measurement.runs.iter().map(|run| &run.preamble);
        let others = measurement.sines.iter().map(|run| &run.preamble);
        let poses = measurement.poses.iter().map(|run| &run.preamble);
        let all = runs.chain(others).chain(poses);
        // Certificates of several recordings are of one sensor; the worst one counts.
        all.filter_map(|p| p.channel.get(channel)?.uncertainty)
            .reduce(f64::max)
    };
    let with_certificate = |own: Uncertainty, channel: &str, stated: Uncertainty| Uncertainty {
        calibration: own
            .calibration
            .or_else(|| certificate(channel))
            .or(stated.calibration),
        ..stated
    };
    let sensors = setup
        .accelerometers
        .iter()
        .enumerate()
        .map(|(k, a)| Channel {
            name: a.channel.clone(),
            kind: u8::from(a.mount == Mount::Interface),
            place: bits(a.position),
            stated: with_certificate(
                a.uncertainty,
                &a.channel,
                setup.accelerometer_uncertainty(k),
            ),
        });
    let cells = setup.load_cells.iter().enumerate().map(|(k, c)| Channel {
        name: c.channel.clone(),
        kind: 2,
        place: bits(c.position),
        stated: with_certificate(c.uncertainty, &c.channel, setup.load_cell_uncertainty(k)),
    });
    sensors.chain(cells).collect()
}

/// Channels that move as one, with their common uncertainty: those of one kind at one place, as
/// a triaxial accelerometer or a load cell of several axes has them.
fn blocks(channels: &[Channel], of: fn(&Channel) -> Option<f64>) -> Vec<(Vec<usize>, f64)> {
    let mut blocks: Vec<(Vec<usize>, f64)> = Vec::new();
    for (number, channel) in channels.iter().enumerate() {
        let Some(size) = of(channel).filter(|u| *u > 0.0) else {
            continue;
        };
        let same = |(members, other): &&mut (Vec<usize>, f64)| {
            let first = &channels[members[0]];
            first.kind == channel.kind && first.place == channel.place && *other == size
        };
        match blocks.iter_mut().find(same) {
            Some((members, _)) => members.push(number),
            None => blocks.push((vec![number], size)),
        }
    }
    blocks
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn each_error_is_there_once() {
        let text = "known_mass = 5\nknown_mass_uncertainty = 0.01\n\
            [defaults]\nposition_uncertainty = 0.001\n[defaults.force]\ncalibration_uncertainty = 0.01\n\
            [[accelerometer]]\nchannel = \"x\"\nposition = [1, 0, 0]\ndirection = [1, 0, 0]\ndirection_uncertainty = 1\n\
            [[accelerometer]]\nchannel = \"y\"\nposition = [1, -0.0, 0]\ndirection = [0, 1, 0]\nposition_uncertainty = 0\n\
            [[accelerometer]]\nchannel = \"z\"\nposition = [1, 0.0, 0]\ndirection = [0, 0, 1]\n\
            [[load_cell]]\nchannel = \"f\"\nposition = [1, 0, 0]\ndirection = [0, 0, 1]\n\
            [[run]]\nname = \"p\"\nrecording = \"p.csv\"\nexcitation = \"static\"\n";
        let setup = Setup::from_str(text, Path::new("s.toml")).unwrap();
        let found = sources(&setup, &Measurement::default());
        let names: Vec<&str> = found.iter().map(|s| &*s.name).collect();
        let expected = [
            "calibration of f",
            "position of x, z along x",
            "position of x, z along y",
            "position of x, z along z",
            "position of f along x",
            "position of f along y",
            "position of f along z",
            "direction of x about x",
            "direction of x about y",
            "direction of x about z",
            "mass on the balance",
        ];
        assert_eq!(names, expected);
        let degree = Vector3::new(1.0_f64.to_radians(), 0.0, 0.0);
        let Error::Sensors(changes) = &found[7].error else {
            panic!("{found:?}");
        };
        let [Change::Direction(channels, by)] = changes.as_slice() else {
            panic!("{found:?}");
        };
        assert_eq!((channels.as_slice(), by), (&[0][..], &degree));
    }
}
