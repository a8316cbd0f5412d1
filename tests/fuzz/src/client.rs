//! A box as a host's client sees it: some of its answers come from a script, the others from an
//! instrument.
//!
//! The first byte chooses the host's command.

use crate::bench::{Bench, Sent, Shelf};
use crate::link;
use crate::scratch::{Scratch, assert_message};
use crate::script::{Bytes, steps};
use massline::acquire::{self, Ending};
use massline::box_runs::{BoxRunError, BoxTest, Ended, Measuring, Operator, Progress, Stage};
use massline::device::{Client, ClientMemory, Port, PortError};
use massline::inputs::InputEntry;
use massline::recording::Recording;
use massline::setup::Setup;
use massline_core::masslines::Method;
use massline_firmware::calibration::{Certificate, Preset};
use massline_firmware::wire::{
    BODY_MAX, Circuit, Gaps, Pass, Received, Receiver, Request, Source, Start, ToBox,
};
use std::collections::VecDeque;
use std::path::Path;
use std::time::Duration;

/// Frames after which a command counts as endless: eight requests for each of some hundred items,
/// and a few thousand samples.
const TALK: u32 = 20_000;
/// Reads of a recording or a run before it is stopped.
const LOOKS: u32 = 60;
/// Reads in a row without bytes before the link is cut.
const SILENT: u32 = 200;
/// Largest file of a recording after [`LOOKS`] reads, bytes.
const FILE: u64 = 64 << 20;

/// The other end of the link.
#[derive(Debug)]
pub struct Answering<'s, 'm> {
    script: VecDeque<(u8, Bytes<'s>)>,
    bench: Option<Bench<'m>>,
    input: Vec<u8>,
    output: Vec<u8>,
    session: u16,
    sequence: u32,
    talk: u32,
    /// Reads in a row without bytes.
    silent: u32,
}

impl<'s, 'm> Answering<'s, 'm> {
    /// A box that answers by a script, and then by the instrument, if any.
    #[must_use]
    pub fn new(script: &'s [u8], bench: Option<Bench<'m>>) -> Self {
        Self {
            script: steps(script).take(400).collect(),
            bench,
            input: Vec::new(),
            output: Vec::new(),
            session: 1,
            sequence: 0,
            talk: 0,
            silent: 0,
        }
    }

    fn frame(&mut self, number: u8, id: u16, payload: &[u8]) {
        let header = link::header(number, self.session, self.sequence, id);
        self.sequence = self.sequence.wrapping_add(1);
        self.output.extend(link::frame(&header, payload));
    }

    /// Answers a request by the next steps of the script up to an answer, if any.
    fn answer(&mut self, id: u16, request: &Request<'_>) {
        while let Some((step, mut bytes)) = self.script.pop_front() {
            match step % 8 {
                0 | 1 => {
                    let number = bytes.u8();
                    return self.frame(number, id, bytes.0);
                }
                2 => return self.honest(id, request),
                3 => {
                    let number = bytes.u8();
                    self.frame(number, 0, bytes.0);
                }
                4 => self.output.extend(bytes.0),
                5 => {
                    let (number, id) = (bytes.u8(), bytes.u16());
                    self.frame(number, id, bytes.0);
                }
                // No answer.
                6 => return,
                _ => {
                    self.session = self.session.wrapping_add(1);
                    self.sequence = bytes.u32();
                }
            }
        }
        self.honest(id, request);
    }

    fn honest(&mut self, id: u16, request: &Request<'_>) {
        if let Some(bench) = &mut self.bench {
            bench.send(id, request);
            self.pass_on();
        }
    }

    /// Sends the instrument's messages.
    fn pass_on(&mut self) {
        let Some(bench) = &mut self.bench else { return };
        let sent: Vec<Sent> = bench.out.sent.drain(..).collect();
        for sent in sent {
            self.frame(sent.number, sent.id, &sent.payload);
        }
    }

    /// Polls the instrument once.
    fn work(&mut self) {
        let Some(bench) = &mut self.bench else { return };
        for _ in 0..4 {
            bench.poll();
        }
        if let Some(job) = bench.instrument.take_job() {
            // The job is not run: identification is another target.
            bench
                .instrument
                .finish(job, &mut bench.hardware, &mut bench.out);
        }
        self.pass_on();
    }
}

impl Port for Answering<'_, '_> {
    fn name(&self) -> String {
        "script".to_owned()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.input.extend(bytes);
        self.talk += 1;
        assert!(self.talk < TALK, "it talks without end");
        // A client sends whole frames.
        let input = std::mem::take(&mut self.input);
        let mut rest = &input[..];
        let mut buffer = [0; BODY_MAX];
        let mut receiver = Receiver::<ToBox>::new(&mut buffer);
        while let Some(received) = receiver.next(&mut rest) {
            let Received::Message(header, request) = received else {
                panic!("the client sent {received:?}");
            };
            self.answer(header.request, &request);
        }
        Ok(())
    }

    fn receive(&mut self, into: &mut Vec<u8>, _: Duration) -> Result<usize, PortError> {
        if self.output.is_empty() {
            self.work();
        }
        self.silent = match self.output.is_empty() {
            true => self.silent + 1,
            false => 0,
        };
        if self.silent > SILENT {
            // Time does not pass here, so a silent box counts as gone.
            return Err(PortError::Gone {
                name: self.name(),
                reason: "the script has ended".to_owned(),
            });
        }
        let came = self.output.len();
        into.append(&mut self.output);
        Ok(came)
    }

    fn patience(&self) -> Duration {
        Duration::ZERO
    }

    fn seconds(&self) -> f64 {
        f64::from(self.talk)
    }
}

/// A valid set-up of one run.
const SETUP: &str = crate::seeds::SETUPS[1];

/// Inputs of a box, with the channels wired to them.
#[must_use]
pub fn wired<'c>(channels: impl IntoIterator<Item = &'c str>) -> Vec<InputEntry> {
    let voltage = Preset::voltage(Circuit::Voltage, 1.0, 1.0);
    let entry = |(input, channel): (u8, &str)| {
        let setting = voltage.input(input, "", "", None, 0.0);
        Some(InputEntry {
            input,
            channel: Some(channel.to_owned()),
            certificate: Certificate::new(&setting).ok()?,
        })
    };
    (0..32).zip(channels).filter_map(entry).collect()
}

/// Runs the target; see the module.
pub fn run(bytes: &[u8]) {
    let mut bytes = Bytes(bytes);
    let choice = bytes.u8();
    let mut shelf = Shelf::default();
    let bench = (choice & 0x80 != 0).then(|| Bench::new(&mut shelf));
    let mut memory = ClientMemory::new();
    let mut client = Client::new(Answering::new(bytes.0, bench), &mut memory);
    let inputs = wired(["a1", "fx", "drive"]);
    let result = match choice & 7 {
        0 => (|| {
            let info = client.hello()?;
            client.ping(7)?;
            client.status()?;
            Ok(format!("{info:?}"))
        })()
        .map_err(|error: massline::device::ClientError| error.to_string()),
        1 => displayed(client.wired_inputs(4)),
        2 => displayed(client.selftest()),
        3 => {
            let stopped = displayed(client.stop());
            displayed(client.summary(0)).and(stopped)
        }
        4 => stream(&mut client),
        5 => record(&mut client, inputs),
        6 => {
            let mut looks = 0;
            let shown = acquire::monitor(&mut client, &inputs, 0.1, Some(5.0), &mut |snapshot| {
                looks += 1;
                assert!(!format!("{snapshot:?}").is_empty());
                looks < LOOKS
            });
            displayed(shown)
        }
        _ => test(&mut client, &inputs),
    };
    if let Err(text) = result {
        assert_message(&text);
    }
    let link = client.link();
    assert!(link.resent <= link.sent && !format!("{link:?}").is_empty());
}

fn displayed<T: std::fmt::Debug, E: std::error::Error>(
    result: Result<T, E>,
) -> Result<String, String> {
    result
        .map(|found| format!("{found:?}"))
        .map_err(|error| error.to_string())
}

fn stream(client: &mut Client<'_, Answering<'_, '_>>) -> Result<String, String> {
    let start = Start {
        run: 0,
        pass: Pass::Measure,
        source: Source::Host,
        gaps: Gaps::Refuse,
        limit: None,
    };
    client
        .tell(&Request::Start(start))
        .map_err(|e| e.to_string())?;
    let mut left = 500_u32;
    let mut source = |sample: &mut [f32]| -> Result<bool, std::convert::Infallible> {
        sample.fill(left as f32);
        left = left.saturating_sub(1);
        Ok(left > 0)
    };
    let mut last = 0;
    let sent = client.stream(3, 0, 3, &mut source, &mut |next| {
        assert!(next >= last, "it goes back from {last} to {next}");
        last = next;
    });
    sent.map(|next| next.to_string()).map_err(|e| e.to_string())
}

fn record(
    client: &mut Client<'_, Answering<'_, '_>>,
    inputs: Vec<InputEntry>,
) -> Result<String, String> {
    let scratch = Scratch::new();
    let order = acquire::Order {
        firmware: None,
        inputs,
        seconds: Some(2.0),
        file: scratch.place("r.csv"),
        replace: false,
    };
    let mut looks = 0;
    let made = acquire::record(client, &order, &mut |progress| {
        looks += 1;
        assert!(progress.seconds >= 0.0);
        looks < LOOKS
    });
    let made = made.map_err(|error| error.to_string())?;
    if let Ending::Failed(error) = &made.ending {
        assert_message(&error.to_string());
    }
    let size = std::fs::metadata(&made.file).map_or(0, |data| data.len());
    assert!(size < FILE, "{size} bytes");
    // The channels are read back.
    let names: Vec<&str> = made.channels.iter().map(String::as_str).collect();
    let opened = Recording::open(&made.file, &names);
    let mut recording = opened.unwrap_or_else(|error| panic!("{error}"));
    let mut row = vec![0.0; names.len()];
    let (mut rows, mut faulty) = (0, 0);
    loop {
        match recording.next_row(&mut row) {
            Ok(true) => {
                rows += 1;
                faulty += u64::from(!recording.health().is_good());
            }
            Ok(false) => break,
            Err(error) => panic!("{error}"),
        }
    }
    assert_eq!((rows, faulty), (made.samples, made.faulty));
    assert!(made.missing <= made.faulty);
    Ok(format!("{made:?}"))
}

/// An operator who ends each run after some reads.
struct Impatient(u32);

impl Operator for Impatient {
    fn shake(&mut self, _: &Stage<'_>) -> Result<(), BoxRunError> {
        Ok(())
    }

    fn watch(&mut self, _: &Stage<'_>, progress: &Progress) -> bool {
        self.0 += 1;
        assert!(!format!("{progress:?}").is_empty());
        self.0 < LOOKS
    }

    fn ended(&mut self, _: &Stage<'_>, ended: &Ended) {
        assert!(!format!("{:?}", ended.rejected()).is_empty());
    }
}

fn test(
    client: &mut Client<'_, Answering<'_, '_>>,
    inputs: &[InputEntry],
) -> Result<String, String> {
    let text = |error: BoxRunError| {
        assert!([1, 2].contains(&error.exit_code()));
        error.to_string()
    };
    let setup = Setup::from_str(SETUP, Path::new("setup.toml"));
    let setup = setup.unwrap_or_else(|error| panic!("{error}"));
    let test = BoxTest::new(client, &setup, inputs, Method::ApparentMass, false).map_err(text)?;
    test.load(client).map_err(text)?;
    let order = Measuring {
        runs: vec![0],
        seconds: Some(1.0),
    };
    let measured = test
        .measure(client, &order, &mut Impatient(0))
        .map_err(text);
    let found = test.identify(client, false).map_err(text);
    measured?;
    let document = found?.document("fuzz", None, None);
    Ok(format!("{document:?}"))
}
