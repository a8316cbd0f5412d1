//! Sensors, converters, driver and acquisition in a chain that is stepped sample by sample.

use super::sensors::{Sensor, Sensors};
use super::trouble::Mischief;
use super::{CHIPS, INPUTS, LEAD, RigError, Troubles};
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use massline_firmware::acquisition::{Acquisition, Sample};
use massline_firmware::drivers::ads131m08::registers::CHANNELS;
use massline_firmware::drivers::ads131m08::{
    self, Ads131m08, CLOCK_HZ, Configuration, Gain, Oversampling,
};
use massline_firmware::drivers::{Converter, Signal};
use massline_firmware::models::BusError;
use massline_firmware::models::rig::{Port, Rig};
use massline_firmware::wire::FaultCounters;
use std::cell::RefCell;
use std::rc::Rc;

/// Input of the sensors: one signal each.
pub(super) struct Felt<D> {
    /// One list an input, all of one length.
    pub(super) samples: D,
    /// Rate of these samples, Hz.
    pub(super) rate: f64,
    /// `true` if the signals begin anew behind their end; else their last value stays.
    pub(super) repeats: bool,
}

/// A box's measuring chain at work.
pub struct Chain<D> {
    bench: Shared<D>,
    chips: [Ads131m08<Spi<D>>; CHIPS],
    acquisition: Acquisition<CHIPS, INPUTS>,
    mischief: Mischief,
}

/// The converters and what is at their inputs.
type Shared<D> = Rc<RefCell<Rig<Sensors<D>, CHIPS>>>;

impl<D: AsRef<[Vec<f32>]>> Chain<D> {
    /// A chain that has just been started, at a sample rate of the converters, Hz, and with
    /// these gains of the inputs' amplifiers, and this signal.
    ///
    /// # Errors
    /// [`RigError::Rate`], [`RigError::Start`].
    pub(super) fn new(
        sensors: &[&Sensor],
        (gains, signal): (&[u8], Signal),
        felt: Felt<D>,
        rate: f64,
        troubles: &Troubles,
        seed: u64,
    ) -> Result<Self, RigError> {
        let oversampling =
            Oversampling::of_rate(rate, CLOCK_HZ).ok_or(RigError::Rate { found: rate })?;
        let period = oversampling.cycles();
        let of_felt = f64::from(period) * rate / felt.rate;
        let voltages = Sensors::new(sensors, felt.samples, of_felt, felt.repeats);
        let bench: Shared<D> = Rc::new(RefCell::new(Rig::new(voltages, seed)));
        let mut chips: [_; CHIPS] = core::array::from_fn(|k| {
            let channel = |c: usize| {
                let gain = gains.get(CHANNELS * k + c).copied().and_then(Gain::new);
                ads131m08::Channel {
                    signal,
                    ..ads131m08::Channel::pins(gain.unwrap_or(Gain::ONE))
                }
            };
            let configuration = Configuration {
                oversampling,
                channels: core::array::from_fn(channel),
            };
            let bench = Rc::clone(&bench);
            Ads131m08::new(Spi { bench, chip: k }, configuration)
        });
        let mut acquisition = Acquisition::<CHIPS, INPUTS>::new(period as f32);
        let [a, b, c, d] = &mut chips;
        let converters: &mut [&mut dyn Converter] = &mut [a, b, c, d];
        let mut synchronise = || bench.borrow_mut().pull_sync(16);
        acquisition
            .start(converters, &mut synchronise)
            .map_err(|(number, fault)| RigError::Start { number, fault })?;
        {
            let mut rig = bench.borrow_mut();
            let first = rig.cycle() + u64::from(period) * (1 + LEAD);
            rig.signal().begin_at(first);
        }
        let used = sensors.len().div_ceil(CHANNELS);
        Ok(Self {
            bench,
            chips,
            acquisition,
            mischief: troubles.begin(rate, used, sensors.len(), seed),
        })
    }

    /// Lets time go by until there is a sample. What `take` says of it.
    pub fn step<T>(&mut self, take: impl FnOnce(&Sample<'_>) -> T) -> T {
        let [a, b, c, d] = &mut self.chips;
        let converters: &mut [&mut dyn Converter] = &mut [a, b, c, d];
        let bench = &self.bench;
        let mut synchronise = || bench.borrow_mut().pull_sync(16);
        loop {
            let edge = bench.borrow_mut().wait();
            let taken = self
                .acquisition
                .edge(converters, &mut synchronise, edge.ready, edge.cycle);
            let Some(sample) = taken else { continue };
            let result = take(&sample);
            if sample.number > LEAD {
                self.mischief.inject(&mut bench.borrow_mut());
            }
            return result;
        }
    }

    /// Time since the converters were switched on, s by their own clock.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.bench.borrow().cycle() as f64 / f64::from(CLOCK_HZ)
    }

    /// Number of the last sample.
    #[must_use]
    pub const fn number(&self) -> u64 {
        self.acquisition.number()
    }

    /// Counters of the acquisition.
    #[must_use]
    pub const fn faults(&self) -> &FaultCounters {
        self.acquisition.faults()
    }

    /// Has the acquisition count anew.
    pub fn forget_faults(&mut self) {
        self.acquisition.clear_faults();
    }
}

/// The way to a converter.
struct Spi<D> {
    bench: Shared<D>,
    chip: usize,
}

impl<D> ErrorType for Spi<D> {
    type Error = BusError;
}

impl<D: AsRef<[Vec<f32>]>> SpiDevice for Spi<D> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), BusError> {
        Port::new(&self.bench, self.chip).transaction(operations)
    }
}
