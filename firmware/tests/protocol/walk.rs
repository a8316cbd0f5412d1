//! Random walks: for every request in every order the model predicts the outcome, and nothing
//! changes but what the request may change.
//!
//! The short form runs with all tests; `MASSLINE_STEPS=1_000_000` makes it longer.

use crate::bench::{Bench, Heard, INPUTS, MILLISECOND, Said};
use crate::model::{Act, CHANNELS, FIELDS, Going, Model, RATE, RUNS, SENSORS, Verdict, may_change};
use crate::random::{Random, wanted};
use massline_core::identify;
use massline_firmware::calibration::Certificate;
use massline_firmware::instrument::Job;
use massline_firmware::models::setup;
use massline_firmware::wire::*;

/// A request that does more events than these is not bounded by its samples.
const EVENTS_A_SAMPLE: usize = 2;

fn processing(random: &mut Random) -> Processing {
    let (accelerations, weighting) = random.pick(&[
        (Accelerations::Interface, Weighting::Given),
        (Accelerations::All, Weighting::Given),
        (Accelerations::Weighted, Weighting::EachRun),
        (Accelerations::Weighted, Weighting::Joined),
    ]);
    Processing {
        sample_rate: RATE,
        block_length: 64,
        kept_band: [8.0, 100.0],
        averaging_band: [8.0, 60.0],
        mode_band: random.pick(&[None, Some([60.0, 100.0]), Some([60.0, 100.0])]),
        accelerations,
        weighting,
        ..setup::PROCESSING
    }
}

fn sensor(number: usize) -> Sensor<'static> {
    const AXES: [[f64; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    Sensor {
        sensor: number as u8,
        name: "s",
        kind: match number {
            0 | 1 => SensorKind::Accelerometer(Mount::Interface),
            _ => SensorKind::LoadCell(Quantity::Force),
        },
        position: [0.0, 0.0, 0.1 * number as f64],
        direction: AXES[number % 2],
        scale: ScaleSource::Given {
            per_unit: 1.0,
            offset: 0.0,
        },
    }
}

const CARRIED: [u8; CHANNELS] = [0, 1, 2, 3, ChannelRole::Drive.code()];

fn run(number: u8) -> Run<'static> {
    Run {
        channels: &CARRIED,
        ..setup::run(number)
    }
}

/// Numbers that requests borrow.
struct Material {
    counts: Vec<i32>,
    weights: [f64; SENSORS],
    bad_weights: [f64; SENSORS],
    input: Certificate,
    unused: Certificate,
}

impl Material {
    fn new(random: &mut Random) -> Self {
        let unused = Certificate::UNUSED;
        let wired = Input {
            circuit: Circuit::Voltage,
            per_count: 0.25,
            ..unused.input(0)
        };
        Self {
            counts: (0..64 * CHANNELS)
                .map(|_| random.bits() as i16 as i32)
                .collect(),
            weights: [1.0, 0.5, 1.0, 1.0],
            bad_weights: [1.0, -0.5, f64::NAN, 1.0],
            input: Certificate::new(&wired).expect("it is sound"),
            unused,
        }
    }
}

/// Choices of [`draw`] that are made more often where they lead somewhere.
const SETUP: usize = 7;
const STARTS: usize = 30;
const STOP: usize = 48;
const IDENTIFY: usize = 50;

/// The next request. What leads on is asked for more often, so that walks come to all states.
fn draw<'a>(random: &mut Random, m: &'a Material, model: &Model) -> Act<'a> {
    let is_sound = !random.once_in(4);
    let number = random.index(RUNS) as u8;
    let act = |request, is_sound| Act { request, is_sound };
    let has_stored = model.stored.iter().any(Option::is_some);
    let choice = match model.state {
        State::Ready if has_stored && random.once_in(4) => IDENTIFY,
        State::Running if random.once_in(16) => STOP,
        State::SettingUp if random.once_in(2) => SETUP + random.index(STARTS - SETUP),
        _ => random.index(64),
    };
    match choice {
        0 => act(
            random.pick(&[Request::Hello, Request::Status, Request::ForgetFaults]),
            true,
        ),
        1..4 => {
            let test = |signal| {
                Stream::Test(Conditions {
                    signal,
                    ..Conditions::default()
                })
            };
            let subscription = Subscription {
                telemetry: random.index(3) as u16,
                levels: random.index(3) as u16,
                samples: random.pick(&[
                    Stream::Off,
                    Stream::Off,
                    Stream::Readings,
                    Stream::Counts,
                    test(Signal::Shorted),
                    test(Signal::Pins),
                ]),
            };
            act(Request::Subscribe(subscription), true)
        }
        4 => act(
            random.pick(&[
                Request::Reboot,
                Request::Provoke(Provoke::Panic),
                Request::Provoke(Provoke::TestPattern),
                Request::Probe(Probe::Skew),
                Request::Probe(Probe::Converter(0)),
                Request::Probe(Probe::Loop(0)),
            ]),
            true,
        ),
        5 if random.once_in(8) => act(Request::Selftest, true),
        6 if random.once_in(2) => act(Request::ReadAnswer, true),
        5 | 6 => {
            let plan = Plan {
                sensors: if is_sound { SENSORS as u8 } else { 200 },
                runs: RUNS as u8,
                reference_point: [0.0; 3],
                fingerprint: random.bits() as u32,
            };
            act(Request::BeginSetup(plan), is_sound)
        }
        SETUP..10 => {
            let mut p = processing(random);
            if !is_sound {
                p.overlap = random.pick(&[1.0, f64::NAN, -0.5]);
            }
            act(Request::SetProcessing(p), is_sound)
        }
        10..18 => {
            let mut sensor = sensor(random.index(SENSORS));
            if !is_sound {
                match random.index(3) {
                    0 => sensor.sensor = SENSORS as u8,
                    1 => sensor.direction = [0.0; 3],
                    _ => sensor.position[2] = f64::INFINITY,
                }
            }
            act(Request::SetSensor(sensor), is_sound)
        }
        18..24 => {
            let mut run = run(number);
            if !is_sound {
                match random.index(3) {
                    0 => run.run = RUNS as u8,
                    1 => run.channels = &CARRIED[..SENSORS],
                    _ => run.rotation[0] = f64::NAN,
                }
            }
            act(Request::SetRun(run), is_sound)
        }
        24..26 => {
            let weights = Weights {
                run: number,
                weights: Packed::new(if is_sound { &m.weights } else { &m.bad_weights }),
            };
            act(Request::SetWeights(weights), is_sound)
        }
        26..STARTS => act(Request::EndSetup, true),
        STARTS..36 => {
            let same = model.run.filter(|_| random.once_in(2)).map(|run| run.start);
            let start = same.unwrap_or(Start {
                run: random.pick(&[number, number, number, RUNS as u8]),
                pass: random.pick(&[Pass::Measure, Pass::Measure, Pass::Survey]),
                source: random.pick(&[Source::Host, Source::Inputs, Source::Synthetic]),
                gaps: random.pick(&[Gaps::Refuse, Gaps::Count]),
                limit: random.pick(&[None, None, Some(500), Some(0), Some(u64::MAX)]),
            });
            act(Request::Start(start), true)
        }
        36..48 => {
            let next = model.run.or(model.ended).map_or(0, |run| run.next);
            let ahead = random.pick(&[1, 7, 600, 1 << 60, u64::MAX - next]);
            let first = match random.index(8) {
                0 if random.once_in(8) => next.saturating_add(ahead),
                0 => next.saturating_add(random.index(20) as u64),
                1 => next.saturating_sub(random.index(80) as u64),
                _ => next,
            };
            let count = random.pick(&[0, 1, 40, 64]);
            let channels = if is_sound || random.once_in(2) {
                CHANNELS
            } else {
                3
            };
            let samples = Samples {
                first,
                channels: channels as u8,
                values: Values::Counts(Packed::new(&m.counts[..count * CHANNELS])),
            };
            act(Request::Samples(samples), true)
        }
        STOP => act(Request::Stop, true),
        49 if random.once_in(2) => act(Request::Abort, true),
        49 | IDENTIFY => {
            let question = Question {
                method: random.pick(&[Method::ApparentMass, Method::FrequencyResponses]),
                identify: identify::Question::new((!is_sound).then_some(-1.0), Procedure::Direct),
                modes: 0,
                fit_band: None,
                runs: random.pick(&[0, 0, 1, 1 << 9]),
            };
            act(Request::Identify(question), is_sound)
        }
        51 => act(Request::ReadAnswer, true),
        52 => {
            let number = random.index(1 + INPUTS as usize) as u8;
            let key = random.pick(&[SettingKey::Name, SettingKey::Input(number)]);
            let is_there = key == SettingKey::Name || number < INPUTS;
            act(Request::ReadSetting(key), is_there)
        }
        53..58 => {
            let input = random.index(INPUTS as usize) as u8;
            let certificate = match random.once_in(16) {
                true => &m.unused,
                false => &m.input,
            };
            let setting = match random.index(4) {
                0 if is_sound => Setting::Name("table 2"),
                0 => Setting::Name("a name that is much longer than any box should have"),
                1 if is_sound => Setting::LinkBaud(115_200),
                1 => Setting::LinkBaud(300),
                2 if is_sound => Setting::SampleRate(random.pick(&[512.0, 512.0, 1024.0])),
                2 => Setting::SampleRate(f64::NAN),
                _ if is_sound => Setting::Input(certificate.input(input)),
                _ => Setting::Input(Input {
                    per_count: 0.0,
                    ..certificate.input(input)
                }),
            };
            act(Request::WriteSetting(setting), is_sound)
        }
        58 => act(Request::SaveSettings, true),
        59 => act(Request::ResetSettings, true),
        60 => {
            let first = if is_sound { 0 } else { u16::MAX };
            let read = ReadLines {
                run: number,
                first,
                count: 3,
            };
            act(Request::ReadLines(read), is_sound)
        }
        61 => act(Request::ReadSummary(number), true),
        62 => act(Request::ReadPeaks(number), true),
        _ => act(Request::ReadWeights(number), true),
    }
}

/// Properties that can be seen of the box, in the order of [`FIELDS`].
fn look(bench: &mut Bench) -> Vec<String> {
    let status = bench.status();
    let hardware = &bench.hardware;
    let mut seen = vec![
        format!("{:?}", status.state),
        format!("{:?}", status.busy),
        format!("{:?}", status.fingerprint),
        format!("{:?}", status.running),
        format!("{:?}", status.stored),
        format!("{:?}", status.surveyed),
        format!("{:?}", status.answer),
        format!("{:?}", hardware.settings),
        format!("{:?}", hardware.saved),
        format!("{:?}", hardware.converting),
        format!("{:?}", hardware.resets),
        format!("{:?}", hardware.test_patterns),
    ];
    let mut all = |read: fn(u8) -> Request<'static>| {
        let runs = 0..RUNS as u8;
        let said: Vec<Said> = runs.map(|run| bench.ask(&read(run))).collect();
        seen.push(format!("{said:?}"));
    };
    all(Request::ReadWeights);
    all(Request::ReadPeaks);
    all(Request::ReadSummary);
    all(|run| {
        Request::ReadLines(ReadLines {
            run,
            first: 0,
            count: 3,
        })
    });
    seen
}

/// Holds the box against the model.
fn compare(bench: &mut Bench, model: &Model) {
    let mut status = bench.status();
    if let Some(running) = &mut status.running {
        running.blocks = 0;
    }
    assert_eq!(status, model.status());
    assert_eq!(bench.hardware.settings, model.settings);
    assert_eq!(bench.hardware.saved, model.saved);
    assert_eq!(bench.hardware.converting, model.converting);
}

/// Ends the run in the model if the box says that it has ended.
fn hear_of_ends(bench: &mut Bench, model: &mut Model) {
    for event in bench.events() {
        if let Heard::RunEnded(summary) = event {
            assert!(model.is_complete(), "{summary:?}");
            let surveyed = bench.status().surveyed;
            model.end(&summary, surveyed);
        }
    }
    assert!(!model.is_complete());
}

/// Counts of each request, granted and refused.
type Tally = std::collections::BTreeMap<&'static str, [u32; 2]>;

/// Numbers of the converters' samples.
#[derive(Default)]
struct Clock {
    /// The last one.
    converted: u64,
    /// The one that is a run's number zero.
    origin: u64,
}

/// Something that happens between requests: samples, jobs, time.
fn live(
    bench: &mut Bench,
    model: &mut Model,
    job: &mut Option<Job<'static>>,
    clock: &mut Clock,
    random: &mut Random,
) {
    match random.index(4) {
        0 => {
            for _ in 0..random.index(60) {
                clock.converted += if random.once_in(200) { 5 } else { 1 };
                let counts = [(); INPUTS as usize].map(|()| random.bits() as i16 as i32);
                let run = model.run.filter(|run| run.start.source == Source::Inputs);
                if let Some(run) = run {
                    // A run's first sample is the first that comes.
                    if run.next == 0 {
                        clock.origin = clock.converted;
                    }
                    model.advance(clock.converted - clock.origin, 1);
                }
                bench.convert(clock.converted, &counts, &[]);
                hear_of_ends(bench, model);
            }
        }
        1 => {
            for _ in 0..random.index(30) {
                bench.poll();
                let run = model
                    .run
                    .filter(|run| run.start.source == Source::Synthetic);
                if let Some(run) = run {
                    model.advance(run.next, 8);
                }
                hear_of_ends(bench, model);
            }
        }
        2 if job.is_none() => {
            *job = bench.instrument.take_job();
            if job.is_some() {
                let pending = model.pending.as_mut().expect("somebody has asked");
                pending.1 = true;
            }
        }
        _ => {
            if let Some(mut taken) = job.take() {
                taken.run();
                bench.give_back(taken);
                let replies = core::mem::take(&mut bench.host.replies);
                let [(_, said)] = replies.as_slice() else {
                    panic!("{replies:?}");
                };
                model.finish(matches!(said, Said::Identified(_)));
            }
        }
    }
    bench.hardware.ticks += MILLISECOND;
}

fn walk(seed: u64, steps: u64, tally: &mut Tally) {
    let mut random = Random::new(seed);
    let material = Material::new(&mut random);
    let mut bench = Bench::switch_on();
    let mut model = Model::new(&bench.hardware.settings);
    let (mut job, mut clock) = (None, Clock::default());
    for _ in 0..steps {
        if random.once_in(2) {
            live(&mut bench, &mut model, &mut job, &mut clock, &mut random);
            compare(&mut bench, &model);
        }
        let act = draw(&mut random, &material, &model);
        let before = look(&mut bench);
        bench.events();
        let expected = model.expect(&act);
        let id = bench.send(&act.request);
        let replies = core::mem::take(&mut bench.host.replies);
        let said = match replies.as_slice() {
            // Its job has yet to be taken.
            [] => None,
            [(to, said)] if *to == id => Some(said),
            other => panic!("{act:?}: {other:?}"),
        };
        let refused = match said {
            Some(Said::Refused(problem)) => Some(*problem),
            _ => None,
        };
        let name = Request::name(act.request.number()).expect("it is in the table");
        tally.entry(name).or_default()[usize::from(refused.is_some())] += 1;
        match (expected, refused) {
            (Verdict::Granted, None) => {
                model.grant(&act);
                let waits = matches!(act.request, Request::Identify(_) | Request::Selftest);
                assert_eq!(said.is_none(), waits, "{act:?}");
                if let (Request::Stop, Some(Said::Summary(summary))) = (&act.request, said)
                    && model.run.is_some()
                {
                    let surveyed = bench.status().surveyed;
                    model.end(summary, surveyed);
                }
                let samples = match &act.request {
                    Request::Samples(samples) => samples.count().unwrap_or(0),
                    _ => 0,
                };
                let events = bench.host.events.len();
                assert!(
                    events <= 1 + EVENTS_A_SAMPLE * (1 + samples),
                    "{act:?}: {events}"
                );
                if let (Some(Said::Progress(taken)), Some(run)) = (said, model.run) {
                    let Going { next, missing, .. } = run;
                    assert_eq!(*taken, Progress { next, missing });
                }
                hear_of_ends(&mut bench, &mut model);
            }
            (Verdict::Refused, Some(_)) => {}
            (Verdict::Because(why), Some(problem)) if why == problem => {}
            (expected, refused) => panic!("{act:?}: {refused:?}, not {expected:?}; {model:#?}"),
        }
        let after = look(&mut bench);
        let allowed = match refused {
            Some(_) => &[],
            None => may_change(&act.request),
        };
        for (field, (before, after)) in FIELDS.iter().zip(before.iter().zip(&after)) {
            assert!(
                before == after || allowed.contains(field),
                "{act:?} ({refused:?}) has changed {field}: {before} to {after}"
            );
        }
        compare(&mut bench, &model);
        if act.request == Request::SaveSettings && refused.is_none() {
            assert_eq!(model.saved, model.settings, "what is confirmed survives");
        }
    }
}

#[test]
fn random_walks_find_the_box_as_the_model_has_it() {
    let steps = wanted("MASSLINE_STEPS", 40_000);
    let mut tally = Tally::new();
    const WALKS: u64 = 20;
    for seed in 0..WALKS {
        walk(seed, steps / WALKS, &mut tally);
    }
    println!("{tally:#?}");
    // Walks that come by every request, granted and refused, have seen all states.
    let always = [
        "Hello",
        "Status",
        "ForgetFaults",
        "Reboot",
        "Subscribe",
        "Abort",
    ];
    for (name, [granted, refused]) in &tally {
        assert!(*granted > 0, "{name} was never granted");
        assert!(
            *refused > 0 || always.contains(name),
            "{name} was never refused"
        );
    }
    // All but the sign of life.
    assert_eq!(tally.len(), Request::TABLE.len() - 1);
}
