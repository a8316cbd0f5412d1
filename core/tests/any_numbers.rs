//! Numbers of any size, and what is none: constructors refuse them or compute with them, and what
//! comes out is finite.
//!
//! The numbers are any 64 bits, so that most are larger than 1e20 or smaller than 1e-20, one in a
//! thousand is none, and the ends of the range are tried on purpose.

use massline_core::geometry::{
    Accelerometer, LoadCell, Mount, Placement, Quantity, RunGeometry, RunSensor,
};
use massline_core::identify::{Estimate, Identification, Procedure, Question, identify};
use massline_core::masslines::{Masslines, StaticPoses};
use massline_core::spectra::{BlockSettings, LineGrid, LineRange, Window};
use massline_core::weighting::weights_from_peaks;
use nalgebra::{Matrix6, Vector3, Vector6};
use proptest::prelude::*;

mod numbers;
use numbers::number;

fn three() -> impl Strategy<Value = Vector3<f64>> {
    [number(), number(), number()].prop_map(Vector3::from)
}

fn six() -> impl Strategy<Value = Vector6<f64>> {
    proptest::array::uniform6(number()).prop_map(Vector6::from)
}

fn finite<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> bool {
    numbers.into_iter().all(|x| x.is_finite())
}

/// Every number of an answer.
fn all(found: &Identification) -> Vec<f64> {
    let estimates = [found.mass, found.indicator]
        .into_iter()
        .chain(found.centre_of_gravity)
        .chain(found.inertia_reference)
        .chain(found.inertia_cg)
        .flatten();
    let mut all: Vec<f64> = estimates
        .flat_map(|Estimate { value, std, .. }| [value, std])
        .collect();
    if let Some(principal) = &found.principal {
        all.extend(principal.moments.iter().chain(&principal.axes));
    }
    all.extend(&found.reference);
    all.extend([found.condition_number, found.attenuation]);
    all.extend(found.consistency);
    all
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn sensors_and_placements(
        position in three(),
        direction in three(),
        rotation in three(),
        translation in three(),
        reference in three(),
        weight in number(),
    ) {
        let given = finite(&position) && finite(&direction);
        let sensor = Accelerometer::new(position, direction, Mount::Interface);
        let cell = LoadCell::new(position, direction, Quantity::Force);
        // What can be drawn can be described, however long its arrow is.
        prop_assert_eq!(sensor.is_ok(), given && direction != Vector3::zeros());
        prop_assert_eq!(sensor.is_ok(), cell.is_ok());
        let placement = Placement::new(rotation, translation);
        if !finite(&rotation) || !finite(&translation) {
            prop_assert!(placement.is_err());
        }
        if let Ok(placement) = &placement {
            let r = placement.rotation();
            // Products of unit vectors: a few roundings of 1.1e-16.
            prop_assert!((r.transpose() * r - nalgebra::Matrix3::identity()).norm() < 1e-14);
        }
        let (Ok(sensor), Ok(cell)) = (sensor, cell) else { return Ok(()) };
        // Three roundings of 1.1e-16.
        prop_assert!((sensor.direction().norm() - 1.0).abs() < 1e-15);
        let placement = placement.unwrap_or_default();
        let sensors = [RunSensor::Accelerometer(sensor, weight), RunSensor::LoadCell(cell)];
        if let Ok(run) = RunGeometry::new(sensors, &placement, &reference) {
            prop_assert!(finite(run.equations.rows()));
            prop_assert!(finite(&run.determined), "{:?}", run.determined);
            let unit = run.map.apply(&[1.0, 1.0]);
            prop_assert!(unit.iter().all(|x| x.is_finite()), "{unit:?}");
        }
    }

    #[test]
    fn blocks_and_bands(
        overlap in number(),
        rate in number(),
        low in number(),
        high in number(),
        length in prop_oneof![Just(1024_usize), Just(16), any::<usize>()],
        line in prop_oneof![0..2000_usize, any::<usize>()],
        first in any::<usize>(),
        count in any::<usize>(),
    ) {
        for window in [Window::Rectangular, Window::Hann, Window::FlatTop] {
            let settings = BlockSettings::new(length, overlap, window, rate, [low, high]);
            let Ok(settings) = settings else { continue };
            prop_assert!(finite(&[rate, low, overlap]) && rate > 0.0 && low <= high);
            let grid = settings.grid();
            prop_assert!(grid.count > 0 && grid.first > 0);
            prop_assert!(grid.first + grid.count <= length / 2);
            prop_assert!(grid.frequency(line).is_finite() || line > length);
            prop_assert!(settings.hop() > 0 && settings.hop() <= length);
            prop_assert_eq!(grid.within([low, high]), Ok(LineRange::all(grid.count)));
        }
        let grid = LineGrid { first, count, spacing: rate };
        match grid.within([low, high]) {
            Ok(band) => {
                prop_assert!(band.indices().start <= band.indices().end && band.indices().end <= count);
                prop_assert!(!(low.is_nan() || high.is_nan()));
            }
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }

    #[test]
    fn weights(peaks in proptest::collection::vec(number(), 0..6)) {
        let mut weights = peaks.clone();
        weights_from_peaks(&mut weights, 0.25);
        for weight in &weights {
            // A product and a quotient round below it, by 1.1e-16 each.
            prop_assert!((0.25 - 3e-16..=1.0).contains(weight), "{peaks:?}: {weights:?}");
        }
        if peaks.iter().any(|peak| !peak.is_finite()) {
            prop_assert!(weights.iter().all(|weight| *weight == 1.0), "{peaks:?}: {weights:?}");
        }
    }

    /// Pairs of a real body, all of a size that nobody has, with entries of any size in places.
    #[test]
    fn identifications(
        accelerations in proptest::collection::vec(six(), 1..5),
        forces in proptest::collection::vec(six(), 5),
        reference in three(),
        scale in number(),
        known_mass in prop::option::of(number()),
        iterative: bool,
        tolerance in number(),
    ) {
        let pairs = accelerations.iter().zip(&forces).map(|(a, f)| (a * scale, *f));
        let Ok(masslines) = Masslines::exact(reference, pairs) else { return Ok(()) };
        let procedure = match iterative {
            true => Procedure::Iterative { tolerance, limit: 9 },
            false => Procedure::Direct,
        };
        if let Ok(found) = identify(&[masslines], &Question::new(known_mass, procedure)) {
            prop_assert!(finite(&all(&found)), "{found:?}");
        }
    }

    /// A body whose numbers are honest, in units so small or large that squares overflow.
    #[test]
    fn identifications_of_any_size(of_a in -320..308_i32, of_f in -320..308_i32, noise in number()) {
        let (of_a, of_f) = (10_f64.powi(of_a), 10_f64.powi(of_f));
        let body = [12.0, 12.0, 12.0, 0.5, 0.6, 0.4];
        let pairs = (0..6).map(|j| {
            let mut a = Vector6::zeros();
            a[j] = of_a;
            a[(j + 2) % 6] = 0.3 * of_a;
            let f = Vector6::from_fn(|i, _| body[i] * a[i] / of_a * of_f);
            (a, f, Vector6::repeat(noise * noise))
        });
        let Ok(masslines) = Masslines::with_variances(Vector3::zeros(), pairs) else {
            return Ok(());
        };
        if let Ok(found) = identify(&[masslines], &Question::default()) {
            prop_assert!(finite(&all(&found)), "{found:?}");
        }
    }

    #[test]
    fn poses(
        poses in proptest::collection::vec((six(), six()), 0..12),
        noise in six(),
        reference in three(),
    ) {
        let mut all_poses = StaticPoses::default();
        for (a, f) in &poses {
            all_poses.add(a, f);
        }
        let equations = massline_core::geometry::Equations::all();
        let noise = Matrix6::from_diagonal(&noise.component_mul(&noise));
        let Ok(fit) = all_poses.masslines(reference, &equations, &noise, None) else {
            return Ok(());
        };
        if let Ok(found) = identify(&[fit.masslines], &Question::default()) {
            prop_assert!(finite(&all(&found)), "{found:?}");
        }
    }
}

#[test]
fn bands_that_end_beyond_all_numbers() {
    let grid = LineGrid {
        first: 1,
        count: 60,
        spacing: 0.5,
    };
    assert!(grid.within([1.0, f64::INFINITY]).is_err());
    assert!(grid.within([1.0, 1e300]).is_err());
    assert!(grid.within([f64::INFINITY, f64::INFINITY]).is_err());
    assert_eq!(
        grid.within([1.0, 30.2]).map(|band| band.indices()),
        Ok(1..60)
    );
    let endless = BlockSettings::new(1024, 0.5, Window::Hann, 512.0, [1.0, f64::INFINITY]);
    assert!(endless.is_err());
}

#[test]
fn a_turn_by_what_is_no_angle() {
    for degrees in [f64::NAN, f64::INFINITY, 1e200] {
        let turned = Placement::new(Vector3::new(0.0, 0.0, degrees), Vector3::zeros());
        assert!(turned.is_err(), "{degrees}");
    }
}
