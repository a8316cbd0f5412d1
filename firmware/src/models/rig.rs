//! Some ADS131M08 on one clock, one SYNC line and a bus, in simulated time.
//!
//! Time is counted in cycles of the converters' clock. It passes during the wait for an edge, the
//! exchange of bytes, and pulses on the SYNC line. Chips convert meanwhile, so that a driver that
//! is too slow loses samples.

use super::BusError;
use super::ads131m08::Chip;
use super::random::Random;
use crate::drivers::ads131m08::registers::CHANNELS;
use crate::drivers::ads131m08::{CLOCK_HZ, RESET_CYCLES};
use core::cell::RefCell;
use embedded_hal::spi::{ErrorType, Operation, SpiDevice};

/// Clock of the bus, Hz.
const BUS_HZ: u32 = 10_500_000;

/// Voltages of the sensors.
pub trait Signal {
    /// Voltage at an input, V, at a cycle of the converters' clock. Inputs count through all
    /// chips.
    fn volts(&mut self, input: usize, cycle: u64) -> f64;
}

impl<F: FnMut(usize, u64) -> f64> Signal for F {
    fn volts(&mut self, input: usize, cycle: u64) -> f64 {
        self(input, cycle)
    }
}

/// Kind of errors in a frame from a chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Garble {
    /// So many wrong bits.
    Bits(u8),
    /// A stretch of random bits.
    Burst,
    /// The whole frame is random.
    Noise,
}

/// A falling edge of a DRDY line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// Time of its interrupt, cycles.
    pub cycle: u64,
    /// Bit k: the DRDY line of chip k was low shortly afterwards.
    pub ready: u32,
}

/// A rig of `N` chips.
#[derive(Debug)]
pub struct Rig<S, const N: usize> {
    cycle: u64,
    signal: S,
    places: [Place; N],
    random: Random,
    /// `true` if a DRDY line has fallen since the last [`Self::wait`].
    pending: bool,
    lost_edges: u32,
    /// Bit k: edges of chip k's line raise an interrupt.
    watched: u32,
    bus_hz: u32,
}

/// A chip in its place, with the faults of its wires.
#[derive(Clone, Debug, Default)]
struct Place {
    chip: Chip,
    /// Cycles of its next and of its last conversion.
    next: u64,
    last: u64,
    garble: Option<Garble>,
    garble_request: bool,
    stuck: Option<bool>,
    hidden: bool,
    bus_fails: bool,
}

impl<S: Signal, const N: usize> Rig<S, N> {
    /// Cycles from an interrupt to the reading of the lines: 1 µs.
    const LOOK: u64 = (CLOCK_HZ / 1_000_000) as u64;

    /// A rig of chips that have just been switched on.
    pub fn new(signal: S, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let places = core::array::from_fn(|_| {
            let chip = Chip::new();
            let next = 1 + random.below(u64::from(chip.cycles()));
            Place {
                chip,
                next,
                ..Place::default()
            }
        });
        Self {
            cycle: 0,
            signal,
            places,
            random,
            pending: false,
            lost_edges: 0,
            watched: u32::MAX,
            bus_hz: BUS_HZ,
        }
    }

    /// The present cycle.
    pub const fn cycle(&self) -> u64 {
        self.cycle
    }

    /// The signal.
    pub const fn signal(&mut self) -> &mut S {
        &mut self.signal
    }

    /// A chip.
    pub fn chip(&mut self, chip: usize) -> Option<&mut Chip> {
        let place = self.places.get_mut(chip)?;
        place.chip.pass_until(self.cycle);
        Some(&mut place.chip)
    }

    /// Time of a chip's last conversion, cycles.
    pub fn converted(&self, chip: usize) -> Option<u64> {
        self.places.get(chip).map(|p| p.last)
    }

    /// Waits for the next edge of a DRDY line, or returns the pending one.
    pub fn wait(&mut self) -> Edge {
        while !self.pending {
            let next = self.places.iter().map(|p| p.next).min();
            let Some(next) = next else { break };
            self.pass_until(next.max(self.cycle));
        }
        let cycle = self.cycle;
        self.pass_until(cycle + Self::LOOK);
        self.pending = false;
        let mut ready = 0;
        for (k, place) in self.places.iter_mut().enumerate() {
            let low = place.chip.is_ready() && !core::mem::take(&mut place.hidden);
            ready |= u32::from(low) << k;
        }
        Edge { cycle, ready }
    }

    /// `true` if a DRDY line has fallen since the last [`Self::wait`].
    pub const fn is_edge_pending(&self) -> bool {
        self.pending
    }

    /// Advances the time to `end`, cycles.
    pub fn pass_until(&mut self, end: u64) {
        loop {
            let due = (0_usize..)
                .zip(&mut self.places)
                .min_by_key(|(_, p)| p.next);
            let Some((k, place)) = due else { break };
            if place.next > end {
                break;
            }
            let cycle = place.next;
            place.next += u64::from(place.chip.cycles());
            place.last = cycle;
            let mut volts = [0.0; CHANNELS];
            for (channel, slot) in volts.iter_mut().enumerate() {
                *slot = self.signal.volts(CHANNELS * k + channel, cycle);
            }
            place.chip.convert(&volts);
            if self.watched >> k & 1 == 0 {
                continue;
            }
            if self.lost_edges == 0 {
                self.pending |= place.chip.is_ready();
            } else {
                self.lost_edges -= 1;
            }
        }
        self.cycle = self.cycle.max(end);
    }

    /// Has edges of these chips' lines raise interrupts, by bits, and of no others.
    pub const fn watch_edges(&mut self, chips: u32) {
        self.watched = chips;
    }

    /// Pulls the SYNC/RESET line low for some cycles.
    pub fn pull_sync(&mut self, cycles: u32) {
        self.pass_until(self.cycle + u64::from(cycles));
        for place in &mut self.places {
            if cycles < RESET_CYCLES {
                place.chip.synchronise();
            } else {
                place.chip.reset();
            }
            place.next = self.cycle + u64::from(place.chip.cycles());
        }
        self.pending = false;
    }

    /// Exchanges a frame with a chip.
    fn transfer(&mut self, chip: usize, bytes: &mut [u8]) -> Result<(), BusError> {
        let time = bytes.len() as u64 * 8 * u64::from(CLOCK_HZ) / u64::from(self.bus_hz);
        let place = self.places.get_mut(chip).ok_or(BusError::Unsupported)?;
        if core::mem::take(&mut place.bus_fails) {
            return Err(BusError::Failed);
        }
        if core::mem::take(&mut place.garble_request)
            && let Some(byte) = bytes.get_mut(self.random.below(3) as usize)
        {
            *byte ^= 1 << self.random.below(8);
        }
        place.chip.pass_until(self.cycle);
        let before = place.chip.cycles();
        place.chip.transfer(bytes);
        if place.chip.cycles() != before {
            // A new rate begins with a new conversion.
            place.next = self.cycle + u64::from(place.chip.cycles());
        }
        if let Some(garble) = place.garble.take() {
            garble_bytes(bytes, garble, &mut self.random);
        }
        if let Some(level) = place.stuck {
            bytes.fill(if level { 0xFF } else { 0 });
        }
        self.pass_until(self.cycle + time);
        Ok(())
    }

    fn with(&mut self, chip: usize, change: impl FnOnce(&mut Place)) {
        if let Some(place) = self.places.get_mut(chip) {
            change(place);
        }
    }

    /// Sets the clock of the bus, Hz; 10.5 MHz before.
    pub fn set_bus(&mut self, hz: u32) {
        self.bus_hz = hz.max(1);
    }

    /// Garbles the next frame that a chip sends.
    pub fn garble(&mut self, chip: usize, how: Garble) {
        self.with(chip, |p| p.garble = Some(how));
    }

    /// Flips a bit in the first word of the next frame to a chip.
    pub fn garble_request(&mut self, chip: usize) {
        self.with(chip, |p| p.garble_request = true);
    }

    /// Holds a chip's data line at a level, or releases it.
    pub fn stick(&mut self, chip: usize, level: Option<bool>) {
        self.with(chip, |p| p.stuck = level);
    }

    /// Makes the next exchange with a chip fail.
    pub fn fail_bus(&mut self, chip: usize) {
        self.with(chip, |p| p.bus_fails = true);
    }

    /// Makes a chip's DRDY line read high at the next edge.
    pub fn hide_ready(&mut self, chip: usize) {
        self.with(chip, |p| p.hidden = true);
    }

    /// Loses the edges of all DRDY lines of the next sample.
    pub fn lose_sample(&mut self) {
        self.lost_edges = N as u32;
    }

    /// Resets a chip, which converts at a random instant afterwards.
    pub fn reset_chip(&mut self, chip: usize) {
        let now = self.cycle;
        let random = &mut self.random;
        if let Some(place) = self.places.get_mut(chip) {
            place.chip.reset();
            place.next = now + 1 + random.below(u64::from(place.chip.cycles()));
        }
    }

    /// Delays a chip by some cycles.
    pub fn delay_chip(&mut self, chip: usize, cycles: u64) {
        self.with(chip, |p| p.next += cycles);
    }
}

/// Garbles bytes in one bit at least.
fn garble_bytes(bytes: &mut [u8], how: Garble, random: &mut Random) {
    let bits = 8 * bytes.len() as u64;
    let mut flip = |bit: u64| {
        if let Some(byte) = bytes.get_mut((bit / 8) as usize) {
            *byte ^= 0x80 >> (bit % 8);
        }
    };
    match how {
        Garble::Bits(count) => {
            // Bits at a random distance, so that none is flipped twice.
            let (first, apart) = (random.below(bits), 1 + random.below(bits / 8));
            (0..u64::from(count.min(8))).for_each(|k| flip((first + k * apart) % bits));
        }
        Garble::Burst => {
            let first = random.below(bits);
            let length = 1 + random.below((bits - first).min(64));
            flip(first);
            (first + 1..first + length).for_each(|bit| {
                if random.chance(0.5) {
                    flip(bit);
                }
            });
        }
        Garble::Noise => {
            flip(0);
            (1..bits).for_each(|bit| {
                if random.chance(0.5) {
                    flip(bit);
                }
            });
        }
    }
}

/// SPI device of one chip of a rig.
#[derive(Debug)]
pub struct Port<'r, S, const N: usize> {
    rig: &'r RefCell<Rig<S, N>>,
    chip: usize,
}

impl<'r, S, const N: usize> Port<'r, S, N> {
    /// The device of the chip of this number.
    pub const fn new(rig: &'r RefCell<Rig<S, N>>, chip: usize) -> Self {
        Self { rig, chip }
    }
}

impl<S, const N: usize> ErrorType for Port<'_, S, N> {
    type Error = BusError;
}

impl<S: Signal, const N: usize> SpiDevice for Port<'_, S, N> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), BusError> {
        let mut rig = self.rig.try_borrow_mut().map_err(|_| BusError::Failed)?;
        for operation in operations {
            match operation {
                Operation::TransferInPlace(bytes) => rig.transfer(self.chip, bytes)?,
                Operation::DelayNs(ns) => {
                    let cycles = u64::from(*ns) * u64::from(CLOCK_HZ) / 1_000_000_000;
                    let end = rig.cycle() + cycles;
                    rig.pass_until(end);
                }
                _ => return Err(BusError::Unsupported),
            }
        }
        Ok(())
    }
}
