//! Measurements of a board against those of a sound one, line by line, with advice.
//!
//! Limits are the data sheets' with room: they tell a solder joint from none, and are no test of a
//! converter's quality.

use super::sampled::{Sampled, Statistics};
use super::{BUSES, Measured, Order};
use crate::format::{plain, significant};
use massline_firmware::calibration::ADXL355_COUNTS_PER_G;
use massline_firmware::drivers::ads131m08::CLOCK_HZ;
use massline_firmware::drivers::ads131m08::registers::CHANNELS;
use massline_firmware::drivers::adxl355;
use massline_firmware::sampling::{CHIPS, CONVERTERS};
use massline_firmware::wire::{ClockSource, ConverterFault, Looped};

/// Counts of full scale of an ADS131M08.
const FULL_SCALE: f64 = (1 << 23) as f64;
/// Largest mean of a short circuit, share of the full scale: the offset at a gain of 128 is a tenth of
/// that.
const OFFSET: f64 = 0.03;
/// Largest noise of a short circuit, share of the full scale: five times that at a gain of 128.
const NOISE: f64 = 2e-4;
/// Test voltage, share of the full scale, and by how much it may be off.
const TEST: f64 = 2.0 / 15.0;
const TEST_OFF: f64 = 0.05 * TEST;
/// Largest deviation of the acceleration at rest from standard gravity, as a share: offset and scale of an
/// ADXL355.
const GRAVITY_OFF: f64 = 0.1;
/// Largest skew of the converters, cycles of their clock.
const SKEW: f64 = 0.5;
/// Largest deviation of a crystal with its capacitors, as a share.
const CLOCK_OFF: f64 = 100e-6;
/// Largest load of the processor while it does nothing but send samples, thousandths.
const LOAD: u16 = 500;
/// Longest round trip, s: a byte takes 11 µs, a turn of a serial adapter up to 16 ms.
const ROUND_TRIP: f64 = 0.05;

/// A verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It is as it should be.
    Good,
    /// It is not.
    Bad,
    /// It was not measured, or says nothing.
    Open,
}

/// A line of the page.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// The part of the board.
    pub part: String,
    /// The measured values, in words.
    pub found: String,
    /// The values of a sound board, in words.
    pub expected: String,
    /// The verdict.
    pub verdict: Verdict,
    /// Advice where the verdict is [`Verdict::Bad`].
    pub advice: Option<String>,
}

impl Check {
    fn new(
        part: impl Into<String>,
        found: impl Into<String>,
        expected: &str,
        is_good: bool,
    ) -> Self {
        Self {
            part: part.into(),
            found: found.into(),
            expected: expected.to_owned(),
            verdict: if is_good { Verdict::Good } else { Verdict::Bad },
            advice: None,
        }
    }

    fn open(part: impl Into<String>, found: impl Into<String>, expected: &str) -> Self {
        Self {
            verdict: Verdict::Open,
            ..Self::new(part, found, expected, false)
        }
    }

    /// Gives advice where the verdict is [`Verdict::Bad`].
    fn or(mut self, advice: impl Into<String>) -> Self {
        if self.verdict == Verdict::Bad {
            self.advice = Some(advice.into());
        }
        self
    }
}

/// A part that the box cannot measure.
const NOT_THERE: &str = "not measured by this box";

impl Measured {
    /// The page, line by line.
    #[must_use]
    pub fn checks(&self, order: &Order) -> Vec<Check> {
        let mut checks = vec![self.crystal()];
        checks.extend(self.clock());
        checks.push(self.round_trip());
        checks.extend(self.loops());
        checks.extend((0..CHIPS).map(|number| self.converter(number, order.without)));
        for number in (0..CONVERTERS).filter(|number| self.has(*number)) {
            checks.push(self.short_circuits(number));
            checks.push(self.test_voltages(number));
        }
        if self.has(CONVERTERS) {
            checks.push(self.gravity());
        }
        checks.extend(self.frames());
        checks.push(self.skew());
        checks.extend(self.link());
        checks.push(self.load());
        checks.push(self.save());
        checks
    }

    /// `true` if a converter was prepared, or gives samples where a box cannot say so.
    fn has(&self, number: usize) -> bool {
        let shorted = self.signals[0].as_ref();
        match self.converters[number] {
            Some(fault) => fault.is_none(),
            None => shorted.is_some_and(|s| inputs_of(number, s).iter().all(|i| i.samples > 0)),
        }
    }

    fn crystal(&self) -> Check {
        let expected = "8, 12 or 16 MHz";
        let core = plain(f64::from(self.info.clock_hz) / 1e6, 4);
        match self.crystal {
            None => Check::open("crystal", NOT_THERE, expected),
            Some(None) => Check::new(
                "crystal",
                format!("does not oscillate; {core} MHz from the chip's own oscillator"),
                expected,
                false,
            )
            .or("crystal: look at its joints at PH0 and PH1 and at its two capacitors"),
            Some(Some(hz)) => {
                let found = format!(
                    "{} MHz by the chip's own oscillator, the processor at {core} MHz",
                    significant(f64::from(hz) / 1e6, 3)
                );
                let is_good = self.info.clock == ClockSource::CrystalPll;
                Check::new("crystal", found, expected, is_good)
                    .or("crystal: fit one of 8, 12 or 16 MHz, the firmware knows no other")
            }
        }
    }

    fn clock(&self) -> Option<Check> {
        let [off, unsure] = self.clock?;
        let found = format!(
            "{} ± {} ppm from this computer's",
            plain((1e6 * off).round(), 6),
            significant(1e6 * unsure, 2)
        );
        let is_good = off.abs() <= CLOCK_OFF + unsure || self.info.clock != ClockSource::CrystalPll;
        Some(
            Check::new("clock", found, "within 100 ppm", is_good)
                .or("clock: the capacitors of the crystal pull it; use those of its data sheet"),
        )
    }

    fn round_trip(&self) -> Check {
        let found = format!("{} ms", significant(1e3 * self.round_trip, 2));
        Check::new(
            "round trip",
            found,
            "at most 50 ms",
            self.round_trip <= ROUND_TRIP,
        )
        .or("link: lower the latency timer of the serial adapter")
    }

    /// A bus with a wire from its request to its answer gives back what is sent. With converters on it
    /// the wire must not be there.
    fn loops(&self) -> impl Iterator<Item = Check> {
        let all = BUSES.into_iter().zip(self.loops);
        all.enumerate().map(|(bus, ((name, pins), looped))| {
            let part = format!("{name} loop");
            let served: &[usize] = [&[0, 1][..], &[2, 3], &[4]][bus];
            let serves = served.iter().any(|number| self.has(*number));
            looped_check(part, looped, pins, serves)
        })
    }

    fn converter(&self, number: usize, without: u32) -> Check {
        let part = converter_name(number);
        let expected = "registers as written";
        match self.converters[number] {
            None => Check::open(part, NOT_THERE, expected),
            Some(None) => Check::new(part, expected, expected, true),
            Some(Some(fault)) if without >> number & 1 != 0 => {
                let found = format!("{}; left out by --without", fault_of(fault));
                Check::open(part, found, expected)
            }
            Some(Some(fault)) => {
                let advice = advice_for(number, fault);
                Check::new(part, fault_of(fault), expected, false).or(advice)
            }
        }
    }

    fn short_circuits(&self, number: usize) -> Check {
        let part = format!("{} shorted", converter_name(number));
        let expected = "noise, at most 0.02 % of full scale; mean within 3 %";
        let Some(sampled) = &self.signals[0] else {
            return Check::open(part, NOT_THERE, expected);
        };
        let inputs = inputs_of(number, sampled);
        let largest = |of: fn(&Statistics) -> f64| inputs.iter().map(of).fold(0.0, f64::max);
        let least = inputs.iter().map(|s| s.samples).min().unwrap_or(0);
        let mean = largest(|s| s.mean.abs()) / FULL_SCALE;
        let noise = largest(Statistics::rms) / FULL_SCALE;
        let is_still = inputs.iter().any(|s| s.rms() == 0.0);
        if least == 0 {
            return Check::new(part, "no sample without a fault", expected, false).or(format!(
                "{}: look at /DRDY, at its clock, at SYNC, and at the errors of its frames",
                converter_name(number)
            ));
        }
        let found = format!(
            "noise {} %, mean {} %",
            significant(100.0 * noise, 2),
            significant(100.0 * mean, 2)
        );
        let is_good = !is_still && noise <= NOISE && mean <= OFFSET;
        let what = if is_still {
            "a count that stands still is none: look at its clock and its supply"
        } else {
            "look at its analog supply, the capacitors at its supply pins, and the ground under it"
        };
        Check::new(part, found, expected, is_good).or(format!("{}: {what}", converter_name(number)))
    }

    fn test_voltages(&self, number: usize) -> Check {
        let part = format!("{} test voltage", converter_name(number));
        let expected = "±13.3 % of full scale, within a twentieth";
        let [_, Some(positive), Some(negative)] = &self.signals else {
            return Check::open(part, NOT_THERE, expected);
        };
        let is_silent = |sampled| inputs_of(number, sampled).iter().any(|i| i.samples == 0);
        if is_silent(positive) || is_silent(negative) {
            return Check::open(part, "no sample without a fault", expected);
        }
        let mut worst = (0.0, [0.0; 2]);
        let both = inputs_of(number, positive)
            .iter()
            .zip(inputs_of(number, negative));
        for (p, n) in both {
            let shares = [p.mean / FULL_SCALE, n.mean / FULL_SCALE];
            let [p, n] = shares;
            let off = (p - TEST).abs().max((n + TEST).abs());
            if off >= worst.0 {
                worst = (off, shares);
            }
        }
        let [p, n] = worst.1.map(|share| significant(100.0 * share, 4));
        Check::new(part, format!("{p} and {n} %"), expected, worst.0 <= TEST_OFF).or(format!(
            "{}: its reference is off: look at its analog supply and the capacitor at its reference pin",
            converter_name(number)
        ))
    }

    fn gravity(&self) -> Check {
        let (part, expected) = ("ADXL355 at rest", "1 g within a tenth, with noise");
        let Some(sampled) = &self.signals[0] else {
            return Check::open(part, NOT_THERE, expected);
        };
        let axes = inputs_of(CONVERTERS, sampled);
        let g = axes
            .iter()
            .map(|axis| (axis.mean / ADXL355_COUNTS_PER_G).powi(2))
            .sum::<f64>()
            .sqrt();
        let is_alive = axes.iter().all(|axis| axis.samples > 0 && axis.rms() > 0.0);
        let found = format!("{} g", significant(g, 4));
        Check::new(
            part,
            found,
            expected,
            is_alive && (g - 1.0).abs() <= GRAVITY_OFF,
        )
        .or("ADXL355: is the board at rest? Then look at its supply and at SYNC")
    }

    /// Frames with wrong checksums at each clock. Only those of the usual one are faults.
    fn frames(&self) -> Vec<Check> {
        let converters = (0..CONVERTERS).filter(|number| self.has(*number)).count() as u64;
        let clocks = ["10.5 MHz", "5.25 MHz", "21 MHz"];
        let all = clocks.into_iter().zip(&self.buses).enumerate();
        all.map(|(k, (clock, sampled))| {
            let part = format!("frames at {clock}");
            let expected = if k == 0 {
                "none wrong"
            } else {
                "none wrong; not in use"
            };
            let Some(sampled) = sampled else {
                return Check::open(part, NOT_THERE, expected);
            };
            let (frames, wrong) = (
                converters * sampled.samples,
                sampled.faults.converter_checksum,
            );
            if frames == 0 {
                return Check::open(part, "no frame", expected);
            }
            let found = match wrong {
                0 => format!(
                    "none of {frames} wrong: less than one in {}",
                    // The rule of three: 95 % of confidence.
                    frames / 3
                ),
                wrong => format!("{wrong} of {frames} wrong"),
            };
            if k > 0 && wrong > 0 {
                return Check::open(part, found, expected);
            }
            Check::new(part, found, expected, wrong == 0)
                .or("buses: shorten the wires, 33 Ω at each output, ground beside each signal")
        })
        .collect()
    }

    fn skew(&self) -> Check {
        let (part, expected) = ("skew of /DRDY", "at most half a cycle, 119 ns");
        let present: Vec<usize> = (0..CONVERTERS).filter(|number| self.has(*number)).collect();
        let Some(sampled) = &self.buses[0] else {
            return Check::open(part, NOT_THERE, expected);
        };
        // A box that knows its crystal has the lines.
        if self.crystal.is_none() {
            return Check::open(part, NOT_THERE, expected);
        }
        if present.is_empty() {
            return Check::open(part, "no converter", expected);
        }
        let ticks = f64::from(self.info.tick_hz);
        let seconds = |number: &usize| sampled.skew[*number].map(|after| f64::from(after) / ticks);
        let silent: Vec<String> = present
            .iter()
            .filter(|number| seconds(number).is_none())
            .map(|number| number.to_string())
            .collect();
        if !silent.is_empty() {
            let found = format!("no edge of converter {}", silent.join(", "));
            return Check::new(part, found, expected, false)
                .or("/DRDY: look at the wire of each converter without an edge");
        }
        let largest = present.iter().filter_map(seconds).fold(0.0, f64::max);
        let found = format!("{} ns", plain((1e9 * largest).round(), 6));
        Check::new(part, found, expected, largest * f64::from(CLOCK_HZ) <= SKEW).or(
            "SYNC: its edge meets that of CLKIN; the flip-flop between PA6 and the converters takes the inverted clock",
        )
    }

    fn link(&self) -> Option<Check> {
        let sampled = self.buses[0].as_ref()?;
        let found = format!(
            "{} kB/s of samples, {} of {} samples missing",
            significant(sampled.bytes_per_second / 1e3, 3),
            sampled.missing,
            sampled.samples
        );
        if sampled.samples == 0 {
            return Some(Check::open("link", "no sample", "none missing"));
        }
        Some(
            Check::new("link", found, "none missing", sampled.missing == 0)
                .or("link: look at cable and adapter; at less than 921600 baud not all inputs go through"),
        )
    }

    fn load(&self) -> Check {
        let (part, expected) = ("load", "at most 50 % at 512 samples/s");
        let load = self.buses[0].as_ref().and_then(|sampled| sampled.load);
        match load.filter(|_| self.crystal.is_some()) {
            None => Check::open(part, NOT_THERE, expected),
            Some(load) => {
                let found = format!("{} %", plain(f64::from(load) / 10.0, 3));
                Check::new(part, found, expected, load <= LOAD)
                    .or("load: is the processor at 168 MHz? See the crystal")
            }
        }
    }

    fn save(&self) -> Check {
        let (part, expected) = ("settings", "saved in 5 s, an erase of the flash included");
        match self.save {
            None => Check::open(part, "not saved; --save measures it", expected),
            Some(seconds) => {
                let found = format!("saved in {} s", significant(seconds, 2));
                Check::new(part, found, expected, seconds <= 5.0)
                    .or("settings: look at the supply of the chip; its flash is slow below 2.7 V")
            }
        }
    }
}

/// The check of a loop over a bus, which has converters that answer or not.
fn looped_check(part: String, looped: Option<Looped>, pins: &str, serves: bool) -> Check {
    let expected = "a wire between the two pins gives back all bits";
    let Some(looped) = looped else {
        return Check::open(part, NOT_THERE, expected);
    };
    match looped {
        Looped { wrong: 0, bits, .. } if serves => Check::new(
            part,
            format!("{bits} bits came back with converters on the bus"),
            expected,
            false,
        )
        .or(format!("remove the wire from {pins}")),
        Looped { wrong: 0, bits, .. } => {
            Check::new(part, format!("{bits} bits came back"), expected, true)
        }
        _ if serves => Check::open(part, "not needed: its converters answer", expected),
        Looped { ones: 0, .. } => Check::open(part, format!("low: no wire from {pins}"), expected),
        Looped { ones, bits, .. } if ones == bits => {
            Check::open(part, format!("high: no wire from {pins}"), expected)
        }
        Looped { wrong, bits, .. } => Check::new(
            part,
            format!("{wrong} of {bits} bits wrong"),
            expected,
            false,
        )
        .or(format!(
            "look at the joints of {pins}, and at what else drives them"
        )),
    }
}

fn converter_name(number: usize) -> String {
    if number < CONVERTERS {
        format!("ADS131M08 {number}")
    } else {
        "ADXL355".to_owned()
    }
}

/// Statistics of the inputs of a converter.
fn inputs_of(number: usize, sampled: &Sampled) -> &[Statistics] {
    let first = CHANNELS * number;
    let channels = if number < CONVERTERS {
        CHANNELS
    } else {
        adxl355::CHANNELS
    };
    sampled.inputs.get(first..first + channels).unwrap_or(&[])
}

fn fault_of(fault: ConverterFault) -> String {
    match fault {
        ConverterFault::Bus => "its bus does not move".to_owned(),
        ConverterFault::Identity {
            found: 0 | 0xFFFF, ..
        }
        | ConverterFault::Stuck => "its data line stays at one level".to_owned(),
        ConverterFault::Checksum => "its frames have wrong checksums".to_owned(),
        ConverterFault::Identity { found, expected } => {
            format!("it is {found:#06x}, and not {expected:#06x}")
        }
        ConverterFault::Register {
            address,
            found,
            expected,
        } => format!("register {address:#04x} is {found:#06x}, and was set to {expected:#06x}"),
        ConverterFault::Command => "it does not execute commands".to_owned(),
    }
}

fn advice_for(number: usize, fault: ConverterFault) -> String {
    let name = converter_name(number);
    let select = ["PC2", "PC3", "PC4", "PC5", "PC1"][number];
    let (bus, _) = BUSES[[0, 0, 1, 1, 2][number]];
    let what = match fault {
        ConverterFault::Identity {
            found: 0 | 0xFFFF, ..
        }
        | ConverterFault::Stuck
        | ConverterFault::Bus => format!(
            "solder it, or look at its supply, at /CS on {select} and at the answers of {bus}; --without {number} leaves it out"
        ),
        ConverterFault::Checksum => {
            format!("look at clock and wires of {bus}: short, 33 Ω in series, ground beside")
        }
        ConverterFault::Identity { .. } => format!("another chip answers at {select}"),
        ConverterFault::Register { .. } | ConverterFault::Command => {
            format!("look at its clock, at SYNC, and at the requests of {bus}")
        }
    };
    format!("{name}: {what}")
}
