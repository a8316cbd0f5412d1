//! The fork from voltages at the inputs to its ten numbers, and its blocks when something goes wrong.
//!
//! A run lasts four seconds; `MASSLINE_SECONDS=60` makes a minute of it, which takes ten minutes.

use std::cell::RefCell;
use std::env;
use std::rc::Rc;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use massline::device::{Client, ClientMemory};
use massline::rig::{Outfit, Trouble, Upset, Voltages};
use massline::simulate::Simulation;
use massline_chip::SECOND;
use massline_chip::bench::Signal;
use massline_chip::flash::Cells;
use massline_chip::machine::Machine;
use massline_core::masslines::Method;
use massline_firmware::calibration::Certificate;
use massline_firmware::drivers::ads131m08::CLOCK_HZ;
use massline_firmware::models::setup;
use massline_firmware::wire::{
    Accelerations, Event, FaultCounters, Gaps, Health, Outcome, Procedure, Request, Setting,
    Source, Stream, Summary, Values, Weighting,
};

use crate::faults::{CASES, CONVERTER};
use crate::sampling::stream;
use crate::stand_in::bench::Heard;
use crate::stand_in::{self, StandIn, pieces};
use crate::{GOOD, boot, lossless, pass};

/// Seconds of a run.
fn seconds() -> f64 {
    let given = env::var("MASSLINE_SECONDS").ok();
    given.map_or(4.0, |text| text.parse().expect("MASSLINE_SECONDS in s"))
}

/// The fork. The sensors feel more than is measured, since the converters run before the box does.
fn simulated() -> Simulation {
    stand_in::fork(seconds() + 1.0)
}

/// Voltages of all runs, one of which the table is shaken with.
struct Table {
    runs: Vec<Voltages>,
    run: usize,
    /// `true` once the run's recording has begun.
    shakes: bool,
    /// Cycle of the converters' clock.
    now: u64,
}

impl Table {
    /// With the certificates of its sensors, and a signal for a bench.
    fn new(simulation: &Simulation) -> (Arc<Mutex<Self>>, Vec<Certificate>, Signal) {
        let outfit = Outfit::new(&simulation.setup, &simulation.recordings).unwrap();
        let voltages = simulation.recordings.iter();
        let runs = voltages.map(|r| Voltages::new(&outfit, r).unwrap());
        let table = Self {
            runs: runs.collect(),
            run: 0,
            shakes: false,
            now: 0,
        };
        let table = Arc::new(Mutex::new(table));
        let shaken = Arc::clone(&table);
        let signal = move |input, cycle| shaken.lock().unwrap().volts(input, cycle);
        let certificates = outfit.certificates(&simulation.recordings[0]);
        (table, certificates, Box::new(signal))
    }

    fn shake(&mut self, run: usize) {
        (self.run, self.shakes) = (run, false);
    }

    fn volts(&mut self, input: usize, cycle: u64) -> f64 {
        self.now = cycle;
        let voltages = &mut self.runs[self.run];
        if !self.shakes {
            voltages.begin_at(cycle);
            self.shakes = true;
        }
        voltages.at(input, cycle)
    }

    /// Upsets the sensor at an input for some seconds.
    fn upset(&mut self, input: usize, upset: Upset, seconds: f64) {
        let until = self.now + (seconds * f64::from(CLOCK_HZ)) as u64;
        self.runs[self.run].upset(input, upset, until);
    }
}

/// Events of a run.
#[derive(Default)]
struct Run {
    /// Numbers of samples with their counts.
    rows: Vec<(u64, Vec<i32>)>,
    /// Faults of samples on the link.
    faulty: Vec<Health>,
    /// Faults of the run's inputs, whenever they changed.
    health: Vec<Vec<Health>>,
    ended: Option<Summary>,
}

impl Run {
    /// Those that the client hears from now on.
    fn listen(client: &mut Client<'_, &mut Machine>) -> Rc<RefCell<Self>> {
        let heard: Rc<RefCell<Self>> = Rc::default();
        let taken = Rc::clone(&heard);
        client.on_event(move |event, _| taken.borrow_mut().take(event));
        heard
    }

    fn take(&mut self, event: &Event<'_>) {
        match event {
            Event::Recorded(samples) => {
                let Values::Counts24(counts) = samples.values else {
                    panic!("{:?}", samples.values);
                };
                let counts: Vec<i32> = counts.iter().map(|count| count.get()).collect();
                let rows = counts.chunks(samples.channels.into());
                let numbered = (samples.first..).zip(rows.map(<[i32]>::to_vec));
                self.rows.extend(numbered);
            }
            Event::RecordedFaulty(samples) => {
                let all = samples.health.iter();
                self.faulty
                    .push(all.fold(Health::GOOD, |h, x| h.union(Health(x))));
            }
            Event::RunEnded(summary) => self.ended = Some(*summary),
            Event::Health(faulty) => {
                let health = faulty.channels.iter().map(Health);
                self.health.push(health.collect());
            }
            _ => {}
        }
    }
}

/// Tells a box which sensors are at its inputs, and what is to be measured.
fn prepare(client: &mut Client<'_, &mut Machine>, simulation: &Simulation, inputs: &[Certificate]) {
    client.hello().unwrap();
    let rate = simulation.recordings[0].sample_rate.unwrap();
    let rate = Request::WriteSetting(Setting::SampleRate(rate));
    client.tell(&rate).unwrap();
    for (number, input) in (0..).zip(inputs) {
        let setting = Request::WriteSetting(Setting::Input(input.input(number)));
        client.tell(&setting).unwrap();
    }
    let setup = &simulation.setup;
    pieces(
        setup,
        Accelerations::Interface,
        Weighting::Given,
        true,
        &mut |request| {
            client.tell(request).unwrap();
        },
    );
    client.ask(&Request::EndSetup, |_| Some(())).unwrap();
}

#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn the_fork_has_the_bits_of_the_host_from_voltages_to_its_ten_numbers() {
    let simulation = simulated();
    let rate = simulation.recordings[0].sample_rate.unwrap();
    let limit = (seconds() * rate) as u64;
    let (table, inputs, signal) = Table::new(&simulation);
    let mut machine = boot(GOOD, Cells::default(), signal, 11);
    let mut memory = ClientMemory::new();
    let mut client = Client::new(&mut machine, &mut memory);
    let heard = Run::listen(&mut client);
    prepare(&mut client, &simulation, &inputs);
    let mut host = StandIn::new(&inputs);
    host.set_up(&simulation.setup, Accelerations::Interface);

    for run in 0..simulation.setup.runs.len() {
        heard.take();
        table.lock().unwrap().shake(run);
        let start = setup::start(run as u8, Source::Inputs, Gaps::Count, Some(limit));
        // The stream starts the converters, whose filters settle first: the run begins with the first
        // sample of the stream.
        client.tell(&stream(Stream::Counts)).unwrap();
        client.tell(&Request::Start(start)).unwrap();
        while heard.borrow().ended.is_none() {
            client.listen(Duration::from_millis(200)).unwrap();
        }
        client.tell(&stream(Stream::Off)).unwrap();
        let Run {
            rows,
            faulty,
            ended,
            ..
        } = heard.take();
        let summary = ended.expect("the run has ended");
        assert_eq!(faulty, []);
        assert_eq!(summary.outcome, Outcome::Limit);
        let lost = (summary.missing, summary.rejected, summary.health);
        assert_eq!((summary.samples, lost), (limit, (0, 0, Health::GOOD)));
        let first = rows[0].0;
        assert!(rows.len() as u64 >= limit, "{} samples", rows.len());

        // The host's own run on the same counts.
        host.done(&Request::Start(start));
        host.bench.events();
        for (number, (found, counts)) in (first..).zip(&rows).take(limit as usize) {
            assert_eq!(number, *found, "a sample is missing");
            let health = vec![Health::GOOD; counts.len()];
            host.bench.convert(number, counts, &health);
        }
        let ended = host
            .bench
            .events()
            .into_iter()
            .find_map(|event| match event {
                Heard::RunEnded(summary) => Some(summary),
                _ => None,
            });
        // Clocks differ.
        let ended = ended.map(|summary| Summary {
            sample_rate: None,
            ..summary
        });
        let of_box = Summary {
            sample_rate: None,
            ..summary
        };
        assert_eq!(ended, Some(of_box));
    }
    let question = setup::question(Method::ApparentMass, Procedure::Direct, 2);
    let found = client.identify(question).unwrap();
    let of_host = host.bench.identify(question);
    assert_eq!(found.answer, of_host.answer);
    let faults = client.hello().unwrap().faults;
    drop(client);
    lossless(&mut machine);
    assert_eq!(faults, FaultCounters::default());

    let mass = found.answer.identification.mass;
    let mass = mass.expect("the fork's mass is observable");
    let off = mass.value - simulation.truth.mass;
    assert!(off.abs() < 3.0 * mass.std, "{off} ± {}", mass.std);
}

/// An input, of the first converter.
const UPSET: usize = 3;

#[test]
#[ignore = "needs the firmware, run it by `cargo xtask test --only emulator`"]
fn each_of_the_seven_faults_is_named_in_a_run_and_rejects_its_blocks() {
    let simulation = simulated();
    let (table, inputs, signal) = Table::new(&simulation);
    let mut machine = boot(GOOD, Cells::default(), signal, 12);
    let chip = Arc::clone(&machine.shared());
    let mut memory = ClientMemory::new();
    let mut client = Client::new(&mut machine, &mut memory);
    let heard = Run::listen(&mut client);
    prepare(&mut client, &simulation, &inputs);
    let start = setup::start(0, Source::Inputs, Gaps::Count, None);
    client.tell(&Request::Start(start)).unwrap();
    // The filters settle: what comes before is nobody's sample.
    pass(&mut client, SECOND / 20);

    let mut named = Vec::new();
    let upsets = [
        (Upset::Knock, Health::OVERLOAD, 0.01),
        (Upset::Open, Health::OPEN, 1.5),
    ];
    for (upset, health, seconds) in upsets {
        table.lock().unwrap().upset(UPSET, upset, seconds);
        let found = inputs_with(&mut client, &heard, health);
        assert_eq!(found, [UPSET], "{health:?}");
        named.push(health);
    }
    for (name, (cause, health, expected)) in CASES {
        cause(&mut chip.lock().unwrap(), CONVERTER);
        let found = inputs_with(&mut client, &heard, health);
        let expected = expected.start..expected.end.min(inputs.len());
        assert!(
            expected.clone().all(|k| found.contains(&k)),
            "{name}: {found:?}"
        );
        named.push(health);
    }
    // A block, and what its filters look back on, behind the last one.
    pass(&mut client, 3 * SECOND);
    let summary = client.stop().unwrap();
    drop(client);
    lossless(&mut machine);
    assert_eq!(summary.outcome, Outcome::Stopped);
    let mut all: Vec<Health> = Trouble::ALL.iter().map(|trouble| trouble.flag()).collect();
    all.sort_unstable_by_key(|health| health.0);
    named.sort_unstable_by_key(|health| health.0);
    assert_eq!(named, all);
    for health in all {
        let rejected = summary.rejected_by[health.0.trailing_zeros() as usize];
        assert!(rejected > 0, "{health:?}: {summary:?}");
    }
    assert!(summary.overloads > 0);
}

/// Waits until a fault is reported; the inputs that have it first.
fn inputs_with(
    client: &mut Client<'_, &mut Machine>,
    heard: &Rc<RefCell<Run>>,
    health: Health,
) -> Vec<usize> {
    // An open lead is told from an overload after a second.
    for _ in 0..200 {
        pass(client, SECOND / 100);
        let heard = heard.borrow();
        for inputs in &heard.health {
            let with: Vec<usize> = (0..inputs.len())
                .filter(|k| inputs[*k].contains(health))
                .collect();
            if !with.is_empty() {
                return with;
            }
        }
    }
    panic!("{health:?} was not reported");
}
