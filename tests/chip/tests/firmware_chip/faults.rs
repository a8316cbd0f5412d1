//! Each of the faults of converters and their wires, named by the flashed ELF for the inputs that it is
//! about. Overloads and broken leads follow from the counts, which runs watch, see `fork`, and the host.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use massline::device::{Client, ClientMemory};
use massline_chip::SECOND;
use massline_chip::bus::Chip;
use massline_chip::flash::Cells;
use massline_firmware::acquisition::GARBLED;
use massline_firmware::drivers::ads131m08::registers::CHANNELS;
use massline_firmware::wire::{Event, Health, Stream};

use crate::sampling::{stream, volts, wire};
use crate::{GOOD, boot, lossless, pass};

/// Inputs of three converters.
const INPUTS: u8 = 24;
/// Good samples between two faults: more than the hold-off after an overload.
const GOOD_SAMPLES: u64 = 60;
/// The converter at fault.
pub const CONVERTER: usize = 1;

/// Frames of a stuck line: less than those after which the converter is prepared anew.
const STUCK: u32 = GARBLED as u32 - 2;

/// A fault: how it is caused at a converter, how the box has to name it, and the inputs that it is about if that is
/// [`CONVERTER`].
pub type Case = (fn(&mut Chip, usize), Health, std::ops::Range<usize>);

const OF_CONVERTER: std::ops::Range<usize> = CHANNELS * CONVERTER..CHANNELS * (CONVERTER + 1);

pub const CASES: [(&str, Case); 5] = [
    (
        "a wrong bit",
        (
            |chip, k| wires(chip, k).is_garbled = true,
            Health::CHECKSUM,
            OF_CONVERTER,
        ),
    ),
    (
        "a lost edge",
        (
            |chip, k| wires(chip, k).lost_edges = 2,
            Health::MISSING,
            OF_CONVERTER,
        ),
    ),
    (
        "a reset",
        (
            |chip, k| {
                let converter = chip.bench.converter(k);
                converter.expect("it is there").reset();
            },
            Health::CONVERTER_RESET,
            OF_CONVERTER,
        ),
    ),
    (
        "a converter that is late",
        (
            |chip, k| chip.bench.delay(k, 3000),
            Health::OUT_OF_STEP,
            // All are synchronised anew.
            0..INPUTS as usize,
        ),
    ),
    (
        "a stuck line",
        (
            |chip, k| wires(chip, k).stuck = Some((true, STUCK)),
            Health::STUCK,
            OF_CONVERTER,
        ),
    ),
];

fn wires(chip: &mut Chip, converter: usize) -> &mut massline_chip::bench::Wires {
    chip.bench.wires(converter).expect("it is there")
}

#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn every_fault_is_named_for_its_inputs() {
    let mut machine = boot(GOOD, Cells::default(), Box::new(volts), 5);
    let chip = Arc::clone(&machine.shared());
    let faulty: Rc<RefCell<Vec<Vec<Health>>>> = Rc::default();
    let good = Rc::new(RefCell::new(0_u64));
    let mut memory = ClientMemory::new();
    let mut client = Client::new(&mut machine, &mut memory);
    let (taken, counted) = (Rc::clone(&faulty), Rc::clone(&good));
    client.on_event(move |event, _| match event {
        Event::Recorded(samples) => *counted.borrow_mut() += samples.count().unwrap_or(0) as u64,
        Event::RecordedFaulty(samples) => {
            let health =
                (0..usize::from(INPUTS)).map(|k| Health(samples.health.get(k).unwrap_or(0)));
            taken.borrow_mut().push(health.collect());
        }
        _ => {}
    });
    client.hello().unwrap();
    wire(&mut client, INPUTS);
    client.tell(&stream(Stream::Counts)).unwrap();
    for (name, (cause, health, inputs)) in CASES {
        // The faults of before are over, and good samples come.
        let begin = *good.borrow();
        for _ in 0..200 {
            pass(&mut client, SECOND / 100);
            if *good.borrow() > begin + GOOD_SAMPLES {
                break;
            }
        }
        assert!(
            *good.borrow() > begin + GOOD_SAMPLES,
            "{name}: no good samples"
        );
        faulty.borrow_mut().clear();
        cause(&mut chip.lock().unwrap(), CONVERTER);
        // The first sample with it: those after a restart have its reason on all inputs.
        let named = || {
            let rows = faulty.borrow();
            let row = rows.iter().find(|r| r.iter().any(|h| h.contains(health)))?;
            let inputs = 0..usize::from(INPUTS);
            Some(inputs.filter(|k| row[*k].contains(health)).collect())
        };
        for _ in 0..200 {
            pass(&mut client, SECOND / 100);
            if named().is_some() {
                break;
            }
        }
        let named: Vec<usize> = named().unwrap_or_default();
        assert_eq!(named, inputs.collect::<Vec<_>>(), "{name}");
    }
    drop(client);
    lossless(&mut machine);
}
