//! Share of the processor that a measurement takes, as the box itself measures it.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use massline::device::{Client, ClientMemory};
use massline_chip::SECOND;
use massline_chip::flash::Cells;
use massline_chip::machine::Machine;
use massline_firmware::calibration::Preset;
use massline_firmware::models::setup;
use massline_firmware::wire::{
    ChannelRole, Circuit, Event, Gaps, Plan, Processing, Request, Run, Sensor, Setting, Source,
    Subscription, Telemetry,
};

use crate::faults::CASES;
use crate::sampling::volts;
use crate::{GOOD, boot, lossless, pass};

/// A measurement with all inputs of some converters, sensors and then the drive.
struct Case {
    converters: &'static [u8],
    /// Samples per second.
    rate: f64,
    /// Largest share of the processor by the rule of the table of load, with blocks, interrupts and the link,
    /// percent.
    share: f64,
    /// Largest share of the processor that the box may find, thousandths, with the cycles that the emulator
    /// charges: two for a load, three for a taken branch, twelve for an exception.
    load: u16,
}

fn prepare(client: &mut Client<'_, &mut Machine>, case: &Case) {
    let wired: Vec<u8> = case
        .converters
        .iter()
        .flat_map(|c| 8 * c..8 * (c + 1))
        .collect();
    let (drive, sensors) = wired.split_last().unwrap();
    let preset = Preset::voltage(Circuit::Voltage, 1.0, 1.0);
    let inputs = wired
        .iter()
        .map(|input| preset.input(*input, "S", "K", None, 1e-3));
    let mut channels = vec![ChannelRole::Unused.code(); usize::from(*drive) + 1];
    for (number, input) in (0..).zip(sensors) {
        channels[usize::from(*input)] = number;
    }
    channels[usize::from(*drive)] = ChannelRole::Drive.code();
    let sensors = sensors.len() as u8;
    let mut tell = |request: &Request<'_>| client.tell(request).unwrap();
    tell(&Request::WriteSetting(Setting::SampleRate(case.rate)));
    for input in inputs {
        tell(&Request::WriteSetting(Setting::Input(input)));
    }
    tell(&Request::BeginSetup(Plan {
        sensors,
        ..setup::plan(1, 0)
    }));
    // Blocks of 1024 samples, a hundred lines of which are kept.
    tell(&Request::SetProcessing(Processing {
        sample_rate: case.rate,
        kept_band: [4.0, 400.0],
        averaging_band: [8.0, 160.0],
        ..setup::PROCESSING
    }));
    // The sensors of the small set-up, farther out each time.
    let all = (1..).flat_map(|round| setup::sensors(0.1 * f64::from(round), 1.0));
    for (number, sensor) in (0..sensors).zip(all) {
        tell(&Request::SetSensor(Sensor {
            sensor: number,
            ..sensor
        }));
    }
    tell(&Request::SetRun(Run {
        channels: &channels,
        ..setup::run(0)
    }));
    client.ask(&Request::EndSetup, |_| Some(())).unwrap();
}

/// Cycles of an instruction, as the table of load in the firmware's README takes them.
const CYCLES: f64 = 1.3;
const CLOCK: f64 = 168e6;
/// Ticks of the timers in a second.
const TICKS: f64 = 84e6;

#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn thirty_two_channels_at_4096_samples_a_second() {
    measure(&Case {
        converters: &[0, 1, 2, 3],
        rate: 4096.0,
        share: 25.0,
        load: 310,
    });
}

#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn thirty_two_channels_at_8192_samples_a_second() {
    measure(&Case {
        converters: &[0, 1, 2, 3],
        rate: 8192.0,
        share: 45.0,
        load: 600,
    });
}

/// Two converters that are left out lie between and behind those in use: their faults, which every sample has,
/// must not cost the common path.
#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn sixteen_channels_beside_converters_that_are_left_out() {
    measure(&Case {
        converters: &[0, 2],
        rate: 8192.0,
        share: 34.0,
        load: 450,
    });
}

/// A converter on each bus.
#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn sixteen_channels_at_16384_samples_a_second() {
    measure(&Case {
        converters: &[0, 2],
        rate: 16_384.0,
        share: 80.0,
        load: 850,
    });
}

fn measure(case: &Case) {
    let mut machine = boot(GOOD, Cells::default(), Box::new(volts), 21);
    let mut memory = ClientMemory::new();
    let mut client = Client::new(&mut machine, &mut memory);
    let heard: Rc<RefCell<Vec<Telemetry>>> = Rc::default();
    let taken = Rc::clone(&heard);
    client.on_event(move |event, _| {
        if let Event::Telemetry(telemetry) = event {
            taken.borrow_mut().push(*telemetry);
        }
    });
    client.hello().unwrap();
    prepare(&mut client, case);
    let start = setup::start(0, Source::Inputs, Gaps::Count, None);
    client.tell(&Request::Start(start)).unwrap();
    let telemetry = Request::Subscribe(Subscription {
        telemetry: 300,
        ..Subscription::default()
    });
    client.tell(&telemetry).unwrap();
    // Converters start, and filters settle.
    pass(&mut client, 4 * SECOND / 10);
    let count = |client: &mut Client<'_, &mut Machine>| {
        let port = client.port();
        (port.instructions(), port.time())
    };
    // While filters settle, buffers are emptied, which takes longer than a period of these rates.
    let settled = client.hello().unwrap().faults;
    let (before, from) = count(&mut client);
    heard.borrow_mut().clear();
    pass(&mut client, 7 * SECOND / 10);
    let (after, to) = count(&mut client);
    let faults = client.hello().unwrap().faults;
    let load = heard.borrow().last().expect("telemetry comes").load;
    let summary = client.stop().unwrap();
    drop(client);
    lossless(&mut machine);
    let samples = (to - from) as f64 / SECOND as f64 * case.rate;
    let each = (after - before) as f64 / samples;
    let share = 100.0 * CYCLES * each * case.rate / CLOCK;
    println!(
        "{each:.0} instructions a sample, {share:.1} % of the processor; the box finds {load} of 1000"
    );
    assert_eq!((summary.missing, faults), (0, settled));
    assert!(summary.blocks > 3, "{summary:?}");
    // The first and the last edge were captured to a tick each, whatever the processor was at.
    let rate = summary.sample_rate.expect("samples of the inputs");
    let ticks = summary.samples as f64 / case.rate * TICKS;
    assert!((rate / case.rate - 1.0).abs() * ticks < 2.0, "{rate} Hz");
    assert!(share < case.share, "{share} % of the processor");
    assert!(load < case.load, "{load} of 1000");
}

/// At the fastest rates little time is left to empty buffers, to prepare a converter, and to tell of gaps: after each
/// fault blocks have to be averaged again, nobody else the wiser.
#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn blocks_are_averaged_again_after_each_fault_at_the_fastest_rates() {
    for (converters, rate, victim) in [(&[0, 2][..], 16_384.0, 2), (&[0, 1, 2, 3], 8192.0, 1)] {
        let mut machine = boot(GOOD, Cells::default(), Box::new(volts), 22);
        let chip = Arc::clone(&machine.shared());
        let mut memory = ClientMemory::new();
        let mut client = Client::new(&mut machine, &mut memory);
        // Blocks rejected so far, and those averaged since the last of them.
        let blocks: Rc<RefCell<(u32, u32)>> = Rc::default();
        let told = Rc::clone(&blocks);
        client.on_event(move |event, _| {
            if let Event::Block(block) = event {
                let (rejected, averaged) = &mut *told.borrow_mut();
                if block.health.is_good() {
                    *averaged += 1;
                } else {
                    (*rejected, *averaged) = (*rejected + 1, 0);
                }
            }
        });
        client.hello().unwrap();
        let case = Case {
            converters,
            rate,
            share: 0.0,
            load: 0,
        };
        prepare(&mut client, &case);
        let start = setup::start(0, Source::Inputs, Gaps::Count, None);
        client.tell(&Request::Start(start)).unwrap();
        for (name, (cause, ..)) in CASES {
            let mut wait = |done: fn(u32, u32, u32) -> bool, before: u32| {
                for _ in 0..200 {
                    pass(&mut client, SECOND / 100);
                    let (rejected, averaged) = *blocks.borrow();
                    if done(before, rejected, averaged) {
                        break;
                    }
                }
                *blocks.borrow()
            };
            let (before, averaged) = wait(|_, _, averaged| averaged > 4, 0);
            assert!(
                averaged > 4,
                "{name}: no block is averaged at {rate} samples/s"
            );
            cause(&mut chip.lock().unwrap(), victim);
            let (after, _) = wait(|before, rejected, _| rejected > before, before);
            assert!(
                after > before,
                "{name}: no block is rejected at {rate} samples/s"
            );
        }
        let summary = client.stop().unwrap();
        let faults = client.hello().unwrap().faults;
        println!("{rate} samples/s: {summary:?} {faults:?}");
        assert_eq!(faults.watchdog, 0);
        drop(client);
        lossless(&mut machine);
    }
}
