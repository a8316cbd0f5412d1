//! Rigid bodies fixed to each other, and sprung masses on them.
//!
//! A sprung mass μ at r slides along the unit vector d on a spring and a damper. Its
//! displacement q relative to the body obeys μ (q̈ + dᵀ u_P) + c q̇ + k q = 0, so that
//! q̈ = D_r dᵀ [I | -skew(r)] a, and it pulls at the structure with μ q̈ d at r. Scaled to
//! unit modal mass it is one mode with L = √μ dᵀ [I | -skew(r)], and its point mass is
//! part of the rigid body in full.

use nalgebra::{Matrix3, Matrix6, Vector3};
use serde::{Deserialize, Deserializer};

use super::specimen::{Mode, Specimen, motion_row};
use crate::frame::shift;
use crate::setup::keys::{self, outside};

/// One rigid body.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct Body {
    #[serde(deserialize_with = "keys::text")]
    pub(super) name: String,
    /// kg.
    #[serde(deserialize_with = "keys::positive")]
    pub(super) mass: f64,
    /// m, specimen frame.
    #[serde(deserialize_with = "keys::vector")]
    pub(super) centre_of_gravity: Vector3<f64>,
    /// Inertia tensor about its own centre of gravity, kg m²; products enter with a
    /// minus sign as in eq (1).
    #[serde(default, deserialize_with = "inertia")]
    pub(super) inertia: Matrix3<f64>,
}

/// A point mass that slides on a spring.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct SprungMass {
    #[serde(deserialize_with = "keys::text")]
    pub(super) name: String,
    /// kg.
    #[serde(deserialize_with = "keys::positive")]
    pub(super) mass: f64,
    /// m, specimen frame.
    #[serde(deserialize_with = "keys::vector")]
    pub(super) position: Vector3<f64>,
    /// Unit vector.
    #[serde(deserialize_with = "keys::direction")]
    pub(super) direction: Vector3<f64>,
    /// Natural frequency on the body held fixed, Hz.
    #[serde(deserialize_with = "keys::positive")]
    pub(super) frequency: f64,
    /// Share of critical damping.
    #[serde(default, deserialize_with = "keys::share")]
    pub(super) damping: f64,
}

/// The inertia tensor of eq (1) from moments and products, the products as ∫xy dm with a plus
/// sign.
fn inertia<'de, D: Deserializer<'de>>(value: D) -> Result<Matrix3<f64>, D::Error> {
    #[derive(Default, Deserialize)]
    #[serde(default, deny_unknown_fields, expecting = "a table")]
    struct Terms {
        #[serde(deserialize_with = "keys::any")]
        xx: f64,
        #[serde(deserialize_with = "keys::any")]
        yy: f64,
        #[serde(deserialize_with = "keys::any")]
        zz: f64,
        #[serde(deserialize_with = "keys::any")]
        xy: f64,
        #[serde(deserialize_with = "keys::any")]
        xz: f64,
        #[serde(deserialize_with = "keys::any")]
        yz: f64,
    }
    let Terms {
        xx,
        yy,
        zz,
        xy,
        xz,
        yz,
    } = Terms::deserialize(value)?;
    let inertia = Matrix3::new(xx, -xy, -xz, -xy, yy, -yz, -xz, -yz, zz);
    let mut principal: [f64; 3] = inertia.symmetric_eigenvalues().into();
    principal.sort_by(f64::total_cmp);
    let [least, middle, most] = principal;
    // A thin plate reaches equality, and so does a rod with zero: leave room for rounding.
    let slack = 1e-9 * most.abs();
    if least < -slack || least + middle < most - slack {
        return Err(outside(
            format_args!(
                "that of no body: its principal moments are {least:.6}, {middle:.6} and \
                 {most:.6} kg m²"
            ),
            "none of these to exceed the sum of the other two; products are ∫xy dm with a plus \
             sign, about the body's own centre of gravity",
        ));
    }
    Ok(inertia)
}

/// Bodies and sprung masses as one specimen; modes keep the order of the sprung masses.
pub(super) fn specimen(bodies: &[Body], sprung: &[SprungMass]) -> Specimen {
    let mut mass_matrix = Matrix6::zeros();
    for body in bodies {
        mass_matrix += about_origin(body.mass, &body.centre_of_gravity, &body.inertia);
    }
    let modes = sprung
        .iter()
        .map(|mass| {
            mass_matrix += about_origin(mass.mass, &mass.position, &Matrix3::zeros());
            Mode {
                name: mass.name.clone(),
                frequency: mass.frequency,
                damping: mass.damping,
                exponent: 1.0,
                participation: motion_row(&mass.position, &mass.direction) * mass.mass.sqrt(),
            }
        })
        .collect();
    Specimen {
        mass_matrix,
        modes,
        plane: false,
    }
}

/// Reading of the mode by a sensor along the unit vector `direction` on a sprung mass.
pub(super) fn reading(mass: &SprungMass, direction: &Vector3<f64>) -> f64 {
    mass.direction.dot(direction) / mass.mass.sqrt()
}

/// Mass matrix about the frame's origin: what the body does at its own centre of
/// gravity, seen through the motion of that point.
fn about_origin(mass: f64, centre: &Vector3<f64>, inertia: &Matrix3<f64>) -> Matrix6<f64> {
    let mut local = Matrix6::zeros();
    local
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&(Matrix3::identity() * mass));
    local.fixed_view_mut::<3, 3>(3, 3).copy_from(inertia);
    let transform = shift(centre);
    transform.tr_mul(&(local * transform))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point mass about the origin, written out from eq (1).
    #[test]
    fn point_mass_matches_equation_1() {
        let (m, x, y, z) = (2.0, 0.1, -0.2, 0.3);
        let found = about_origin(m, &Vector3::new(x, y, z), &Matrix3::zeros());
        #[rustfmt::skip]
        let expected = Matrix6::new(
            m,      0.0,    0.0,    0.0,             m * z,           -m * y,
            0.0,    m,      0.0,    -m * z,          0.0,             m * x,
            0.0,    0.0,    m,      m * y,           -m * x,          0.0,
            0.0,    -m * z, m * y,  m * (y*y + z*z), -m * x * y,      -m * x * z,
            m * z,  0.0,    -m * x, -m * x * y,      m * (x*x + z*z), -m * y * z,
            -m * y, m * x,  0.0,    -m * x * z,      -m * y * z,      m * (x*x + y*y),
        );
        // Sums of at most two products of numbers below one: a few ε.
        assert!((found - expected).abs().max() < 1e-15);
    }

    /// The effective mass matrix of a sprung mass that may slide along x, y and z at once
    /// is the mass matrix of its point mass.
    #[test]
    fn three_directions_make_the_whole_mass() {
        let position = Vector3::new(0.4, 0.5, -0.6);
        let along = |direction| SprungMass {
            name: String::new(),
            mass: 3.0,
            position,
            direction,
            frequency: 40.0,
            damping: 0.01,
        };
        let sprung = [Vector3::x(), Vector3::y(), Vector3::z()].map(along);
        let modes = specimen(&[], &sprung[..]).modes;
        let effective: Matrix6<f64> = modes
            .iter()
            .map(|mode| mode.participation * mode.participation.transpose())
            .sum();
        let point = about_origin(3.0, &position, &Matrix3::zeros());
        assert!((effective - point).abs().max() < 1e-14);
    }
}
