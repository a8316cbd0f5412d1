//! From a measurement to the detective's evidence: sensors in the table's frame, products of all
//! channels at the low lines, rows.

use nalgebra::{Complex, DMatrix, Matrix3, Vector3};

use super::model::{Bench, Kind, Sensor, equations};
use super::search::{Found, search};
use super::state::State;
use super::table::{Gauge, Line, Regression};
use super::{Fault, Undecided};
use crate::measure::{Channels, Measurement};
use crate::setup::{Excitation, Mount, Setup};
use massline_core::geometry::Placement;

/// A channel whose mean coherence with the drives is below this in every run is quiet.
const QUIET: f64 = 0.3;
/// It is dead if most channels that look the same way have more than this.
const LOUD: f64 = 0.7;
/// Cosine from which two channels look the same way.
const PARALLEL: f64 = 0.9;

/// All that is known of a group of runs with the specimen mounted in one way.
pub(super) struct Evidence {
    pub(super) sensors: Vec<Sensor>,
    pub(super) lines: Vec<Line>,
    /// Channels without a signal that others have.
    pub(super) dead: Vec<usize>,
    /// Channels without a signal, which are no part of the motion.
    quiet: Vec<usize>,
    /// Complex equations of a line.
    pub(super) runs: usize,
    /// Phase of one sample at the highest line, rad.
    pub(super) sample: f64,
    /// Delays that were found and taken out of the lines: channels and samples.
    pub(super) delays: Vec<(Vec<usize>, f64)>,
    /// From the specimen's frame, in which the set-up has the structure's sensors.
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
}

/// The sensors of a setup in the table's frame, as the runs of this one have them.
fn sensors(setup: &Setup, rotation: &Matrix3<f64>, translation: &Vector3<f64>) -> Vec<Sensor> {
    let mut all = Vec::new();
    for a in &setup.accelerometers {
        let (mut position, mut direction) = (Vector3::from(a.position), Vector3::from(a.direction));
        let kind = match a.mount {
            Mount::Structure => {
                position = rotation * position + translation;
                direction = rotation * direction;
                Kind::Structure
            }
            _ => Kind::Interface,
        };
        all.push(Sensor {
            channel: a.channel.clone(),
            kind,
            position,
            direction,
        });
    }
    for c in &setup.load_cells {
        all.push(Sensor {
            channel: c.channel.clone(),
            kind: Kind::Cell(c.quantity),
            position: Vector3::from(c.position),
            direction: Vector3::from(c.direction),
        });
    }
    all
}

impl Evidence {
    /// The evidence of the random runs in the mounting that most runs have.
    ///
    /// # Errors
    /// [`Undecided`].
    pub(super) fn new(
        setup: &Setup,
        measurement: &Measurement,
        channels: &Channels,
    ) -> Result<Self, Undecided> {
        let mounted = |number: usize| {
            let run = &setup.runs[number];
            (run.rotation, run.translation)
        };
        let random: Vec<(usize, usize)> = measurement
            .runs
            .iter()
            .enumerate()
            .filter(|(_, run)| setup.runs[run.number].excitation == Excitation::Random)
            .map(|(index, run)| (index, run.number))
            .collect();
        let alike = |number: usize| {
            let of = mounted(number);
            random.iter().filter(|(_, n)| mounted(*n) == of).count()
        };
        let Some(&(_, first)) = random
            .iter()
            .max_by_key(|(index, n)| (alike(*n), usize::MAX - index))
        else {
            return Err(Undecided::NoRandomRun);
        };
        let run = &setup.runs[first];
        let translation = Vector3::from(run.translation);
        let rotation = Placement::new(Vector3::from(run.rotation), translation)
            .map_err(|_| Undecided::Placement)?
            .rotation();
        let sensors = sensors(setup, &rotation, &translation);
        let scales: Vec<f64> = setup
            .accelerometers
            .iter()
            .map(|a| a.scale)
            .chain(setup.load_cells.iter().map(|c| c.scale))
            .collect();
        let grid = measurement.grid.ok_or(Undecided::NoRandomRun)?;
        let band = measurement.band.indices();
        let highest = grid.frequency(band.end.saturating_sub(1));
        let settings = measurement.runs.first().map(|run| *run.settings());
        let length = settings.map_or(1, |settings| settings.block_length());
        let rate = grid.spacing * length as f64;
        let n = sensors.len();
        let mut lines: Vec<Line> = band
            .clone()
            .map(|k| Line {
                frequency: grid.frequency(k) / highest,
                products: DMatrix::zeros(n, n),
            })
            .collect();
        let mut coherence = vec![0.0_f64; n];
        let mut runs = 0;
        for &(index, number) in &random {
            if mounted(number) != mounted(first) {
                continue;
            }
            runs += channels.equations(index, measurement.runs[index].blocks);
            for (line, k) in lines.iter_mut().zip(band.clone()) {
                let products = channels.products(index, k);
                line.products += DMatrix::from_fn(n, n, |i, j| {
                    products[(i, j)] * Complex::new(scales[i] * scales[j], 0.0)
                });
            }
            for (best, found) in coherence
                .iter_mut()
                .zip(channels.coherence(index, band.clone()))
            {
                *best = best.max(found);
            }
        }
        for (i, coherence) in coherence.iter_mut().enumerate() {
            if lines.iter().all(|line| line.products[(i, i)].re <= 0.0) {
                *coherence = 0.0;
            }
        }
        let quiet: Vec<usize> = (0..n).filter(|&i| coherence[i] < QUIET).collect();
        // A motion that the table does not make is nobody's fault.
        let dead = quiet.iter().copied().filter(|&i| {
            let here: &Sensor = &sensors[i];
            let peers = sensors
                .iter()
                .zip(&coherence)
                .enumerate()
                .filter(|(j, (s, _))| {
                    *j != i
                        && s.kind.is_cell() == here.kind.is_cell()
                        && s.direction.dot(&here.direction).abs() > PARALLEL
                });
            let (mut loud, mut all) = (0, 0);
            for (_, (_, coherence)) in peers {
                all += 1;
                loud += usize::from(*coherence > LOUD);
            }
            all >= 2 && 2 * loud > all
        });
        let dead = dead.collect();
        Ok(Self {
            sensors,
            lines,
            dead,
            quiet,
            runs,
            sample: std::f64::consts::TAU * highest / rate,
            delays: Vec::new(),
            rotation,
            translation,
        }
        .without_delays())
    }

    #[cfg(test)]
    pub(super) fn of_lines(sensors: Vec<Sensor>, lines: Vec<Line>, runs: usize) -> Self {
        Self {
            sensors,
            lines,
            dead: Vec::new(),
            quiet: Vec::new(),
            runs,
            sample: 0.25,
            delays: Vec::new(),
            rotation: Matrix3::identity(),
            translation: Vector3::zeros(),
        }
        .without_delays()
    }

    /// A position in the frame in which the set-up has this channel.
    pub(super) fn moved_back(&self, channel: usize, position: Vector3<f64>) -> Vector3<f64> {
        match self.sensors[channel].kind {
            Kind::Structure => self.rotation.tr_mul(&(position - self.translation)),
            _ => position,
        }
    }

    /// A direction in the frame in which the set-up has this channel.
    pub(super) fn turned_back(&self, channel: usize, direction: Vector3<f64>) -> Vector3<f64> {
        match self.sensors[channel].kind {
            Kind::Structure => self.rotation.tr_mul(&direction),
            _ => direction,
        }
    }

    /// The interface accelerometers that span the motion, but one.
    pub(super) fn moving(&self, but: Option<usize>) -> Vec<usize> {
        (0..self.sensors.len())
            .filter(|i| self.sensors[*i].kind == Kind::Interface)
            .filter(|i| !self.quiet.contains(i) && Some(*i) != but)
            .collect()
    }

    /// The rows of all channels, with the readings of some exchanged.
    fn state(&self, sensors: &[Sensor], exchanged: &[[usize; 2]]) -> Option<(State, usize)> {
        let mut lines = self.lines.clone();
        for &[a, b] in exchanged {
            for line in &mut lines {
                line.products.swap_rows(a, b);
                line.products.swap_columns(a, b);
            }
        }
        let live = |i: &usize| !self.dead.contains(i);
        let gauge = Gauge::of(&lines, &self.moving(None))?;
        let regression = Regression::new(&lines, &gauge, self.runs)?;
        let row = |i: usize, constant: bool| {
            let terms = if constant { 1 } else { 3 };
            live(&i)
                .then(|| regression.fit(i, terms, 0.0))
                .flatten()
                .map(|fit| fit.row)
        };
        let constant = |i: usize| sensors[i].kind == Kind::Interface;
        let all = 0..sensors.len();
        Some((
            State {
                sensors: sensors.to_vec(),
                rows: all.clone().map(|i| row(i, constant(i))).collect(),
                others: all.map(|i| row(i, !constant(i))).collect(),
            },
            gauge.motions(),
        ))
    }

    /// Searches for the faults.
    ///
    /// # Errors
    /// [`Undecided`].
    pub(super) fn search(&self) -> Result<Found, Undecided> {
        let (mut state, motions) = self
            .state(&self.sensors, &[])
            .ok_or(Undecided::NoInterface)?;
        let length = spread(&self.sensors);
        let bench = Bench {
            motions,
            equations: equations(&self.sensors, length),
            length,
        };
        for &channel in &self.dead {
            if self.sensors[channel].kind.is_cell() {
                // What it carries is unknown, which its noise says.
                let level = cells(&state);
                state.rows[channel] = Some(super::table::Row::unknown(motions, level));
            }
        }
        let anew = |exchanged: &[[usize; 2]], state: &State| {
            Some(self.state(&state.sensors, exchanged)?.0)
        };
        let mut found = search(&bench, &state, &anew).ok_or(Undecided::NoMotion)?;
        for (channels, samples) in &self.delays {
            let fault = Fault::Delayed {
                channels: channels.clone(),
                samples: *samples,
            };
            found.named.insert(0, vec![found.certain(fault)]);
        }
        for &channel in self.dead.iter().rev() {
            found
                .named
                .insert(0, vec![found.certain(Fault::Dead { channel })]);
        }
        Ok(found)
    }
}

/// Mean square of the load cells' rows.
fn cells(state: &State) -> f64 {
    let cells = state.sensors.iter().zip(&state.rows);
    cells
        .filter(|(s, _)| s.kind.is_cell())
        .filter_map(|(_, row)| row.as_ref())
        .map(|row| row.k.norm_squared())
        .fold(1e-12, f64::max)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// The middle of the sensors: the medians of their coordinates, m.
pub(super) fn middle(sensors: &[Sensor]) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| median(sensors.iter().map(|s| s.position[axis]).collect()))
}

/// Median distance of the sensors from their middle, m: robust against a position in millimetres.
pub(super) fn spread(sensors: &[Sensor]) -> f64 {
    let middle = middle(sensors);
    let distance = median(
        sensors
            .iter()
            .map(|s| (s.position - middle).norm())
            .collect(),
    );
    if distance > 0.0 { distance } else { 1.0 }
}
