//! Cost of acquisition and spectra on the chip: instructions counted in the emulator, and the table
//! of load in the firmware's README, which follows from them.

use massline::device::{Emulator, firmware};
use massline_tests::readme;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::time::Duration;

/// The chip's clock, Hz.
const CLOCK: f64 = 168e6;
/// Most of the processor's time that the link takes, percent: a microsecond a byte, which lasts 10.85.
const LINK: f64 = 10.0;
/// Cycles of the interrupts of a sample but those of its frames: of DRDY, of the begin of frames and
/// of the task that processes it, with 22 each to begin and to end, from the processor's manual, and RTIC's
/// part of a task. And the microsecond after which the DRDY lines are read.
const INTERRUPTS: f64 = 3.0 * 60.0 + 168.0;
/// Cycles of the interrupt at the end of a frame: the same, and two looks for edges.
const FRAME_END: f64 = 100.0;
/// Samples from one block to the next.
const HOP: f64 = 512.0;
/// Cycles of an instruction, unknown to the emulator; on a Cortex-M4 most take one, loads two,
/// taken branches two to four, and the flash's accelerator hides its wait states.
const CYCLES: f64 = 1.3;

/// Channels, interrupts at the end of a frame, and what is behind the names of their costs. The
/// accelerometer has two frames, and comes beside 32 channels.
const SIZES: [(u32, f64, &str); 2] = [(32, 6.0, ""), (16, 2.0, "-16")];

/// Converters without the accelerometer, by bits: all, and two on a bus each.
const ALL: u32 = 0b1111;
const TWO: u32 = 0b0101;

/// Parts of the work for each sample, and whether they depend on the number of channels.
const SAMPLE: [(&str, bool, &str); 6] = [
    (
        "frames",
        true,
        "a sample: its frames begun and ended, chip selects, DMA",
    ),
    (
        "acquisition",
        true,
        "a sample: frames to counts, checksums, numbers, faults",
    ),
    (
        "hand-over",
        false,
        "a sample: into the queue, and looked at there",
    ),
    (
        "calibration",
        true,
        "a sample: counts to SI, watch for overload, open and stuck",
    ),
    (
        "resultants",
        true,
        "a sample: all sensors but the drive to twelve resultants, (4) and (5)",
    ),
    (
        "decimation",
        false,
        "a sample: drive and resultants into the history",
    ),
];

/// A hop of 512 samples of twelve channels, from samples to sums of 64 lines: names, descriptions, and
/// budgets in instructions, which fall freely and rise only with the reason in the commit.
const HOPS: [(&str, &str, f64); 4] = [
    ("hop-drive", "by the drive", 170e3),
    ("hop-full", "all 78 products", 200e3),
    ("hop-exact", "by the drive, without decimation", 360e3),
    (
        "hop-exact-full",
        "all 78 products, without decimation",
        390e3,
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

/// Instructions of a part for the size whose costs have these words behind their names.
fn part(costs: &BTreeMap<String, f64>, (what, depends, _): (&str, bool, &str), size: &str) -> f64 {
    costs[&format!("{what}{}", if depends { size } else { "" })]
}

/// Shares of a second at a sample rate, in percent: frames and interrupts, samples, blocks.
fn loads((_, ends, size): (u32, f64, &str), rate: f64, costs: &BTreeMap<String, f64>) -> [f64; 3] {
    let compute = |instructions: f64| CYCLES * instructions / CLOCK;
    let [frames, work @ ..] = SAMPLE.map(|row| part(costs, row, size));
    let interrupts = (INTERRUPTS + ends * FRAME_END) / CLOCK;
    [
        rate * (compute(frames) + interrupts),
        rate * compute(work.iter().sum()),
        rate / HOP * compute(costs["block"]),
    ]
    .map(|share| 100.0 * share)
}

/// Samples of 32 channels that come while a block is computed, at a sample rate: what has a higher
/// priority takes its part of that time.
fn during_a_block(rate: f64, costs: &BTreeMap<String, f64>) -> f64 {
    let [frames, ..] = loads(SIZES[0], rate, costs);
    let above = ["acquisition", "hand-over"].map(|what| costs[what]);
    let above = rate * CYCLES * above.iter().sum::<f64>() / CLOCK;
    let left = 1.0 - above - (frames + LINK) / 100.0;
    rate * CYCLES * costs["block"] / CLOCK / left.max(0.01)
}

fn table(costs: &BTreeMap<String, f64>) -> String {
    let mut text =
        String::from("| what | instructions for 32 channels | for 16 |\n| --- | ---: | ---: |\n");
    for row in SAMPLE {
        let [all, half] = SIZES.map(|(_, _, size)| part(costs, row, size));
        let _ = writeln!(text, "| {} | {all} | {half} |", row.2);
    }
    let words = "a block: 13 transforms, powers, cross powers, coherences of 100 lines";
    let _ = writeln!(text, "| {words} | {0} | {0} |", costs["block"]);
    text.push_str(
        "\n| channels | samples/s | frames, interrupts | samples | blocks | load |\n\
         | ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    for size in SIZES {
        // 32 channels come with the accelerometer, beside which the box refuses more.
        let fastest = if size == SIZES[0] { 4096.0 } else { 16384.0 };
        for rate in [512.0, 4096.0, 8192.0, 16384.0] {
            if rate > fastest {
                continue;
            }
            let parts = loads(size, rate, costs);
            let all: f64 = parts.iter().sum();
            let [frames, samples, blocks] = parts.map(|p| format!("{p:.1} %"));
            let verdict = if all < 100.0 {
                format!("**{all:.1} %**")
            } else {
                format!("{all:.0} %: more than there is")
            };
            let _ = writeln!(
                text,
                "| {} | {rate} | {frames} | {samples} | {blocks} | {verdict} |",
                size.0
            );
        }
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
    let rates = [ALL, TWO].map(massline_firmware::sampling::fastest);
    for (size, rate) in SIZES.into_iter().zip(rates) {
        let fastest = loads(size, rate, &costs).iter().sum::<f64>() + LINK;
        assert!(fastest < 100.0, "{fastest} % at {rate} samples/s");
    }
    let at_4096: f64 = loads(SIZES[0], 4096.0, &costs).iter().sum();
    assert!(at_4096 < 25.0, "{at_4096} % at 4096 samples/s");
    // What comes while a block is computed fits into the queue.
    let room = massline_firmware::sampling::WAITING as f64 - 1.0;
    let waiting = during_a_block(rates[0], &costs);
    println!("{waiting:.1} samples come during a block");
    assert!(waiting < room, "{waiting} samples come during a block");
}
