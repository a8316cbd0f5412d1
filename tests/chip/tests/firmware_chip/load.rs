//! Share of the processor that a measurement takes, as the box itself measures it.

use std::cell::RefCell;
use std::rc::Rc;

use massline::device::{Client, ClientMemory};
use massline_chip::SECOND;
use massline_chip::flash::Cells;
use massline_chip::machine::Machine;
use massline_firmware::calibration::Preset;
use massline_firmware::models::setup;
use massline_firmware::wire::{
    ChannelRole, Circuit, Event, Gaps, Input, Plan, Processing, Request, Run, Sensor, Setting,
    Source, Subscription, Telemetry,
};

use crate::sampling::volts;
use crate::{GOOD, boot, lossless, pass};

/// Inputs of the four ADS131M08: sensors, then the drive.
const INPUTS: u8 = 32;

fn inputs() -> impl Iterator<Item = Input<'static>> {
    let preset = Preset::voltage(Circuit::Voltage, 1.0, 1.0);
    (0..INPUTS).map(move |input| preset.input(input, "S", "K", None, 1e-3))
}

fn prepare(client: &mut Client<'_, &mut Machine>, rate: f64) {
    let sensors = INPUTS - 1;
    let mut tell = |request: &Request<'_>| client.tell(request).unwrap();
    tell(&Request::WriteSetting(Setting::SampleRate(rate)));
    for input in inputs() {
        tell(&Request::WriteSetting(Setting::Input(input)));
    }
    tell(&Request::BeginSetup(Plan {
        sensors,
        ..setup::plan(1, 0)
    }));
    // Blocks of 1024 samples, a hundred lines of which are kept.
    tell(&Request::SetProcessing(Processing {
        sample_rate: rate,
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
    let mut channels: Vec<u8> = (0..sensors).collect();
    channels.push(ChannelRole::Drive.code());
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

/// Largest shares of the processor at a sample rate, with blocks, interrupts and the link.
struct Bounds {
    /// By that rule, percent.
    share: f64,
    /// That the box may find, thousandths, with the cycles that the emulator charges: two for a load, three
    /// for a taken branch, twelve for an exception.
    load: u16,
}

#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn thirty_two_channels_at_4096_samples_a_second() {
    let bounds = Bounds {
        share: 25.0,
        load: 330,
    };
    measure(4096.0, &bounds);
}

#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn thirty_two_channels_at_8192_samples_a_second() {
    let bounds = Bounds {
        share: 50.0,
        load: 660,
    };
    measure(8192.0, &bounds);
}

fn measure(rate: f64, bounds: &Bounds) {
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
    prepare(&mut client, rate);
    let start = setup::start(0, Source::Inputs, Gaps::Count, None);
    client.tell(&Request::Start(start)).unwrap();
    let telemetry = Request::Subscribe(Subscription {
        telemetry: 500,
        ..Subscription::default()
    });
    client.tell(&telemetry).unwrap();
    // Converters start, and filters settle.
    pass(&mut client, 6 * SECOND / 10);
    let count = |client: &mut Client<'_, &mut Machine>| {
        let port = client.port();
        (port.instructions(), port.time())
    };
    // While filters settle, buffers are emptied, which takes longer than a period of the faster rate.
    let settled = client.hello().unwrap().faults;
    let (before, from) = count(&mut client);
    heard.borrow_mut().clear();
    pass(&mut client, 11 * SECOND / 10);
    let (after, to) = count(&mut client);
    let load = heard.borrow().last().expect("telemetry comes").load;
    let faults = client.hello().unwrap().faults;
    let summary = client.stop().unwrap();
    drop(client);
    lossless(&mut machine);
    let samples = (to - from) as f64 / SECOND as f64 * rate;
    let each = (after - before) as f64 / samples;
    let share = 100.0 * CYCLES * each * rate / CLOCK;
    println!(
        "{each:.0} instructions a sample, {share:.1} % of the processor; the box finds {load} of 1000"
    );
    assert_eq!((summary.missing, faults), (0, settled));
    assert!(summary.blocks > 3, "{summary:?}");
    // The first and the last edge were captured to a tick each, whatever the processor was at.
    let found = summary.sample_rate.expect("samples of the inputs");
    let ticks = summary.samples as f64 / rate * TICKS;
    assert!((found / rate - 1.0).abs() * ticks < 2.0, "{found} Hz");
    assert!(share < bounds.share, "{share} % of the processor");
    assert!(load < bounds.load, "{load} of 1000");
}
