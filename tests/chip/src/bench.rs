//! The board and what is wired to it: four ADS131M08 and an ADXL355, with the models of the firmware's
//! library, a byte at a time.

use massline_firmware::drivers::ads131m08::registers::CHANNELS;
use massline_firmware::drivers::ads131m08::{self, CLOCK_HZ, RESET_CYCLES};
use massline_firmware::drivers::adxl355;
use massline_firmware::models::{ads131m08 as ads, adxl355 as adxl};

use crate::gpio::{Gpio, Pin, pin};
use crate::spi::Word;
use crate::{SECOND, counted, periods};

/// Number of ADS131M08.
pub const CONVERTERS: usize = 4;
/// Buses: SPI2 with converters 0 and 1, SPI3 with 2 and 3, SPI1 with the ADXL355.
pub const BUSES: usize = 3;
/// The ADXL355's.
const OWN: usize = 2;
/// Names of the buses, and alternate functions of their pins (data sheet, table 9).
const FUNCTIONS: [(&str, u32); BUSES] = [("SPI2", 5), ("SPI3", 6), ("SPI1", 5)];
/// Samples of the ADXL355 in a second by its own clock.
const ADXL_HZ: u32 = 4000;
/// Converter whose DRDY line leads to its SYNC pin.
const LEADER: usize = 0;

/// Voltage at an input, V, and acceleration along an axis, in units of standard gravity, at a cycle of
/// the converters' clock.
pub type Signal = Box<dyn FnMut(usize, u64) -> f64 + Send>;

/// A converter in its place.
struct Place {
    chip: ads::Chip,
    select: Pin,
    ready: Pin,
    /// Cycle of the next conversion.
    next: u64,
    /// The frame that goes on: answer, and bytes so far.
    frame: Option<(Vec<u8>, Vec<u8>)>,
    wires: Wires,
}

/// Faults of the wires of a converter.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wires {
    /// `true` if a bit of the next frame from the converter is wrong.
    pub is_garbled: bool,
    /// Conversions whose edge does not reach the pin.
    pub lost_edges: u32,
    /// Level that the data line is stuck at, and for how many frames.
    pub stuck: Option<(bool, u32)>,
}

/// The board's parts.
pub struct Bench {
    converters: Vec<Place>,
    adxl: adxl::Chip,
    adxl_select: Pin,
    /// Head of the exchange with the ADXL355 that goes on; the outer one: it is selected.
    adxl_frame: Option<Option<u8>>,
    adxl_next: u64,
    sync: Pin,
    /// Time at which SYNC was pulled low.
    sync_low: Option<u64>,
    /// Wires of the buses: clock, answer, request.
    wires: [[Pin; 3]; BUSES],
    signal: Signal,
    /// Buses whose answer is wired to their request while no converter is selected.
    pub loops: [bool; BUSES],
    /// `false` if no converter is there.
    pub are_soldered: bool,
    /// Cycles by which each converter restarts later than SYNC says.
    pub sync_skew: [u64; CONVERTERS],
    /// A bit of every so many frames from a converter is wrong while they sample.
    pub garbles_every: Option<u32>,
    /// Fastest clock that the converters' wires bear, Hz: a bit of each faster word is wrong.
    pub bears_hz: Option<u32>,
    /// Number of frames of the converters.
    frames: u32,
    /// The newest sample of each converter, by cycle and counts.
    pub converted: Vec<Vec<(u64, [i32; CHANNELS])>>,
}

impl Bench {
    /// The board of the wiring page, with these signals.
    #[must_use]
    pub fn new(signal: Signal) -> Self {
        let places = ["PC2", "PC3", "PC4", "PC5"].into_iter();
        let ready = ["PC6", "PC7", "PB8", "PB9"];
        let converters: Vec<Place> = places
            .zip(ready)
            .enumerate()
            .map(|(k, (select, ready))| {
                let chip = ads::Chip::new();
                let period = u64::from(chip.cycles());
                Place {
                    select: pin(select),
                    ready: pin(ready),
                    // They were switched on at any instant.
                    next: period / 7 * (k as u64 + 1),
                    chip,
                    frame: None,
                    wires: Wires::default(),
                }
            })
            .collect();
        Self {
            converted: vec![Vec::new(); converters.len()],
            converters,
            adxl: adxl::Chip::new(),
            adxl_select: pin("PC1"),
            adxl_frame: None,
            adxl_next: periods(1, ADXL_HZ),
            sync: pin("PA6"),
            sync_low: None,
            wires: [
                ["PB13", "PB14", "PB15"].map(pin),
                ["PC10", "PC11", "PB5"].map(pin),
                ["PB3", "PB4", "PA7"].map(pin),
            ],
            signal,
            loops: [false; BUSES],
            are_soldered: true,
            sync_skew: [0; CONVERTERS],
            garbles_every: None,
            bears_hz: None,
            frames: 0,
        }
    }

    /// Time of the next event, ps.
    #[must_use]
    pub fn next(&self) -> u64 {
        let converters = self.converters.iter().map(|p| time(p.next));
        converters.chain([self.adxl_next]).min().unwrap_or(u64::MAX)
    }

    /// Levels of the DRDY lines.
    pub fn ready(&self) -> impl Iterator<Item = (Pin, bool)> {
        let is_low = |p: &Place| p.chip.is_ready() && p.wires.lost_edges == 0;
        self.converters.iter().map(move |p| (p.ready, !is_low(p)))
    }

    /// Advances to a time: pins whose level fell, for an instant at least, and when, ps.
    pub fn pass(&mut self, now: u64) -> Vec<(Pin, u64)> {
        let mut fallen = Vec::new();
        for (k, place) in self.converters.iter_mut().enumerate() {
            while time(place.next) <= now {
                let cycle = place.next;
                place.next += u64::from(place.chip.cycles());
                place.chip.pass_until(cycle);
                let signal = &mut self.signal;
                let volts: [f64; CHANNELS] =
                    core::array::from_fn(|channel| signal(CHANNELS * k + channel, cycle));
                place.chip.convert(&volts);
                place.wires.lost_edges = place.wires.lost_edges.saturating_sub(1);
                if k == LEADER && self.adxl.is_led() {
                    self.adxl.convert(acceleration(signal, cycle));
                }
                if place.chip.is_ready() {
                    fallen.push((place.ready, time(cycle)));
                    let counts = core::array::from_fn(|channel| {
                        place.chip.count(channel as u8, volts[channel])
                    });
                    self.converted[k].push((cycle, counts));
                }
            }
        }
        while self.adxl_next <= now {
            if !self.adxl.is_led() {
                let cycle = counted(self.adxl_next, CLOCK_HZ);
                self.adxl.convert(acceleration(&mut self.signal, cycle));
            }
            self.adxl.pass_ns(periods(1, ADXL_HZ) / 1000);
            self.adxl_next += periods(1, ADXL_HZ);
        }
        fallen
    }

    /// The pins may have changed their levels; the words that say what was wrong.
    pub fn look(&mut self, pins: &Gpio, is_busy: [bool; BUSES], now: u64) -> Vec<String> {
        let mut wrong = Vec::new();
        let is_low = |pin: Pin| pins.is_output(pin) && !pins.level(pin);
        for (k, place) in self.converters.iter_mut().enumerate() {
            match (is_low(place.select), &mut place.frame) {
                (true, None) => {
                    place.chip.pass_until(counted(now, CLOCK_HZ));
                    let mut answer = place.chip.select().to_vec();
                    self.frames += 1;
                    let every = self.garbles_every.filter(|_| place.chip.is_ready());
                    let is_due = every.is_some_and(|every| self.frames.is_multiple_of(every));
                    if std::mem::take(&mut place.wires.is_garbled) || is_due {
                        answer[4] ^= 0x10;
                    }
                    if let Some((level, frames)) = place.wires.stuck {
                        answer.fill(if level { 0xFF } else { 0 });
                        place.wires.stuck = (frames > 1).then(|| (level, frames - 1));
                    }
                    place.frame = Some((answer, Vec::new()));
                }
                (false, Some((_, received))) => {
                    if is_busy[bus_of(k)] {
                        wrong.push("a converter's chip select rises within a word".to_owned());
                    }
                    let before = place.chip.cycles();
                    place.chip.release(received);
                    if place.chip.cycles() != before {
                        place.next = counted(now, CLOCK_HZ) + u64::from(place.chip.cycles());
                    }
                    place.frame = None;
                }
                _ => {}
            }
        }
        for pair in self.converters.chunks(CONVERTERS / 2) {
            let selected = pair.iter().filter(|p| p.frame.is_some()).count();
            if selected > 1 {
                wrong.push(format!(
                    "{selected} converters of a bus are selected at a time"
                ));
            }
        }
        match (is_low(self.adxl_select), self.adxl_frame) {
            (true, None) => self.adxl_frame = Some(None),
            (false, Some(_)) => {
                if is_busy[OWN] {
                    wrong.push("the ADXL355's chip select rises within a word".to_owned());
                }
                self.adxl_frame = None;
            }
            _ => {}
        }
        match (is_low(self.sync), self.sync_low) {
            (true, None) => self.sync_low = Some(now),
            (false, Some(since)) => {
                self.sync_low = None;
                self.pulse(counted(now - since, CLOCK_HZ), counted(now, CLOCK_HZ));
            }
            _ => {}
        }
        wrong
    }

    fn pulse(&mut self, cycles: u64, now: u64) {
        for (place, late) in self.converters.iter_mut().zip(self.sync_skew) {
            if cycles < u64::from(RESET_CYCLES) {
                place.chip.synchronise();
            } else {
                place.chip.reset();
            }
            place.next = now + u64::from(place.chip.cycles()) + late;
        }
    }

    /// Exchanges a word on a bus, see [`BUSES`]. The answer, and what was wrong.
    pub fn exchange(&mut self, bus: usize, word: Word, pins: &Gpio) -> (u16, Option<String>) {
        let (most, mode) = match bus {
            OWN => (adxl355::SPI_HZ_MAX, 0),
            _ => (ads131m08::SPI_HZ_MAX, 1),
        };
        let (name, function) = FUNCTIONS[bus];
        let is_wired = self.wires[bus]
            .iter()
            .all(|pin| pins.has_function(*pin, function));
        let wrong = if !is_wired {
            Some(format!("{name} has pins without its function"))
        } else if word.hz > most || word.mode != mode {
            Some(format!("{name} has {} Hz in mode {}", word.hz, word.mode))
        } else {
            None
        };
        let bytes = word.out.to_be_bytes();
        let out = &bytes[2 - word.bits as usize / 8..];
        let mut answer = 0_u16;
        for byte in out {
            answer = answer << 8 | u16::from(self.byte(bus, *byte));
        }
        if bus != OWN && self.bears_hz.is_some_and(|most| word.hz > most) {
            answer ^= 1;
        }
        (answer, wrong)
    }

    /// A line that nobody drives is low, unless it is wired to another one: its pin has no pull.
    fn byte(&mut self, bus: usize, byte: u8) -> u8 {
        let undriven = if self.loops[bus] { byte } else { 0 };
        if !self.are_soldered {
            return undriven;
        }
        if bus != OWN {
            let pairs = self.converters.chunks_mut(CONVERTERS / 2);
            let own = pairs.skip(bus).take(1).flatten();
            let mut frames = own.filter_map(|p| p.frame.as_mut());
            return frames.next().map_or(undriven, |(answer, received)| {
                let found = answer.get(received.len()).copied().unwrap_or(0);
                received.push(byte);
                found
            });
        }
        match &mut self.adxl_frame {
            Some(head) => self.adxl.shift(head, byte),
            None => undriven,
        }
    }

    /// Wires of a converter.
    pub fn wires(&mut self, number: usize) -> Option<&mut Wires> {
        self.converters.get_mut(number).map(|p| &mut p.wires)
    }

    /// Makes a converter late by so many cycles of its clock.
    pub fn delay(&mut self, number: usize, cycles: u64) {
        if let Some(place) = self.converters.get_mut(number) {
            place.next += cycles;
        }
    }

    /// A converter's model.
    pub fn converter(&mut self, number: usize) -> Option<&mut ads::Chip> {
        self.converters.get_mut(number).map(|p| &mut p.chip)
    }
}

/// Acceleration along the axes of the ADXL355 at a cycle, in units of standard gravity.
fn acceleration(signal: &mut Signal, cycle: u64) -> [f64; 3] {
    core::array::from_fn(|axis| signal(CHANNELS * CONVERTERS + axis, cycle))
}

/// Time of a cycle of the converters' clock, ps.
fn time(cycle: u64) -> u64 {
    (u128::from(cycle) * u128::from(SECOND) / u128::from(CLOCK_HZ)) as u64
}

/// Bus of a converter.
const fn bus_of(converter: usize) -> usize {
    converter / (CONVERTERS / 2)
}
