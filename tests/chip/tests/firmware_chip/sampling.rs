//! Samples from the voltages at the inputs to the link, over DRDY lines, captures, SPI and DMA.

use std::cell::RefCell;
use std::rc::Rc;

use massline::device::{Client, ClientMemory, Port};
use massline_chip::SECOND;
use massline_chip::flash::Cells;
use massline_firmware::calibration::Preset;
use massline_firmware::drivers::ads131m08::registers::CHANNELS;
use massline_firmware::models::random::mix;
use massline_firmware::wire::{
    Circuit, Event, FaultCounters, Request, Setting, Stream, Subscription, Values,
};

use crate::{GOOD, boot, lossless, pass};

/// Inputs that are wired: all of three converters, two of the fourth.
const INPUTS: u8 = 26;
pub const RATE: f64 = 512.0;
/// Samples that are compared.
const SAMPLES: usize = 300;

/// Number of a sample, and its counts.
type Row = (u64, Vec<i32>);

/// A voltage that no other input and no other cycle has, V.
pub fn volts(input: usize, cycle: u64) -> f64 {
    let share = mix(cycle << 6 | input as u64) as f64 / u64::MAX as f64;
    0.9 * (2.0 * share - 1.0)
}

/// Wires the first inputs, to voltages of 1 V at most.
pub fn wire<P: Port>(client: &mut Client<'_, P>, inputs: u8) {
    let rate = Request::WriteSetting(Setting::SampleRate(RATE));
    client.tell(&rate).unwrap();
    let preset = Preset::voltage(Circuit::Voltage, 1.0, 1.0);
    for input in 0..inputs {
        let input = preset.input(input, "S", "K", None, 1e-3);
        let setting = Request::WriteSetting(Setting::Input(input));
        client.tell(&setting).unwrap();
    }
}

/// The request for samples in a form.
pub fn stream(samples: Stream) -> Request<'static> {
    Request::Subscribe(Subscription {
        samples,
        ..Subscription::default()
    })
}

#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn every_sample_on_the_link_is_one_of_the_converters() {
    let mut machine = boot(GOOD, Cells::default(), Box::new(volts), 3);
    let rows: Rc<RefCell<Vec<Row>>> = Rc::default();
    let mut memory = ClientMemory::new();
    let mut client = Client::new(&mut machine, &mut memory);
    let taken = Rc::clone(&rows);
    client.on_event(move |event, _| {
        let samples = match event {
            Event::Recorded(samples) => samples,
            Event::RecordedFaulty(faulty) => panic!("{:?}", faulty.health),
            _ => return,
        };
        let channels = usize::from(samples.channels);
        let Values::Counts24(counts) = samples.values else {
            panic!("{:?}", samples.values);
        };
        let counts: Vec<i32> = counts.iter().map(|count| count.get()).collect();
        for (k, row) in (0..).zip(counts.chunks(channels)) {
            taken.borrow_mut().push((samples.first + k, row.to_vec()));
        }
    });
    client.hello().unwrap();
    wire(&mut client, INPUTS);
    client.tell(&stream(Stream::Counts)).unwrap();
    // Filters settle during the first samples, and a frame holds ten.
    for _ in 0..500 {
        pass(&mut client, SECOND / 100);
        if rows.borrow().len() > SAMPLES {
            break;
        }
    }
    client.tell(&stream(Stream::Off)).unwrap();
    let faults = client.hello().unwrap().faults;
    drop(client);
    lossless(&mut machine);
    assert_eq!(faults, FaultCounters::default());

    let rows = rows.borrow();
    assert!(rows.len() > SAMPLES, "{} samples", rows.len());
    let chip = machine.chip();
    // Every sample has come by DMA: 30 bytes of each converter, two on each of SPI2 and SPI3. The
    // accelerometer on SPI1, none of whose inputs is in use, was not read.
    let [moved, own] = [0, 1].map(|n: usize| chip.dma[n].moved());
    for bytes in [moved[3], moved[0]] {
        assert!(bytes >= 60 * SAMPLES as u64, "{bytes} bytes by DMA");
    }
    assert_eq!(own[0], 0);
    let converted = &chip.bench.converted;
    // Each converter counts its own conversions: the first sample tells where the box began.
    let offsets: Vec<usize> = (0..usize::from(INPUTS).div_ceil(CHANNELS))
        .map(|k| {
            let first = rows[0].1[CHANNELS * k];
            let place = converted[k].iter().position(|(_, c)| c[0] == first);
            place.unwrap_or_else(|| panic!("converter {k}: {first} was never converted"))
        })
        .collect();
    for (n, (number, row)) in rows.iter().enumerate() {
        assert_eq!(*number, rows[0].0 + n as u64, "a sample is missing");
        for (input, found) in row.iter().enumerate() {
            let (converter, channel) = (input / CHANNELS, input % CHANNELS);
            let (_, counts) = converted[converter][offsets[converter] + n];
            assert_eq!(*found, counts[channel], "sample {n}, input {input}");
        }
        // Converters that were started together convert together.
        let cycles = offsets
            .iter()
            .enumerate()
            .map(|(k, at)| converted[k][at + n].0);
        let (least, most) = (cycles.clone().min(), cycles.max());
        assert_eq!(least, most, "sample {n}");
    }
}

/// Stops and starts of the stream.
const STOPS: u64 = 12;

/// Samples are stopped at instants that wander through the period: frames that run are broken off, and
/// leave the buses as the next ones have to find them.
#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn frames_are_broken_off_at_any_instant() {
    let mut machine = boot(GOOD, Cells::default(), Box::new(volts), 4);
    let mut memory = ClientMemory::new();
    let mut client = Client::new(&mut machine, &mut memory);
    let faulty = Rc::new(RefCell::new(0));
    let counted = Rc::clone(&faulty);
    client.on_event(move |event, _| {
        if let Event::RecordedFaulty(_) = event {
            *counted.borrow_mut() += 1;
        }
    });
    client.hello().unwrap();
    wire(&mut client, INPUTS);
    // Frames take a fifth of the time at this rate.
    let rate = Request::WriteSetting(Setting::SampleRate(4096.0));
    client.tell(&rate).unwrap();
    for stop in 0..STOPS {
        client.tell(&stream(Stream::Counts)).unwrap();
        pass(&mut client, SECOND / 100 + stop * SECOND / 4096 / STOPS);
        client.tell(&stream(Stream::Off)).unwrap();
    }
    let faults = client.hello().unwrap().faults;
    drop(client);
    lossless(&mut machine);
    // While filters settle, buffers are emptied, which takes longer than a period of this rate: those
    // samples are nobody's.
    let settling = FaultCounters {
        converter_missed: faults.converter_missed,
        ..FaultCounters::default()
    };
    assert_eq!((faults, *faulty.borrow()), (settling, 0));
}
