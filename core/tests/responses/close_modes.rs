//! Pairs of modes at nearly one frequency, as every axisymmetric structure has them.

use crate::specimen::{Measured, Sprung, axes, hundred};
use massline_core::geometry::Equations;
use massline_core::masslines::{FixedMode, fixed_modes, lines_between};
use massline_core::spectra::LineRange;
use nalgebra::{Complex, Matrix6, Vector6};

fn modes(measured: &Measured) -> Vec<FixedMode> {
    measured.read(|lines| {
        let band = lines_between(lines, [1.0, 10.0]).unwrap();
        let all = LineRange::all(measured.frequencies.len());
        let mut work = vec![Complex::new(0.0, 0.0); 2 * measured.frequencies.len()];
        let found = fixed_modes(lines, band, all, &Equations::all(), &mut work).unwrap();
        found.to_vec()
    })
}

fn pair(apart: f64, accelerations: &[Vector6<f64>], noise: f64) -> Vec<FixedMode> {
    let sprung = [
        Sprung::bending(20.0, 40.0, 0, 1.5),
        Sprung::bending(20.0 + apart, 40.0, 1, 1.5),
    ];
    modes(&Measured::new(
        &hundred(),
        &sprung,
        accelerations,
        200,
        0.25,
        noise,
    ))
}

/// Case 3: they came back as one.
#[test]
fn two_bending_modes_of_an_axisymmetric_structure_are_two() {
    // Errors go with the noise: at 1 % of it, of which every pole sees some twenty lines, a
    // frequency was found to 2e-3 Hz, a mass to 0.1 kg of 40 and a rotation to 0.2 kg m² of 90.
    // Three times that holds for other seeds, and a tenth for a tenth of the noise.
    for apart in [0.0, 0.05, 0.2, 0.4, 1.0, 1.5, 3.0] {
        for noise in [0.001, 0.01] {
            let found = pair(apart, &axes(), noise);
            let told = format!("{apart} Hz apart, noise {noise}: {found:?}");
            assert_eq!(found.len(), 2, "{told}");
            let share = noise / 0.01;
            let total: Matrix6<f64> = found.iter().map(|m| m.effective_mass).sum();
            for (i, (mass, turned)) in [(40.0, 90.0); 2].into_iter().enumerate() {
                assert!((total[(i, i)] - mass).abs() < 0.3 * share, "{told}");
                assert!(
                    (total[(4 - i, 4 - i)] - turned).abs() < 0.6 * share,
                    "{told}"
                );
            }
            for (m, frequency) in found.iter().zip([20.0, 20.0 + apart]) {
                assert!(
                    (m.pole.frequency - frequency).abs() < 6e-3 * share,
                    "{told}"
                );
                assert!((m.pole.damping - 0.02).abs() < 4e-4 * share, "{told}");
                assert!(m.rank_one > 0.93, "{told}");
                // Each along one axis, the other's share being a square of the error.
                let e = m.effective_mass;
                assert!(e[(0, 0)].min(e[(1, 1)]) < 0.1 * share, "{told}");
            }
            if apart > 0.0 {
                // The first one is along x: none is taken for the other.
                assert!(found[0].effective_mass[(0, 0)] > 39.0, "{told}");
            }
        }
    }
}

#[test]
fn one_mode_is_never_two() {
    for noise in [0.001, 0.003, 0.01, 0.03] {
        for k in 0..8 {
            let mut mode = Sprung::bending(18.0 + 0.37 * f64::from(k), 40.0, 0, 1.5);
            mode.participation[1] = 1.0;
            let measured = Measured::new(&hundred(), &[mode], &axes(), 200, 0.25, noise);
            let found = modes(&measured);
            assert_eq!(found.len(), 1, "noise {noise}");
        }
    }
}
