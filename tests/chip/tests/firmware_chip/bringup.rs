//! The bring-up of a board, on sound boards and on such with a defect.

use std::cell::Cell;
use std::rc::Rc;

use massline::bringup::{self, Check, Order, Verdict};
use massline::device::{Client, ClientMemory};
use massline_chip::SECOND;
use massline_chip::bench::{self, Bench};
use massline_chip::flash::Cells;
use massline_chip::rcc::Oscillators;
use massline_firmware::drivers::ads131m08::CLOCK_HZ;
use massline_firmware::drivers::ads131m08::registers::CHANNELS;
use massline_firmware::wire::{
    Conditions, Event, Reply, Request, Setting, SettingKey, Signal, Stream, Subscription, Values,
};

use crate::{GOOD, boot, clean, pass};

/// Inputs of the ADS131M08; those of the ADXL355 follow.
const VOLTAGES: usize = 4 * CHANNELS;

/// A board at rest: voltages nowhere, gravity along z with some noise.
fn at_rest() -> bench::Signal {
    Box::new(|input, cycle| match input {
        0..VOLTAGES => 0.0,
        _ => {
            let noise = 1e-4 * f64::from((cycle / 256 % 7) as u32);
            noise + if input == VOLTAGES + 2 { 1.0 } else { 0.0 }
        }
    })
}

/// A sample rate that is not that of the measurements, Hz.
const RATE: f64 = 4096.0;

/// The page of a board, whose settings are the same afterwards, and saved if that is ordered.
fn page(oscillators: Oscillators, order: &Order, wire: impl FnOnce(&mut Bench)) -> Vec<Check> {
    let mut machine = boot(oscillators, Cells::default(), at_rest(), 31);
    wire(&mut machine.chip().bench);
    let mut memory = ClientMemory::new();
    let mut client = Client::new(&mut machine, &mut memory);
    let rate = Request::WriteSetting(Setting::SampleRate(RATE));
    client.tell(&rate).unwrap();
    let measured = bringup::measure(&mut client, order, &mut |_| ()).unwrap();
    let read = Request::ReadSetting(SettingKey::SampleRate);
    let is_kept = |reply: &Reply<'_>| Some(*reply == Reply::Setting(Setting::SampleRate(RATE)));
    assert!(client.ask(&read, is_kept).unwrap());
    assert_eq!(client.status().unwrap().unsaved, !order.saves);
    drop(client);
    clean(&machine);
    measured.checks(order)
}

fn order() -> Order {
    Order {
        seconds: 0.3,
        without: 0,
        saves: false,
        keeps_time: true,
    }
}

/// Names of the parts that are wrong.
fn wrong(checks: &[Check]) -> Vec<&str> {
    let wrong = checks.iter().filter(|c| c.verdict == Verdict::Bad);
    wrong.map(|check| check.part.as_str()).collect()
}

fn found<'a>(checks: &'a [Check], part: &str) -> &'a Check {
    let check = checks.iter().find(|check| check.part == part);
    check.unwrap_or_else(|| panic!("{part} is not among {checks:#?}"))
}

#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn nothing_is_wrong_with_a_sound_board() {
    let order = Order {
        saves: true,
        ..order()
    };
    let checks = page(GOOD, &order, |_| ());
    for check in &checks {
        println!("{:?} {}: {}", check.verdict, check.part, check.found);
    }
    assert_eq!(wrong(&checks), [""; 0]);
    // All that is open: a wire on a bus of converters that answer is not needed.
    let open = checks.iter().filter(|c| c.verdict == Verdict::Open);
    let open: Vec<&str> = open.map(|check| check.part.as_str()).collect();
    assert_eq!(open, ["SPI2 loop", "SPI3 loop", "SPI1 loop"]);
    assert!(found(&checks, "crystal").found.starts_with("12.0 MHz"));
    // A tick: two counters are set against each other.
    assert!(["0 ns", "12 ns"].contains(&found(&checks, "skew of /DRDY").found.as_str()));
}

#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn a_board_without_converters_is_tested_by_wires() {
    let without = Order {
        without: 0b1_1111,
        ..order()
    };
    let checks = page(GOOD, &without, |bench| {
        bench.loops = [true, true, false];
        bench.are_soldered = false;
    });
    assert_eq!(wrong(&checks), [""; 0]);
    assert_eq!(found(&checks, "SPI2 loop").verdict, Verdict::Good);
    assert_eq!(found(&checks, "SPI3 loop").verdict, Verdict::Good);
    let open = found(&checks, "SPI1 loop");
    assert_eq!(open.verdict, Verdict::Open);
    assert!(open.found.contains("no wire from PA7 to PB4"), "{open:?}");
    // Without --without all five are asked for, and nothing else.
    let all = page(GOOD, &order(), |bench| bench.are_soldered = false);
    let five = [
        "ADS131M08 0",
        "ADS131M08 1",
        "ADS131M08 2",
        "ADS131M08 3",
        "ADXL355",
    ];
    assert_eq!(wrong(&all), five);
    let advice = found(&all, "ADS131M08 2").advice.as_ref().unwrap();
    assert!(
        advice.contains("PC4") && advice.contains("--without 2"),
        "{advice}"
    );
}

#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn every_defect_is_found_where_it_is() {
    let dead = Oscillators {
        crystal: None,
        ..GOOD
    };
    assert_eq!(wrong(&page(dead, &order(), |_| ())), ["crystal"]);

    let checks = page(GOOD, &order(), |bench| {
        bench.wires(3).unwrap().stuck = Some((false, u32::MAX))
    });
    let silent = wrong(&checks);
    assert_eq!(silent.first(), Some(&"ADS131M08 3"), "{silent:?}");

    let checks = page(GOOD, &order(), |bench| {
        bench.wires(2).unwrap().lost_edges = u32::MAX
    });
    assert_eq!(wrong(&checks).first(), Some(&"ADS131M08 2 shorted"));
    let skew = found(&checks, "skew of /DRDY");
    assert!(skew.found.contains("no edge of converter 2"), "{skew:?}");

    // Wires that are too long for the fastest clock alone, which is not in use.
    let checks = page(GOOD, &order(), |bench| bench.bears_hz = Some(10_500_000));
    assert_eq!(wrong(&checks), [""; 0]);
    for clock in ["10.5", "5.25"] {
        let frames = found(&checks, &format!("frames at {clock} MHz"));
        assert_eq!(frames.verdict, Verdict::Good, "{frames:?}");
    }
    let fastest = found(&checks, "frames at 21 MHz");
    assert_eq!(fastest.verdict, Verdict::Open, "{fastest:?}");

    let checks = page(GOOD, &order(), |bench| bench.garbles_every = Some(40));
    assert_eq!(wrong(&checks), ["frames at 10.5 MHz"]);
}

/// A converter whose edge comes some cycles of the converters' clock after the others', as where SYNC
/// meets an edge of that clock: told, and read with the others all the same.
#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn a_skew_is_told_to_two_ticks_and_costs_no_sample() {
    for cycles in [1, 3] {
        let checks = page(GOOD, &order(), |bench| bench.sync_skew = [0, 0, cycles, 0]);
        assert_eq!(wrong(&checks), ["skew of /DRDY"]);
        let skew = &found(&checks, "skew of /DRDY").found;
        let ns: f64 = skew.strip_suffix(" ns").unwrap().parse().unwrap();
        // A tick of each counter.
        let [late, tick] = [1e9 * cycles as f64 / f64::from(CLOCK_HZ), 1e9 / 84e6];
        assert!((ns - late).abs() <= 2.0 * tick, "{skew}");
    }
}

/// A bring-up that is killed leaves its samples behind: whoever records then gets those of the pins.
#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn samples_of_a_test_end_with_its_subscription() {
    let mut machine = boot(GOOD, Cells::default(), at_rest(), 32);
    let mut last = |samples| {
        let counts: Rc<Cell<Option<i32>>> = Rc::default();
        let heard = Rc::clone(&counts);
        let mut memory = ClientMemory::new();
        let mut client = Client::new(&mut machine, &mut memory);
        client.on_event(move |event, _| {
            if let Event::Recorded(samples) = event
                && let Values::Counts24(list) = samples.values
            {
                heard.set(list.get(0).map(|count| count.get()));
            }
        });
        let subscription = Subscription {
            samples,
            ..Subscription::default()
        };
        client.tell(&Request::Subscribe(subscription)).unwrap();
        pass(&mut client, SECOND / 5);
        counts.get().expect("samples come")
    };
    let test = Stream::Test(Conditions {
        signal: Signal::TestPositive,
        ..Conditions::default()
    });
    // 2/15 of the full scale, with a noise of some counts.
    let off = |count: i32| (f64::from(count) - 2.0 / 15.0 * 8_388_608.0).abs();
    assert!(off(last(test)) < 100.0);
    assert_eq!(last(Stream::Counts), 0);
    assert!(off(last(test)) < 100.0);
}
