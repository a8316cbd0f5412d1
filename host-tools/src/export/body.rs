//! The body of a result as formats need it that hold all ten numbers.

use super::{ExportError, View};
use crate::frame::tensor;
use crate::printable::printable;
use crate::result::ResultDocument;
use massline_core::rigid_body::{Inertia, RigidBody};
use nalgebra::{Matrix6, SVector, Vector3};

/// Share by which the inequality of principal moments may be violated by rounding.
const ROUNDING: f64 = 1e-12;

/// A body about the origin and in the axes of an export.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Body {
    /// Mass, kg.
    pub(super) mass: f64,
    /// Centre of gravity S, m.
    pub(super) centre: [f64; 3],
    /// xx, yy, zz, xy, xz, yz about S, kg m²; products are `∫ x y dm`.
    pub(super) inertia: [f64; 6],
}

impl Body {
    /// The body of a result.
    ///
    /// # Errors
    /// [`ExportError::Unsuitable`] if a number is not observable.
    pub(super) fn of(result: &ResultDocument, view: &View) -> Result<Self, ExportError> {
        let whole = whole(result).map_err(|missing| ExportError::Unsuitable {
            reason: format!(
                "the format needs all ten numbers, and this test does not determine {}; shake the directions that do and identify again, or export the table `csv`, which leaves them empty",
                missing.join(", ")
            ),
        })?;
        let frame = view.frame(result).map_err(|e| ExportError::Unsuitable {
            reason: format!("--rotation: {e}"),
        })?;
        let inertia = frame.turn_of_inertia() * SVector::from(whole.inertia);
        let centre = frame.point(&whole.centre.into());
        // A zero has no sign.
        let body = Self {
            mass: whole.mass,
            centre: centre.map(|x| x + 0.0).into(),
            inertia: inertia.map(|x| x + 0.0).into(),
        };
        // Nor has any number of a body the size at which these overflow.
        if !body.mass_matrix().iter().all(|entry| entry.is_finite()) {
            let reason = "its numbers are too large to compute with; look for a wrong unit in the setup or in --about";
            return Err(ExportError::Unsuitable {
                reason: reason.to_owned(),
            });
        }
        Ok(body)
    }

    /// Entries of the inertia tensor in the order of the terms: products with a minus sign.
    pub(super) fn entries(&self) -> [f64; 6] {
        let [xx, yy, zz, xy, xz, yz] = self.inertia;
        [xx, yy, zz, 0.0 - xy, 0.0 - xz, 0.0 - yz]
    }

    /// The body whose tensor has these entries.
    pub(super) fn of_entries(mass: f64, centre: [f64; 3], entries: [f64; 6]) -> Self {
        let body = Self {
            mass,
            centre,
            inertia: entries,
        };
        Self {
            inertia: body.entries(),
            ..body
        }
    }

    /// The mass matrix of equation (1) about the origin of the export.
    pub(super) fn mass_matrix(&self) -> Matrix6<f64> {
        let body = RigidBody {
            mass: self.mass,
            centre_of_gravity: self.centre.into(),
            inertia: Inertia::from_terms(self.inertia),
        };
        body.mass_matrix(&Vector3::zeros())
    }

    /// The first number in which a body that was read differs by more than a share of its size,
    /// in words.
    pub(super) fn difference(&self, read: &Self, share: f64) -> Result<(), String> {
        let numbers = |body: &Self| {
            let mut all = [body.mass; 10];
            all[1..4].copy_from_slice(&body.centre);
            all[4..].copy_from_slice(&body.inertia);
            all
        };
        let names = ["mass", "x", "y", "z", "xx", "yy", "zz", "xy", "xz", "yz"];
        for ((name, is), was) in names.iter().zip(numbers(read)).zip(numbers(self)) {
            let alike = (is - was).abs() <= share * was.abs();
            // A number that is none differs, too.
            if !alike {
                return Err(format!("{name} is {is}, not {was}"));
            }
        }
        Ok(())
    }

    /// Reason why programs refuse to load the body of a result.
    pub(super) fn doubt(result: &ResultDocument) -> Option<&'static str> {
        let body = whole(result).ok()?;
        if body.mass <= 0.0 {
            return Some("the mass is not positive: no such body exists");
        }
        let mut moments: Vec<f64> = tensor(body.inertia)
            .symmetric_eigenvalues()
            .iter()
            .copied()
            .collect();
        moments.sort_by(f64::total_cmp);
        let [smallest, middle, largest] = moments[..] else {
            return None;
        };
        if smallest <= 0.0 {
            return Some(
                "the inertia about the centre of gravity is not positive definite: no such body exists, and MuJoCo refuses to load it",
            );
        }
        (smallest + middle < largest * (1.0 - ROUNDING)).then_some(
            "the largest principal moment of inertia exceeds the sum of the other two: no such body exists, and MuJoCo refuses to load it (its `balanceinertia` would change the numbers)",
        )
    }

    /// Lines that say about which point and in which axes the numbers are.
    pub(super) fn remarks(result: &ResultDocument, view: &View) -> Vec<String> {
        let title = remark(&result.title);
        let words = |v: [f64; 3]| v.map(|x| number(x + 0.0)).join(", ");
        let about = view.about.unwrap_or(result.reference_point);
        let axes = match view.rotation {
            Some(rotation) => format!(
                "axes turned by the rotation vector ({}) degrees",
                words(rotation)
            ),
            None => "axes of the result".to_owned(),
        };
        let mut remarks = vec![
            format!(
                "{title}: identified by massline, method {}",
                remark(&result.method)
            ),
            format!(
                "kg, m, kg m2; origin at ({}) m of the result, {axes}",
                words(about)
            ),
        ];
        if let Some(reason) = &result.refused {
            remarks.push(format!(
                "REFUSED, the data contradict it: {}",
                remark(reason)
            ));
        }
        if let Some(doubt) = Self::doubt(result) {
            remarks.push(doubt.to_owned());
        }
        remarks
    }
}

/// Text on one line, without the two hyphens that an XML comment must not hold.
fn remark(text: &str) -> String {
    let mut line = printable(text).into_owned();
    while line.contains("--") {
        line = line.replace("--", "- -");
    }
    line
}

/// The body in the coordinates of the result, or the names of the numbers that are missing.
fn whole(result: &ResultDocument) -> Result<Body, Vec<String>> {
    let mut missing = Vec::new();
    let mut values = result.properties().into_iter().filter_map(|property| {
        let needed = property.name != "indicator" && !property.name.starts_with("inertia_ref");
        if needed && property.number.value.is_none() {
            missing.push(format!("`{}`", property.name));
        }
        needed.then_some(property.number.value.unwrap_or(0.0))
    });
    let mut next = || values.next().unwrap_or(0.0);
    let body = Body {
        mass: next(),
        centre: [next(), next(), next()],
        inertia: std::array::from_fn(|_| next()),
    };
    drop(values);
    if missing.is_empty() {
        Ok(body)
    } else {
        Err(missing)
    }
}

/// A number with all its digits, as every format reads it.
pub(super) fn number(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-4..1e15).contains(&size) {
        format!("{value:e}")
    } else {
        format!("{value}")
    }
}
