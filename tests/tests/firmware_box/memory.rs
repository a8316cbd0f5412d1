//! The firmware's static variables: memories and sizes.

use std::fmt::Write as _;
use std::fs;

use massline::device::firmware;
use massline_tests::readme;
use massline_tests::xtask::image;
use massline_tests::xtask::variables::{Variable, variables};

/// Variables below this size are shown together, bytes.
const SMALL: u64 = 256;

/// Memories by their name in the memory map, with their descriptions.
const MEMORIES: [(&str, &str); 2] = [("CCM", "core-coupled memory"), ("RAM", "SRAM")];

/// Purposes of the large variables. Those without one are shown by their names alone.
const WORDS: [(&str, &str); 12] = [
    (
        "board::memory::RUNS",
        "six stored runs, 100 lines of twelve responses and the drive each; a block's transform \
         and lines",
    ),
    (
        "working",
        "a run: samples and filters of 13 channels, sums, geometry; or an identification: sets, \
         regression, modes",
    ),
    ("persistent", "set-up, weights and peaks, summaries, answer"),
    ("queues", "the link's queues, and the message that is read"),
    ("samples", "samples on their way from the sampling task"),
    ("settings", "settings, with the calibrations of 35 inputs"),
    (
        "sampler",
        "the sampling task: converters, grid of samples, faults",
    ),
    (
        "app",
        "instrument, run that is going on, frame that is sent",
    ),
    ("defmt_rtt::BUFFER", "log"),
    (
        "board::lanes::BUFFERS",
        "bytes to and from the converters, by DMA",
    ),
    ("faults::RETAINED", "last words, which outlive a reset"),
    (
        "board::tasks::app::init::VAR",
        "those that were found at the start",
    ),
];

fn table() -> String {
    let elf = firmware::find(None).unwrap_or_else(|error| panic!("{error}"));
    let bytes = fs::read(&elf).expect("the firmware can be read");
    let map = image::regions(include_str!("../../../memory.x"));
    let usages = image::usage(&bytes, &map).expect("an ELF for the chip");
    let variables = variables(&bytes, &map).expect("an ELF with its symbols");
    for (name, _) in WORDS {
        assert!(
            variables.iter().any(|v| v.name == name && v.size >= SMALL),
            "no large variable {name} any more"
        );
    }
    let mut text = String::from("| where | what | bytes |\n| --- | --- | ---: |\n");
    for (memory, words) in MEMORIES {
        let usage = usages.iter().find(|u| u.region.name == memory);
        let usage = usage.unwrap_or_else(|| panic!("no memory {memory}"));
        let mut place = format!(" {words}, {} KiB ", usage.region.length >> 10);
        let mut row = |what: &str, size: u64| {
            let _ = writeln!(text, "|{place}| {what} | {size} |");
            " ".clone_into(&mut place);
        };
        let here = |v: &&Variable| v.region == memory;
        for Variable { name, size, .. } in variables.iter().filter(here) {
            if *size >= SMALL {
                let known = WORDS.iter().find(|(known, _)| known == name);
                match known {
                    Some((_, words)) => row(&format!("`{name}`: {words}"), *size),
                    None => row(&format!("`{name}`"), *size),
                }
            }
        }
        row("all, with what is smaller", usage.used);
    }
    let stack = map.iter().find(|region| region.name == "STACK");
    let stack = stack.expect("a stack in the memory map");
    let _ = writeln!(
        text,
        "| SRAM, another {} KiB | stack | {} |",
        stack.length >> 10,
        stack.length
    );
    text
}

#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn every_large_variable_is_shown() {
    readme::compare("memory", &table()).unwrap_or_else(|error| panic!("{error}"));
}
