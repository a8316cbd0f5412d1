//! Plausibility of a body with all that is known of its errors: the core judges by the noise of its
//! own estimate, which knows neither type B uncertainty nor a fit of the host.

use super::second_order::with_second_order;
use super::type_b::{TypeB, number, together};
use massline_core::identify::{Covariance, Estimate, Identification};
use massline_core::rigid_body::{Margin, Plausibility, PrincipalInertia, Verdict};

/// Share of the largest moment that rounding of a solve may be worth.
const ROUNDING: f64 = 1e-12;

/// Plausibility of an identification whose ten numbers (mass or Δ, centre of gravity, inertia about
/// it) have this covariance of the noise, SI; numbers whose type B uncertainty is unknown are judged
/// by the noise.
pub(super) fn plausibility(
    i: &Identification,
    covariance: &Covariance,
    type_b: Option<&TypeB>,
) -> Plausibility {
    let covariance = &with_second_order(i.mass.map(|mass| mass.value), covariance);
    let half = |sum: &Sum| sum.half_width(i, covariance, type_b);
    let mass = i.mass.map(|mass| {
        let times = i.indicator.map_or(1.0, |delta| delta.value);
        // A weighed mass is positive; the mass that the data say is Δ times as much.
        let (place, row) = match i.indicator {
            Some(_) => (number::INDICATOR, mass.value),
            None => (number::MASS, 1.0),
        };
        let (value, sum) = (mass.value * times, Sum::of([(0, place, row)]));
        margin(value, half(&sum), value.abs())
    });
    let Some(principal) = &i.principal else {
        let moments = [0, 1, 2].map(|k| i.inertia_cg[k].map(|term| (k, term)));
        let known = || moments.iter().flatten();
        let scale = known().fold(0.0, |largest, (_, m): &(_, Estimate)| {
            f64::max(largest, m.value.abs())
        });
        let margins = known().map(|(k, term)| {
            let sum = Sum::of([(4 + k, number::INERTIA_CG + k, 1.0)]);
            margin(term.value, half(&sum), scale)
        });
        return Plausibility {
            mass,
            // A violation before what might be one, and the nearer to it first.
            positive_definite: margins.min_by(|a, b| {
                let possible = |m: &Margin| m.verdict() != Verdict::Violated;
                let lowest = |m: &Margin| m.relative - m.uncertainty;
                let first = possible(a).cmp(&possible(b));
                first.then(lowest(a).total_cmp(&lowest(b)))
            }),
            triangle: None,
        };
    };
    let moments = principal.moments;
    let scale = moments.amax();
    let inertia = |left: f64, weights: [f64; 6]| {
        let terms = weights.into_iter().enumerate();
        let sum = Sum::of(terms.map(|(k, w)| (4 + k, number::INERTIA_CG + k, w)));
        Some(margin(left, half(&sum).max(ROUNDING * scale), scale))
    };
    let [smallest, middle, largest] = [0, 1, 2].map(|k| gradient(principal, k));
    let triangle = core::array::from_fn(|t| smallest[t] + middle[t] - largest[t]);
    Plausibility {
        mass,
        positive_definite: inertia(moments[0], smallest),
        triangle: inertia(moments[0] + moments[1] - moments[2], triangle),
    }
}

/// A weighted sum of numbers: row of the covariance, place among the numbers of type B, weight.
struct Sum(Vec<(usize, usize, f64)>);

impl Sum {
    fn of(terms: impl IntoIterator<Item = (usize, usize, f64)>) -> Self {
        Self(terms.into_iter().collect())
    }

    /// Half of the sum's 95 % interval.
    fn half_width(
        &self,
        i: &Identification,
        covariance: &Covariance,
        type_b: Option<&TypeB>,
    ) -> f64 {
        let mut variance = 0.0;
        for (a, _, weight) in &self.0 {
            for (b, _, other) in &self.0 {
                variance += weight * other * covariance[*a][*b].unwrap_or(0.0);
            }
        }
        let noise = variance.max(0.0).sqrt();
        let squares = type_b.and_then(|type_b| {
            let moved = type_b.contributions.iter().map(|contribution| {
                let terms = self.0.iter();
                let moved = terms.map(|(_, place, weight)| {
                    Some(weight * contribution.numbers.get(*place).copied().flatten()?)
                });
                moved.sum::<Option<f64>>().map(|sum| sum * sum)
            });
            moved.sum::<Option<f64>>()
        });
        let (std, freedom) = together(noise, squares.unwrap_or(0.0).sqrt(), i.freedom);
        Estimate { value: 0.0, std }.interval(freedom)
    }
}

fn margin(left: f64, half: f64, scale: f64) -> Margin {
    let scale = if scale > 0.0 { scale } else { 1.0 };
    Margin {
        relative: left / scale,
        uncertainty: half / scale,
    }
}

/// Change of principal moment `k` with the six terms about S (xx, yy, zz, xy, xz, yz): `vᵀ dΘ v`
/// about its axis v, with the products entering the tensor twice and with a minus sign.
fn gradient(principal: &PrincipalInertia, k: usize) -> [f64; 6] {
    let v = principal.axes.column(k);
    [
        v[0] * v[0],
        v[1] * v[1],
        v[2] * v[2],
        -2.0 * v[0] * v[1],
        -2.0 * v[0] * v[2],
        -2.0 * v[1] * v[2],
    ]
}
