//! Runs, poles and lines that do not fit are refused with numbers, never dropped.

use crate::specimen::{Measured, Sprung, axes, hundred};
use massline_core::geometry::Equations;
use massline_core::masslines::{
    Bands, Condensed, Lines, MasslineError, Method, condense, fixed_modes, lines_between,
};
use massline_core::spectra::{BandError, BlockSettings, LineGrid, LineRange, SpectraError, Window};
use nalgebra::{Complex, Vector3};

/// Methods that fit modes and so work in lent memory.
const WITH_MODES: [Method; 3] = [Method::ApparentMass, Method::CurveFit, Method::Synthesis];

fn condensed(
    method: Method,
    lines: &impl Lines,
    bands: &Bands,
    work: usize,
) -> Result<Condensed, MasslineError> {
    let mut work = vec![Complex::new(0.0, 0.0); work];
    let equations = Equations::all();
    condense(
        method,
        lines,
        bands,
        Vector3::zeros(),
        &equations,
        &mut work,
    )
}

fn measured() -> Measured {
    let sprung = [Sprung::bending(20.0, 40.0, 0, 1.5)];
    Measured::new(&hundred(), &sprung, &axes(), 200, 0.25, 0.003)
}

/// Case 4: of 30 runs the first 24 excite x only, and those after them were dropped.
#[test]
fn runs_beyond_the_limit_are_refused_by_number() {
    let mut plan = vec![axes()[0]; 24];
    plan.extend(axes());
    let measured = Measured::new(&hundred(), &[], &plan, 40, 1.0, 0.003);
    measured.read(|lines| {
        let bands = Bands::new(LineRange::all(40));
        let refused = condensed(Method::ApparentMass, lines, &bands, 80);
        let expected = MasslineError::TooManyRuns {
            limit: 24,
            found: 30,
        };
        assert_eq!(refused.unwrap_err(), expected);
        let mut work = [Complex::new(0.0, 0.0); 80];
        let (all, equations) = (LineRange::all(40), Equations::all());
        let refused = fixed_modes(lines, all, all, &equations, &mut work);
        assert_eq!(refused.unwrap_err(), expected);
        // Method a has a limit of its own: one pair a run.
        let refused = condensed(Method::FrequencyResponses, lines, &bands, 80);
        assert!(matches!(
            refused,
            Err(MasslineError::TooManyPairs { found: 30, .. })
        ));
        // Those that sum moments over the runs have none.
        let all_six = condensed(Method::FreeResponses, lines, &bands, 80);
        assert_eq!(all_six.unwrap().masslines.pairs().len(), 6);
    });
    measured.first(24, |lines| {
        let bands = Bands::new(LineRange::all(40));
        let first = condensed(Method::ApparentMass, lines, &bands, 80).unwrap();
        assert_eq!(first.apparent_mass.unwrap().excited, 1);
    });
}

/// Case 13: with less than two elements a line, poles were not found, and the mode's mass went
/// into the rigid body.
#[test]
fn working_memory_that_is_too_short_is_refused_by_number() {
    measured().read(|lines| {
        let band = lines_between(lines, [1.0, 18.0]).unwrap();
        let bands = Bands::new(band);
        for method in WITH_MODES {
            assert!(condensed(method, lines, &bands, 400).is_ok(), "{method:?}");
            for given in [0, 100, 399] {
                let refused = condensed(method, lines, &bands, given).unwrap_err();
                let needed = 400;
                assert_eq!(refused, MasslineError::Work { needed, given });
            }
        }
        let mut short = [Complex::new(0.0, 0.0); 399];
        let (all, equations) = (LineRange::all(200), Equations::all());
        let refused = fixed_modes(lines, band, all, &equations, &mut short).unwrap_err();
        let expected = MasslineError::Work {
            needed: 400,
            given: 399,
        };
        assert_eq!(refused, expected);
    });
}

/// Case 10: lines beyond the last one counted as measured zeros.
#[test]
fn a_band_beyond_the_lines_is_refused_by_number() {
    measured().read(|lines| {
        // 0.25 to 50 Hz.
        let beyond = lines_between(lines, [1.0, 60.0]).unwrap_err();
        let expected = BandError::Beyond {
            band: [1.0, 60.0],
            lines: Some([0.25, 50.0]),
        };
        assert_eq!(beyond, expected);
        // A range of other lines, as they were before the recordings were changed.
        let others = LineRange::all(400);
        for method in Method::ALL {
            let band = lines_between(lines, [1.0, 18.0]).unwrap();
            let refused = condensed(method, lines, &Bands::new(others), 800).unwrap_err();
            let expected = MasslineError::OtherLines {
                band: 400,
                lines: 200,
            };
            assert_eq!(refused, expected, "{method:?}");
            let mut bands = Bands::new(band);
            bands.fit = others;
            if WITH_MODES.contains(&method) {
                let refused = condensed(method, lines, &bands, 800).unwrap_err();
                assert_eq!(refused, expected, "{method:?}");
            }
        }
    });
}

/// Case 5: an infinite band panicked, and so did lines far up.
#[test]
fn bands_without_an_end_are_refused() {
    let settings = |rate, band| BlockSettings::new(1024, 0.5, Window::Hann, rate, band);
    for band in [
        [1.0, f64::INFINITY],
        [f64::NEG_INFINITY, 1.0],
        [1.0, f64::NAN],
        [2.0, 1.0],
        [-1.0, 5.0],
    ] {
        let refused = settings(512.0, band);
        assert!(
            matches!(refused, Err(SpectraError::BandEnds(_))),
            "{band:?}"
        );
    }
    for high in [255.5, 1e10, f64::MAX] {
        let refused = settings(512.0, [1.0, high]);
        // Half of 1024, without the line at half the rate and one for the window's foot.
        let usable = 510;
        assert!(
            matches!(refused, Err(SpectraError::Band { usable: u, .. }) if u == usable),
            "{high}: {refused:?}"
        );
    }
    for rate in [
        0.0,
        -512.0,
        f64::NAN,
        f64::INFINITY,
        f64::MIN_POSITIVE / 4.0,
    ] {
        let refused = settings(rate, [1.0, 20.0]);
        assert!(
            matches!(refused, Err(SpectraError::SampleRate(_))),
            "{rate}"
        );
    }
    for first in [usize::MAX, usize::MAX - 60, 1 << 53] {
        let grid = LineGrid {
            first,
            count: 60,
            spacing: 0.1,
        };
        assert!(grid.within([0.1, 0.3]).is_err());
    }
}
