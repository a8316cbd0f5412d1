//! Plane frames of Euler-Bernoulli beams in the x-z plane, read from JSON as
//! `models/README.md` describes it.
//!
//! A node has the degrees of freedom u_x, u_z and β, the rotation about y; a rigid
//! motion is u_x(P) = u_x + z β, u_z(P) = u_z - x β, which is eq (2) at y = 0. Masses are
//! consistent, so that the rigid-body properties of the mesh are those of its lines; rotary
//! inertia and shear are left out. The base node is part of the rigid interface.

use std::path::Path;

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, SMatrix, Vector3, Vector6};
use serde::Deserialize;

use super::error::ModelError;
use super::specimen::{Mode, Specimen};

/// A plane frame with its sensors; SI units.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct BeamModel {
    pub(super) title: Option<String>,
    node_coordinates_xz: Vec<[f64; 2]>,
    elements: Vec<Element>,
    #[serde(default)]
    lumped_masses: Vec<LumpedMass>,
    base_node: usize,
    damping: Damping,
    pub(super) sensors: Vec<BeamSensor>,
}

/// A straight beam of constant section.
#[derive(Debug, Clone, Deserialize)]
struct Element {
    n1: usize,
    n2: usize,
    /// Young's modulus, N/m².
    #[serde(rename = "E")]
    modulus: f64,
    /// Section area, m².
    #[serde(rename = "A")]
    area: f64,
    /// Second moment of area about y, m⁴.
    #[serde(rename = "I")]
    second_moment: f64,
    /// kg/m³.
    rho: f64,
}

#[derive(Debug, Clone, Deserialize)]
struct LumpedMass {
    node: usize,
    /// kg.
    mass: f64,
    /// About y, kg m².
    #[serde(default)]
    inertia: f64,
}

#[derive(Debug, Clone, Deserialize)]
struct Damping {
    zeta: f64,
}

/// An accelerometer on a node, or on a rigid arm from it.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct BeamSensor {
    node: usize,
    #[serde(rename = "dir")]
    pub(super) axis: BeamAxis,
    /// From the node to the sensor, (x, z) in m.
    #[serde(default)]
    rigid_offset: [f64; 2],
    #[serde(default)]
    pub(super) base_plate: bool,
}

/// The two directions of a plane model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum BeamAxis {
    X,
    Z,
}

/// The frame reduced to what its interface and its sensors see.
pub(super) struct ReducedBeam {
    pub(super) specimen: Specimen,
    /// Position of the base node, (x, z) in m.
    pub(super) base: [f64; 2],
    /// Per sensor: position (m) and motion in each mode (unit modal mass).
    pub(super) sensors: Vec<([f64; 3], Vec<f64>)>,
}

/// Indices of the plane's three motions among the six of a rigid body.
const PLANE: [usize; 3] = [0, 2, 4];

impl BeamModel {
    pub(super) fn from_json(text: &str, file: &Path) -> Result<Self, ModelError> {
        let model: Self = serde_json::from_str(text).map_err(|source| ModelError::Json {
            file: file.to_owned(),
            source,
        })?;
        model.check(file)?;
        Ok(model)
    }

    fn check(&self, file: &Path) -> Result<(), ModelError> {
        let nodes = self.node_coordinates_xz.len();
        let node = |what: String, node: usize| {
            if node < nodes {
                return Ok(());
            }
            Err(ModelError::NoSuchNode {
                file: file.to_owned(),
                what,
                node,
                nodes,
            })
        };
        let at_least = |what: String, key: &'static str, found: f64, zero: bool| {
            if found.is_finite() && (found > 0.0 || (zero && found == 0.0)) {
                return Ok(());
            }
            Err(ModelError::BeamValue {
                file: file.to_owned(),
                what,
                key,
                found,
                expected: if zero { "at least 0" } else { "more than 0" },
            })
        };
        node("`base_node`".to_owned(), self.base_node)?;
        at_least("`damping`".to_owned(), "zeta", self.damping.zeta, true)?;
        for (index, element) in self.elements.iter().enumerate() {
            let what = format!("element {}", index + 1);
            node(what.clone(), element.n1)?;
            node(what.clone(), element.n2)?;
            at_least(what.clone(), "E", element.modulus, false)?;
            at_least(what.clone(), "A", element.area, false)?;
            at_least(what.clone(), "I", element.second_moment, false)?;
            at_least(what.clone(), "rho", element.rho, false)?;
            at_least(what, "length", self.span(element).2, false)?;
        }
        for (index, lumped) in self.lumped_masses.iter().enumerate() {
            let what = format!("lumped mass {}", index + 1);
            node(what.clone(), lumped.node)?;
            at_least(what.clone(), "mass", lumped.mass, true)?;
            at_least(what, "inertia", lumped.inertia, true)?;
        }
        for (index, sensor) in self.sensors.iter().enumerate() {
            let what = format!("sensor {}", index + 1);
            node(what.clone(), sensor.node)?;
            if sensor.base_plate && sensor.node != self.base_node {
                return Err(ModelError::OffTheBase {
                    file: file.to_owned(),
                    what,
                    node: sensor.node,
                    base: self.base_node,
                });
            }
        }
        if self.sensors.is_empty() {
            return Err(ModelError::NoEntries {
                file: file.to_owned(),
                list: "sensor",
                reason: "no motion would be recorded",
            });
        }
        match self.loose_node() {
            Some(node) => Err(ModelError::Loose {
                file: file.to_owned(),
                node,
                base: self.base_node,
            }),
            None => Ok(()),
        }
    }

    /// A node that no chain of elements holds to the base.
    fn loose_node(&self) -> Option<usize> {
        let mut held = vec![false; self.node_coordinates_xz.len()];
        held[self.base_node] = true;
        // A chain is at most as long as there are nodes; each pass lengthens all chains.
        for _ in 0..held.len() {
            for element in &self.elements {
                let reached = held[element.n1] || held[element.n2];
                held[element.n1] = reached;
                held[element.n2] = reached;
            }
        }
        held.iter().position(|held| !held)
    }

    /// Direction cosines along x and z, and length (m).
    fn span(&self, element: &Element) -> (f64, f64, f64) {
        let [x1, z1] = self.node_coordinates_xz[element.n1];
        let [x2, z2] = self.node_coordinates_xz[element.n2];
        let (dx, dz) = (x2 - x1, z2 - z1);
        let length = (dx * dx + dz * dz).sqrt();
        (dx / length, dz / length, length)
    }

    /// Stiffness and mass matrices of the free frame.
    fn assemble(&self) -> (DMatrix<f64>, DMatrix<f64>) {
        let size = 3 * self.node_coordinates_xz.len();
        let mut stiffness = DMatrix::zeros(size, size);
        let mut mass = DMatrix::zeros(size, size);
        for element in &self.elements {
            let (cos, sin, length) = self.span(element);
            let (k, m) = element_matrices(element, length);
            // Along the beam e = (cos, sin); the normal n = (sin, -cos) makes β the slope
            // dw/ds: a rotation β moves the tip, e away, by (z, -x) β = n β.
            let turn = Matrix3::new(cos, sin, 0.0, sin, -cos, 0.0, 0.0, 0.0, 1.0);
            let mut transform = SMatrix::<f64, 6, 6>::zeros();
            transform.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
            transform.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
            let k = transform.tr_mul(&(k * transform));
            let m = transform.tr_mul(&(m * transform));
            for row in 0..6 {
                for column in 0..6 {
                    let at = |local: usize| {
                        let node = if local < 3 { element.n1 } else { element.n2 };
                        3 * node + local % 3
                    };
                    stiffness[(at(row), at(column))] += k[(row, column)];
                    mass[(at(row), at(column))] += m[(row, column)];
                }
            }
        }
        for lumped in &self.lumped_masses {
            let first = 3 * lumped.node;
            mass[(first, first)] += lumped.mass;
            mass[(first + 1, first + 1)] += lumped.mass;
            mass[(first + 2, first + 2)] += lumped.inertia;
        }
        (stiffness, mass)
    }

    /// Rigid motion of all degrees of freedom under unit motions of the origin.
    fn rigid_motion(&self) -> DMatrix<f64> {
        let mut motion = DMatrix::zeros(3 * self.node_coordinates_xz.len(), 3);
        for (node, [x, z]) in self.node_coordinates_xz.iter().enumerate() {
            motion[(3 * node, 0)] = 1.0;
            motion[(3 * node, 2)] = *z;
            motion[(3 * node + 1, 1)] = 1.0;
            motion[(3 * node + 1, 2)] = -x;
            motion[(3 * node + 2, 2)] = 1.0;
        }
        motion
    }

    /// Solves for the fixed-base modes, all of them: leaving the high ones out would
    /// take away part of the structure's quasi-static flexibility.
    pub(super) fn reduce(&self, file: &Path) -> Result<ReducedBeam, ModelError> {
        let (stiffness, mass) = self.assemble();
        let rigid = self.rigid_motion();
        let free: Vec<usize> = (0..stiffness.nrows())
            .filter(|dof| dof / 3 != self.base_node)
            .collect();
        let solved = solve(&stiffness, &mass, &free).ok_or_else(|| ModelError::Singular {
            file: file.to_owned(),
        })?;

        let load = (&mass * &rigid).select_rows(&free);
        let modes: Vec<Mode> = solved
            .iter()
            .enumerate()
            .map(|(index, (frequency, shape))| {
                let plane = load.tr_mul(shape);
                let mut participation = Vector6::zeros();
                for (axis, value) in PLANE.iter().zip(plane.iter()) {
                    participation[*axis] = *value;
                }
                Mode {
                    name: format!("mode {}", index + 1),
                    frequency: *frequency,
                    damping: self.damping.zeta,
                    exponent: 1.0,
                    participation,
                }
            })
            .collect();

        let plane_mass = rigid.tr_mul(&(&mass * &rigid));
        let mut mass_matrix = Matrix6::zeros();
        for (row, to_row) in PLANE.iter().enumerate() {
            for (column, to_column) in PLANE.iter().enumerate() {
                mass_matrix[(*to_row, *to_column)] = plane_mass[(row, column)];
            }
        }

        let sensors = self
            .sensors
            .iter()
            .map(|sensor| {
                let gains = solved
                    .iter()
                    .map(|(_, shape)| sensor.reading(&free, shape))
                    .collect();
                let [x, z] = self.node_coordinates_xz[sensor.node];
                let [dx, dz] = sensor.rigid_offset;
                ([x + dx, 0.0, z + dz], gains)
            })
            .collect();
        Ok(ReducedBeam {
            specimen: Specimen {
                mass_matrix,
                modes,
                plane: true,
            },
            base: self.node_coordinates_xz[self.base_node],
            sensors,
        })
    }
}

impl BeamSensor {
    pub(super) fn direction(&self) -> Vector3<f64> {
        match self.axis {
            BeamAxis::X => Vector3::x(),
            BeamAxis::Z => Vector3::z(),
        }
    }

    /// Its reading of a mode shape over the free degrees of freedom.
    fn reading(&self, free: &[usize], shape: &DVector<f64>) -> f64 {
        let of = |dof: usize| {
            free.iter()
                .position(|candidate| *candidate == 3 * self.node + dof)
                .map_or(0.0, |row| shape[row])
        };
        match self.axis {
            BeamAxis::X => of(0) + self.rigid_offset[1] * of(2),
            BeamAxis::Z => of(1) - self.rigid_offset[0] * of(2),
        }
    }
}

/// Local matrices of one element, degrees of freedom (along, across, slope) at each end.
fn element_matrices(element: &Element, length: f64) -> (SMatrix<f64, 6, 6>, SMatrix<f64, 6, 6>) {
    let l = length;
    let axial = element.modulus * element.area / l;
    let bending = element.modulus * element.second_moment / (l * l * l);
    let line = element.rho * element.area * l;
    let mut k = SMatrix::<f64, 6, 6>::zeros();
    let mut m = SMatrix::<f64, 6, 6>::zeros();
    for (row, column, stiffness, mass) in [(0, 0, 1.0, 2.0), (0, 3, -1.0, 1.0), (3, 3, 1.0, 2.0)] {
        k[(row, column)] = axial * stiffness;
        m[(row, column)] = line / 6.0 * mass;
    }
    // Cubic interpolation of the deflection: the textbook's 4 x 4 over (w1, β1, w2, β2).
    let across = [1, 2, 4, 5];
    let stiffness = [
        [12.0, 6.0 * l, -12.0, 6.0 * l],
        [0.0, 4.0 * l * l, -6.0 * l, 2.0 * l * l],
        [0.0, 0.0, 12.0, -6.0 * l],
        [0.0, 0.0, 0.0, 4.0 * l * l],
    ];
    let mass = [
        [156.0, 22.0 * l, 54.0, -13.0 * l],
        [0.0, 4.0 * l * l, 13.0 * l, -3.0 * l * l],
        [0.0, 0.0, 156.0, -22.0 * l],
        [0.0, 0.0, 0.0, 4.0 * l * l],
    ];
    for row in 0..4 {
        for column in row..4 {
            k[(across[row], across[column])] = bending * stiffness[row][column];
            m[(across[row], across[column])] = line / 420.0 * mass[row][column];
        }
    }
    k.fill_lower_triangle_with_upper_triangle();
    m.fill_lower_triangle_with_upper_triangle();
    (k, m)
}

/// Natural frequencies (Hz) and shapes at unit modal mass over the free degrees of
/// freedom, ascending; `None` where the stiffness is singular.
///
/// The problem is turned round, M φ = (1/ω²) K φ with K = G Gᵀ, because a symmetric
/// eigensolver is accurate relative to its largest eigenvalue: this way the low modes,
/// the ones that matter, are the large ones.
fn solve(
    stiffness: &DMatrix<f64>,
    mass: &DMatrix<f64>,
    free: &[usize],
) -> Option<Vec<(f64, DVector<f64>)>> {
    let k = stiffness.select_rows(free).select_columns(free);
    let m = mass.select_rows(free).select_columns(free);
    let g = k.cholesky()?.unpack();
    let half = g.solve_lower_triangular(&m)?;
    let mut turned = g.solve_lower_triangular(&half.transpose())?;
    turned.fill_upper_triangle_with_lower_triangle();
    // The eigensolver would iterate on infinities for ever.
    if !turned.iter().all(|entry| entry.is_finite()) {
        return None;
    }
    let eigen = turned.symmetric_eigen();

    let mut order: Vec<usize> = (0..free.len()).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let mut modes = Vec::with_capacity(free.len());
    for index in order {
        let inverse_square = eigen.eigenvalues[index];
        // Massless degrees of freedom follow quasi-statically and have no mode.
        if inverse_square <= 0.0 {
            continue;
        }
        let shape = g.tr_solve_lower_triangular(&eigen.eigenvectors.column(index))?;
        let omega = 1.0 / inverse_square.sqrt();
        modes.push((
            omega / (2.0 * std::f64::consts::PI),
            shape / inverse_square.sqrt(),
        ));
    }
    Some(modes)
}
