//! Samples to ten numbers in fixed memory, with the same code that `on_chip` builds for a chip.
//!
//! `cargo run -p massline-core --example samples`

mod weigher;

use massline_core::geometry::{Accelerometer, LoadCell, LoadShares, Mount, Quantity, RunSensor};
use massline_core::masslines::Method;
use massline_core::nalgebra::{Vector3, Vector6};
use massline_core::rigid_body::{Inertia, RigidBody};
use weigher::{RUNS, SAMPLE_RATE, Weigher};

/// Numbers between -1 and 1, evenly distributed.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let body = RigidBody {
        mass: 12.0,
        centre_of_gravity: Vector3::new(0.10, -0.02, 0.30),
        inertia: Inertia::from_terms([0.5, 0.6, 0.4, 0.02, -0.03, 0.01]),
    };
    // Three sensors at each of four corners: along x, along y and along z.
    let corners = [(0.2, 0.2), (0.2, -0.2), (-0.2, 0.2), (-0.2, -0.2)];
    let places = corners.into_iter().flat_map(|(x, y)| {
        [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| (Vector3::new(x, y, 0.0), axis))
    });
    let mut accelerometers = Vec::new();
    let mut cells = Vec::new();
    for (place, axis) in places {
        accelerometers.push(Accelerometer::new(place, axis, Mount::Interface)?);
        cells.push(LoadCell::new(place, axis, Quantity::Force)?);
    }
    let sensors = accelerometers
        .iter()
        .map(|a| RunSensor::Accelerometer(*a, 1.0));
    let sensors: Vec<_> = sensors
        .chain(cells.iter().map(|c| RunSensor::LoadCell(*c)))
        .collect();

    let origin = Vector3::zeros();
    let matrix = body.mass_matrix(&origin);
    let shares = LoadShares::new(&cells, &origin);
    let mut noise = Noise(2026);
    let mut weigher = Weigher::new(sensors)?;
    for run in 0..RUNS {
        // Each run moves the table mostly in one of its six directions.
        let direction = Vector6::from_fn(|j, _| if j == run { 1.0 } else { 0.05 });
        for _ in 0..(30.0 * SAMPLE_RATE) as usize {
            let drive = noise.next();
            let acceleration = direction * drive;
            let force = matrix * acceleration;
            let readings = accelerometers
                .iter()
                .map(|a| (a.rigid_body_row(&origin) * acceleration)[0]);
            let loads = cells.iter().map(|cell| shares.load(cell, &force));
            let sample: Vec<f32> = readings
                .chain(loads)
                .map(|reading| (reading + 1e-3 * noise.next()) as f32)
                .collect();
            weigher.push(drive as f32, &sample)?;
        }
        weigher.finish_run()?;
    }

    let found = weigher.identify(Method::ApparentMass)?;
    let mass = found.mass.ok_or("the mass is not observable")?;
    println!(
        "mass {:.6} ± {:.6} kg",
        mass.value,
        mass.interval(found.freedom)
    );
    for (axis, cg) in ["x", "y", "z"].iter().zip(found.centre_of_gravity) {
        let cg = cg.ok_or("the centre of gravity is not observable")?;
        println!(
            "{axis}    {:.6} ± {:.6} m",
            cg.value,
            cg.interval(found.freedom)
        );
    }
    let names = ["xx", "yy", "zz", "xy", "xz", "yz"];
    for ((name, term), truth) in names.iter().zip(found.inertia_cg).zip(body.inertia.terms()) {
        let term = term.ok_or("an inertia term is not observable")?;
        println!(
            "Θ{name}  {:.6} ± {:.6} kg m²",
            term.value,
            term.interval(found.freedom)
        );
        // Five 95 % intervals: chance exceeds that once in 10²¹ draws.
        assert!((term.value - truth).abs() < 5.0 * term.interval(found.freedom));
    }
    assert!((mass.value - body.mass).abs() < 5.0 * mass.interval(found.freedom));
    Ok(())
}

#[test]
fn the_numbers_hold() -> Result<(), Box<dyn std::error::Error>> {
    main()
}
