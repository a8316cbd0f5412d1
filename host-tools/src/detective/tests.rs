//! Faults put into random elastic structures, of which none may accuse a sensor wrongly.

use super::hypothesis::{Fault, Mistake};
use super::model::{Bench, Kind, Sensor, equations};
use super::search::{Found, State, search};
use super::table::{Gauge, Line, Regression};
use crate::simulate::Stream;
use massline_core::geometry::Quantity;
use nalgebra::{Complex, DMatrix, DVector, Matrix6, Vector3, Vector6};

/// Sensors and readings of a test.
struct Laboratory {
    sensors: Vec<Sensor>,
    /// Readings of all channels, line by line, a column a run.
    lines: Vec<(f64, DMatrix<Complex<f64>>)>,
    runs: usize,
}

/// Differences of sensors, as shares of 0.3 %, 0.3 degrees and 0.5 mm.
fn laboratory(seed: u64, noise: f64, differences: f64) -> Laboratory {
    let mut stream = Stream::new(seed, &["laboratory"]);
    let mut random = |size: f64| stream.signed() * size;
    let mut sensors = Vec::new();
    let mut triax = |name: &str, kind: Kind, position: Vector3<f64>| {
        for (axis, letter) in ["x", "y", "z"].iter().enumerate() {
            sensors.push(Sensor {
                channel: format!("{name}.{letter}"),
                kind,
                position,
                direction: Vector3::ith(axis, 1.0),
            });
        }
    };
    for (i, [x, y]) in [[0.5, 0.4], [-0.5, 0.45], [0.05, -0.5]].into_iter().enumerate() {
        let p = Vector3::new(x + random(0.05), y + random(0.05), 0.0);
        triax(&format!("base{i}"), Kind::Interface, p);
    }
    for i in 0..3 {
        let p = Vector3::new(random(0.4), random(0.4), 0.3 + random(0.2) + 0.3 * f64::from(i));
        triax(&format!("body{i}"), Kind::Structure, p);
    }
    let force = Kind::Cell(Quantity::Force);
    for (i, [x, y]) in [[0.4, 0.4], [-0.4, 0.4], [-0.4, -0.4], [0.4, -0.4]].into_iter().enumerate() {
        triax(&format!("cell{i}"), force, Vector3::new(x, y, 0.02));
    }
    let body = {
        let m = 80.0 + random(40.0);
        let s = Vector3::new(random(0.1), random(0.1), 0.5 + random(0.1));
        let cross = s.cross_matrix();
        let mut theta = nalgebra::Matrix3::from_diagonal(&Vector3::new(
            6.0 + random(2.0),
            7.0 + random(2.0),
            5.0 + random(2.0),
        ));
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let x = random(0.6);
            theta[(i, j)] = x;
            theta[(j, i)] = x;
        }
        let mut matrix = Matrix6::<f64>::zeros();
        (0..3).for_each(|i| matrix[(i, i)] = m);
        matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(&(-cross * m));
        matrix.fixed_view_mut::<3, 3>(3, 0).copy_from(&(cross * m));
        matrix
            .fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&(theta - cross * cross * m));
        matrix
    };
    // Modes: frequency over that of the highest line, participation, shape at the sensors.
    let n = sensors.len();
    let modes: Vec<(f64, Vector6<f64>, DVector<f64>)> = [2.2, 3.1, 4.4]
        .into_iter()
        .map(|ratio| {
            let l = Vector6::from_fn(|i, _| random(if i < 3 { 6.0 } else { 3.0 }));
            let shape = DVector::from_fn(n, |i, _| match sensors[i].kind {
                Kind::Structure => random(0.15),
                _ => 0.0,
            });
            (ratio, l, shape)
        })
        .collect();
    let cells: Vec<usize> = (0..n).filter(|&i| sensors[i].kind.is_cell()).collect();
    let x = DMatrix::from_fn(6, cells.len(), |i, j| {
        let s = &sensors[cells[j]];
        if i < 3 {
            s.direction[i]
        } else {
            s.position.cross(&s.direction)[i - 3]
        }
    });
    let inverse = x.clone().pseudo_inverse(1e-9).unwrap();
    let internal = DMatrix::from_fn(cells.len(), 6, |_, _| random(8.0));
    let internal = &internal - &inverse * (&x * &internal);
    // Sensors are not where and how the set-up says.
    let real: Vec<(f64, Sensor)> = sensors
        .iter()
        .map(|s| {
            let mut other = s.clone();
            other.position += Vector3::from_fn(|_, _| random(0.0005 * 1.7)) * differences;
            other.direction += Vector3::from_fn(|_, _| random(0.0052 * 1.7)) * differences;
            other.direction.normalize_mut();
            (1.0 + random(0.003 * 1.7) * differences, other)
        })
        .collect();
    let runs = 6;
    let mut lines = Vec::new();
    for line in 1..=12 {
        let w = f64::from(line) / 12.0;
        let mut readings = DMatrix::zeros(n, runs);
        for run in 0..runs {
            let a = Vector6::from_fn(|i, _| {
                let main = if i == run { 1.0 } else { 0.1 };
                stream.normal() * main * if i < 3 { 1.0 } else { 2.0 }
            });
            let mut f = body.map(|v| Complex::new(v, 0.0)) * a;
            let mut clean = DVector::<Complex<f64>>::zeros(n);
            for (ratio, l, shape) in &modes {
                let d = w * w / (ratio * ratio - w * w);
                let along = l.map(|v| Complex::new(v, 0.0)).dot(&a);
                f += l.map(|v| Complex::new(v, 0.0)) * along * Complex::new(d, 0.0);
                clean += shape.map(|v| Complex::new(v, 0.0)) * along * Complex::new(d, 0.0);
            }
            let wide = |m: &DMatrix<f64>| m.map(|v| Complex::new(v, 0.0));
            let dynamic = |v: &Vector6<Complex<f64>>| DVector::from_fn(6, |i, _| v[i]);
            let shares = wide(&inverse) * dynamic(&f) + wide(&internal) * dynamic(&a);
            for (i, (gain, sensor)) in real.iter().enumerate() {
                if sensor.kind.is_cell() {
                    continue;
                }
                let t = Vector3::new(a[0], a[1], a[2]);
                let o = Vector3::new(a[3], a[4], a[5]);
                let p = sensor.position.map(|v| Complex::new(v, 0.0));
                let motion = t + o.cross(&p);
                let reading: Complex<f64> =
                    (0..3).map(|k| motion[k] * sensor.direction[k]).sum();
                clean[i] = (clean[i] + reading) * *gain;
            }
            for (j, &i) in cells.iter().enumerate() {
                clean[i] = shares[j] * real[i].0;
            }
            readings.set_column(run, &clean);
        }
        lines.push((w, readings));
    }
    let mean = |i: usize| {
        let sum: f64 = lines.iter().map(|(_, r)| r.row(i).map(|z| z.norm_sqr()).sum()).sum();
        (sum / (12 * runs) as f64).sqrt()
    };
    let levels: Vec<f64> = (0..n).map(mean).collect();
    for (_, readings) in &mut lines {
        for i in 0..n {
            for run in 0..runs {
                readings[(i, run)] += stream.normal() * (noise * levels[i] * 0.7);
            }
        }
    }
    Laboratory {
        sensors,
        lines,
        runs,
    }
}

impl Laboratory {
    fn search(&self) -> Found {
        let lines: Vec<Line> = self
            .lines
            .iter()
            .map(|(frequency, x)| Line {
                frequency: *frequency,
                products: x * x.adjoint(),
            })
            .collect();
        let interface: Vec<usize> = (0..self.sensors.len())
            .filter(|&i| self.sensors[i].kind == Kind::Interface)
            .collect();
        let gauge = Gauge::of(&lines, &interface).unwrap();
        let regression = Regression::new(&lines, &gauge, self.runs).unwrap();
        let rows = (0..self.sensors.len())
            .map(|i| {
                let terms = if self.sensors[i].kind == Kind::Interface { 1 } else { 3 };
                regression.fit(i, terms, 0.0).map(|fit| fit.row)
            })
            .collect();
        let length = 0.5;
        let bench = Bench {
            motions: gauge.motions(),
            equations: equations(&self.sensors, length),
            length,
        };
        let state = State {
            sensors: self.sensors.clone(),
            rows,
        };
        search(&bench, &state).unwrap()
    }

    fn scale(&mut self, channel: usize, factor: f64) {
        for (_, readings) in &mut self.lines {
            readings.row_mut(channel).scale_mut(factor);
        }
    }
}

/// A fault of this kind, put into the laboratory; the channels that it concerns.
fn spoil(l: &mut Laboratory, kind: &str, stream: &mut Stream) -> Vec<usize> {
    let n = l.sensors.len();
    let mut pick = |limit: usize| ((stream.uniform() * limit as f64) as usize).min(limit - 1);
    let channel = pick(n);
    let place = 3 * (channel / 3);
    match kind {
        "inverted" => l.scale(channel, -1.0),
        "g" => l.scale(channel, 1.0 / 9.806_65),
        "ten" => l.scale(channel, 10.0),
        "gain" => l.scale(channel, 1.0 + [0.06, -0.06, 0.1, -0.2][pick(4)]),
        "swapped" => {
            let cells = l.sensors[channel].kind.is_cell();
            let other = loop {
                let other = pick(n);
                if other != channel && l.sensors[other].kind.is_cell() == cells {
                    break other;
                }
            };
            for (_, readings) in &mut l.lines {
                readings.swap_rows(channel, other);
            }
            return vec![channel, other];
        }
        "upside down" => {
            l.scale(place + 1, -1.0);
            l.scale(place + 2, -1.0);
            return (place..place + 3).collect();
        }
        "millimetres" => {
            (place..place + 3).for_each(|i| l.sensors[i].position *= 1000.0);
            return (place..place + 3).collect();
        }
        "offset" => {
            let axis = pick(3);
            (place..place + 3).for_each(|i| l.sensors[i].position[axis] += 0.03);
            return (place..place + 3).collect();
        }
        "cross-talk" => {
            let from = place + (channel + 1) % 3;
            for (_, readings) in &mut l.lines {
                let other = readings.row(from) * Complex::new(0.08, 0.0);
                let mut row = readings.row_mut(channel);
                row += other;
            }
        }
        "clean" => return Vec::new(),
        _ => unreachable!(),
    }
    vec![channel]
}

#[test]
fn look() {
    let kinds = [
        "clean", "inverted", "g", "ten", "gain", "swapped", "upside down", "millimetres", "offset", "cross-talk",
    ];
    for kind in kinds {
        let mut counts = [0; 4];
        for seed in 1..11 {
            let mut l = laboratory(seed, 0.003, f64::from(seed as u32 % 2));
            let mut stream = Stream::new(seed, &[kind]);
            let guilty = spoil(&mut l, kind, &mut stream);
            let found = l.search();
            let right = |f: &Fault| f.channels().iter().any(|c| guilty.contains(c));
            let (n, text) = match found.named.as_slice() {
                [] => (3, "silent"),
                [one] if one.len() == 1 && right(&one[0].fault) => (0, "right"),
                [one] if one.iter().any(|c| right(&c.fault)) => (1, "tie"),
                several => (if several.iter().any(|c| right(&c[0].fault)) { 1 } else { 2 }, "WRONG"),
            };
            counts[n] += 1;
            if n != 0 && kind != "clean" || kind == "clean" && n != 3 || kind == "swapped" {
                println!(
                    "  {seed} {kind} {guilty:?} {text} {:.2} -> {:.2} {:?}",
                    found.before.ratio(),
                    found.after.ratio(),
                    found
                        .named
                        .iter()
                        .map(|n| n.iter().take(4).map(|c| (c.fault.clone(), c.score.round())).collect::<Vec<_>>())
                        .collect::<Vec<_>>()
                );
            }
        }
        println!("{kind}: right, tie, wrong, silent {counts:?}");
    }
    let _ = Mistake::Offset;
}
