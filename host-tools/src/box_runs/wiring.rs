//! The inputs of the box that read the channels of a set-up.

use super::BoxRunError;
use crate::inputs::InputEntry;
use crate::measure::channel_names;
use crate::on_box::plan::Feed;
use crate::setup::Setup;
use massline_firmware::wire::{ChannelRole, ScaleSource};

/// The inputs behind the channels of a set-up.
#[derive(Clone, Debug)]
pub struct Wiring {
    /// One a sensor: accelerometers, then load cells.
    sensors: Vec<InputEntry>,
    /// The drive of each run.
    drives: Vec<Option<InputEntry>>,
    /// Factor of the set-up for each sensor.
    scales: Vec<f64>,
}

impl Wiring {
    /// Finds the channels of a set-up among the inputs that something is wired to: by the name
    /// that the input was given, else by its sensor's serial number.
    ///
    /// # Errors
    /// [`BoxRunError::Channel`], [`BoxRunError::Twice`].
    pub fn new(setup: &Setup, wired: &[InputEntry]) -> Result<Self, BoxRunError> {
        let accelerometers = setup.accelerometers.iter();
        let channels = accelerometers.map(|a| (a.channel.as_str(), a.scale));
        let cells = setup.load_cells.iter();
        let channels = channels.chain(cells.map(|c| (c.channel.as_str(), c.scale)));
        let (names, scales): (Vec<&str>, Vec<f64>) = channels.unzip();
        let found: Result<_, _> = names
            .iter()
            .map(|name| find(wired, name).cloned())
            .collect();
        let sensors: Vec<InputEntry> = found?;
        // More than one drive a run was refused by the plan.
        let drive = |references: &[String]| {
            let name = references.first().map(String::as_str);
            name.map(|name| find(wired, name).cloned()).transpose()
        };
        let drives: Result<_, _> = setup.runs.iter().map(|r| drive(&r.references)).collect();
        let drives: Vec<Option<InputEntry>> = drives?;
        for (number, run) in setup.runs.iter().enumerate() {
            let all = sensors
                .iter()
                .chain(drives.get(number).into_iter().flatten());
            let all: Vec<&InputEntry> = all.collect();
            let names = channel_names(setup, run);
            for (k, entry) in all.iter().enumerate() {
                if let Some(other) = all[..k].iter().position(|e| e.input == entry.input) {
                    return Err(BoxRunError::Twice {
                        input: entry.number(),
                        channels: [names[other].to_owned(), names[k].to_owned()],
                    });
                }
            }
        }
        Ok(Self {
            sensors,
            drives,
            scales,
        })
    }

    /// The inputs of a run, each with the name of its channel and with its range: SI, counts of
    /// the drive.
    pub(super) fn inputs<'a>(
        &'a self,
        setup: &'a Setup,
        run: usize,
    ) -> impl Iterator<Item = (&'a InputEntry, &'a str, f64)> {
        let names = channel_names(setup, &setup.runs[run]);
        let range = |entry: &InputEntry, si: bool| {
            let (scale, limits) = (entry.certificate.scale(), entry.certificate.limits());
            let end = |count: i32| match si {
                true => f64::from(scale.count(count)).abs(),
                false => f64::from(count).abs(),
            };
            end(limits.low).min(end(limits.high))
        };
        let sensors = self.sensors.iter().zip(&self.scales);
        let sensors = sensors.map(move |(e, factor)| (e, factor.abs() * range(e, true)));
        let drive = self.drives.get(run).into_iter().flatten();
        let all = sensors.chain(drive.map(move |e| (e, range(e, false))));
        all.zip(names)
            .map(|((entry, range), name)| (entry, name, range))
    }
}

impl Feed for Wiring {
    /// ScaleSource from counts to SI, by the box's calibration; the set-up's scale is a factor of
    /// it.
    fn scale(&self, sensor: usize, given: ScaleSource) -> ScaleSource {
        match (self.sensors.get(sensor), given) {
            (Some(entry), ScaleSource::Given { per_unit, .. }) if per_unit != 1.0 => {
                let input = entry.setting();
                ScaleSource::Given {
                    per_unit: per_unit * input.per_count,
                    offset: input.offset,
                }
            }
            _ => ScaleSource::Stored,
        }
    }

    /// Roles of the inputs in a run, up to the last one that is wanted.
    fn channels(&self, _: &Setup, run: usize) -> Vec<u8> {
        let sensors = self.sensors.iter().enumerate();
        let sensors = sensors.map(|(k, entry)| (entry.input, ChannelRole::Sensor(k as u8)));
        let drive = self.drives.get(run).into_iter().flatten();
        let drive = drive.map(|entry| (entry.input, ChannelRole::Drive));
        let mut channels = Vec::new();
        for (input, carries) in sensors.chain(drive) {
            let input = usize::from(input);
            if channels.len() <= input {
                channels.resize(input + 1, ChannelRole::Unused.code());
            }
            channels[input] = carries.code();
        }
        channels
    }
}

fn find<'w>(wired: &'w [InputEntry], name: &str) -> Result<&'w InputEntry, BoxRunError> {
    let named = wired.iter().find(|entry| entry.column() == name);
    let mut of_serial = wired.iter().filter(|e| e.setting().serial == name);
    let only = match (of_serial.next(), of_serial.next()) {
        (Some(only), None) => Some(only),
        _ => None,
    };
    named.or(only).ok_or_else(|| BoxRunError::Channel {
        channel: name.to_owned(),
        inputs: wired
            .iter()
            .map(|entry| (entry.number(), entry.setting().serial.to_owned()))
            .collect(),
    })
}
