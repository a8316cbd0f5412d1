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
    costs
}

/// Shares of a second, in percent: bus, samples, blocks.
fn loads(rate: f64, costs: &BTreeMap<String, f64>) -> [f64; 3] {
    let of_sample: f64 = SAMPLE.iter().map(|(what, _)| costs[*what]).sum();
    let compute = |instructions: f64| CYCLES * instructions / CLOCK;
    // Between two words the bus waits for the processor, within a word the processor for the bus.
    let frame = FRAME_BYTES * 8.0 / SPI + compute(costs["exchange"]);
    [
        rate * FRAMES * frame,
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
    for (what, words) in frame.iter().chain(&SAMPLE).chain(&block) {
        let _ = writeln!(text, "| {words} | {} |", costs[*what]);
    }
    text.push_str(
        "\n| samples/s | bus | samples | blocks | load |\n| ---: | ---: | ---: | ---: | ---: |\n",
    );
    for rate in [512.0, 4096.0, 8192.0, 16384.0] {
        let parts = loads(rate, costs);
        let all: f64 = parts.iter().sum();
        let [bus, samples, blocks] = parts.map(|p| format!("{p:.1} %"));
        let verdict = if all < 100.0 {
            format!("**{all:.1} %**")
        } else {
            format!("{all:.0} %: more than there is")
        };
        let _ = writeln!(
            text,
            "| {rate} | {bus} | {samples} | {blocks} | {verdict} |"
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
    // The link takes a tenth at most, and a fifth is left for requests and identifications. Two thirds of
    // the load are the bus at half the clock that the processor could make, which its wires need.
    let [fastest, beyond] = [1.0, 2.0].map(|times| {
        let parts = loads(times * massline_firmware::sampling::FASTEST_HZ, &costs);
        parts.iter().sum::<f64>()
    });
    assert!(fastest < 70.0, "{fastest} % at the fastest rate");
    // What is refused could not be done.
    assert!(beyond > 100.0, "{beyond} % at twice the fastest rate");
}
