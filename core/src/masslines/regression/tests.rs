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
