//! A mode at neighbouring lines: its denominator, D, leakage, and their slopes.

use super::lanes::{Lane, Pair, PairRow, Row};
use pulp::Simd;

/// A mode at each line of a batch; D is x² over the denominator 1 - x² + 2 j ζ x^p.
#[derive(Clone)]
pub(super) struct Resonances {
    /// x = ω/ω_r, its logarithm, and 2 ζ x^p.
    x: Row,
    logarithm: Row,
    damper: Row,
    /// 1 over the denominator.
    pub(super) inverse: PairRow,
}

impl Resonances {
    pub(super) const ZERO: Self = Self {
        x: Row::ZERO,
        logarithm: Row::ZERO,
        damper: Row::ZERO,
        inverse: PairRow::ZERO,
    };

    pub(super) fn put(&mut self, line: usize, x: f64, damping: f64, exponent: f64) {
        self.x.0[line] = x;
        self.logarithm.0[line] = x.ln();
        let power = if exponent == 1.0 { x } else { x.powf(exponent) };
        self.damper.0[line] = 2.0 * damping * power;
    }

    #[inline(always)]
    pub(super) fn invert<S: Simd>(&mut self, simd: S, n: usize) {
        let (x, damper) = (self.x.get(simd, n), self.damper.get(simd, n));
        let real = Lane::all(simd, 1.0) - x * x;
        let scale = Lane::all(simd, 1.0) / (real * real + damper * damper);
        let inverse = Pair {
            re: real * scale,
            im: -damper * scale,
        };
        self.inverse.set(n, inverse);
    }

    /// D.
    #[inline(always)]
    pub(super) fn response<S: Simd>(&self, simd: S, n: usize) -> Pair<S> {
        let x = self.x.get(simd, n);
        self.inverse.get(simd, n) * (x * x)
    }

    /// Slopes of D, and of `u/N + v j x/N`, with respect to ln ω_r, ln ζ_r and the exponent, and that
    /// sum, N being the denominator.
    #[inline(always)]
    pub(super) fn slopes<S: Simd>(
        &self,
        simd: S,
        n: usize,
        exponent: f64,
        [u, v]: [f64; 2],
    ) -> ([Pair<S>; 3], [Pair<S>; 3], Pair<S>) {
        let (x, damper) = (self.x.get(simd, n), self.damper.get(simd, n));
        let inverse = self.inverse.get(simd, n);
        let of_denominator = [
            Pair {
                re: x * x * 2.0,
                im: -(damper * exponent),
            },
            Pair {
                re: Lane::all(simd, 0.0),
                im: damper,
            },
            Pair {
                re: Lane::all(simd, 0.0),
                im: damper * self.logarithm.get(simd, n),
            },
        ];
        let d = inverse * (x * x);
        let turned = inverse.turned() * x * v;
        let leaked = inverse * u + turned;
        let mut of_response = of_denominator;
        let mut of_leaked = of_denominator;
        for s in 0..3 {
            let relative = inverse * of_denominator[s] * -1.0;
            of_response[s] = d * relative;
            of_leaked[s] = leaked * relative;
        }
        of_response[0] -= d * 2.0;
        of_leaked[0] -= turned;
        (of_response, of_leaked, leaked)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::likelihood::model::response;
    use nalgebra::Complex;
    use pulp::Scalar;

    /// Slopes of D and of the leakage, these two, and D.
    type Of = (
        [Complex<f64>; 3],
        [Complex<f64>; 3],
        Complex<f64>,
        Complex<f64>,
    );

    fn of(x: f64, damping: f64, exponent: f64, coefficients: [f64; 2]) -> Of {
        let simd = Scalar::new();
        let mut resonances = Resonances::ZERO;
        resonances.put(0, x, damping, exponent);
        resonances.invert(simd, 0);
        let number = |pair: Pair<Scalar>| {
            let mut row = PairRow::ZERO;
            row.set(0, pair);
            Complex::new(row.re.0[0], row.im.0[0])
        };
        let (d, leaked, sum) = resonances.slopes(simd, 0, exponent, coefficients);
        let response = number(resonances.response(simd, 0));
        (d.map(number), leaked.map(number), number(sum), response)
    }

    /// Central differences of a step h err by h² f'''/6; with h = 1e-5, next to a resonance of
    /// 2 %, third derivatives are some 50³ times D: relative errors below 1e-4.
    #[test]
    fn slopes_are_those_of_differences() {
        let h = 1e-5;
        for (x, damping, exponent) in [(0.3, 0.02, 1.0), (0.99, 0.02, 0.4), (1.7, 0.05, 0.0)] {
            let coefficients = [0.7, -0.4];
            let at = |ln_w: f64, ln_z: f64, p: f64| {
                let ratio = x * (-ln_w).exp();
                of(ratio, damping * ln_z.exp(), exponent + p, coefficients)
            };
            let (responses, leaked, _, d) = at(0.0, 0.0, 0.0);
            // The same formula, rounded elsewhere.
            assert!((d - response(x, damping, exponent)).norm() < 1e-13 * d.norm());
            for k in 0..3 {
                let step = |s: f64| {
                    let mut d = [0.0; 3];
                    d[k] = s;
                    at(d[0], d[1], d[2])
                };
                let (up, down) = (step(h), step(-h));
                let d = (up.3 - down.3) / (2.0 * h);
                let size = responses[k].norm().max(1e-3);
                assert!((d - responses[k]).norm() < 1e-4 * size, "{k} {x}");
                let t = (up.2 - down.2) / (2.0 * h);
                let size = leaked[k].norm().max(1e-3);
                assert!((t - leaked[k]).norm() < 1e-4 * size, "{k} {x}");
            }
        }
    }
}
