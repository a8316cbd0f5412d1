//! Every message of the protocol, drawn at random. A message that is added to the tables must be
//! added here, or the tests that go through the tables fail.

use crate::draw::{Draw, SENSORS};
use crate::parts::*;
use crate::problems::problem;
use massline_firmware::wire::*;

pub fn request<'a>(number: u8, d: &mut Draw<'a>) -> Request<'a> {
    match number {
        0x01 => Request::Hello,
        0x02 => Request::Ping(Ping { stamp: d.u64() }),
        0x03 => Request::Status,
        0x04 => Request::Subscribe(Subscription {
            telemetry: d.u16(),
            levels: d.u16(),
            samples: d.pick(&[Stream::Off, Stream::Readings, Stream::Counts]),
        }),
        0x05 => Request::ForgetFaults,
        0x06 => Request::Reboot,
        0x07 => Request::Provoke(d.pick(&[
            Provoke::Panic,
            Provoke::StackOverflow,
            Provoke::Hang,
            Provoke::TestPattern,
        ])),
        0x08 => Request::Selftest,
        0x10 => Request::BeginSetup(Plan {
            sensors: d.u8(),
            runs: d.u8(),
            reference_point: d.array(Draw::f64),
            fingerprint: d.u32(),
        }),
        0x11 => Request::SetProcessing(processing(d)),
        0x12 => Request::SetSensor(sensor(d)),
        0x13 => Request::SetRun(Run {
            run: d.u8(),
            name: d.text(NAME_MAX),
            excitation: d.pick(&[Excitation::Random, Excitation::Sine, Excitation::Static]),
            rotation: d.array(Draw::f64),
            translation: d.array(Draw::f64),
            channels: d.bytes(SENSORS),
        }),
        0x14 => Request::SetWeights(weights(d)),
        0x15 => Request::EndSetup,
        0x20 => Request::Start(Start {
            run: d.u8(),
            pass: pass(d),
            source: source(d),
            gaps: d.pick(&[Gaps::Refuse, Gaps::Count]),
            limit: d.option(Draw::u64),
        }),
        0x21 => Request::Samples(samples(d)),
        0x22 => Request::Stop,
        0x23 => Request::Abort,
        0x30 => Request::ReadSummary(d.u8()),
        0x31 => Request::ReadLines(ReadLines {
            run: d.u8(),
            first: d.u16(),
            count: d.u16(),
        }),
        0x32 => Request::ReadPeaks(d.u8()),
        0x33 => Request::ReadWeights(d.u8()),
        0x40 => Request::Identify(question(d)),
        0x41 => Request::ReadAnswer,
        0x50 => Request::ReadSetting(key(d)),
        0x51 => Request::WriteSetting(setting(d)),
        0x52 => Request::SaveSettings,
        0x53 => Request::ResetSettings,
        _ => panic!("request {number:#04x} is not drawn"),
    }
}

pub fn reply<'a>(number: u8, d: &mut Draw<'a>) -> Reply<'a> {
    match number {
        0x80 => Reply::Done,
        0x81 => Reply::Error(Refused {
            request: d.u8(),
            problem: problem(d),
        }),
        0x82 => Reply::Info(info(d)),
        0x83 => Reply::Pong(Pong {
            stamp: d.u64(),
            ticks: d.u64(),
            samples: d.u64(),
        }),
        0x84 => Reply::Status(Status {
            state: state(d),
            busy: d.option(Draw::u8),
            fingerprint: d.option(Draw::u32),
            running: d.option(|d| Running {
                run: d.u8(),
                pass: pass(d),
                source: source(d),
                next: d.u64(),
                blocks: d.u32(),
            }),
            stored: d.u32(),
            surveyed: d.u32(),
            answer: d.bool(),
            unsaved: d.bool(),
        }),
        0x85 => Reply::Selftest(Selftest {
            passed: d.bool(),
            checks: d.array(|d| Check {
                truth: d.f64(),
                found: d.option(Draw::f64),
                bound: d.f64(),
            }),
            health: Health(d.u16()),
        }),
        0x86 => Reply::Grid(Grid {
            lines: LineGrid {
                first: d.u32() as usize,
                count: d.u32() as usize,
                spacing: d.f64(),
            },
            hop: d.u32(),
            band: d.array(Draw::u32),
        }),
        0x87 => Reply::Progress(Progress {
            next: d.u64(),
            missing: d.u64(),
        }),
        0x88 => Reply::Summary(summary(d)),
        0x89 => Reply::Lines(Lines {
            run: d.u8(),
            first: d.u16(),
            lines: d.lines(Lines::FIT),
        }),
        0x8A => Reply::Peaks(Peaks {
            run: d.u8(),
            peaks: d.doubles(SENSORS),
        }),
        0x8B => Reply::Weights(weights(d)),
        0x8C => Reply::Identified(Identified {
            ticks: d.u64(),
            answer: answer(d),
        }),
        0x8D => Reply::Setting(setting(d)),
        0x8E => Reply::Saved(Saved {
            storage: storage(d),
        }),
        _ => panic!("reply {number:#04x} is not drawn"),
    }
}

pub fn event<'a>(number: u8, d: &mut Draw<'a>) -> Event<'a> {
    match number {
        0xC0 => Event::Started(Started {
            reset: reset(d),
            resets: d.u32(),
        }),
        0xC1 => Event::Block(Block {
            run: d.u8(),
            pass: pass(d),
            block: d.u32(),
            first: d.u64(),
            health: Health(d.u16()),
            averaged: d.u32(),
            coherence: d.option(|d| d.array(Draw::f32)),
            ticks: d.u32(),
        }),
        0xC2 => Event::Health(ChannelHealth {
            sample: d.u64(),
            channels: d.flags(SENSORS),
        }),
        0xC3 => Event::RunEnded(summary(d)),
        0xC4 => Event::Levels(Levels {
            sample: d.u64(),
            samples: d.u32(),
            mean: d.singles(SENSORS),
            rms: d.singles(SENSORS),
            peak: d.singles(SENSORS),
        }),
        0xC5 => Event::Recorded(samples(d)),
        0xC6 => Event::Telemetry(Telemetry {
            uptime: d.u64(),
            stack_used: d.u32(),
            stack_size: d.u32(),
            load: d.u16(),
            block_ticks: d.u32(),
            dropped: d.u32(),
            overrun: d.u32(),
            link: link(d),
            faults: faults(d),
        }),
        0xC7 => Event::Fault(Fault {
            kind: d.pick(&[
                FaultKind::Overrun,
                FaultKind::Converter,
                FaultKind::Storage,
                FaultKind::Clock,
                FaultKind::Stack,
            ]),
            sample: d.u64(),
            part: d.option(Draw::u8),
        }),
        0xC8 => Event::RecordedFaulty(FaultySamples {
            health: d.flags(SENSORS),
            samples: samples_of(d, FaultySamples::FIT / 4),
        }),
        _ => panic!("event {number:#04x} is not drawn"),
    }
}
