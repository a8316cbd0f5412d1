//! The acquisition on four modelled converters, with injected faults of all kinds.

use core::cell::RefCell;
use massline_firmware::acquisition::{Acquisition, SETTLING};
use massline_firmware::drivers::Converter;
use massline_firmware::drivers::ads131m08::registers::CHANNELS;
use massline_firmware::drivers::ads131m08::{
    Ads131m08, Channel, Configuration, Gain, Oversampling,
};
use massline_firmware::models::injector::{Injector, Kind};
use massline_firmware::models::random::mix;
use massline_firmware::models::rig::{Edge, Port, Rig};
use massline_firmware::wire::{FaultCounters, Health};

const CHIPS: usize = 4;
const INPUTS: usize = CHIPS * CHANNELS;
/// Another gain than after a reset, so that a chip that has lost its settings gives other counts.
const GAIN: u8 = 4;

/// The count of an input for a conversion at a cycle: pseudo-random.
fn count(input: usize, cycle: u64) -> i32 {
    (mix(cycle * 64 + input as u64) >> 42) as i32 - (1 << 21)
}

/// The voltage of that count.
fn volts(input: usize, cycle: u64) -> f64 {
    f64::from(count(input, cycle)) * (1.2 / 8_388_608.0 / f64::from(GAIN))
}

type Signal = fn(usize, u64) -> f64;
type Box = Acquisition<CHIPS, INPUTS>;

/// A box with its converters, run sample by sample.
struct Bench<'r> {
    rig: &'r RefCell<Rig<Signal, CHIPS>>,
    chips: [Ads131m08<Port<'r, Signal, CHIPS>>; CHIPS],
    acquisition: Box,
    /// Cycle of the first sample.
    first: Option<u64>,
    period: u64,
}

/// A sample, and the times of its conversions.
struct Converted {
    number: u64,
    counts: [i32; INPUTS],
    health: [Health; INPUTS],
    /// Cycle of each chip's last conversion.
    converted: [u64; CHIPS],
}

impl Converted {
    fn health(&self) -> Health {
        self.health
            .iter()
            .fold(Health::GOOD, |all, h| all.union(*h))
    }
}

impl<'r> Bench<'r> {
    fn new(rig: &'r RefCell<Rig<Signal, CHIPS>>, oversampling: Oversampling) -> Self {
        let configuration = Configuration {
            oversampling,
            channels: [Channel::pins(Gain::new(GAIN).unwrap()); CHANNELS],
        };
        Self {
            rig,
            chips: core::array::from_fn(|k| Ads131m08::new(Port::new(rig, k), configuration)),
            acquisition: Box::new(oversampling.cycles() as f32),
            first: None,
            period: oversampling.cycles().into(),
        }
    }

    fn start(&mut self) {
        let [a, b, c, d] = &mut self.chips;
        let converters: &mut [&mut dyn Converter] = &mut [a, b, c, d];
        let mut synchronise = || self.rig.borrow_mut().pull_sync(16);
        self.acquisition
            .start(converters, &mut synchronise)
            .unwrap();
    }

    /// The next sample, after one or more edges.
    fn next(&mut self) -> Converted {
        loop {
            let Edge { cycle, ready } = self.rig.borrow_mut().wait();
            let converted = core::array::from_fn(|k| self.rig.borrow().converted(k).unwrap());
            let [a, b, c, d] = &mut self.chips;
            let converters: &mut [&mut dyn Converter] = &mut [a, b, c, d];
            let mut synchronise = || self.rig.borrow_mut().pull_sync(16);
            let found = self
                .acquisition
                .edge(converters, &mut synchronise, ready, cycle);
            if let Some(sample) = found {
                self.first.get_or_insert(cycle);
                return Converted {
                    number: sample.number,
                    counts: sample.counts.try_into().unwrap(),
                    health: sample.health.try_into().unwrap(),
                    converted,
                };
            }
        }
    }

    /// The next sample, after checks of all its inputs that are reported as good.
    fn checked(&mut self) -> Converted {
        let sample = self.next();
        let mut together = None;
        for (k, (&found, health)) in sample.counts.iter().zip(sample.health).enumerate() {
            if health.is_good() {
                let converted = sample.converted[k / CHANNELS];
                let number = sample.number;
                assert_eq!(found, count(k, converted), "input {k} of {number}");
                assert_eq!(converted, *together.get_or_insert(converted));
            }
        }
        // The number of a sample without good inputs is not checked.
        if let Some(converted) = together {
            let since = converted - self.first.unwrap();
            let exact = since as f64 / self.period as f64;
            // Within half a period, and 1 % of a period for the error of the measured period.
            let off = sample.number as f64 - exact;
            assert!(off.abs() < 0.51, "number {} at {exact}", sample.number);
        }
        sample
    }

    /// Checks so many samples.
    fn run(&mut self, samples: usize) {
        for _ in 0..samples {
            self.checked();
        }
    }

    fn is_steady(&self) -> bool {
        self.acquisition.is_steady(CHIPS)
    }
}

fn rig() -> RefCell<Rig<Signal, CHIPS>> {
    RefCell::new(Rig::new(volts as Signal, 1))
}

#[test]
fn samples_come_together_and_in_order() {
    for oversampling in [Oversampling::X512, Oversampling::X4096] {
        let rig = rig();
        let mut bench = Bench::new(&rig, oversampling);
        bench.start();
        for number in 0..2000 {
            let sample = bench.checked();
            assert_eq!(sample.number, number);
            let settling = number < u64::from(SETTLING);
            assert_eq!(sample.health().is_good(), !settling, "sample {number}");
        }
        assert_eq!(*bench.acquisition.faults(), FaultCounters::default());
    }
}

#[test]
fn each_fault_has_its_flag_and_no_other() {
    for (round, kind) in (0..40).flat_map(|round| Kind::ALL.map(|kind| (round, kind))) {
        let rig = rig();
        let mut injector = Injector::new(0.0, 100 + round);
        let mut bench = Bench::new(&rig, Oversampling::X4096);
        bench.start();
        bench.run(20);
        injector.inject(&mut rig.borrow_mut(), kind, round as usize % CHIPS);
        let mut flags = Health::GOOD;
        let before = bench.acquisition.number();
        let mut bad = 0;
        for _ in 0..30 {
            let sample = bench.checked();
            flags = flags.union(sample.health());
            bad += u64::from(!sample.health().is_good());
            injector.disturb(&mut rig.borrow_mut(), true);
        }
        bad += bench.acquisition.number() - before - 30;
        let mut expected = kind.flag();
        if kind == Kind::Delay {
            // The chip is reported as missing until it is detected to be out of step.
            expected = expected.union(flags);
            assert!(Health::MISSING.union(Health::OUT_OF_STEP).contains(flags));
        }
        assert_eq!(flags, expected, "{kind:?}");
        assert_eq!(bench.acquisition.faults().overrun, 0);
        // Samples of detection, of the restart, and of settling.
        assert!(bad <= 8, "{kind:?} cost {bad} samples");
        assert!(bench.is_steady(), "{kind:?}");
    }
}

/// A million frames, one in a thousand with a fault.
#[test]
fn no_false_sample_among_a_million_frames_and_every_fault_counted() {
    let rig = rig();
    let mut injector = Injector::new(1e-3, 2026);
    let mut bench = Bench::new(&rig, Oversampling::X4096);
    bench.start();
    let mut good = 0_u32;
    let mut apart = 0_u32;
    for _ in 0..250_000 {
        // Faults a few samples apart do not disturb each other's recovery: each must be counted
        // once, by its kind.
        let quiet = bench.is_steady() && apart > 12;
        apart += 1;
        if injector.disturb(&mut rig.borrow_mut(), quiet).is_some() {
            apart = 0;
        }
        good += u32::from(bench.checked().health().is_good());
    }
    let faults = *bench.acquisition.faults();
    let mut expected = *injector.faults();
    // A chip that falls behind is missed up to three times before it is detected to be out of step.
    let late = faults.converter_missed - expected.converter_missed;
    assert!(late <= 3 * expected.out_of_step, "{late}");
    expected.converter_missed += late;
    assert_eq!(faults, expected);
    let all: u32 = injector.kinds().iter().sum();
    // One fault in 250 samples, less the samples between faults: about 950 in all.
    assert!(
        injector.kinds().iter().all(|&n| n > 50),
        "{:?}",
        injector.kinds()
    );
    // A fault costs eight samples at most.
    assert!(
        good > 250_000 - 8 * all - u32::from(SETTLING),
        "{good} {all}"
    );
}

/// Faults at any time, also while the box recovers from others.
#[test]
fn no_false_sample_when_everything_fails_at_once() {
    for seed in 0..20 {
        let rig = rig();
        let mut injector = Injector::new(0.05, seed);
        let mut bench = Bench::new(&rig, Oversampling::X4096);
        bench.start();
        for _ in 0..5_000 {
            injector.disturb(&mut rig.borrow_mut(), true);
            bench.checked();
        }
        // The acquisition recovers once no more faults are injected.
        let mut calm = Injector::new(0.0, 0);
        for _ in 0..2_000 {
            calm.disturb(&mut rig.borrow_mut(), true);
            (0..CHIPS).for_each(|k| rig.borrow_mut().stick(k, None));
            bench.checked();
        }
        assert!(bench.is_steady(), "seed {seed}");
        assert!(bench.checked().health().is_good(), "seed {seed}");
    }
}

#[test]
fn a_dead_converter_does_not_stop_the_others() {
    let rig = rig();
    let mut bench = Bench::new(&rig, Oversampling::X4096);
    bench.start();
    bench.run(10);
    rig.borrow_mut().stick(2, Some(true));
    let mut reported = None;
    let mut good = 0;
    for _ in 0..2000 {
        let sample = bench.checked();
        let dead = 2 * CHANNELS..3 * CHANNELS;
        assert!(sample.health[dead.clone()].iter().all(|h| !h.is_good()));
        let others = (0..INPUTS).filter(|k| !dead.contains(k));
        good += usize::from(others.into_iter().all(|k| sample.health[k].is_good()));
        reported = reported.or(bench.acquisition.take_fault());
    }
    assert_eq!(reported.map(|fault| fault.part), Some(Some(2)));
    assert!(good > 1950, "{good}");
    // Then it recovers by itself.
    rig.borrow_mut().stick(2, None);
    bench.run(600);
    assert!(bench.checked().health().is_good());
}

#[test]
fn converters_without_edges_are_restarted() {
    let rig = rig();
    let mut bench = Bench::new(&rig, Oversampling::X4096);
    bench.start();
    bench.run(10);
    // An external pulse on the reset line: all four chips lose their settings.
    rig.borrow_mut().pull_sync(4096);
    bench.run(40);
    assert!(bench.is_steady());
    assert_eq!(bench.acquisition.faults().converter_reset, 4);

    let [a, b, c, d] = &mut bench.chips;
    let converters: &mut [&mut dyn Converter] = &mut [a, b, c, d];
    let now = rig.borrow().cycle();
    let mut pulses = 0;
    let mut synchronise = || {
        pulses += 1;
        rig.borrow_mut().pull_sync(16);
    };
    let acquisition = &mut bench.acquisition;
    assert!(!acquisition.watch(converters, &mut synchronise, now + 2 * bench.period));
    assert!(acquisition.watch(converters, &mut synchronise, now + 20 * bench.period));
    assert_eq!(pulses, 1);
    bench.run(40);
    assert!(bench.checked().health().is_good());
}

#[test]
fn a_busy_box_loses_samples_but_numbers_them_right() {
    let rig = rig();
    let mut bench = Bench::new(&rig, Oversampling::X4096);
    bench.start();
    bench.run(10);
    for busy in 1..200 {
        let before = bench.acquisition.number();
        let missed = bench.acquisition.faults().converter_missed;
        // Ends a tenth of a period after an edge, so that the interrupt is still in time.
        let later = rig.borrow().cycle() / bench.period + busy;
        let first = bench.first.unwrap() % bench.period;
        let end = later * bench.period + first + bench.period / 10;
        rig.borrow_mut().pass_until(end);
        let lost = bench.next().number - before - 1;
        assert!(lost.abs_diff(busy) <= 1, "{lost} {busy}");
        assert_eq!(
            u64::from(bench.acquisition.faults().converter_missed - missed),
            lost
        );
        for _ in 0..5 {
            assert!(bench.checked().health().is_good());
        }
    }
}
