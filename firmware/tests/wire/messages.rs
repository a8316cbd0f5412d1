//! Every message of the protocol, drawn at random. A message that is added to the tables must be
//! added here, or the tests that go through the tables fail.

use crate::draw::Draw;
use massline_firmware::wire::*;

pub fn request<'a>(number: u8, d: &mut Draw<'a>) -> Request<'a> {
    match number {
        0x01 => Request::Hello,
        0x02 => Request::Ping(d.any()),
        0x03 => Request::Status,
        0x04 => Request::Subscribe(d.any()),
        0x05 => Request::ForgetFaults,
        0x06 => Request::Reboot,
        0x07 => Request::Provoke(d.any()),
        0x08 => Request::Selftest,
        0x09 => Request::Probe(d.any()),
        0x10 => Request::BeginSetup(d.any()),
        0x11 => Request::SetProcessing(d.any()),
        0x12 => Request::SetSensor(d.any()),
        0x13 => Request::SetRun(d.any()),
        0x14 => Request::SetWeights(d.any()),
        0x15 => Request::EndSetup,
        0x20 => Request::Start(d.any()),
        0x21 => Request::Samples(d.any()),
        0x22 => Request::Stop,
        0x23 => Request::Abort,
        0x30 => Request::ReadSummary(d.any()),
        0x31 => Request::ReadLines(d.any()),
        0x32 => Request::ReadPeaks(d.any()),
        0x33 => Request::ReadWeights(d.any()),
        0x40 => Request::Identify(d.any()),
        0x41 => Request::ReadAnswer,
        0x50 => Request::ReadSetting(d.any()),
        0x51 => Request::WriteSetting(d.any()),
        0x52 => Request::SaveSettings,
        0x53 => Request::ResetSettings,
        _ => panic!("request {number:#04x} is not drawn"),
    }
}

pub fn reply<'a>(number: u8, d: &mut Draw<'a>) -> Reply<'a> {
    match number {
        0x80 => Reply::Done,
        0x81 => Reply::Error(d.any()),
        0x82 => Reply::Info(d.any()),
        0x83 => Reply::Pong(d.any()),
        0x84 => Reply::Status(d.any()),
        0x85 => Reply::Selftest(d.any()),
        0x86 => Reply::Grid(d.any()),
        0x87 => Reply::Progress(d.any()),
        0x88 => Reply::Summary(d.any()),
        0x89 => Reply::Lines(d.any()),
        0x8A => Reply::Peaks(d.any()),
        0x8B => Reply::Weights(d.any()),
        0x8C => Reply::Identified(d.any()),
        0x8D => Reply::Setting(d.any()),
        0x8E => Reply::Saved(d.any()),
        0x8F => Reply::Probed(d.any()),
        _ => panic!("reply {number:#04x} is not drawn"),
    }
}

pub fn event<'a>(number: u8, d: &mut Draw<'a>) -> Event<'a> {
    match number {
        0xC0 => Event::Started(d.any()),
        0xC1 => Event::Block(d.any()),
        0xC2 => Event::Health(d.any()),
        0xC3 => Event::RunEnded(d.any()),
        0xC4 => Event::Levels(d.any()),
        0xC5 => Event::Recorded(d.any()),
        0xC6 => Event::Telemetry(d.any()),
        0xC7 => Event::Fault(d.any()),
        0xC8 => Event::RecordedFaulty(d.any()),
        _ => panic!("event {number:#04x} is not drawn"),
    }
}
