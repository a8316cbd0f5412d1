use super::*;
use nalgebra::SMatrix;

/// A fit of some functions to others, over lines, beside a decomposition in singular values.
#[test]
fn known_terms_bias_as_a_fit_of_those_that_are_left_says() {
    const LINES: usize = 9;
    let function = |t: usize, line: usize| {
        let f = 0.3 + 0.05 * line as f64;
        match t {
            0 => 1.0,
            5 => f * f,
            _ => f * f / ((0.9 + 0.4 * t as f64) - f * f),
        }
    };
    let mut products = Triangle::ZERO;
    let entries = &mut cells(&mut products);
    for t in 0..MAX_TERMS {
        for u in 0..=t {
            let lines = 0..LINES;
            entries[(t, u)] = lines.map(|k| function(t, k) * function(u, k)).sum();
        }
    }
    let shares = [0.0, 0.1, 0.2, 0.05, 0.0, 0.0];
    let known = KnownTerms { shares, products };
    let expected = |chosen: &[usize]| {
        let columns = SMatrix::<f64, LINES, MAX_TERMS>::from_fn(|k, i| {
            chosen.get(i).map_or(0.0, |t| function(*t, k))
        });
        let left_out = |t: &usize| !chosen.contains(t);
        let rest = SMatrix::<f64, LINES, 1>::from_fn(|k, _| {
            let terms = (0..MAX_TERMS).filter(left_out);
            terms.map(|t| shares[t] * function(t, k)).sum()
        });
        columns.svd(true, true).solve(&rest, 1e-12).unwrap()[0]
    };
    for chosen in [
        &[0][..],
        &[0, 5],
        &[0, 1],
        &[0, 1, 5],
        &[0, 1, 2],
        &[0, 1, 4],
    ] {
        let (found, expected) = (known.relative_bias(chosen), expected(chosen));
        // Normal equations square the condition, 1e4 at most here.
        assert!(
            (found - expected).abs() < 1e-8,
            "{chosen:?}: {found} {expected}"
        );
    }
    // Alone, the constant takes the mean of the others; all that are known leave nothing.
    let mean = |t: usize| (0..LINES).map(|k| function(t, k)).sum::<f64>() / LINES as f64;
    let all = 0.1 * mean(1) + 0.2 * mean(2) + 0.05 * mean(3);
    assert!((known.relative_bias(&[0]) - all).abs() < 1e-12);
    assert_eq!(known.relative_bias(&[0, 1, 2, 3, 5]), 0.0);
}

/// A base that is driven along x and follows along y and about z, by shares of their own that a resonance changes from line
/// to line, with less than a hundred times the power of the noise: one direction is excited. Forces are those of a body, and of a
/// mode that moves along x.
fn following(share: f64, resonant: f64) -> (Masslines, Matrix6<f64>) {
    const LINES: usize = 30;
    let body = crate::rigid_body::RigidBody {
        mass: 5.0,
        centre_of_gravity: Vector3::new(0.1, -0.2, 0.3),
        inertia: crate::rigid_body::Inertia::from_terms([0.5, 0.6, 0.7, 0.05, -0.04, 0.03]),
    };
    let rigid = body.mass_matrix(&Vector3::zeros());
    let mut elastic = Matrix6::zeros();
    elastic[(0, 0)] = 2.0;
    let one = Complex::new(1.0, 0.0);
    let mut regression = Regression::EMPTY;
    regression.begin(&Equations::all(), 2, 1.0);
    let lines: [_; LINES] = core::array::from_fn(|line| {
        let f = (line + 1) as f64 / LINES as f64;
        let phi = [one, Complex::new(f * f / (2.0 - f * f), 0.0)];
        let follows = phi[0] * share + phi[1] * resonant;
        let a = Vector6::from([
            one,
            follows,
            one * 0.0,
            one * 0.0,
            one * 0.0,
            follows * -0.5,
        ]);
        let m = rigid.map(Complex::from) + elastic.map(Complex::from) * phi[1];
        let f = m * a;
        let moments = Moments {
            aa: a * a.adjoint(),
            fa: f * a.adjoint(),
            ff: f * f.adjoint(),
        };
        (moments, phi)
    });
    let mut aa = Matrix6::zeros();
    for (moments, _) in &lines {
        aa += moments.aa.map(|z| z.re);
    }
    // Of one direction the power is 3e5 times that.
    let noise = Matrix6::identity() * 1e-4;
    regression.restart(&aa, &noise).unwrap();
    assert_eq!(regression.excitation().rank(), 1);
    for (moments, phi) in &lines {
        regression.add(moments, phi, 2.0);
    }
    regression.turn(None);
    let mut solution = Solution::EMPTY;
    regression.solve(&[0, 1], &mut solution).unwrap();
    let mut set = Masslines::new(Vector3::zeros(), Equations::all());
    let share = regression.share_of_pairs(&solution);
    regression
        .masslines(&solution, &noise, share, &mut set)
        .unwrap();
    (set, rigid)
}

/// The pair of such a base has the motion that the rigid term goes with, `a = (1, share, 0, 0, 0, -share / 2)`, and the
/// forces of the body for it: what the resonance adds along the axes at rest goes with the mode's term.
#[test]
fn a_base_that_follows_otherwise_at_each_line_is_in_the_pairs() {
    for (share, resonant) in [(0.0, 0.0), (0.01, 0.0), (0.0, 0.01), (0.02, -0.015)] {
        let (set, rigid) = following(share, resonant);
        let [pair] = set.pairs() else {
            panic!("{} pairs", set.pairs().len());
        };
        let size = pair.acceleration[0];
        let expected = Vector6::new(1.0, share, 0.0, 0.0, 0.0, -0.5 * share) * size;
        // The direction leans towards what follows by its share, so that squares of it are left.
        let least = share * share + resonant * resonant + 1e-7;
        let off = (pair.acceleration - expected).norm() / size;
        assert!(off < least, "{share} {resonant}: {off}");
        let left = (rigid * pair.acceleration - pair.force).norm() / pair.force.norm();
        assert!(left < least, "{share} {resonant}: {left}");
    }
}
