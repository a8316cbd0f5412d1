//! A starting point with bounds for `mujoco.sysid`, as its `ParameterDict.load_from_disk` reads it.
//!
//! The parameters are those of its pseudo-inertia: with Σ = ∫ r rᵀ dm about the origin of the body,
//! `J = [Σ, m r; m rᵀ, m] = e^2α U Uᵀ`, where U is an upper triangular matrix with a one in its last
//! place, `d` are the logarithms of its diagonal, `s` and `t` the entries above. The bounds lie at
//! twice the 95 % interval of each, by the exact derivative of that factorisation.

use super::body::Body;
use super::{Export, ExportError, Form, Kind, View};
use crate::frame::{Frame, tensor};
use crate::result::ResultDocument;
use nalgebra::{Matrix3, Matrix4, SMatrix, SVector, Vector3};
use std::fmt::Write as _;
use std::io::Write;

/// The format `mujoco-sysid`.
#[derive(Debug)]
pub(super) struct Sysid;

/// Bounds in half widths of the 95 % interval: a wall that the truth lies behind would cost more
/// than a wide one.
const WIDTH: f64 = 2.0;
/// Keys of the lists, as the reader has them.
const LISTS: [&str; 4] = ["nominal", "min_value", "max_value", "value"];

type Vector10 = SVector<f64, 10>;
type Matrix10 = SMatrix<f64, 10, 10>;

impl Export for Sysid {
    fn form(&self) -> Form {
        Form {
            name: "mujoco-sysid",
            description: "`mujoco.sysid`: pseudo-inertia of the body of `mjcf` as a starting point, with bounds at twice the 95 % interval",
            extension: "yaml",
            kind: Kind::Body,
        }
    }

    fn write(
        &self,
        result: &ResultDocument,
        view: &View,
        out: &mut dyn Write,
    ) -> Result<(), ExportError> {
        let lists = lists(result, view)?;
        for remark in Body::remarks(result, view) {
            writeln!(out, "# {remark}")?;
        }
        writeln!(
            out,
            "# [alpha, d1, d2, d3, s12, s23, s13, t1, t2, t3] of the pseudo-inertia; bounds at twice the 95 % interval\n\
             # read by mujoco.sysid.ParameterDict.load_from_disk(FILE); it is the parameter that\n\
             # mujoco.sysid.body_inertia_param(spec, model, \"body\", inertia_type=InertiaType.Pseudo) makes,\n\
             # whose modifier it takes\n\
             body_inertia:\n  name: body_inertia\n  frozen: false"
        )?;
        for (key, list) in LISTS.iter().zip(lists) {
            writeln!(out, "  {key}: {}", flow(&list))?;
        }
        Ok(())
    }

    fn compare(&self, result: &ResultDocument, view: &View, bytes: &[u8]) -> Result<(), String> {
        let was = lists(result, view).map_err(|e| e.to_string())?;
        let text = std::str::from_utf8(bytes).map_err(|e| e.to_string())?;
        for (key, list) in LISTS.iter().zip(was) {
            let line = text
                .lines()
                .find_map(|line| line.trim().strip_prefix(&format!("{key}: [")));
            let numbers = line.and_then(|line| line.strip_suffix(']'));
            let numbers = numbers.ok_or_else(|| format!("`{key}` is missing"))?;
            let numbers: Result<Vec<f64>, _> = numbers.split(", ").map(str::parse).collect();
            if numbers.as_deref() != Ok(list.as_slice()) {
                return Err(format!("`{key}`"));
            }
        }
        Ok(())
    }
}

/// A list as YAML reads it: a number needs a point, and its exponent a sign.
fn flow(list: &Vector10) -> String {
    let mut text = String::new();
    for value in list {
        let number = format!("{value:e}");
        let (mantissa, exponent) = number.split_once('e').unwrap_or((&number, "0"));
        let point = if mantissa.contains('.') { "" } else { ".0" };
        let sign = if exponent.starts_with('-') { "" } else { "+" };
        let comma = if text.is_empty() { "" } else { ", " };
        // Writing to a string cannot fail.
        let _ = write!(text, "{comma}{mantissa}{point}e{sign}{exponent}");
    }
    format!("[{text}]")
}

/// Nominal values, lower bounds, upper bounds, and the nominal values again.
fn lists(result: &ResultDocument, view: &View) -> Result<[Vector10; 4], ExportError> {
    let unsuitable = |reason: &str| ExportError::Unsuitable {
        reason: reason.to_owned(),
    };
    let body = Body::of(result, view)?;
    let (nominal, jacobian) = factor(&body).ok_or_else(|| {
        unsuitable(
            "a body like that cannot exist (its largest principal moment exceeds the sum of the other two, or its mass is not positive), and the pseudo-inertia has no such body",
        )
    })?;
    let frame = view.frame(result).map_err(|e| unsuitable(&e.to_string()))?;
    let (covariance, widths) = covariance(result, &frame).ok_or_else(|| {
        unsuitable("the document has no covariance to take bounds from, as that of a box; identify the recordings by `massline identify`")
    })?;
    let covariance = jacobian * covariance * jacobian.transpose();
    let half = Vector10::from_fn(|k, _| WIDTH * widths * covariance[(k, k)].max(0.0).sqrt());
    Ok([nominal, nominal - half, nominal + half, nominal])
}

/// Covariance of mass, centre of gravity and inertia about it in a frame, of both types where B is
/// stated, and standard deviations that half of a 95 % interval has.
fn covariance(result: &ResultDocument, frame: &Frame) -> Option<(Matrix10, f64)> {
    let of = |document: Option<&crate::result::CovarianceDocument>| -> Option<Matrix10> {
        let mut matrix = Matrix10::zeros();
        for (i, row) in document?.matrix.iter().enumerate() {
            for (j, entry) in row.iter().enumerate() {
                matrix[(i, j)] = (*entry)?;
            }
        }
        Some(matrix)
    };
    let mut matrix = of(result.covariance.as_ref())?;
    if result.covariance_type_b.is_some() {
        matrix += of(result.covariance_type_b.as_ref())?;
    }
    let mut widths = 1.0;
    for property in result.properties() {
        let number = property.number;
        let (std, half) = (number.std_of_both()?, number.half_width());
        if property.name == "mass" && result.indicator.is_some() {
            // Δ stands in the place of a mass that was weighed.
            matrix.fill_row(0, 0.0);
            matrix.fill_column(0, 0.0);
            matrix[(0, 0)] = std * std;
        }
        if std > 0.0 {
            widths = f64::max(widths, half / std);
        }
    }
    let mut turn = Matrix10::identity();
    turn.fixed_view_mut::<3, 3>(1, 1).copy_from(&frame.turn());
    turn.fixed_view_mut::<6, 6>(4, 4)
        .copy_from(&frame.turn_of_inertia());
    widths
        .is_finite()
        .then_some((turn * matrix * turn.transpose(), widths))
}

/// The ten parameters of a body, and their derivative with respect to mass, centre of gravity and
/// inertia about it; `None` where the pseudo-inertia is not positive definite.
fn factor(body: &Body) -> Option<(Vector10, Matrix10)> {
    let r = Vector3::from(body.centre);
    let unit = |k: usize| std::array::from_fn(|i| f64::from(u8::from(i == k)));
    let second = |terms: [f64; 6]| {
        let t = tensor(terms);
        Matrix3::identity() * (t.trace() / 2.0) - t
    };
    let join = |sigma: Matrix3<f64>, first: Vector3<f64>, mass: f64| {
        let mut j = Matrix4::zeros();
        j.fixed_view_mut::<3, 3>(0, 0).copy_from(&sigma);
        j.fixed_view_mut::<3, 1>(0, 3).copy_from(&first);
        j.fixed_view_mut::<1, 3>(3, 0).copy_from(&first.transpose());
        j[(3, 3)] = mass;
        j
    };
    let square = r * r.transpose();
    let j = join(
        second(body.inertia) + square * body.mass,
        r * body.mass,
        body.mass,
    );
    // The rows and columns in reverse make an upper triangle of the lower one.
    let reversed = |m: Matrix4<f64>| Matrix4::from_fn(|i, k| m[(3 - i, 3 - k)]);
    let u = reversed(reversed(j).cholesky()?.l());
    let inverse = u.try_inverse()?;
    let last = u[(3, 3)];
    let above = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)];
    let mut theta = Vector10::zeros();
    theta[0] = last.ln();
    for k in 0..3 {
        theta[1 + k] = (u[(k, k)] / last).ln();
    }
    for (k, place) in above.into_iter().enumerate() {
        theta[4 + k] = u[place] / last;
    }
    let mut jacobian = Matrix10::zeros();
    for column in 0..10 {
        let change = match column {
            0 => join(square, r, 1.0),
            1..4 => {
                let e = Vector3::from(std::array::from_fn(|i| {
                    f64::from(u8::from(i == column - 1))
                }));
                join(
                    (e * r.transpose() + r * e.transpose()) * body.mass,
                    e * body.mass,
                    0.0,
                )
            }
            _ => join(second(unit(column - 4)), Vector3::zeros(), 0.0),
        };
        let inner = inverse * change * inverse.transpose();
        let upper = Matrix4::from_fn(|i, k| match i.cmp(&k) {
            std::cmp::Ordering::Less => inner[(i, k)],
            std::cmp::Ordering::Equal => inner[(i, k)] / 2.0,
            std::cmp::Ordering::Greater => 0.0,
        });
        let du = u * upper;
        let scale = du[(3, 3)] / last;
        jacobian[(0, column)] = scale;
        for k in 0..3 {
            jacobian[(1 + k, column)] = du[(k, k)] / u[(k, k)] - scale;
        }
        for (k, place) in above.into_iter().enumerate() {
            jacobian[(4 + k, column)] = (du[place] - u[place] * scale) / last;
        }
    }
    Some((theta, jacobian))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(body: &Body) -> Vector10 {
        let [x, y, z] = body.centre;
        let [xx, yy, zz, xy, xz, yz] = body.inertia;
        [body.mass, x, y, z, xx, yy, zz, xy, xz, yz].into()
    }

    fn body(all: &Vector10) -> Body {
        Body {
            mass: all[0],
            centre: std::array::from_fn(|k| all[1 + k]),
            inertia: std::array::from_fn(|k| all[4 + k]),
        }
    }

    const BODY: Body = Body {
        mass: 3.0,
        centre: [0.1, -0.2, 0.3],
        inertia: [0.5, 0.6, 0.7, 0.05, -0.04, 0.03],
    };

    /// Central differences of a step h err by about h² and 1e-16 / h: 1e-10 at 1e-5, times
    /// derivatives up to a hundred.
    #[test]
    fn the_derivative_is_that_of_finite_differences() {
        let (_, jacobian) = factor(&BODY).unwrap();
        let at = numbers(&BODY);
        for column in 0..10 {
            let side = |step: f64| {
                let mut moved = at;
                moved[column] += step;
                factor(&body(&moved)).unwrap().0
            };
            let h = 1e-5;
            let slope = (side(h) - side(-h)) / (2.0 * h);
            let error = (slope - jacobian.column(column)).amax();
            assert!(error < 1e-7 * jacobian.amax(), "{column}: {error}");
        }
    }

    #[test]
    fn a_body_that_cannot_exist_has_no_parameters() {
        let mut impossible = BODY;
        impossible.inertia = [0.5, 0.6, 1.2, 0.0, 0.0, 0.0];
        assert_eq!(factor(&impossible), None);
    }

    #[test]
    fn numbers_are_written_as_yaml_reads_them() {
        let list =
            Vector10::from_row_slice(&[0.0, 1.0, -2.5e-7, 1e22, 3.0, 0.1, 0.0, 0.0, 0.0, 0.0]);
        let text = flow(&list);
        assert!(
            text.starts_with("[0.0e+0, 1.0e+0, -2.5e-7, 1.0e+22, 3.0e+0, 1.0e-1, "),
            "{text}"
        );
    }
}
