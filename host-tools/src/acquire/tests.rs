//! Recordings from the box in this program against what its models did.

use super::*;
use crate::box_runs::Wiring;
use crate::device::failing::Failing;
use crate::device::{
    Client, ClientMemory, HostBox, HostBoxMemory, Noise, NoisyLine, Port, PortError,
};
use crate::inputs::InputEntry;
use crate::measure::block_settings;
use crate::on_box::Base;
use crate::on_box::plan::upload;
use crate::recording::Recording;
use crate::rig::{Inputs, Trouble, Troubles};
use crate::setup::Setup;
use crate::simulate::{Model, Options, Stream, simulate};
use massline_firmware::acquisition::SETTLING;
use massline_firmware::drivers::Signal;
use massline_firmware::wire::{
    Event, FaultKind, Gaps, Health, Outcome, Pass, Request, Source, Start, Subscription,
};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;
use std::time::{Duration, Instant};

const RATE: f64 = 512.0;

fn fork(kinds: &[Trouble], seed: u64) -> Inputs {
    Inputs::fork(Troubles {
        kinds: kinds.to_vec(),
        per_minute: 30.0,
        seed,
    })
    .unwrap()
}

/// Some of the fork's inputs, not in their order.
fn chosen(inputs: &Inputs) -> Vec<InputEntry> {
    these(inputs, &[3, 0, 17, 9])
}

fn these(inputs: &Inputs, numbers: &[u8]) -> Vec<InputEntry> {
    let certificates = inputs.certificates();
    let entry = |&input: &u8| InputEntry {
        input,
        channel: Some(inputs.channels()[usize::from(input)].clone()),
        certificate: certificates[usize::from(input)].clone(),
    };
    numbers.iter().map(entry).collect()
}

/// SI and faults of the chosen inputs, by number, for so many seconds.
type Truth = BTreeMap<u64, (Vec<f32>, Vec<Health>)>;

/// The models after the box has started them for the first time, with every sample that the
/// acquisition delivers.
fn truth(inputs: &Inputs, chosen: &[InputEntry], seconds: f64) -> Truth {
    let gains: Vec<u8> = inputs.certificates().iter().map(|c| c.gain()).collect();
    let mut chain = inputs.chain(RATE, &gains, Signal::Pins, 0).unwrap();
    let channel = |e: &InputEntry| e.certificate.channel(RATE as f32);
    let mut channels: Vec<_> = chosen.iter().map(channel).collect();
    let mut truth = Truth::new();
    let mut next = None;
    let end = (seconds * RATE) as u64;
    while next.is_none_or(|next| next < end) {
        chain.step(|sample| {
            // The box keeps those of filters that settle to itself.
            if sample.number <= SETTLING.into() {
                return;
            }
            for missing in next.unwrap_or(sample.number)..sample.number {
                let health = channels.iter_mut().map(|c| c.count(0, Health::MISSING).1);
                truth.insert(missing, (Vec::new(), health.collect()));
            }
            let of =
                |(entry, channel): (&InputEntry, &mut massline_firmware::calibration::Channel)| {
                    let input = usize::from(entry.input);
                    channel.count(sample.counts[input], sample.health[input])
                };
            let row = chosen.iter().zip(&mut channels).map(of).unzip();
            truth.insert(sample.number, row);
            next = Some(sample.number + 1);
        });
    }
    truth
}

#[test]
fn faults_of_the_box_are_told_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let inputs = fork(&[], 1);
    let chosen = chosen(&inputs);
    let faults = vec![
        (60, FaultKind::Overrun, None),
        (70, FaultKind::Overrun, None),
        (80, FaultKind::Converter, Some(2)),
    ];
    let mut own = HostBoxMemory::new();
    let failing = Failing {
        faults,
        ..Failing::new(HostBox::with_inputs(&mut own, 1, inputs))
    };
    let recorded = recorded(failing, &order(&chosen, 20.0, &folder.path().join("x.csv")));
    let counts: Vec<_> = count_faults(&recorded.box_faults).into_iter().collect();
    assert_eq!(counts, [("converter", 1), ("overrun", 2)]);
    let text = fault_text(&recorded.box_faults[2]);
    assert!(text.contains("converter 2 does not answer"), "{text}");
}

/// The request that ends the samples is the third, after the one for the rate and the one that
/// begins them. While it is waited for, samples come without end, as fast as they are computed.
#[test]
fn the_request_that_ends_the_samples_is_sent_again_when_it_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    let inputs = fork(&[], 1);
    let chosen = chosen(&inputs);
    let order = order(&chosen, 5.0, &folder.path().join("x.csv"));
    let mut own = HostBoxMemory::new();
    let line = Failing {
        lost: 3,
        ..Failing::new(HostBox::with_inputs(&mut own, 1, inputs))
    };
    let patience = line.patience();
    let mut memory = ClientMemory::new();
    let mut client = Client::new(line, &mut memory);
    let since = Instant::now();
    let recorded = record(&mut client, &order, &mut |_| true).unwrap();
    assert_eq!(client.link().resent, 1);
    assert_eq!(client.port().sent, 4);
    assert_eq!(recorded.samples, (5.0 * RATE) as u64);
    // One wait, and not the hour that the box's longest work may take; on a busy machine some
    // more than the wait.
    let waited = since.elapsed();
    assert!(waited >= patience && waited < 12 * patience, "{waited:?}");
}

fn order(inputs: &[InputEntry], seconds: f64, file: &Path) -> Order {
    Order {
        inputs: inputs.to_vec(),
        seconds: Some(seconds),
        file: file.to_owned(),
        replace: false,
        firmware: None,
    }
}

fn recorded(port: impl Port, order: &Order) -> Recorded {
    let mut memory = ClientMemory::new();
    let mut client = Client::new(port, &mut memory);
    record(&mut client, order, &mut |_| true).unwrap()
}

/// All rows of a recording: readings and faults.
fn rows(file: &Path, channels: &[String]) -> Vec<(Vec<f32>, Health)> {
    let names: Vec<&str> = channels.iter().map(String::as_str).collect();
    let mut recording = Recording::open(file, &names).unwrap();
    let mut sample = vec![0.0; names.len()];
    let mut rows = Vec::new();
    while recording.next_row(&mut sample).unwrap() {
        rows.push((sample.clone(), recording.health()));
    }
    rows
}

fn all(health: &[Health]) -> Health {
    health.iter().fold(Health::GOOD, |a, b| a.union(*b))
}

#[test]
fn a_recording_holds_what_the_models_did_and_every_fault_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let inputs = fork(&Trouble::ALL, 5);
    let chosen = chosen(&inputs);
    let truth = truth(&inputs, &chosen, 61.0);
    let mut memory = HostBoxMemory::new();
    let order = order(&chosen, 60.0, &folder.path().join("x.csv"));
    let recorded = recorded(HostBox::with_inputs(&mut memory, 1, inputs), &order);
    assert!(matches!(recorded.ending, Ending::Complete));
    assert_eq!((recorded.samples, recorded.lost), (30_720, 0));

    let first = truth.iter().find(|(_, (_, health))| all(health).is_good());
    let first = *first.unwrap().0;
    let rows = rows(&order.file, &recorded.channels);
    assert_eq!(rows.len(), 30_720);
    let (mut faulty, mut missing) = (0, 0);
    for (number, (si, health)) in (first..).zip(&rows) {
        let (true_si, true_health) = &truth[&number];
        assert_eq!(*health, all(true_health), "sample {number}");
        if !health.contains(Health::MISSING) {
            assert_eq!(si, true_si, "sample {number}");
        }
        faulty += u64::from(!health.is_good());
        missing += u64::from(true_health.iter().all(|h| h.contains(Health::MISSING)));
    }
    assert_eq!((recorded.faulty, recorded.missing), (faulty, missing));
    for kind in Trouble::ALL {
        let bit = kind.flag().0.trailing_zeros() as usize;
        let of_kind = rows.iter().filter(|(_, h)| h.contains(kind.flag())).count();
        assert!(of_kind > 0, "{}", kind.name());
        assert_eq!(recorded.by_fault[bit], of_kind as u64, "{}", kind.name());
    }
}

#[test]
fn the_true_rate_is_that_of_the_crystal() {
    let folder = tempfile::tempdir().unwrap();
    for seed in 0..4 {
        let inputs = fork(&[], seed);
        let chosen = chosen(&inputs)[..1].to_vec();
        let mut memory = HostBoxMemory::new();
        let file = folder.path().join(format!("{seed}.csv.gz"));
        let order = order(&chosen, 60.0, &file);
        let recorded = recorded(HostBox::with_inputs(&mut memory, 1, inputs), &order);
        let found = recorded.sample_rate.unwrap();
        let crystal = 20e-6 * Stream::new(seed, &["crystal"]).signed();
        let off = found.value - RATE * (1.0 + crystal);
        // Four standard deviations: by chance once in 16 000.
        assert!(off.abs() < 4.0 * found.uncertainty, "{off} {found:?}");
        // Delays uniform over 2 ms, 2194 messages of 14 samples in a minute: the slope through
        // them scatters by 0.58 ms √(12/2194)/60 s = 0.7e-6. Not more than twice that.
        assert!(found.uncertainty < 1.4e-6 * RATE, "{found:?}");
        // It stands in the recording, with the sensor's serial number.
        let recording = Recording::open(&file, &[]).unwrap();
        let preamble = recording.preamble();
        assert_eq!(preamble.sample_rate.as_ref(), Some(&found));
        assert_eq!(preamble.channel[&recorded.channels[0]].serial, "SIM-a3");
    }
}

#[test]
fn frames_that_are_lost_leave_gaps_and_shift_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let inputs = fork(&[], 2);
    let chosen = chosen(&inputs);
    let truth = truth(&inputs, &chosen, 31.0);
    let mut memory = HostBoxMemory::new();
    let bad = Noise {
        corrupted: 0.02,
        truncated: 0.02,
        duplicated: 0.02,
    };
    let mut line = NoisyLine::new(HostBox::with_inputs(&mut memory, 1, inputs), bad, 7);
    let order = order(&chosen, 30.0, &folder.path().join("x.csv"));
    let recorded = recorded(&mut line, &order);
    assert!(recorded.lost > 20, "{}", recorded.lost);
    let rows = rows(&order.file, &recorded.channels);
    assert_eq!((recorded.samples, rows.len()), (15_360, 15_360));
    // The first sample that came, among the first of all.
    let came = rows.iter().position(|(_, h)| h.is_good()).unwrap();
    let found = (0..100)
        .find(|n| truth.get(n).is_some_and(|row| row.0 == rows[came].0))
        .unwrap();
    let first = found - came as u64;
    let mut missing = 0;
    for (number, (si, health)) in (first..).zip(&rows) {
        if health.contains(Health::MISSING) {
            assert_eq!(*health, Health::MISSING);
            missing += 1;
        } else {
            assert_eq!((si, *health), (&truth[&number].0, Health::GOOD), "{number}");
        }
    }
    assert_eq!(recorded.missing, missing);
    // Fourteen samples of 19 inputs a frame, of the frames that were lost before the end; the
    // first row may lie within one.
    assert!(
        (missing - came as u64).is_multiple_of(14),
        "{missing} {came}"
    );
    assert!(
        missing <= 14 * recorded.lost && missing > 14 * 20,
        "{missing}"
    );
}

#[test]
fn a_recording_that_is_stopped_is_one_and_none_is_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let inputs = fork(&[], 1);
    let chosen = chosen(&inputs);
    let mut own = HostBoxMemory::new();
    let mut memory = ClientMemory::new();
    let mut client = Client::new(HostBox::with_inputs(&mut own, 1, inputs), &mut memory);
    let mut order = order(&chosen, 1.0, &folder.path().join("new/x.csv"));
    order.seconds = None;
    let stopped = record(&mut client, &order, &mut |p| p.seconds < 2.0).unwrap();
    assert!(matches!(stopped.ending, Ending::Stopped));
    let count = rows(&order.file, &stopped.channels).len() as u64;
    assert!(count == stopped.samples && count > 1024, "{count}");
    let files = std::fs::read_dir(folder.path().join("new")).unwrap();
    assert_eq!(files.count(), 1, "nothing is left beside it");
    let again = record(&mut client, &order, &mut |_| true).unwrap_err();
    assert!(again.to_string().contains("--force"), "{again}");
    order.replace = true;
    order.seconds = Some(0.5);
    // The converters were stopped and start anew.
    let second = record(&mut client, &order, &mut |_| true).unwrap();
    assert_eq!((second.samples, second.faulty), (256, 0));
    assert_eq!(
        free_name(&folder.path().join("new")).file_name().unwrap(),
        "recording-1.csv"
    );
}

/// A port whose plug is drawn after some receives.
struct Drawn<P> {
    port: P,
    receives: u32,
}

impl<P: Port> Port for Drawn<P> {
    fn name(&self) -> String {
        self.port.name()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.port.send(bytes)
    }

    fn receive(&mut self, into: &mut Vec<u8>, timeout: Duration) -> Result<usize, PortError> {
        self.receives = self.receives.checked_sub(1).ok_or(PortError::Gone {
            name: self.name(),
            reason: "drawn".to_owned(),
        })?;
        self.port.receive(into, timeout)
    }

    crate::device::port::ask_within!(self, self.port);
}

#[test]
fn what_came_before_the_plug_was_drawn_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    for (receives, some) in [(200, true), (2, false)] {
        let inputs = fork(&[], 1);
        let chosen = chosen(&inputs);
        let file = folder.path().join(format!("{receives}.csv"));
        let order = order(&chosen, 60.0, &file);
        let mut own = HostBoxMemory::new();
        let mut memory = ClientMemory::new();
        let port = HostBox::with_inputs(&mut own, 1, inputs);
        let mut client = Client::new(Drawn { port, receives }, &mut memory);
        let found = record(&mut client, &order, &mut |_| true);
        if some {
            let recorded = found.unwrap();
            assert!(matches!(
                recorded.ending,
                Ending::Failed(AcquireError::Client(_))
            ));
            let rows = rows(&file, &recorded.channels);
            assert!(rows.len() as u64 == recorded.samples && rows.len() > 1000);
        } else {
            // It was gone before the first sample.
            assert!(found.is_err() && !file.exists());
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        }
    }
}

#[test]
fn levels_are_those_of_the_samples() {
    let inputs = fork(&[Trouble::Open], 3);
    // All there are: which lead breaks is chance.
    let chosen = these(&inputs, &std::array::from_fn::<_, 19, _>(|k| k as u8));
    let truth = truth(&inputs, &chosen, 21.0);
    let mut own = HostBoxMemory::new();
    let mut memory = ClientMemory::new();
    let mut client = Client::new(HostBox::with_inputs(&mut own, 1, inputs), &mut memory);
    let mut seen = Vec::new();
    let mut show = |snapshot: &Snapshot| {
        seen.push(snapshot.clone());
        true
    };
    monitor(&mut client, &chosen, 0.5, Some(20.0), &mut show).unwrap();
    assert_eq!(seen.len(), 40);
    let first = truth.iter().find(|(_, (_, health))| all(health).is_good());
    let first = *first.unwrap().0;
    let mut health = Health::GOOD;
    for (k, snapshot) in seen.iter().enumerate() {
        assert_eq!(snapshot.seconds, 0.5 * (k + 1) as f64);
        let rows = truth.range(first + 256 * k as u64..).take(256);
        let rows: Vec<_> = rows.map(|(_, row)| row).collect();
        for (c, level) in snapshot.levels.iter().enumerate() {
            let faults = rows.iter().map(|(_, health)| health[c]);
            assert_eq!(level.health, all(&faults.collect::<Vec<_>>()));
            health = health.union(level.health);
            let usable = Health::OVERLOAD.union(Health::OPEN);
            let good = rows.iter().filter(|(_, health)| usable.contains(health[c]));
            let x: Vec<f64> = good.map(|(si, _)| f64::from(si[c])).collect();
            let n = x.len() as f64;
            let mean = x.iter().sum::<f64>() / n;
            let rms = (x.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n).sqrt();
            let peak = x.iter().fold(0.0_f64, |p, x| p.max(x.abs()));
            assert_eq!((level.samples, level.peak), (x.len() as u64, peak));
            // Both are sums of 256 terms in f64, in another order.
            let near = |a: f64, b: f64| (a - b).abs() <= 1e-12 * peak;
            assert!(
                near(level.mean, mean) && near(level.rms(), rms),
                "{level:?}"
            );
        }
    }
    assert!(health.contains(Health::OPEN));
}

/// The box's summary of a run from its own inputs equals the one computed here from its samples.
#[test]
fn a_run_from_the_inputs_counts_what_was_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let mut model = Model::fork().unwrap();
    model.runs.truncate(1);
    let options = Options {
        duration: Some(40.0),
        ..Options::default()
    };
    let simulation = simulate(&model, &options, &mut |_| ()).unwrap();
    let setup = Setup::read(&simulation.write(folder.path()).unwrap()).unwrap();
    let troubles = Troubles {
        kinds: vec![Trouble::Overload, Trouble::Missed, Trouble::Checksum],
        per_minute: 15.0,
        seed: 11,
    };
    let inputs = Inputs::new(&simulation.setup, &simulation.recordings[0], troubles).unwrap();
    let all = these(&inputs, &std::array::from_fn::<_, 19, _>(|k| k as u8));
    let mut own = HostBoxMemory::new();
    let mut memory = ClientMemory::new();
    let mut client = Client::new(HostBox::with_inputs(&mut own, 1, inputs), &mut memory);
    let settings = block_settings(&setup).unwrap().unwrap();
    let wiring = Wiring::new(&setup, &all).unwrap();
    upload(&mut client, &setup, &settings, Base::Interface, &wiring, 1).unwrap();

    let seen = Rc::new(RefCell::new((Intake::new(&all, RATE), Vec::new(), None)));
    let shared = Rc::clone(&seen);
    client.on_event(move |event, _| {
        let (intake, rows, ended) = &mut *shared.borrow_mut();
        if let Event::RunEnded(summary) = event {
            *ended = Some(*summary);
        }
        let mut take = |row: &Row<'_>| rows.push((row.number, row.all(), row.health.to_vec()));
        intake.take(event, &mut take).unwrap();
    });
    client
        .tell(&Request::Subscribe(Subscription {
            samples: massline_firmware::wire::Stream::Counts,
            ..Subscription::default()
        }))
        .unwrap();
    let limit = 60 * 512;
    client
        .tell(&Request::Start(Start {
            run: 0,
            pass: Pass::Measure,
            source: Source::Inputs,
            gaps: Gaps::Count,
            limit: Some(limit),
        }))
        .unwrap();
    while seen.borrow().2.is_none() {
        client.listen(Duration::from_millis(10)).unwrap();
    }
    client
        .tell(&Request::Subscribe(Subscription::default()))
        .unwrap();
    client.on_event(|_, _| ());
    let (_, rows, summary) = &*seen.borrow();
    let summary = summary.unwrap();
    assert_eq!(
        (summary.samples + summary.missing, summary.outcome),
        (limit, Outcome::Limit)
    );
    assert!(summary.rejected > 5 && summary.blocks > 5, "{summary:?}");
    // The run began with the first sample of all, which was not settled yet; what is missing
    // in it never came here either.
    let first = rows[0].0 - rows[0].0.min(16);
    let of_run = rows
        .iter()
        .take_while(|(number, ..)| *number < first + limit);
    let lost = |health: &[Health]| health.iter().all(|h| *h == Health::MISSING);
    let never = of_run.clone().filter(|(_, _, health)| lost(health)).count() as u64;
    assert!(
        summary.missing > 0 && summary.missing <= never,
        "{never} {summary:?}"
    );
    let came = of_run.filter(|(_, all, _)| !all.contains(Health::MISSING));
    let overloads = came.filter(|(_, all, _)| all.contains(Health::OVERLOAD));
    // Of samples that are missing the box takes no faults down.
    let found = overloads.count() as u64;
    assert!(
        summary.overloads == found && found > 0,
        "{found} {summary:?}"
    );
    let crystal = 20e-6 * Stream::new(11, &["crystal"]).signed();
    // Converters that are restarted leave their grid by half a period at the most.
    let off = summary.sample_rate.unwrap() / (RATE * (1.0 + crystal)) - 1.0;
    assert!(off.abs() < 0.5 / limit as f64, "{off:e}");
}
