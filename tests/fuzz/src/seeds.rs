//! Seeds: valid messages of hosts and boxes, and valid files of users.

use crate::link;
use crate::script::push;
use massline_firmware::calibration::Preset;
use massline_firmware::models::setup;
use massline_firmware::wire::*;
use std::fmt::Write;

/// Inputs of a target.
#[must_use]
pub fn of(target: &str) -> Vec<Vec<u8>> {
    match target {
        "wire" => wire(),
        "instrument" => instrument(),
        "setup" => SETUPS.iter().map(|text| text.as_bytes().to_vec()).collect(),
        "recording" => recordings(),
        "inputs" => vec![INPUTS.as_bytes().to_vec()],
        "flash" => flash(),
        "client" => client(),
        _ => Vec::new(),
    }
}

/// A request as a step: its number and its payload.
fn request(request: &Request<'_>) -> Vec<u8> {
    let mut out = [0; FRAME_MAX];
    let frame = Sender::new(1).request(1, request, &mut out);
    let mut step = vec![request.number()];
    step.extend(link::payload(frame.unwrap_or_default()));
    step
}

/// A reply or an event as a step: its number and its payload.
fn message(message: &FromBox<'_>) -> Vec<u8> {
    let mut out = [0; FRAME_MAX];
    let mut sender = Sender::new(1);
    let (number, frame) = match message {
        FromBox::Reply(reply) => (reply.number(), sender.reply(1, reply, &mut out)),
        FromBox::Event(event) => (event.number(), sender.event(event, &mut out)),
    };
    let mut step = vec![number];
    step.extend(link::payload(frame.unwrap_or_default()));
    step
}

/// Six accelerometers on the interface, six load cells, and a drive.
fn set_up(weighting: Weighting, runs: u8) -> Vec<Vec<u8>> {
    let mut all = vec![
        Request::BeginSetup(setup::plan(runs, 99)),
        Request::SetProcessing(Processing {
            block_length: 64,
            kept_band: [8.0, 100.0],
            averaging_band: [8.0, 60.0],
            mode_band: Some([64.0, 100.0]),
            weighting,
            ..setup::PROCESSING
        }),
    ];
    all.extend(setup::sensors(0.2, 0.1).map(Request::SetSensor));
    all.extend((0..runs).map(|run| Request::SetRun(setup::run(run))));
    all.push(Request::EndSetup);
    all.iter().map(request).collect()
}

fn start(run: u8, pass: Pass, source: Source, gaps: Gaps) -> Vec<u8> {
    request(&Request::Start(Start {
        run,
        pass,
        source,
        gaps,
        limit: Some(400),
    }))
}

fn question(method: Method) -> Vec<u8> {
    let procedure = Procedure::Iterative {
        tolerance: 1e-7,
        limit: 20,
    };
    request(&Request::Identify(setup::question(method, procedure, 2)))
}

fn reading() -> Vec<Vec<u8>> {
    [
        Request::Status,
        Request::ReadSummary(0),
        Request::ReadLines(ReadLines {
            run: 0,
            first: 0,
            count: 9,
        }),
        Request::ReadPeaks(0),
        Request::ReadWeights(0),
        Request::ReadAnswer,
    ]
    .iter()
    .map(request)
    .collect()
}

fn setting() -> Vec<u8> {
    let input = Preset::bridge(500.0, 2e-3, 2.5)
        .unwrap()
        .input(1, "LC-0815", "K 17", None, 1e-3);
    request(&Request::WriteSetting(Setting::Input(input)))
}

fn voltages() -> Vec<Vec<u8>> {
    let setting = |input| {
        let input = Preset::voltage(Circuit::Voltage, 1.0, 1.0).input(input, "", "", None, 0.0);
        request(&Request::WriteSetting(Setting::Input(input)))
    };
    (0..13).map(setting).collect()
}

/// The step that feeds so many samples of thirteen channels.
fn feed(samples: u16) -> Vec<u8> {
    let mut step = samples.to_le_bytes().to_vec();
    step.extend([13, 0]);
    step
}

/// A message of samples without samples.
fn empty(first: u64) -> Vec<u8> {
    request(&Request::Samples(Samples {
        first,
        channels: 13,
        values: Values::Counts24(Packed::new(&[])),
    }))
}

/// A script of requests and other steps.
fn script(steps: impl IntoIterator<Item = (u8, Vec<u8>)>) -> Vec<u8> {
    let mut script = Vec::new();
    for (number, bytes) in steps {
        push(&mut script, number, &bytes);
    }
    script
}

fn requests(all: Vec<Vec<u8>>) -> impl Iterator<Item = (u8, Vec<u8>)> {
    all.into_iter().map(|step| (0, step))
}

/// The step that runs a job.
fn job() -> (u8, Vec<u8>) {
    (6, vec![1])
}

fn instrument() -> Vec<Vec<u8>> {
    let measured = |method| {
        let mut steps: Vec<_> = requests(set_up(Weighting::Given, 3)).collect();
        for run in 0..3 {
            steps.push((0, start(run, Pass::Measure, Source::Host, Gaps::Refuse)));
            steps.push((3, feed(400)));
            steps.push((0, request(&Request::Stop)));
        }
        steps.push((0, question(method)));
        steps.push(job());
        steps.extend(requests(reading()));
        script(steps)
    };
    let mut all: Vec<_> = [
        Method::ApparentMass,
        Method::FrequencyResponses,
        Method::FreeResponsesSquared,
        Method::Synthesis,
    ]
    .map(measured)
    .into();

    // Surveys, then weights, from the host with gaps.
    let mut steps: Vec<_> = requests(set_up(Weighting::EachRun, 1)).collect();
    steps.push((0, start(0, Pass::Survey, Source::Host, Gaps::Count)));
    steps.push((3, feed(300)));
    steps.push((3, vec![20, 0, 13, 5]));
    steps.push((0, request(&Request::Stop)));
    steps.extend(requests(reading()));
    steps.push((0, start(0, Pass::Measure, Source::Host, Gaps::Count)));
    steps.push((3, feed(300)));
    steps.push((0, request(&Request::Abort)));
    all.push(script(steps));

    // No samples, but numbers ahead of the run, by little and by much, for both rules of gaps.
    for gaps in [Gaps::Refuse, Gaps::Count] {
        let mut steps: Vec<_> = requests(set_up(Weighting::Given, 1)).collect();
        steps.push((0, start(0, Pass::Measure, Source::Host, gaps)));
        steps.push((3, feed(70)));
        for ahead in [71, 75, 1 << 40, u64::MAX] {
            steps.push((0, empty(ahead)));
            steps.push((3, feed(20)));
        }
        steps.push((0, request(&Request::Stop)));
        steps.extend(requests(reading()));
        all.push(script(steps));
    }

    // From the inputs, with levels, samples and telemetry.
    let mut steps: Vec<_> = requests(voltages()).collect();
    steps.push((0, setting()));
    steps.push((0, request(&Request::SaveSettings)));
    steps.extend(requests(set_up(Weighting::Given, 1)));
    steps.push((
        0,
        request(&Request::Subscribe(Subscription {
            telemetry: 100,
            levels: 100,
            samples: Stream::Readings,
        })),
    ));
    steps.push((0, start(0, Pass::Measure, Source::Inputs, Gaps::Count)));
    for (samples, jump, fault) in [(100_u8, 0, 0), (100, 3, 0), (50, 0, 2), (100, 0, 0)] {
        steps.push((4, vec![samples, 0, jump, 2, fault, 0, 4]));
        steps.push((5, vec![0, 0, 2, 0, 3]));
    }
    steps.push((7, vec![1, 0]));
    steps.push((0, request(&Request::ResetSettings)));
    all.push(script(steps));

    // A synthetic run, and the self-test.
    let mut steps: Vec<_> = requests(set_up(Weighting::Given, 1)).collect();
    steps.push((0, start(0, Pass::Measure, Source::Synthetic, Gaps::Refuse)));
    steps.push((5, vec![0, 0, 2, 0, 60]));
    steps.extend(requests(reading()));
    let shorted = Stream::Test(Conditions {
        signal: Signal::Shorted,
        bus: BusClock::Double,
    });
    for samples in [shorted, Stream::Counts] {
        let subscription = Subscription {
            samples,
            ..Subscription::default()
        };
        steps.push((0, request(&Request::Subscribe(subscription))));
        steps.push((0, start(0, Pass::Measure, Source::Inputs, Gaps::Count)));
    }
    steps.push((0, request(&Request::Probe(Probe::Skew))));
    steps.push((0, request(&Request::Selftest)));
    steps.push((5, vec![0, 0, 2, 0, 255]));
    steps.push(job());
    all.push(script(steps));
    all
}

fn wire() -> Vec<Vec<u8>> {
    let mut all = Vec::new();
    let samples: Vec<f32> = (0..39).map(|i| i as f32 * 0.25).collect();
    let counts: Vec<i32> = (0..26).map(|i| i * 1000 - 9000).collect();
    let frames = |values: Values<'_>| {
        let samples = Samples {
            first: 3,
            channels: 13,
            values,
        };
        let health = [0_u16, 1, 2, 3, 0, 0, 0, 0, 0, 0, 0, 0, 4];
        [
            request(&Request::Samples(samples)),
            message(&FromBox::Event(Event::Recorded(samples))),
            message(&FromBox::Event(Event::RecordedFaulty(FaultySamples {
                health: Packed::new(&health),
                samples,
            }))),
        ]
    };
    let mut steps = set_up(Weighting::Joined, 2);
    steps.extend(reading());
    steps.push(question(Method::CurveFit));
    steps.push(setting());
    steps.extend(frames(Values::Readings(Packed::new(&samples))));
    steps.extend(frames(Values::Counts(Packed::new(&counts))));
    for step in steps {
        // The number, the request's id, the payload.
        let (number, payload) = step.split_first().map_or((0, &[][..]), |(n, p)| (*n, p));
        let id = if number < 0xC0 { [9, 0] } else { [0, 0] };
        let mut bytes = vec![number];
        bytes.extend(id);
        bytes.extend(payload);
        let mut seed = vec![2, 9, 0, 40];
        push(&mut seed, 1, &bytes);
        push(&mut seed, 5, &[]);
        push(&mut seed, 6, &[3, 0, 0, 0]);
        push(&mut seed, 1, &bytes);
        push(&mut seed, 7, &[4, 0, 8]);
        push(&mut seed, 0, &[0, 1, 2, 0]);
        all.push(seed);
    }
    all
}

fn flash() -> Vec<Vec<u8>> {
    let payload = |step: Vec<u8>| step.get(1..).unwrap_or_default().to_vec();
    let name = payload(request(&Request::WriteSetting(Setting::Name("table 2"))));
    let baud = payload(request(&Request::WriteSetting(Setting::LinkBaud(115_200))));
    let rate = payload(request(&Request::WriteSetting(Setting::SampleRate(1024.0))));
    let input = payload(setting());
    let mut layout = vec![0, 2, 0];
    for one in [&name, &baud, &rate, &input] {
        layout.extend((one.len() as u16).to_le_bytes());
        layout.extend(one);
    }
    let mut first = layout.clone();
    first[1] = 1;
    let mut pages = vec![1];
    for one in [&name, &baud, &rate, &input] {
        push(&mut pages, 2, one);
        push(&mut pages, 7, &[]);
        push(&mut pages, 6, &[30, 0, 0]);
    }
    let mut spoilt = pages.clone();
    push(&mut spoilt, 1, &[40, 0, 3]);
    push(&mut spoilt, 6, &[10, 0, 5]);
    push(&mut spoilt, 0, &[0, 0, 0, 0, 0, 0]);
    vec![layout, first, pages, spoilt]
}

fn client() -> Vec<Vec<u8>> {
    let reply = |reply: Reply<'_>| (0, message(&FromBox::Reply(reply)));
    let event = |event: Event<'_>| (3, message(&FromBox::Event(event)));
    let counts: Vec<i32> = (0..300).map(|i| (i * 7919) % 4001 - 2000).collect();
    let recorded = |first: u64, values: &[i32]| {
        event(Event::Recorded(Samples {
            first,
            channels: 3,
            values: Values::Counts(Packed::new(values)),
        }))
    };
    let rate = || reply(Reply::Setting(Setting::SampleRate(512.0)));
    let done = || reply(Reply::Done);
    let with = |choice: u8, steps: Vec<(u8, Vec<u8>)>| {
        let mut seed = vec![choice];
        seed.extend(script(steps));
        seed
    };
    let recording = || {
        vec![
            rate(),
            recorded(0, &counts[..150]),
            recorded(50, &counts[..60]),
            recorded(90, &counts),
            event(Event::Fault(Fault {
                kind: FaultKind::Overrun,
                sample: 3,
                part: None,
            })),
            done(),
        ]
    };
    let summary = Summary {
        run: 0,
        pass: Pass::Measure,
        source: Source::Inputs,
        outcome: Outcome::Limit,
        samples: 512,
        missing: 0,
        blocks: 7,
        rejected: 0,
        rejected_by: [0; Health::KINDS],
        health: Health::GOOD,
        overloads: 0,
        sample_rate: None,
        noise: None,
    };
    let tested = vec![
        (2, Vec::new()),
        (2, Vec::new()),
        (2, Vec::new()),
        event(Event::RunEnded(summary)),
        reply(Reply::Summary(summary)),
    ];
    vec![
        with(0x80, vec![]),
        with(0x81, vec![]),
        with(0x82, vec![]),
        with(0x83, vec![reply(Reply::Summary(summary))]),
        with(
            4,
            vec![
                done(),
                reply(Reply::Progress(Progress {
                    next: 40,
                    missing: 0,
                })),
                (6, vec![]),
                reply(Reply::Error(Refused {
                    request: 0x21,
                    problem: Problem::Gap {
                        found: 90,
                        expected: 60,
                    },
                })),
            ],
        ),
        with(5, recording()),
        with(6, recording()),
        with(0x85, vec![]),
        with(0x86, vec![]),
        with(0x87, vec![]),
        with(0x87, tested),
        with(
            0x80,
            vec![(7, vec![0; 4]), (5, vec![0x80, 3, 0]), (4, vec![0, 1])],
        ),
    ]
}

fn recordings() -> Vec<Vec<u8>> {
    let mut plain = "time,a1,fx,ignored\n".to_owned();
    let mut faulty = "# massline recording 1\n# [sample_rate]\n# value = 511.9\n# uncertainty = \
                      0.01\n# clock = \"host\"\n# [channel.a1]\n# serial = \"7\"\na1,fx,health\n"
        .to_owned();
    for row in 0..8 {
        let x = f64::from(row) * 0.37 - 1.0;
        // Writing to a list does not fail.
        let _ = writeln!(plain, "{},{x},{:e},0", f64::from(row) / 512.0, x * 1e-3);
        let words = ["", "missing", "overload+open", "unknown"][row as usize % 4];
        let _ = match words {
            "missing" => writeln!(faulty, ",,{words}"),
            _ => writeln!(faulty, "{x},\"{x}\",{words}"),
        };
    }
    let mut all = Vec::new();
    for text in [&plain, &faulty] {
        for choice in [1, 2, 5, 6] {
            let mut seed = vec![choice];
            seed.extend(text.bytes());
            all.push(seed);
        }
    }
    let comma = "Pr\u{fc}fling;7\nZeit [ms];a1;fx\ns;m/s\u{b2};N\n0,0;1,25;-3\n1,953;0,5;2e-3\n";
    let utf16 = comma.encode_utf16().flat_map(u16::to_le_bytes);
    let stamps = "time,a1,fx\n2026-03-02T12:00:00.5Z,1,2\n2026-03-02T12:00:00.75Z,3,4\n";
    for (choice, file) in [
        (2, comma.as_bytes()),
        (2 | 16 | 32, comma.as_bytes()),
        (2, &[&[0xff, 0xfe], &*utf16.collect::<Vec<u8>>()].concat()),
        (2 | 4, stamps.as_bytes()),
        (2, include_bytes!("../../fixtures/formats/named.uff")),
        (2, include_bytes!("../../fixtures/formats/binary.uff")),
        (2, include_bytes!("../../fixtures/formats/vectors.mat")),
        (2, include_bytes!("../../fixtures/formats/single.mat")),
        (
            2,
            include_bytes!("../../fixtures/formats/testlab-group.mat"),
        ),
        (2, include_bytes!("../../fixtures/formats/struct.mat")),
        (2, include_bytes!("../../fixtures/formats/struct-73.mat")),
        (2, include_bytes!("../../fixtures/formats/vectors.h5")),
        (2, include_bytes!("../../fixtures/formats/tree.h5")),
        (2, include_bytes!("../../fixtures/formats/growing.h5")),
        (2, include_bytes!("../../fixtures/formats/growing-gzip.h5")),
        (2, include_bytes!("../../fixtures/formats/fixed.h5")),
        (2, include_bytes!("../../fixtures/formats/single.h5")),
        (2, include_bytes!("../../fixtures/formats/dense.h5")),
        (2, include_bytes!("../../fixtures/formats/odd.h5")),
        (2, NODES.as_bytes()),
        (2, include_bytes!("../../fixtures/formats/segments.tdms")),
        (2 | 8, include_bytes!("../../fixtures/formats/float.wav")),
        (2 | 8, include_bytes!("../../fixtures/formats/pcm16.wav")),
        (2, include_bytes!("../../fixtures/formats/snappy.parquet")),
        (2, include_bytes!("../../fixtures/formats/zstd-v2.parquet")),
        (2, include_bytes!("../../fixtures/formats/gzip.parquet")),
        (
            2 | 4,
            include_bytes!("../../fixtures/formats/split.parquet"),
        ),
        (
            2 | 4,
            include_bytes!("../../fixtures/formats/counts.parquet"),
        ),
        (2, include_bytes!("../../fixtures/formats/duckdb.parquet")),
    ] {
        all.push([&[choice], file].concat());
    }
    let mut simple = vec![2];
    simple.extend(b"a1,fx\n1,2\n-3.5e2,0.25\n");
    all.push(simple);
    // An empty stream of gzip, from its specification.
    let empty = [
        31, 139, 8, 0, 0, 0, 0, 0, 0, 255, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    ];
    all.push([&[0][..], &empty].concat());
    all
}

pub(crate) const SETUPS: [&str; 4] = [
    include_str!("../seeds/setup.toml"),
    include_str!("../seeds/one-run.toml"),
    include_str!("../seeds/poses.toml"),
    include_str!("../seeds/shorthand.toml"),
];

/// Nodes of datasets 15 and 2411 in units of a dataset 164, and a response.
const NODES: &str = "    -1
   164
         9  own                    2
  1.0000D+03  1.0000D+00  1.0000D+00
  2.7315D+02
    -1
    -1
    15
        12         0         0        11  6.00000E+02 -5.50000E+02  5.00000E+00
    -1
    -1
  2411
        13         1         7        11
   1.0000000000000000D+03   0.0000000000000000D+00  -2.5000000000000000D+02
    -1
    -1
    58
a1
NONE
NONE
run 1
NONE
    4         0    0         0 NONE              12   3 NONE              99   3
         6         2         1  5.00000e-01  5.00000e-01  0.00000e+00
        18    0    0    0 NONE                 Hz
        12    0    0    0 NONE                 NONE
        13    0    0    0 NONE                 N
         0    0    0    0 NONE                 NONE
  1.000000000000E+00 -2.000000000000E+00  3.000000000000E+00  4.000000000000E+00
    -1
";

const INPUTS: &str = include_str!("../seeds/inputs.toml");
