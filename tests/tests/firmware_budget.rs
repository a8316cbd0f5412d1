//! Cost of acquisition and spectra on the chip: instructions counted in the emulator, and the table
//! of load in the firmware's README, which follows from them.

use massline::device::{Emulator, firmware};
use massline_tests::readme;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::time::Duration;

/// The chip's clock, Hz.
const CLOCK: f64 = 168e6;
/// The converters' bus: a fourth of APB1, Hz.
const SPI: f64 = 10.5e6;
/// The same at twice the clock, which code may be measured by and wires do not allow.
const FAST_SPI: f64 = 21e6;
/// The accelerometer's bus, Hz, and its bytes a sample: data and settings, with an address each.
const OWN_SPI: f64 = 5.25e6;
const OWN_BYTES: f64 = 14.0 + 7.0;
/// Most of the processor's time that the link takes, percent: a microsecond a byte, which lasts 10.85.
const LINK: f64 = 10.0;
/// Frames a sample, bytes a frame.
const FRAMES: f64 = 4.0;
const FRAME_BYTES: f64 = 30.0;
/// Cycles of the interrupts of a sample: of DRDY, of sampling and of the task that processes it,
/// with 22 each to begin and to end, from the processor's manual, and RTIC's part of a task. And
/// the microsecond after which the DRDY lines are read.
const INTERRUPTS: f64 = 3.0 * 60.0 + 168.0;
/// Samples from one block to the next.
const HOP: f64 = 512.0;
/// Cycles of an instruction, unknown to the emulator; on a Cortex-M4 most take one, loads two,
/// taken branches two to four, and the flash's accelerator hides its wait states.
const CYCLES: f64 = 1.3;

/// Parts of the work for each sample.
const SAMPLE: [(&str, &str); 5] = [
    (
        "acquisition",
        "a sample: four frames to counts, checksums, numbers, faults",
    ),
    ("hand-over", "a sample: into the queue, and looked at there"),
    (
        "calibration",
        "a sample: counts to SI, watch for overload, open and stuck",
    ),
    (
        "resultants",
        "a sample: 31 sensors to twelve resultants, (4) and (5)",
    ),
    (
        "decimation",
        "a sample: drive and resultants into the history",
    ),
];

/// A hop of 512 samples of twelve channels, from samples to sums of 64 lines: names, descriptions, and
/// budgets in instructions, which fall freely and rise only with the reason in the commit.
const HOPS: [(&str, &str, f64); 4] = [
    ("hop-drive", "by the drive", 300e3),
    ("hop-full", "all 78 products", 360e3),
    ("hop-exact", "by the drive, without decimation", 560e3),
    (
        "hop-exact-full",
        "all 78 products, without decimation",
        620e3,
    ),
];
/// The same job by CMSIS-DSP 1.17 (GCC 12.2, -O3), instructions and modelled cycles: at the full rate, and
/// decimated by four first. All 78 products.
const CMSIS: [(&str, f64, f64); 2] = [
    (
        "CMSIS-DSP, all 78 products, without decimation",
        671e3,
        876e3,
    ),
    ("CMSIS-DSP, all 78 products", 379e3, 546e3),
];

/// The table of a hop beside other libraries.
fn table_of_hops(costs: &BTreeMap<String, f64>) -> String {
    let mut text = String::from(
        "| a hop of 512 samples, 12 channels, 64 lines | instructions | cycles | budget, instructions |\n\
         | --- | ---: | ---: | ---: |\n",
    );
    for (name, words, budget) in HOPS {
        let cost = costs[name];
        let cycles = (CYCLES * cost).round();
        let _ = writeln!(text, "| {words} | {cost} | {cycles} | {budget} |");
    }
    for (words, instructions, cycles) in CMSIS {
        let _ = writeln!(text, "| {words} | {instructions} | {cycles} | none |");
    }
    text
}

/// Costs in instructions, by name.
fn measure() -> BTreeMap<String, f64> {
    let elf = firmware::find(None).unwrap_or_else(|error| panic!("{error}"));
    let budget = elf.with_file_name("examples").join("budget");
    let mut board = Emulator::start_with(&budget, &["-icount", "shift=0"])
        .unwrap_or_else(|error| panic!("{error}"));
    let mut costs = BTreeMap::new();
    loop {
        let line = board
            .read_until(b'\n', Duration::from_secs(120))
            .unwrap_or_else(|error| panic!("{error}; so far {costs:?}"));
        let line = String::from_utf8(line).expect("it speaks ASCII");
        let Some((what, cost)) = line.trim().split_once(' ') else {
            break;
        };
        costs.insert(what.to_owned(), cost.parse().expect("a number"));
    }
    // The memory has no room for samples at the full rate beside the sums of all products. Both take
    // what they take.
    let full = costs["hop-exact"] + costs["hop-full"] - costs["hop-drive"];
    costs.insert("hop-exact-full".to_owned(), full);
    costs
}

/// Shares of a second at a sample rate and a clock of the bus, in percent: buses, samples, blocks; the
/// accelerometer's is the second one.
fn loads([rate, spi]: [f64; 2], costs: &BTreeMap<String, f64>) -> [f64; 4] {
    let of_sample: f64 = SAMPLE.iter().map(|(what, _)| costs[*what]).sum();
    let compute = |instructions: f64| CYCLES * instructions / CLOCK;
    // Between two words the bus waits for the processor, within a word the processor for the bus.
    let frame = FRAME_BYTES * 8.0 / spi + compute(costs["exchange"]);
    let own = OWN_BYTES * 8.0 / OWN_SPI + compute(costs["accelerometer"]);
    [
        rate * FRAMES * frame,
        rate * own,
        rate * (compute(of_sample) + INTERRUPTS / CLOCK),
        rate / HOP * compute(costs["block"]),
    ]
    .map(|share| 100.0 * share)
}

fn table(costs: &BTreeMap<String, f64>) -> String {
    let mut text = String::from("| what, for 32 channels | instructions |\n| --- | ---: |\n");
    let frame = [(
        "exchange",
        "a frame, of which a sample has four: SPI driver, chip select",
    )];
    let block = [(
        "block",
        "a block: 13 transforms, powers, cross powers, coherences of 100 lines",
    )];
    let own = [(
        "accelerometer",
        "a sample of the accelerometer on its own bus: SPI driver, chip select",
    )];
    for (what, words) in frame.iter().chain(&own).chain(&SAMPLE).chain(&block) {
        let _ = writeln!(text, "| {words} | {} |", costs[*what]);
    }
    text.push_str(
        "\n| samples/s | bus | accelerometer | samples | blocks | load |\n| ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    for rate in [512.0, 4096.0, 8192.0, 16384.0] {
        let parts = loads([rate, SPI], costs);
        let all: f64 = parts.iter().sum();
        let [bus, own, samples, blocks] = parts.map(|p| format!("{p:.1} %"));
        let verdict = if all < 100.0 {
            format!("**{all:.1} %**")
        } else {
            format!("{all:.0} %: more than there is")
        };
        let _ = writeln!(
            text,
            "| {rate} | {bus} | {own} | {samples} | {blocks} | {verdict} |"
        );
    }
    text
}

#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn the_table_of_load_follows_from_counted_instructions() {
    let costs = measure();
    for (what, cost) in &costs {
        assert!(*cost > 100.0, "{what} was not measured: {cost}");
    }
    readme::compare("load", &table(&costs)).unwrap_or_else(|error| panic!("{error}"));
    readme::compare("hop", &table_of_hops(&costs)).unwrap_or_else(|error| panic!("{error}"));
    for (name, _, budget) in HOPS {
        let cost = costs[name];
        assert!(cost <= budget, "{name}: {cost}, {budget} are allowed");
    }
    let [bus, _, samples, blocks] = loads([4096.0, FAST_SPI], &costs);
    let at_4096 = bus + samples + blocks;
    assert!(at_4096 < 50.0, "{at_4096} % at 4096 samples/s and 21 MHz");
    let of = |times: f64| -> f64 {
        let rate = times * massline_firmware::sampling::FASTEST_HZ;
        loads([rate, SPI], &costs).iter().sum()
    };
    let fastest = of(1.0) + LINK;
    assert!(fastest < 100.0, "{fastest} % at the fastest rate");
    // What is refused could not be done.
    assert!(of(2.0) > 100.0, "{} % at twice the fastest rate", of(2.0));
}
