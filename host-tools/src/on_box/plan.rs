//! The set-up in the box's words, and whether the box holds it.

use super::PlanError;
use crate::device::{BoxInfo, Client, ClientError, Port};
use crate::measure::channel_names;
use crate::setup::{Excitation, Setup};
use massline_core::identify::{self, Procedure};
use massline_core::masslines::Method;
use massline_core::spectra::BlockSettings;
use massline_firmware::wire::{
    self, Accelerations, CRC32, ChannelRole, Grid, NAME_MAX, Plan, Processing, Reply, Request,
    ScaleSource, Sensor, SensorKind, Weighting, Window,
};

/// Runs that were measured alike serve several methods: what they share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Base {
    /// The base acceleration comes from the accelerometers on the interface.
    Interface,
    /// From all of them, equation (4), with equal weights.
    All,
    /// From all of them, with weights from the survey of each run.
    WeightedEachRun,
    /// From all of them, with weights from the surveys of all runs.
    WeightedJoined,
    /// From all of them, with weights given by hand only.
    WeightedByHand,
}

impl Base {
    /// All of them.
    pub(crate) const ALL: [Self; 5] = [
        Self::Interface,
        Self::All,
        Self::WeightedEachRun,
        Self::WeightedJoined,
        Self::WeightedByHand,
    ];

    /// In words.
    #[must_use]
    pub const fn description(self) -> &'static str {
        match self {
            Self::Interface => "interface accelerometers",
            Self::All => "all accelerometers",
            Self::WeightedEachRun => "all accelerometers, weighted by each run's survey",
            Self::WeightedJoined => "all accelerometers, weighted by all surveys",
            Self::WeightedByHand => "all accelerometers, weighted by hand",
        }
    }

    /// `true` if accelerometers are weighted.
    #[must_use]
    pub const fn is_weighted(self) -> bool {
        !matches!(self, Self::Interface | Self::All)
    }

    /// `true` if the runs are surveyed before they are measured.
    #[must_use]
    pub const fn surveys(self) -> bool {
        matches!(self, Self::WeightedEachRun | Self::WeightedJoined)
    }

    /// The base of `identify` for a method, as far as a box can do it.
    pub(crate) fn of(method: Method, setup: &Setup, weighted: bool) -> Self {
        let mode_band = setup.processing.as_ref().and_then(|p| p.mode_band);
        let by_hand = setup.runs.iter().any(|r| !r.weights.is_empty());
        if method.interface_only() {
            Self::Interface
        } else if !weighted {
            Self::All
        } else if mode_band.is_none() {
            if by_hand {
                Self::WeightedByHand
            } else {
                Self::All
            }
        } else if method == Method::FrequencyResponses {
            Self::WeightedEachRun
        } else {
            Self::WeightedJoined
        }
    }

    const fn accelerations(self) -> Accelerations {
        match self {
            Self::Interface => Accelerations::Interface,
            Self::All => Accelerations::All,
            _ => Accelerations::Weighted,
        }
    }

    const fn weighting(self) -> Weighting {
        match self {
            Self::WeightedEachRun => Weighting::EachRun,
            Self::WeightedJoined => Weighting::Joined,
            _ => Weighting::Given,
        }
    }
}

/// The bases that methods need, each with its methods.
pub(crate) fn bases(methods: &[Method], setup: &Setup, weighted: bool) -> Vec<(Base, Vec<Method>)> {
    let mut bases: Vec<(Base, Vec<Method>)> = Vec::new();
    for &method in methods {
        let base = Base::of(method, setup, weighted);
        match bases.iter_mut().find(|(b, _)| *b == base) {
            Some((_, all)) => all.push(method),
            None => bases.push((base, vec![method])),
        }
    }
    bases
}

/// Checks that the box can do all that is asked.
pub(crate) fn check(
    setup: &Setup,
    methods: &[Method],
    settings: &BlockSettings,
    device: &BoxInfo,
) -> Result<(), PlanError> {
    let capacity = &device.capacity;
    let has = |m: &Method| capacity.methods.contains(*m);
    if let Some(&method) = methods.iter().find(|m| !has(m)) {
        let has = Method::ALL.iter().filter(|m| has(m)).map(|m| m.name());
        return Err(PlanError::Method {
            method,
            has: has.collect(),
        });
    }
    for run in &setup.runs {
        let wrong = |what, advice| PlanError::Run {
            run: run.name.clone(),
            what,
            advice,
        };
        if run.excitation != Excitation::Random {
            return Err(wrong(
                "is no random excitation",
                "the box measures random runs; take the others out of the setup",
            ));
        }
        match run.references.len() {
            0 => {
                return Err(wrong(
                    "names no `reference`",
                    "the box refers its lines to the drive signal; record it and name its channel",
                ));
            }
            1 => {}
            _ => {
                return Err(wrong(
                    "names several drives",
                    "the box refers its lines to one drive a run; use `massline identify` on the recording, or shake with one drive at a time",
                ));
            }
        }
    }
    let grid = settings.grid();
    let sensors = setup.accelerometers.len() + setup.load_cells.len();
    let highest =
        (grid.first + usize::from(capacity.lines)).saturating_sub(1) as f64 * grid.spacing;
    for (what, found, limit, advice) in [
        (
            "sensors",
            sensors,
            usize::from(capacity.sensors),
            "leave some out".to_owned(),
        ),
        (
            "channels of a sample",
            sensors + 1,
            usize::from(capacity.channels),
            "leave some sensors out".to_owned(),
        ),
        (
            "runs",
            setup.runs.len(),
            usize::from(capacity.runs),
            "leave some out, or do it in parts".to_owned(),
        ),
        (
            "samples of a block",
            settings.block_length(),
            capacity.block_length as usize,
            format!("set `block_length = {}`", capacity.block_length),
        ),
        (
            "lines",
            grid.count,
            usize::from(capacity.lines),
            format!("end `mode_band` at {highest} Hz"),
        ),
    ] {
        if found > limit {
            return Err(PlanError::Capacity {
                what,
                found,
                limit,
                advice,
            });
        }
    }
    Ok(())
}

/// The beginning of a name that fits.
fn name(text: &str) -> &str {
    let end = (0..=text.len().min(NAME_MAX)).rfind(|&end| text.is_char_boundary(end));
    &text[..end.unwrap_or(0)]
}

/// A mark of a set-up with all that its recordings are read by, and of what else decides the answers of a replay.
pub(crate) fn fingerprint(setup: &Setup, base: Base, mark: &str) -> u32 {
    CRC32.checksum(format!("{base:?} {mark} {setup:?}").as_bytes())
}

/// Origin of the samples, which decides their channels and the calibrations that count.
pub(crate) trait Feed {
    /// ScaleSource of a sensor's samples to SI; `given` is that of the set-up.
    fn scale(&self, sensor: usize, given: ScaleSource) -> ScaleSource;

    /// Roles of the channels of a run's samples, as codes of [`ChannelRole`].
    fn channels(&self, setup: &Setup, run: usize) -> Vec<u8>;
}

/// Columns of a recording in the set-up's order, scaled by the set-up.
pub(crate) struct Columns;

impl Feed for Columns {
    fn scale(&self, _: usize, given: ScaleSource) -> ScaleSource {
        given
    }

    fn channels(&self, setup: &Setup, run: usize) -> Vec<u8> {
        let sensors = setup.accelerometers.len() + setup.load_cells.len();
        let role = |channel| match channel < sensors {
            true => ChannelRole::Sensor(channel as u8).code(),
            false => ChannelRole::Drive.code(),
        };
        let names = setup.runs.get(run).map(|run| channel_names(setup, run));
        (0..names.map_or(0, |names| names.len()))
            .map(role)
            .collect()
    }
}

/// Sends the set-up, and gives the box's lines.
pub(crate) fn upload<P: Port>(
    client: &mut Client<'_, P>,
    setup: &Setup,
    settings: &BlockSettings,
    base: Base,
    feed: &dyn Feed,
    fingerprint: u32,
) -> Result<Grid, PlanError> {
    let tell = &mut |request: &Request<'_>| Ok(client.tell(request)?);
    requests(setup, settings, base, feed, fingerprint, tell)?;
    Ok(grid(client)?)
}

/// A mark of all that a box is told of a set-up, weights given by hand among it, and of nothing else.
pub(crate) fn mark_of(
    setup: &Setup,
    settings: &BlockSettings,
    base: Base,
    feed: &dyn Feed,
) -> Result<u32, PlanError> {
    let mut digest = CRC32.digest();
    let take = &mut |request: &Request<'_>| {
        digest.update(format!("{request:?}").as_bytes());
        Ok(())
    };
    requests(setup, settings, base, feed, 0, take)?;
    if base.is_weighted() {
        for run in &setup.runs {
            digest.update(format!("{:?}", run.weights).as_bytes());
        }
    }
    Ok(digest.finalize())
}

/// Hands the requests that make a box hold a set-up to `tell`, in their order.
fn requests(
    setup: &Setup,
    settings: &BlockSettings,
    base: Base,
    feed: &dyn Feed,
    fingerprint: u32,
    tell: &mut dyn FnMut(&Request<'_>) -> Result<(), PlanError>,
) -> Result<(), PlanError> {
    let p = setup.processing.as_ref().ok_or(PlanError::NoProcessing)?;
    let rate = settings.grid().spacing * settings.block_length() as f64;
    tell(&Request::BeginSetup(Plan {
        sensors: (setup.accelerometers.len() + setup.load_cells.len()) as u8,
        runs: setup.runs.len() as u8,
        reference_point: setup.reference_point,
        fingerprint,
    }))?;
    tell(&Request::SetProcessing(Processing {
        sample_rate: rate,
        block_length: settings.block_length() as u32,
        overlap: p.overlap,
        window: Window::Hann,
        kept_band: [p.averaging_band[0], p.kept_up_to(Some(rate))],
        averaging_band: p.averaging_band,
        mode_band: p.mode_band,
        accelerations: base.accelerations(),
        weighting: base.weighting(),
        minimum_weight: setup.estimation.minimum_weight,
    }))?;
    for (number, mut sensor) in sensors(setup).enumerate() {
        sensor.scale = feed.scale(number, sensor.scale);
        tell(&Request::SetSensor(sensor))?;
    }
    for (number, run) in setup.runs.iter().enumerate() {
        let channels = feed.channels(setup, number);
        tell(&Request::SetRun(wire::Run {
            run: number as u8,
            name: name(&run.name),
            excitation: wire::Excitation::Random,
            rotation: run.rotation,
            translation: run.translation,
            channels: &channels,
        }))?;
    }
    Ok(())
}

/// The question to the box.
pub(crate) fn question(setup: &Setup, method: Method, iterative: bool) -> wire::Question {
    let estimation = &setup.estimation;
    wire::Question {
        method,
        identify: identify::Question::new(
            setup.known_mass,
            if iterative {
                Procedure::Iterative {
                    tolerance: estimation.tolerance,
                    limit: estimation.iterations,
                }
            } else {
                Procedure::Direct
            },
        ),
        modes: estimation.modes as u8,
        // Without one, the box fits all the lines it keeps, as the workstation does.
        fit_band: estimation.fit_band,
        runs: 0,
    }
}

fn grid<P: Port>(client: &mut Client<'_, P>) -> Result<Grid, ClientError> {
    client.ask(&Request::EndSetup, |reply| match reply {
        Reply::Grid(grid) => Some(*grid),
        _ => None,
    })
}

/// The sensors in the order of a run's channels.
fn sensors(setup: &Setup) -> impl Iterator<Item = Sensor<'_>> {
    let accelerometers = setup.accelerometers.iter().map(|a| {
        let kind = SensorKind::Accelerometer(a.mount);
        (kind, &a.channel, a.position, a.direction, a.scale)
    });
    let cells = setup.load_cells.iter().map(|c| {
        let kind = SensorKind::LoadCell(c.quantity);
        (kind, &c.channel, c.position, c.direction, c.scale)
    });
    let all = accelerometers.chain(cells).enumerate();
    all.map(|(k, (kind, channel, position, direction, scale))| Sensor {
        sensor: k as u8,
        name: name(channel),
        kind,
        position,
        direction,
        scale: ScaleSource::Given {
            per_unit: scale,
            offset: 0.0,
        },
    })
}
