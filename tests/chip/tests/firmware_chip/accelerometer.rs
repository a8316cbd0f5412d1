//! Accelerations from the ADXL355 and from the ADS131M08, in step on the chip.

use std::cell::Cell;
use std::f64::consts::TAU;
use std::rc::Rc;

use massline::device::{Client, ClientMemory};
use massline_chip::flash::Cells;
use massline_chip::{SECOND, bench::Signal};
use massline_firmware::calibration::{ADXL355_COUNTS_PER_G, FULL_SCALE_VOLTS, Preset};
use massline_firmware::models::setup;
use massline_firmware::sampling::{CLOCK_HZ, lowpass};
use massline_firmware::wire::{
    ChannelRole, Circuit, Event, Gaps, Input, Line, Plan, Processing, ReadLines, Reply, Request,
    Run, ScaleSource, Sensor, Setting, Source, Subscription,
};

use crate::sampling::volts;
use crate::{GOOD, boot, lossless, pass};

const RATE: f64 = 512.0;
/// Samples of a block.
const BLOCK: u32 = 256;
/// The first input of the ADXL355, whose axes are the first three accelerometers.
const LATE: u8 = 32;
/// Input of the drive, behind those of the other accelerometers and of the load cells.
const DRIVE: u8 = 9;
/// Inputs of the accelerometers along z.
const ALONG_Z: [u8; 3] = [1, 2, LATE + 2];
/// Inputs that carry something.
fn wired() -> impl Iterator<Item = u8> {
    (0..=DRIVE).chain(LATE..LATE + 3)
}

/// A translation along z: tones of 20 mV, or thousandths of standard gravity, on every fourth line, as the
/// filters of each converter pass them on; and a thousandth of noise, or inputs would be stuck.
fn tones() -> Signal {
    let line = RATE / f64::from(BLOCK);
    let frequencies = move || (1..=24).map(move |n| f64::from(4 * n) * line);
    let filters: Vec<Vec<[f64; 3]>> = (0..=LATE + 2)
        .map(|input| {
            let filter = lowpass(input.into(), RATE).unwrap();
            let tone = |f: f64| [TAU * f, filter.lag(f) + f * f, 20e-3 * filter.magnitude(f)];
            frequencies().map(tone).collect()
        })
        .collect();
    Box::new(move |input, cycle| {
        let noise = 2e-5 * volts(input, cycle);
        let number = input as u8;
        if number != DRIVE && !ALONG_Z.contains(&number) {
            return noise;
        }
        let time = cycle as f64 / f64::from(CLOCK_HZ);
        let tone = |[omega, lag, amplitude]: &[f64; 3]| amplitude * (omega * time - lag).cos();
        noise + filters[input].iter().map(tone).sum::<f64>()
    })
}

fn prepare(client: &mut Client<'_, &mut massline_chip::machine::Machine>) {
    let mut tell = |request: &Request<'_>| client.tell(request).unwrap();
    tell(&Request::WriteSetting(Setting::SampleRate(RATE)));
    let voltage = Preset::voltage(Circuit::Voltage, 1.0, 1.0);
    for input in wired() {
        let preset = if input < LATE {
            voltage
        } else {
            Preset::adxl355()
        };
        let input: Input<'_> = preset.input(input, "S", "K", None, 1e-3);
        tell(&Request::WriteSetting(Setting::Input(input)));
    }
    tell(&Request::BeginSetup(Plan {
        ..setup::plan(1, 0)
    }));
    let band = [1.0, 99.0].map(|line| line * RATE / f64::from(BLOCK));
    tell(&Request::SetProcessing(Processing {
        sample_rate: RATE,
        block_length: BLOCK,
        kept_band: band,
        averaging_band: band,
        ..setup::PROCESSING
    }));
    for sensor in setup::sensors(0.2, 1.0) {
        // Volts and standard gravity count alike.
        let per_unit = if sensor.sensor < 3 {
            1.0 / ADXL355_COUNTS_PER_G
        } else {
            FULL_SCALE_VOLTS / f64::from(1 << 23)
        };
        let offset = 0.0;
        tell(&Request::SetSensor(Sensor {
            scale: ScaleSource::Given { per_unit, offset },
            ..sensor
        }));
    }
    let mut channels = [ChannelRole::Unused.code(); LATE as usize + 3];
    for (sensor, input) in (0..3).zip(LATE..).chain((3..setup::SENSORS).zip(0..)) {
        channels[usize::from(input)] = sensor;
    }
    channels[usize::from(DRIVE)] = ChannelRole::Drive.code();
    tell(&Request::SetRun(Run {
        channels: &channels,
        ..setup::run(0)
    }));
    client.ask(&Request::EndSetup, |_| Some(())).unwrap();
}

#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn accelerations_of_both_kinds_of_converters_are_in_step() {
    let mut machine = boot(GOOD, Cells::default(), tones(), 5);
    let mut memory = ClientMemory::new();
    let mut client = Client::new(&mut machine, &mut memory);
    let stack = Rc::new(Cell::new(0));
    let deepest = Rc::clone(&stack);
    client.on_event(move |event, _| {
        if let Event::Telemetry(telemetry) = event {
            deepest.set(telemetry.stack_used);
        }
    });
    client.hello().unwrap();
    prepare(&mut client);
    let start = setup::start(0, Source::Inputs, Gaps::Count, None);
    client.tell(&Request::Start(start)).unwrap();
    let telemetry = Request::Subscribe(Subscription {
        telemetry: 500,
        ..Subscription::default()
    });
    client.tell(&telemetry).unwrap();
    pass(&mut client, 25 * SECOND / 10);
    let summary = client.stop().unwrap();
    assert_eq!((summary.missing, summary.rejected), (0, 0), "{summary:?}");
    assert!(summary.blocks >= 4, "{summary:?}");
    let mut lines: Vec<Line> = Vec::new();
    while lines.len() < 99 {
        let first = lines.len() as u16;
        let (run, count) = (0, u16::MAX);
        let request = Request::ReadLines(ReadLines { run, first, count });
        let more = client.ask(&request, |reply| match reply {
            Reply::Lines(lines) => Some(lines.lines.iter().collect::<Vec<Line>>()),
            _ => None,
        });
        lines.extend(more.unwrap());
    }
    drop(client);
    lossless(&mut machine);
    // Its samples have come by DMA, 21 bytes each.
    let moved = machine.chip().dma[1].moved()[0];
    assert!(moved >= 21 * summary.samples, "{moved} bytes by DMA");
    let volts_a_count = FULL_SCALE_VOLTS / f64::from(1 << 23);
    let mut worst = 0.0_f64;
    // Line n is the one of number n + 1.
    for line in lines.iter().skip(3).step_by(4) {
        for (k, response) in line.responses.iter().take(6).enumerate() {
            let [re, im] = response.map(|x| f64::from(x) / volts_a_count);
            let wanted = if k == 2 { 1.0 } else { 0.0 };
            worst = worst.max((re - wanted).hypot(im));
        }
    }
    println!("{worst:.1e} of the drive; {} bytes of stack", stack.get());
    // The taps keep 4e-4; a rotation about places 0.4 m apart is 2.5 times as large.
    assert!(worst < 1.05e-3, "{worst}");
}
