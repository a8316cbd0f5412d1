//! The section `[frame]`: origin and axes that results are given in.

use nalgebra::Vector3;
use serde::{Deserialize, Deserializer};

use super::keys::{self, outside};
use crate::frame::Frame;

/// The keys as they are written.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields, expecting = "a table")]
struct FrameKeys {
    #[serde(deserialize_with = "keys::vector")]
    origin: [f64; 3],
    #[serde(deserialize_with = "keys::direction")]
    x: Option<[f64; 3]>,
    #[serde(deserialize_with = "keys::direction")]
    y: Option<[f64; 3]>,
    #[serde(deserialize_with = "keys::direction")]
    z: Option<[f64; 3]>,
}

/// Largest deviation of the angle between the two axes from 90 degrees: directions that are read off
/// a drawing are rounded, those of other sensors are wrong by more.
const TOLERANCE: f64 = 0.1;
/// Product of unit vectors that are perpendicular to rounding, which are left untouched, so that a
/// setup that was written and read again is bit for bit the same.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

pub(super) fn read<'de, D: Deserializer<'de>>(value: D) -> Result<Option<Frame>, D::Error> {
    const EXPECTED: &str =
        "two of `x`, `y`, `z`, the third follows by the right hand; or none, and the axes stay";
    let keys = FrameKeys::deserialize(value)?;
    let origin = keys.origin;
    let given = [("x", keys.x), ("y", keys.y), ("z", keys.z)];
    let known: Vec<_> = given
        .into_iter()
        .filter_map(|(n, v)| Some((n, v?)))
        .collect();
    let [(first, a), (second, b)] = known[..] else {
        return match known.len() {
            0 => Ok(Some(Frame {
                origin,
                ..Frame::default()
            })),
            1 => Err(outside(
                format_args!("given by `{}` alone", known[0].0),
                EXPECTED,
            )),
            _ => Err(outside("given by three axes", EXPECTED)),
        };
    };
    let (a, b) = (Vector3::from(a), Vector3::from(b));
    let angle = a.dot(&b).clamp(-1.0, 1.0).acos().to_degrees();
    if (angle - 90.0).abs() > TOLERANCE {
        let expected = "axes that are perpendicular to each other";
        let found =
            format_args!("given by `{first}` and `{second}`, which are {angle:.1} degrees apart");
        return Err(outside(found, expected));
    }
    let b = square(&a, &b);
    // From x and z, whatever was given: what is written has them.
    let (x, z) = match (first, second) {
        ("x", "z") => (a, b),
        ("x", _) => (a, square(&a, &a.cross(&b))),
        _ => (square(&b, &a.cross(&b)), b),
    };
    // A zero has no sign.
    let axes = [x, z.cross(&x), z].map(|axis| axis.map(|c| c + 0.0).into());
    Ok(Some(Frame { origin, axes }))
}

/// The unit vector next to `b` that is perpendicular to the unit vector `a`.
fn square(a: &Vector3<f64>, b: &Vector3<f64>) -> Vector3<f64> {
    let dot = a.dot(b);
    if dot.abs() <= ROUNDING {
        // Products of unit vectors are so to rounding, too.
        return keys::unit((*b).into()).map_or(*b, Vector3::from);
    }
    let rest = b - a * dot;
    let found = keys::unit(rest.into()).map_or(rest, Vector3::from);
    if a.dot(&found).abs() <= ROUNDING {
        return found;
    }
    // Once more, where much was taken off.
    let rest = found - a * a.dot(&found);
    keys::unit(rest.into()).map_or(rest, Vector3::from)
}
