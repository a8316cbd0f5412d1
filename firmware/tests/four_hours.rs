//! Four hours at 512 samples/s with random faults: every sample is numbered once, and the memory
//! does not grow.

use core::cell::RefCell;
use massline_firmware::acquisition::Acquisition;
use massline_firmware::drivers::Converter;
use massline_firmware::drivers::ads131m08::registers::CHANNELS;
use massline_firmware::drivers::ads131m08::{
    Ads131m08, CLOCK_HZ, Channel, Configuration, Gain, Oversampling,
};
use massline_firmware::models::injector::Injector;
use massline_firmware::models::random::mix;
use massline_firmware::models::rig::{Port, Rig};

const CHIPS: usize = 4;
const RATE: u64 = 512;
/// Time of the box. Ten minutes without optimisation, with which the models are fast enough for
/// four hours.
const SECONDS: u64 = if cfg!(debug_assertions) {
    600
} else {
    4 * 3600
};

fn volts(input: usize, cycle: u64) -> f64 {
    let bits = mix(cycle * 64 + input as u64) >> 42;
    (bits as f64 - 2_097_152.0) * (1.2 / 8_388_608.0)
}

/// Resident pages of this process; `None` if the system does not report them.
fn resident_pages() -> Option<u64> {
    let statm = std::fs::read_to_string("/proc/self/statm").ok()?;
    statm.split_whitespace().nth(1)?.parse().ok()
}

#[test]
fn four_hours_keep_count_in_the_same_memory() {
    let oversampling = Oversampling::X4096;
    let period = u64::from(oversampling.cycles());
    assert_eq!(u64::from(CLOCK_HZ), RATE * period);
    type Signal = fn(usize, u64) -> f64;
    let rig: RefCell<Rig<Signal, CHIPS>> = RefCell::new(Rig::new(volts, 5));
    let configuration = Configuration {
        oversampling,
        channels: [Channel::pins(Gain::ONE); CHANNELS],
    };
    let [mut a, mut b, mut c, mut d]: [_; CHIPS] =
        core::array::from_fn(|k| Ads131m08::new(Port::new(&rig, k), configuration));
    let converters: &mut [&mut dyn Converter] = &mut [&mut a, &mut b, &mut c, &mut d];
    let mut synchronise = || rig.borrow_mut().pull_sync(16);
    let mut acquisition = Acquisition::<CHIPS, { CHIPS * CHANNELS }>::new(period as f32);
    acquisition.start(converters, &mut synchronise).unwrap();
    let mut injector = Injector::new(1e-4, 11);

    let (mut first, mut last, mut pages) = (None, 0, None);
    let (mut samples, mut good, mut missing) = (0_u64, 0_u64, 0_u64);
    let end = SECONDS * u64::from(CLOCK_HZ);
    loop {
        let edge = rig.borrow_mut().wait();
        let sample = acquisition.edge(converters, &mut synchronise, edge.ready, edge.cycle);
        let Some(sample) = sample else { continue };
        let start = *first.get_or_insert(edge.cycle);
        missing += sample.number.saturating_sub(last + 1);
        last = sample.number;
        samples += 1;
        good += u64::from(sample.health.iter().all(|h| h.is_good()));
        // By then all memory has been touched.
        if samples == 10 * RATE {
            pages = resident_pages();
        }
        if edge.cycle - start >= end {
            break;
        }
        let steady = acquisition.is_steady(CHIPS);
        injector.disturb(&mut rig.borrow_mut(), steady);
    }

    // The last edge is that of the first sample at or after the end; restarts have moved the
    // grid by less than half a period.
    assert!(last.abs_diff(SECONDS * RATE) <= 1, "{last}");
    assert_eq!(samples + missing, last + 1, "each number once, or missing");
    let faults: u64 = injector.kinds().iter().map(|&n| u64::from(n)).sum();
    assert!(faults > SECONDS * RATE / 5000, "{faults}");
    let bad = last + 1 - good;
    assert!(bad > faults / 2 && bad <= 8 * faults + 4, "{bad} {faults}");
    if let (Some(before), Some(after)) = (pages, resident_pages()) {
        // The test's own thread and the harness may touch a page or two.
        assert!(after <= before + 16, "{before} pages became {after}");
    }
    println!("{last} samples, {faults} faults, {missing} missing, {bad} invalid");
}
