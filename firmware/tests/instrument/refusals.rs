//! Requests that do not fit are refused with the reason, and change nothing.

use crate::bench::{Bench, Said, start};
use crate::plan::{Pieces, ready, set_up};
use massline_firmware::calibration::Certificate;
use massline_firmware::capacity::{BLOCK_LENGTH, LINES, RUNS, SENSORS};
use massline_firmware::wire::*;

fn range(problem: Problem) -> (Field, u32) {
    match problem {
        Problem::Range { field, index, .. } => (field, index),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_processing_is_refused_by_the_field_that_is_wrong() {
    let mut bench = Bench::switch_on();
    let good = Pieces::new();
    good.send(&mut bench);
    type Change = fn(&mut Processing);
    let wrong: [(Field, Change); 8] = [
        (Field::SampleRate, |p| p.sample_rate = f64::NAN),
        (Field::SampleRate, |p| p.sample_rate = -512.0),
        (Field::BlockLength, |p| p.block_length = 1000),
        (Field::BlockLength, |p| {
            p.block_length = 2 * BLOCK_LENGTH as u32
        }),
        (Field::Overlap, |p| p.overlap = 1.0),
        (Field::KeptBand, |p| p.kept_band = [0.5, 300.0]),
        (Field::AveragingBand, |p| p.averaging_band = [15.0, 1.0]),
        (Field::MinimumWeight, |p| p.minimum_weight = 1.5),
    ];
    for (field, change) in wrong {
        let mut processing = good.processing;
        change(&mut processing);
        let problem = bench.refused(&Request::SetProcessing(processing));
        assert_eq!(range(problem), (field, 0));
    }
    let mut processing = good.processing;
    // Lines are 0.5 Hz apart.
    let found = LINES + 20;
    processing.kept_band = [0.5, 0.5 * found as f64];
    let problem = bench.refused(&Request::SetProcessing(processing));
    let full = Problem::capacity(Item::Line, found, LINES);
    assert_eq!(problem, full);
    processing = good.processing;
    processing.averaging_band = [1.0, 1.4];
    let problem = bench.refused(&Request::SetProcessing(processing));
    assert!(matches!(
        problem,
        Problem::Count {
            item: Item::Line,
            found: 1,
            ..
        }
    ));
    // What came before still holds.
    assert!(matches!(bench.ask(&Request::EndSetup), Said::Grid(_)));
}

#[test]
fn a_sensor_is_refused_by_its_number_and_field() {
    let mut bench = Bench::switch_on();
    let good = Pieces::new();
    good.send(&mut bench);
    type Change = fn(&mut Sensor<'_>);
    let wrong: [(Field, Change); 4] = [
        (Field::Direction, |s| s.direction = [0.0; 3]),
        (Field::Direction, |s| s.direction = [f64::NAN, 0.0, 1.0]),
        (Field::Position, |s| s.position[1] = f64::INFINITY),
        (Field::Scale, |s| {
            s.scale = ScaleSource::Given {
                per_unit: 0.0,
                offset: 0.0,
            };
        }),
    ];
    for (field, change) in wrong {
        let mut sensor = good.sensors[7];
        change(&mut sensor);
        let problem = bench.refused(&Request::SetSensor(sensor));
        assert_eq!(range(problem), (field, 7));
    }
    let sensor = Sensor {
        sensor: 12,
        ..good.sensors[0]
    };
    let none = Problem::index(Item::Sensor, 12, 12);
    assert_eq!(bench.refused(&Request::SetSensor(sensor)), none);
    assert!(matches!(bench.ask(&Request::EndSetup), Said::Grid(_)));
}

#[test]
fn a_run_is_refused_for_what_its_channels_lack() {
    let mut bench = Bench::switch_on();
    let good = Pieces::new();
    good.send(&mut bench);
    let run = good.run(1);
    let drive = ChannelRole::Drive.code();
    let without = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];
    let twice = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 10, drive];
    let unknown = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 40, drive];
    let wrong = [
        (&without[..], Problem::missing(Item::Drive, 1)),
        (&twice, Problem::count(Item::Sensor, 2, 1)),
        (&unknown, Problem::index(Item::Sensor, 40, 12)),
    ];
    for (channels, problem) in wrong {
        assert_eq!(
            bench.refused(&Request::SetRun(Run { channels, ..run })),
            problem
        );
    }
    let excitation = Excitation::Sine;
    assert_eq!(
        bench.refused(&Request::SetRun(Run { excitation, ..run })),
        Problem::Unsupported(Item::Excitation)
    );
    let rotation = [0.0, f64::NAN, 0.0];
    let problem = bench.refused(&Request::SetRun(Run { rotation, ..run }));
    assert_eq!(range(problem), (Field::Rotation, 1));
    assert!(matches!(bench.ask(&Request::EndSetup), Said::Grid(_)));
    // A sensor that no channel carries shows when all is together.
    good.send(&mut bench);
    let channels = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 11, drive];
    bench.done(&Request::SetRun(Run {
        channels: &channels,
        ..run
    }));
    let missing = Problem::missing(Item::Channel, 10);
    assert_eq!(bench.refused(&Request::EndSetup), missing);
}

#[test]
fn a_set_up_ends_only_when_it_is_whole() {
    let mut bench = Bench::switch_on();
    let good = Pieces::new();
    let missing = |item, index| Problem::missing(item, index);
    bench.done(&Request::BeginSetup(good.plan));
    assert_eq!(
        bench.refused(&Request::EndSetup),
        missing(Item::Processing, 0)
    );
    bench.done(&Request::SetProcessing(good.processing));
    for sensor in &good.sensors[..11] {
        bench.done(&Request::SetSensor(*sensor));
    }
    assert_eq!(bench.refused(&Request::EndSetup), missing(Item::Sensor, 11));
    bench.done(&Request::SetSensor(good.sensors[11]));
    assert_eq!(bench.refused(&Request::EndSetup), missing(Item::Run, 0));
    for run in 0..3 {
        bench.done(&Request::SetRun(good.run(run)));
    }
    assert!(matches!(bench.ask(&Request::EndSetup), Said::Grid(_)));
    assert_eq!(bench.status().fingerprint, Some(99));
    let (mut sensors, mut runs) = (good.plan, good.plan);
    sensors.sensors = SENSORS as u8 + 1;
    runs.runs = RUNS as u8 + 1;
    for (too_many, item, limit) in [(sensors, Item::Sensor, SENSORS), (runs, Item::Run, RUNS)] {
        let full = Problem::capacity(item, limit + 1, limit);
        assert_eq!(bench.refused(&Request::BeginSetup(too_many)), full);
    }
    // A set-up that was refused has not thrown the other one away.
    assert_eq!(bench.status().state, State::Ready);
}

#[test]
fn each_request_has_its_state() {
    let mut bench = Bench::switch_on();
    let good = Pieces::new();
    let state = |found, expected| Problem::State { found, expected };
    let begin = Request::Start(start(0, Source::Host, Gaps::Refuse, None));
    assert_eq!(
        bench.refused(&Request::SetSensor(good.sensors[0])),
        state(State::Empty, State::SettingUp)
    );
    assert_eq!(bench.refused(&begin), state(State::Empty, State::Ready));
    set_up(&mut bench);
    bench.done(&begin);
    for request in [Request::BeginSetup(good.plan), Request::Selftest] {
        assert_eq!(bench.refused(&request), state(State::Running, State::Ready));
    }
    let other = Request::Start(start(1, Source::Host, Gaps::Refuse, None));
    assert_eq!(bench.refused(&other), state(State::Running, State::Ready));
    // The very same start is one that was sent twice.
    bench.done(&begin);
    bench.done(&Request::Abort);
    assert_eq!(bench.status().state, State::Ready);
}

#[test]
fn a_run_from_inputs_is_refused_where_nothing_is_wired() {
    let mut bench = ready();
    let unused = Certificate::UNUSED;
    bench.done(&Request::WriteSetting(Setting::Input(unused.input(3))));
    let from_inputs = Request::Start(start(0, Source::Inputs, Gaps::Count, None));
    let missing = Problem::missing(Item::Input, 3);
    assert_eq!(bench.refused(&from_inputs), missing);
    assert_eq!(bench.status().state, State::Ready);
    assert_eq!(bench.hardware.converting, None);
}

#[test]
fn what_samples_are_made_of_stays_while_they_are_recorded() {
    let mut bench = Bench::switch_on();
    let stream = |samples| {
        Request::Subscribe(Subscription {
            samples,
            ..Subscription::default()
        })
    };
    bench.done(&stream(Stream::Readings));
    let before = bench.hardware.settings.clone();
    let unused = Certificate::UNUSED;
    let input = unused.input(2);
    let disturbing = [
        Request::WriteSetting(Setting::Input(input)),
        Request::WriteSetting(Setting::SampleRate(1024.0)),
        Request::ResetSettings,
        Request::SaveSettings,
        Request::Provoke(Provoke::TestPattern),
    ];
    let busy = Problem::Busy(stream(Stream::Off).number());
    for request in &disturbing {
        assert_eq!(bench.refused(request), busy, "{request:?}");
    }
    assert_eq!(bench.hardware.settings, before);
    assert_eq!(bench.hardware.test_patterns, 0);
    assert_eq!(bench.hardware.converting, Some(512.0));
    // A name is no part of a sample.
    bench.done(&Request::WriteSetting(Setting::Name("table 2")));
    bench.done(&stream(Stream::Off));
    for request in &disturbing {
        let said = bench.ask(request);
        assert!(!matches!(said, Said::Refused(_)), "{request:?}: {said:?}");
    }
    // Nor do they change while a run takes samples, wherever these come from.
    set_up(&mut bench);
    bench.start(0, Source::Host, Gaps::Refuse, None);
    for request in &disturbing {
        let problem = bench.refused(request);
        assert!(matches!(problem, Problem::State { .. }), "{problem:?}");
    }
}
