//! A body of 100 kg with two sprung masses on a table of six axes, as its sensors see it.

use massline_core::geometry::{Accelerometer, LoadCell, LoadShares, Mount, Quantity};
use massline_core::nalgebra::{Vector3, Vector6};
use massline_core::rigid_body::{Inertia, RigidBody};

#[path = "noise.rs"]
mod noise;
use noise::Noise;

/// Six on the interface, two on the structure.
pub const ACCELEROMETERS: usize = 8;
/// Three at each of four corners.
pub const CELLS: usize = 12;
const SENSORS: usize = ACCELEROMETERS + CELLS;

pub struct Specimen {
    pub accelerometers: Vec<Accelerometer>,
    pub cells: Vec<LoadCell>,
    body: RigidBody,
    shares: LoadShares,
}

impl Specimen {
    pub fn new() -> Self {
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        let interface = [
            ([0.2, 0.2, 0.0], 0),
            ([0.2, 0.2, 0.0], 1),
            ([0.2, 0.2, 0.0], 2),
            ([-0.2, 0.2, 0.0], 1),
            ([-0.2, 0.2, 0.0], 2),
            ([0.2, -0.2, 0.0], 2),
        ];
        let on = |mount| {
            move |(place, axis): ([f64; 3], usize)| {
                Accelerometer::new(place.into(), axes[axis], mount).unwrap()
            }
        };
        let structure = [([0.0, 0.0, 0.6], 0), ([0.0, 0.0, 0.6], 1)];
        let accelerometers = interface.map(on(Mount::Interface)).into_iter();
        let accelerometers = accelerometers.chain(structure.map(on(Mount::Structure)));
        let corners = [
            [0.2, 0.2, 0.0],
            [0.2, -0.2, 0.0],
            [-0.2, 0.2, 0.0],
            [-0.2, -0.2, 0.0],
        ];
        let cells: Vec<_> = corners
            .into_iter()
            .flat_map(|corner| {
                axes.map(|axis| LoadCell::new(corner.into(), axis, Quantity::Force).unwrap())
            })
            .collect();
        Self {
            accelerometers: accelerometers.collect(),
            shares: LoadShares::new(&cells, &Vector3::zeros()),
            cells,
            body: RigidBody {
                mass: 100.0,
                centre_of_gravity: Vector3::new(0.02, -0.03, 0.5),
                inertia: Inertia::from_terms([35.0, 45.0, 20.0, 1.0, -2.0, 0.5]),
            },
        }
    }

    /// The drive and all sensors of a run, sample by sample.
    pub fn samples(&self, run: usize, count: usize) -> impl Iterator<Item = (f32, [f32; SENSORS])> {
        let mut noise = Noise(run as u32 + 1);
        // Near 33 and 45 Hz at 512 samples a second.
        let (mut bending, mut other) = (Sprung::default(), Sprung::default());
        let direction = Vector6::from_fn(|axis, _| match axis == run {
            true => 1.0,
            false => 0.05 * (axis as f64 + 1.0) - 0.02 * run as f64,
        });
        let origin = Vector3::zeros();
        let matrix = self.body.mass_matrix(&origin);
        (0..count).map(move |_| {
            let drive = noise.next();
            let a = direction * drive;
            let u = bending.follow(1.821, 0.02 * (a[0] + a[4]));
            let v = other.follow(1.687, 0.03 * (a[1] - 0.5 * a[3] + 0.2 * a[5]));
            let elastic = Vector6::new(40.0 * u, 30.0 * v, 0.0, -20.0 * v, 35.0 * u, 4.0 * v);
            let force = matrix * a + elastic;
            let sample = std::array::from_fn(|k| {
                let reading = match self.accelerometers.get(k) {
                    Some(sensor) => {
                        let moved = (sensor.rigid_body_row(&origin) * a)[0];
                        moved + [3.0 * u, 2.0 * v].get(k.wrapping_sub(6)).unwrap_or(&0.0)
                    }
                    None => self.shares.load(&self.cells[k - ACCELEROMETERS], &force),
                };
                (reading + 0.01 * noise.next()) as f32
            });
            (drive as f32, sample)
        })
    }
}

/// A mass on a spring: its coordinate by the recursion `y = c y₁ - r² y₂ + x`.
#[derive(Clone, Copy, Default)]
struct Sprung {
    last: [f64; 2],
}

impl Sprung {
    fn follow(&mut self, c: f64, x: f64) -> f64 {
        let y = c * self.last[0] - 0.98 * self.last[1] + x;
        self.last = [y, self.last[0]];
        y
    }
}
