//! From a measurement to the detective's evidence: sensors in the table's frame, products of all
//! channels at the low lines, rows.

use nalgebra::{Complex, DMatrix, DVector, Matrix3, Vector3};

use super::hypothesis::outlying;
use super::model::{Bench, Mounting, Score, equations};
use super::search::{CONTRADICTS, Found, Given, search};
use super::sensor::{Kind, Sensor};
use super::state::{Rows, State};
use super::table::{Gauge, Line, Regression};
use super::{Fault, Undecided};
use crate::measure::{Channels, Measurement};
use crate::setup::{Excitation, Mount, Setup};
use massline_core::geometry::Placement;

/// A channel of which the drives, or without any the other channels, explain less than this is
/// quiet.
const QUIET: f64 = 0.3;

/// Size of the body over the median distance of the sensors from their middle: a standard deviation.
const REACH: f64 = 4.0;

/// Distance of a sensor from the middle over the median one, above which it is taken for a mistake.
pub(super) const OUTLYING: f64 = 50.0;

/// The runs in which the specimen is mounted in one way.
#[derive(Clone)]
pub(super) struct Mounted {
    pub(super) lines: Vec<Line>,
    /// Real equations of a channel in all lines.
    pub(super) equations: usize,
    /// Channels without a signal in these runs, which are no part of the motion.
    pub(super) quiet: Vec<usize>,
    /// From the specimen's frame, in which the set-up has the structure's sensors, to the table's.
    pub(super) rotation: Matrix3<f64>,
    pub(super) translation: Vector3<f64>,
}

/// All that is known of a set-up's runs.
#[derive(Clone)]
pub(super) struct Evidence {
    pub(super) sensors: Vec<Sensor>,
    pub(super) mountings: Vec<Mounted>,
    /// Channels without a signal in any run.
    pub(super) quiet: Vec<usize>,
    /// Phase of one sample at the highest line, rad; 0 without a random run, where nothing is late.
    pub(super) sample: f64,
    /// Weighed mass, kg.
    pub(super) weighed: Option<f64>,
    /// Delays that were found and taken out of the lines: channels and samples.
    pub(super) delays: Vec<(Vec<usize>, f64)>,
}

/// The sensors as a setup has them.
pub(super) fn sensors(setup: &Setup) -> Vec<Sensor> {
    let motion = setup.accelerometers.iter().map(|a| Sensor {
        channel: a.channel.clone(),
        kind: match a.mount {
            Mount::Structure => Kind::Structure,
            _ => Kind::Interface,
        },
        position: Vector3::from(a.position),
        direction: Vector3::from(a.direction),
    });
    let force = setup.load_cells.iter().map(|c| Sensor {
        channel: c.channel.clone(),
        kind: Kind::Cell(c.quantity),
        position: Vector3::from(c.position),
        direction: Vector3::from(c.direction),
    });
    motion.chain(force).collect()
}

/// Parts of the band in which a late channel hardly turns its phase.
const PARTS: usize = 6;

/// Share of each channel that the others explain, mean over parts of the band. A line has so many
/// equations.
fn coherence(lines: &[Line], equations: usize) -> Vec<f64> {
    let n = lines.first().map_or(0, |line| line.products.nrows());
    // Channels explain each other by chance where there are few equations.
    let parts = (lines.len() * equations / (10 * n.max(1))).clamp(1, PARTS);
    let length = lines.len().div_ceil(parts).max(1);
    let mut mean = vec![0.0; n];
    let chunks = lines.chunks(length);
    let count = chunks.len() as f64;
    for part in chunks {
        for (mean, found) in mean.iter_mut().zip(coherence_of(part, n)) {
            *mean += found / count;
        }
    }
    mean
}

/// The same of the sum of some lines.
fn coherence_of(lines: &[Line], n: usize) -> Vec<f64> {
    let mut sum = DMatrix::<Complex<f64>>::zeros(n, n);
    lines.iter().for_each(|line| sum += &line.products);
    let size: Vec<f64> = (0..n).map(|i| sum[(i, i)].re.max(0.0).sqrt()).collect();
    let unit = |i: usize| if size[i] > 0.0 { 1.0 / size[i] } else { 0.0 };
    // Rounding and readings that repeat each other leave no inverse without this share.
    let mut normal = DMatrix::from_fn(n, n, |i, j| sum[(i, j)] * unit(i) * unit(j));
    for i in 0..n {
        normal[(i, i)] = Complex::new(1.0 + 1e-6, 0.0);
    }
    let Some(inverse) = normal.cholesky().map(|c| c.inverse()) else {
        return vec![1.0; n];
    };
    (0..n)
        .map(|i| match size[i] > 0.0 {
            true => 1.0 - 1.0 / inverse[(i, i)].re,
            false => 0.0,
        })
        .collect()
}

/// A way in which the specimen is mounted, with the indices of its runs among the measured ones of their kind.
struct Way {
    rotation: [f64; 3],
    translation: [f64; 3],
    random: Vec<usize>,
    sines: Vec<usize>,
    poses: Vec<usize>,
}

/// The ways in which the specimen is mounted in those runs of the set-up that are wanted.
fn ways(setup: &Setup, measurement: &Measurement, wanted: &dyn Fn(usize) -> bool) -> Vec<Way> {
    let mut ways: Vec<Way> = Vec::new();
    let mut counts = [0; 2];
    for (number, run) in setup.runs.iter().enumerate() {
        let of = |w: &Way| (w.rotation, w.translation) == (run.rotation, run.translation);
        let at = ways.iter().position(of).unwrap_or(ways.len());
        if at == ways.len() {
            ways.push(Way {
                rotation: run.rotation,
                translation: run.translation,
                random: Vec::new(),
                sines: Vec::new(),
                poses: Vec::new(),
            });
        }
        let way = &mut ways[at];
        let (count, list) = match run.excitation {
            // With several drives one run of the set-up is several of the measurement.
            Excitation::Random => {
                let measured = measurement.runs.iter().enumerate();
                let of = measured.filter(|(_, m)| m.number == number && wanted(number));
                way.random.extend(of.map(|(index, _)| index));
                continue;
            }
            Excitation::Sine => (&mut counts[0], &mut way.sines),
            Excitation::Static => (&mut counts[1], &mut way.poses),
        };
        if wanted(number) {
            list.push(*count);
        }
        *count += 1;
    }
    ways
}

/// Sums of the runs of one mounting.
struct Sums {
    lines: Vec<Line>,
    /// Real equations of a channel.
    equations: usize,
    /// Channels without a signal.
    quiet: Vec<usize>,
}

/// The runs of a measurement, with the readings of all channels.
struct Runs<'a> {
    measurement: &'a Measurement,
    channels: &'a Channels,
    /// SI per recorded unit, channel by channel.
    scales: Vec<f64>,
}

impl Runs<'_> {
    /// The highest frequency that is looked at, Hz.
    fn highest(&self) -> f64 {
        let band = self.measurement.band.indices();
        let random = self
            .measurement
            .grid
            .map(|grid| grid.frequency(band.end.saturating_sub(1)));
        let sines = self.measurement.sines.iter();
        let sines = sines.filter_map(|run| run.frequencies[run.band.indices()].last().copied());
        sines.chain(random).fold(f64::MIN_POSITIVE, f64::max)
    }

    /// Sums of random and stepped sine runs.
    fn moving(&self, way: &Way, highest: f64) -> Option<Sums> {
        let n = self.scales.len();
        let mut lines: Vec<Line> = Vec::new();
        let mut equations = 0;
        let mut best = vec![0.0_f64; n];
        let mut driven = !way.random.is_empty();
        let mut add = |frequency: f64, products: DMatrix<Complex<f64>>| match lines
            .iter_mut()
            .find(|line| line.frequency == frequency)
        {
            Some(line) => line.products += products,
            None => lines.push(Line {
                frequency,
                products,
            }),
        };
        let band = self.measurement.band.indices();
        let runs = way.random.iter().filter_map(|&number| {
            Some((
                number,
                self.measurement.grid?,
                self.measurement.runs.get(number)?,
            ))
        });
        for (number, grid, run) in runs {
            equations += 2 * band.len() * self.channels.equations(number, run.blocks);
            for k in band.clone() {
                let products = self.channels.products(number, k);
                let scaled = DMatrix::from_fn(n, n, |i, j| {
                    products[(i, j)] * Complex::new(self.scales[i] * self.scales[j], 0.0)
                });
                add(grid.frequency(k) / highest, scaled);
            }
            match self.channels.coherence(number, band.clone()) {
                Some(found) => {
                    for (best, found) in best.iter_mut().zip(found) {
                        *best = best.max(found);
                    }
                }
                None => driven = false,
            }
        }
        for run in way
            .sines
            .iter()
            .filter_map(|&n| self.measurement.sines.get(n))
        {
            driven = false;
            for k in run.band.indices() {
                equations += 2;
                let x = DVector::from_fn(n, |i, _| {
                    run.readings[k][i] * Complex::new(self.scales[i], 0.0)
                });
                add(run.frequencies[k] / highest, &x * x.adjoint());
            }
        }
        if lines.is_empty() {
            return None;
        }
        if !driven {
            best = coherence(&lines, (equations / 2).div_ceil(lines.len()));
        }
        let silent = |i: usize| lines.iter().all(|line| line.products[(i, i)].re <= 0.0);
        let quiet = (0..n).filter(|&i| best[i] < QUIET || silent(i)).collect();
        Some(Sums {
            lines,
            equations,
            quiet,
        })
    }

    /// Sums of static poses, each against the mean of its run: offsets of the sensors are no signal.
    fn still(&self, way: &Way) -> Option<Sums> {
        let n = self.scales.len();
        let mut products = DMatrix::zeros(n, n);
        let mut equations = 0;
        for run in way
            .poses
            .iter()
            .filter_map(|&n| self.measurement.poses.get(n))
        {
            let rows: Vec<DVector<f64>> = (run.readings.iter())
                .map(|row| DVector::from_fn(n, |i, _| f64::from(row[i]) * self.scales[i]))
                .collect();
            let mean = rows.iter().sum::<DVector<f64>>() / rows.len().max(1) as f64;
            equations += rows.len().saturating_sub(1);
            for row in rows {
                let x = (row - &mean).map(|x| Complex::new(x, 0.0));
                products += &x * x.adjoint();
            }
        }
        if equations == 0 {
            return None;
        }
        let lines = vec![Line {
            frequency: 0.0,
            products,
        }];
        let best = coherence(&lines, equations);
        // As many channels as poses explain each other by chance.
        let enough = equations > 2 * n;
        let silent = |i: usize| lines[0].products[(i, i)].re <= 0.0;
        Some(Sums {
            quiet: (0..n)
                .filter(|&i| silent(i) || (enough && best[i] < QUIET))
                .collect(),
            lines,
            equations,
        })
    }
}

impl Evidence {
    /// The evidence of all runs.
    ///
    /// # Errors
    /// [`Undecided`].
    pub(super) fn new(
        setup: &Setup,
        measurement: &Measurement,
        channels: &Channels,
    ) -> Result<Self, Undecided> {
        Self::of_runs(setup, measurement, channels, &|_| true)
    }

    /// The evidence of those runs of the set-up that are wanted, by their number.
    ///
    /// # Errors
    /// [`Undecided`].
    pub(super) fn of_runs(
        setup: &Setup,
        measurement: &Measurement,
        channels: &Channels,
        wanted: &dyn Fn(usize) -> bool,
    ) -> Result<Self, Undecided> {
        let scales: Vec<f64> = setup
            .accelerometers
            .iter()
            .map(|a| a.scale)
            .chain(setup.load_cells.iter().map(|c| c.scale))
            .collect();
        let n = scales.len();
        let runs = Runs {
            measurement,
            channels,
            scales,
        };
        let highest = runs.highest();
        let mut mountings = Vec::new();
        for way in ways(setup, measurement, wanted) {
            let translation = Vector3::from(way.translation);
            let rotation = Placement::new(Vector3::from(way.rotation), translation)
                .map_err(|_| Undecided::Placement)?
                .rotation();
            let moving = [runs.moving(&way, highest), runs.still(&way)];
            mountings.extend(moving.into_iter().flatten().map(|sums| Mounted {
                lines: sums.lines,
                equations: sums.equations,
                quiet: sums.quiet,
                rotation,
                translation,
            }));
        }
        if mountings.is_empty() {
            return Err(Undecided::NoRun);
        }
        // Only random runs have samples.
        let settings = measurement.runs.first().map(|run| *run.settings());
        let sample = match (measurement.grid, settings) {
            (Some(grid), Some(settings)) => {
                let rate = grid.spacing * settings.block_length() as f64;
                std::f64::consts::TAU * highest / rate
            }
            _ => 0.0,
        };
        let quiet = |i: &usize| mountings.iter().all(|m: &Mounted| m.quiet.contains(i));
        Ok(Self {
            sensors: sensors(setup),
            quiet: (0..n).filter(quiet).collect(),
            mountings,
            sample,
            weighed: setup.known_mass,
            delays: Vec::new(),
        }
        .without_delays())
    }

    /// The same of a body that was not weighed.
    pub(super) fn without_mass(&self) -> Self {
        Self {
            weighed: None,
            ..self.clone()
        }
    }

    /// Sums that were made elsewhere, of which no channel is late.
    pub(super) fn of_mountings(
        sensors: Vec<Sensor>,
        mountings: Vec<Mounted>,
        weighed: Option<f64>,
    ) -> Self {
        Self {
            sensors,
            mountings,
            quiet: Vec::new(),
            sample: 0.0,
            weighed,
            delays: Vec::new(),
        }
    }

    /// This evidence and that of another run of the same sensors, as if it were mounted anew.
    pub(super) fn beside(&self, other: &Self) -> Self {
        let mut both = self.clone();
        both.mountings.extend(other.mountings.iter().cloned());
        both.quiet.retain(|channel| other.quiet.contains(channel));
        both
    }

    #[cfg(test)]
    pub(super) fn of_lines(sensors: Vec<Sensor>, lines: Vec<Line>, runs: usize) -> Self {
        Self {
            sensors,
            mountings: vec![Mounted {
                equations: 2 * runs * lines.len(),
                lines,
                quiet: Vec::new(),
                rotation: Matrix3::identity(),
                translation: Vector3::zeros(),
            }],
            quiet: Vec::new(),
            sample: 0.25,
            weighed: None,
            delays: Vec::new(),
        }
        .without_delays()
    }

    /// The interface accelerometers that span the motion.
    pub(super) fn moving(&self, mounted: &Mounted) -> Vec<usize> {
        (0..self.sensors.len())
            .filter(|i| self.sensors[*i].kind == Kind::Interface)
            .filter(|i| !mounted.quiet.contains(i))
            .collect()
    }

    /// The accelerometers that span the motion without one of them, for which those on the structure
    /// stand in.
    pub(super) fn moving_but(&self, mounted: &Mounted, channel: usize) -> Vec<usize> {
        if self.sensors[channel].kind != Kind::Interface {
            return self.moving(mounted);
        }
        (0..self.sensors.len())
            .filter(|&i| !self.sensors[i].kind.is_cell() && i != channel)
            .filter(|i| !mounted.quiet.contains(i))
            .collect()
    }

    /// The rows of all channels in one mounting, with the readings of some exchanged, and the
    /// number of motions.
    fn rows(
        &self,
        mounted: &Mounted,
        sensors: &[Sensor],
        exchanged: &[[usize; 2]],
    ) -> Option<(Rows, usize)> {
        let mut lines = mounted.lines.clone();
        let mut quiet = mounted.quiet.clone();
        for &[a, b] in exchanged {
            for line in &mut lines {
                line.products.swap_rows(a, b);
                line.products.swap_columns(a, b);
            }
            for channel in &mut quiet {
                match *channel {
                    c if c == a => *channel = b,
                    c if c == b => *channel = a,
                    _ => {}
                }
            }
        }
        let moving: Vec<usize> = (0..sensors.len())
            .filter(|i| sensors[*i].kind == Kind::Interface && !quiet.contains(i))
            .collect();
        let gauge = Gauge::of(&lines, &moving)?;
        let regression = Regression::new(&lines, &gauge, mounted.equations)?;
        let row = |i: usize, constant: bool| {
            let terms = if constant { 1 } else { 3 };
            regression.fit(i, terms, 0.0).map(|fit| fit.row)
        };
        let constant = |i: usize| sensors[i].kind == Kind::Interface;
        let all = 0..sensors.len();
        let rows = Rows {
            rows: all.clone().map(|i| row(i, constant(i))).collect(),
            others: all.map(|i| row(i, !constant(i))).collect(),
        };
        Some((rows, gauge.motions()))
    }

    /// The rows of all mountings in which something moves, and what does not change with a
    /// hypothesis.
    pub(super) fn state(
        &self,
        sensors: &[Sensor],
        exchanged: &[[usize; 2]],
    ) -> Option<(State, Bench)> {
        let length = spread(sensors);
        let (mut all, mut mountings) = (Vec::new(), Vec::new());
        for mounted in &self.mountings {
            let Some((rows, motions)) = self.rows(mounted, sensors, exchanged) else {
                continue;
            };
            all.push(rows);
            let way = (mounted.rotation, mounted.translation);
            mountings.push(Mounting::new(motions, way, length));
        }
        let state = State {
            sensors: sensors.to_vec(),
            mountings: all,
        };
        let bench = Bench {
            mountings,
            equations: equations(sensors, length),
            length,
            weighed: self.weighed,
            reach: REACH * (length + middle(sensors).norm()),
        };
        (!bench.mountings.is_empty()).then_some((state, bench))
    }

    /// `true` if some channels are late, or the set-up as it is contradicts itself.
    pub(super) fn is_contradicted(&self) -> bool {
        let contradicts = |score: Score| score.ratio() > CONTRADICTS;
        !self.delays.is_empty() || self.score().is_some_and(contradicts)
    }

    /// Contradiction of the set-up as it is.
    pub(super) fn score(&self) -> Option<Score> {
        let (state, bench) = self.state(&self.sensors, &[])?;
        bench.score(&state, 1.0)
    }

    /// Contradiction of the accelerometers on the interface and the load cells alone.
    pub(super) fn balance(&self) -> Option<f64> {
        let (mut state, bench) = self.state(&self.sensors, &[])?;
        for (i, sensor) in self.sensors.iter().enumerate() {
            if sensor.kind == Kind::Structure {
                state.mountings.iter_mut().for_each(|m| m.rows[i] = None);
            }
        }
        Some(bench.score(&state, 1.0)?.ratio())
    }

    /// Searches for the faults.
    ///
    /// # Errors
    /// [`Undecided`].
    pub(super) fn search(&self) -> Result<Found, Undecided> {
        self.search_unless(Some(1), &|| false)
    }

    /// The same on `threads` threads, as many as there are processors if `None`, and without pairs of faults, where
    /// something else is `known` to explain the data.
    ///
    /// # Errors
    /// [`Undecided`].
    pub(super) fn search_unless(
        &self,
        threads: Option<usize>,
        known: &dyn Fn() -> bool,
    ) -> Result<Found, Undecided> {
        // Positions that are far away whatever moves are mended before anything is made of them.
        let (centre, size) = (middle(&self.sensors), spread(&self.sensors));
        let outlying = outlying(&self.sensors, &|p| (p - centre).norm() > OUTLYING * size);
        let mut sensors = self.sensors.clone();
        for fault in &outlying {
            if let Fault::Position {
                place, position, ..
            } = fault
            {
                place.iter().for_each(|&i| sensors[i].position = *position);
            }
        }
        let (state, bench) = self.state(&sensors, &[]).ok_or(Undecided::NoInterface)?;
        let anew = |exchanged: &[[usize; 2]], state: &State| self.state(&state.sensors, exchanged);
        let given = Given {
            bench: &bench,
            state: &state,
            quiet: &self.quiet,
            rows: &anew,
            threads,
        };
        let before = outlying.len() + self.delays.len();
        let mut found = search(&given, before, known).ok_or(Undecided::NoMotion)?;
        for fault in outlying {
            found.named.insert(0, vec![found.certain(fault)]);
        }
        for (channels, samples) in &self.delays {
            let fault = Fault::Delayed {
                channels: channels.clone(),
                samples: *samples,
            };
            found.named.insert(0, vec![found.certain(fault)]);
        }
        Ok(found)
    }
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
