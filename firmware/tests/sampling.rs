//! The sampling task on modelled converters: commands in, samples out.

use core::cell::RefCell;
use core::convert::Infallible;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{ErrorType, OutputPin};
use embedded_hal::spi::{self, Operation, SpiDevice};
use heapless::spsc::Consumer;
use massline_firmware::acquisition::SETTLING;
use massline_firmware::calibration::Preset;
use massline_firmware::drivers;
use massline_firmware::drivers::ads131m08::CLOCK_HZ;
use massline_firmware::drivers::lanes::{BusClock, ByDrivers, Lanes, Progress, Step};
use massline_firmware::models::BusError;
use massline_firmware::models::adxl355::Chip as Adxl;
use massline_firmware::models::lanes::Model;
use massline_firmware::models::pattern;
use massline_firmware::models::rig::{self, Garble, Port, Rig};
use massline_firmware::sampling::sequencer::Edge;
use massline_firmware::sampling::{
    CHIPS, CONVERTERS, Command, Commands, Converters, Counters, INPUTS, Outcome, Plan, Queues,
    REQUESTS, RawFrame, Sampler, WAITING, problem,
};
use massline_firmware::settings::Settings;
use massline_firmware::wire::{
    Conditions, ConverterFault, FaultCounters, Field, Health, Problem, Setting,
};

type Signal = fn(usize, u64) -> f64;
type Chips = RefCell<Rig<Signal, CONVERTERS>>;

/// An input of each converter.
const EACH: [u8; 5] = [0, 8, 16, 24, 32];

const PINS: Conditions = Conditions {
    signal: drivers::Signal::Pins,
    bus: BusClock::Usual,
};

/// Ticks are cycles of the converters' clock.
const TICK_HZ: u32 = CLOCK_HZ;

/// The SYNC line of a rig: a pulse of two microseconds.
struct Sync<'r>(&'r Chips);

impl ErrorType for Sync<'_> {
    type Error = Infallible;
}

impl OutputPin for Sync<'_> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.borrow_mut().pull_sync(16);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

struct NoDelay;

impl DelayNs for NoDelay {
    fn delay_ns(&mut self, _: u32) {}
}

type Ads<'r> = Port<'r, Signal, CONVERTERS>;
type OnRig<'r> = Sampler<'r, Ads<'r>, Follower<'r>, Sync<'r>, NoDelay, OnLanes<'r>>;

/// Who exchanges the frames of samples.
#[derive(Clone, Copy, Debug)]
enum By {
    Drivers,
    Lanes,
}

/// Lanes of either kind.
enum OnLanes<'r> {
    Drivers(ByDrivers, &'r Chips),
    Lanes(Box<Model<Ads<'r>, Follower<'r>, CONVERTERS>>, &'r Chips),
}

impl OnLanes<'_> {
    /// Ends the frame that runs on the first lane that is not at rest; its number.
    fn finish(&mut self) -> Option<usize> {
        let Self::Lanes(model, _) = self else {
            return None;
        };
        let lane = model.running()?;
        model.finish(lane);
        Some(lane)
    }

    fn each(&mut self) -> &mut dyn Lanes {
        match self {
            Self::Drivers(lanes, _) => lanes,
            Self::Lanes(lanes, _) => &mut **lanes,
        }
    }
}

impl Lanes for OnLanes<'_> {
    fn begin(&mut self, lane: usize, step: Step) -> Progress {
        self.each().begin(lane, step)
    }

    fn progress(&mut self, lane: usize) -> Progress {
        self.each().progress(lane)
    }

    fn abort(&mut self, lane: usize) {
        self.each().abort(lane);
    }

    fn is_edge_noted(&self) -> bool {
        match self {
            Self::Drivers(lanes, _) => lanes.is_edge_noted(),
            Self::Lanes(_, rig) => rig.borrow().is_edge_pending(),
        }
    }

    fn watch_edges(&mut self, converters: u32) {
        let (Self::Drivers(_, rig) | Self::Lanes(_, rig)) = self;
        rig.borrow_mut().watch_edges(converters);
    }

    fn received(&self, converter: usize) -> &[u8] {
        match self {
            Self::Drivers(lanes, _) => lanes.received(converter),
            Self::Lanes(lanes, _) => lanes.received(converter),
        }
    }
}

/// Tests that hold whoever exchanges the frames.
macro_rules! tests {
    ($($name:ident)*) => {
        mod frames_by_drivers {
            $(#[test] fn $name() { super::$name(super::By::Drivers); })*
        }
        mod frames_by_lanes {
            $(#[test] fn $name() { super::$name(super::By::Lanes); })*
        }
    };
}

/// The SPI device of the accelerometer.
struct Follower<'r>(&'r RefCell<Adxl>);

impl spi::ErrorType for Follower<'_> {
    type Error = BusError;
}

impl SpiDevice for Follower<'_> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), BusError> {
        self.0.borrow_mut().transaction(operations)
    }
}

/// A box with its converters.
struct Bench {
    by: By,
    rig: Chips,
    adxl: RefCell<Adxl>,
    queues: Queues,
    counters: Counters,
}

/// The tasks of a box.
struct Tasks<'b> {
    rig: &'b Chips,
    adxl: &'b RefCell<Adxl>,
    counters: &'b Counters,
    sampler: OnRig<'b>,
    commands: Commands<'b>,
    frames: Consumer<'b, RawFrame>,
}

impl Bench {
    fn new(by: By) -> Self {
        Self {
            by,
            rig: RefCell::new(Rig::new(volts as Signal, 5)),
            adxl: RefCell::new(Adxl::new()),
            queues: Queues::new(),
            counters: Counters::new(),
        }
    }

    fn tasks(&mut self) -> Tasks<'_> {
        let (rig, adxl, counters) = (&self.rig, &self.adxl, &self.counters);
        let (ends, commands, frames) = self.queues.split();
        let ports = core::array::from_fn(|k| Port::new(rig, k));
        let converters = Converters::new(ports, Follower(adxl), Sync(rig), NoDelay);
        let lanes = match self.by {
            By::Drivers => OnLanes::Drivers(ByDrivers, rig),
            By::Lanes => {
                let ports = core::array::from_fn(|k| Port::new(rig, k));
                OnLanes::Lanes(Box::new(Model::new(ports, Follower(adxl), &REQUESTS)), rig)
            }
        };
        Tasks {
            rig,
            adxl,
            counters,
            sampler: Sampler::new(converters, lanes, ends, counters, TICK_HZ),
            commands,
            frames,
        }
    }
}

impl Tasks<'_> {
    fn start(&mut self, plan: &Plan) -> Result<(), Problem> {
        let (rig, sampler) = (self.rig, &mut self.sampler);
        let poll = || {
            let now = rig.borrow().cycle();
            sampler.poll(now);
        };
        match self.commands.ask(Command::Start(plan.clone()), poll) {
            Some(Outcome::Started(outcome)) => outcome.map_err(problem),
            other => panic!("the sampling task runs at once, and not {other:?}"),
        }
    }

    /// Runs until the next edge. `true` if there is a sample.
    fn edge(&mut self) -> bool {
        let edge = self.rig.borrow_mut().wait();
        let g = [0.1, 0.2, -0.5];
        self.adxl.borrow_mut().convert(g);
        self.sampler.poll(edge.cycle);
        self.sampler.edge(noted(edge)) | self.finish()
    }

    /// Waits for the next edge, and begins with its frames.
    fn note(&mut self) -> rig::Edge {
        let edge = self.rig.borrow_mut().wait();
        self.sampler.edge(noted(edge));
        edge
    }

    /// Ends the frames of a sample. `true` if there is a sample.
    fn end_frames(&mut self) -> bool {
        let mut is_new = false;
        while let Some(lane) = self.sampler.lanes().finish() {
            is_new |= self.sampler.lane(lane);
        }
        is_new
    }

    /// The same, and goes on with the edges that came meanwhile.
    fn finish(&mut self) -> bool {
        let mut is_new = self.end_frames();
        while self.rig.borrow().is_edge_pending() {
            self.note();
            is_new |= self.sampler.resume() | self.end_frames();
        }
        is_new | self.sampler.resume()
    }

    fn edges(&mut self, count: usize) {
        (0..count).for_each(|_| _ = self.edge());
    }

    fn faults(&self) -> FaultCounters {
        let mut faults = FaultCounters::default();
        self.counters.read(&mut faults);
        faults
    }
}

/// An edge as the sampling task sees it.
fn noted(edge: rig::Edge) -> Edge {
    Edge {
        ready: edge.ready,
        at: edge.cycle,
        is_merged: false,
    }
}

/// Number of the first sample after a start that is sent.
const FIRST: u64 = SETTLING as u64 + 1;

/// A constant voltage for each input.
fn volts(input: usize, _: u64) -> f64 {
    1e-3 * (input as f64 - 15.0)
}

/// The count of an input at a gain.
fn count(input: usize, gain: u8) -> i32 {
    match input {
        32 => 25_600,
        33 => 51_200,
        34 => -128_000,
        // Full scale is 1.2 V at 2^23.
        _ => (volts(input, 0) * f64::from(gain) * 8_388_608.0 / 1.2).round() as i32,
    }
}

fn wired(inputs: &[u8]) -> Settings<INPUTS> {
    let mut settings = Settings::DELIVERED;
    for input in inputs {
        // 2 mV/V on 2.5 V: a gain of 128.
        let preset = Preset::bridge(500.0, 2e-3, 2.5).unwrap();
        let input = preset.input(*input, "LC", "K", None, 1e-3);
        settings.set(&Setting::Input(input)).unwrap();
    }
    settings
}

fn plan(settings: &Settings<INPUTS>) -> Plan {
    Plan::new(settings, 512.0, PINS, TICK_HZ).unwrap()
}

fn all_inputs_of_a_sample_come_under_one_number(by: By) {
    let mut bench = Bench::new(by);
    let mut tasks = bench.tasks();
    // One input of each chip at a gain of 128, which more than 9 mV would overdrive.
    tasks.start(&plan(&wired(&[7, 14, 16, 24, 32]))).unwrap();
    (0..FIRST).for_each(|_| assert!(!tasks.edge()));
    for expected in FIRST..200 {
        assert!(tasks.edge());
        let frame = tasks.frames.dequeue().unwrap();
        let health = frame.health();
        let RawFrame { number, counts, .. } = frame;
        assert_eq!(number, expected);
        for input in 0..INPUTS {
            assert_eq!(
                health[input],
                Health::GOOD,
                "input {input}, sample {number}"
            );
            let gain = if [7, 14, 16, 24].contains(&input) {
                128
            } else {
                1
            };
            // The model rounds to the nearest, on the same scale.
            let off = counts[input] - count(input, gain);
            assert!(off.abs() <= 1, "input {input}: {} {off}", counts[input]);
        }
    }
    assert_eq!(tasks.faults(), FaultCounters::default());
}

fn a_missing_chip_is_left_out_unless_it_is_in_use(by: By) {
    let mut bench = Bench::new(by);
    let mut tasks = bench.tasks();
    for chip in [1, 3] {
        tasks.rig.borrow_mut().stick(chip, Some(true));
    }
    tasks.adxl.borrow_mut().stuck = Some(false);
    let two = plan(&wired(&[0, 17]));
    tasks.start(&two).unwrap();
    let mut expected = FIRST;
    while expected < 500 {
        // Converters that are left out have edges, too, at a rate of their own.
        tasks.edge();
        let Some(frame) = tasks.frames.dequeue() else {
            continue;
        };
        let (number, health) = (frame.number, frame.health());
        for inputs in 0..=INPUTS {
            let is_good = health[..inputs].iter().all(|health| health.is_good());
            assert_eq!(frame.is_good(u32::MAX, inputs), is_good, "{inputs} inputs");
            assert!(frame.is_good(two.needed(), inputs), "{inputs} inputs");
        }
        for converters in 0..1 << CHIPS {
            let is_good = converters & 0b1_1010 == 0;
            assert_eq!(frame.is_good(converters, INPUTS), is_good, "{converters}");
        }
        assert_eq!(number, expected);
        expected += 1;
        for (input, health) in health.iter().enumerate() {
            let expected = match input / 8 {
                1 | 3 | 4 => Health::MISSING,
                _ => Health::GOOD,
            };
            assert_eq!(*health, expected, "input {input}, sample {number}");
        }
    }
    assert_eq!(tasks.faults(), FaultCounters::default());
    assert_eq!(tasks.counters.take_failed(), None);

    let needed = tasks.start(&plan(&wired(&[0, 9]))).unwrap_err();
    let stuck = |converter| Problem::Converter {
        converter,
        fault: ConverterFault::Stuck,
    };
    // The first fault is the garbled acknowledgement.
    assert!(
        matches!(needed, Problem::Converter { converter: 1, .. }),
        "{needed:?}"
    );
    assert!(!tasks.edge(), "it has not started");
    (0..4).for_each(|chip| tasks.rig.borrow_mut().stick(chip, Some(false)));
    let none_answers = tasks.start(&plan(&wired(&[]))).unwrap_err();
    assert_eq!(none_answers, stuck(0));
}

fn a_dropped_sample_is_counted_and_missing_in_the_numbers(by: By) {
    const LATE: u64 = 10;
    let mut bench = Bench::new(by);
    let mut tasks = bench.tasks();
    tasks.start(&plan(&wired(&[0]))).unwrap();
    (0..FIRST).for_each(|_| assert!(!tasks.edge()));
    let room = WAITING as u64 - 1;
    for _ in 0..room + LATE {
        assert!(tasks.edge());
    }
    assert_eq!(u64::from(tasks.faults().overrun), LATE);
    for expected in FIRST..FIRST + room {
        assert_eq!(tasks.frames.dequeue().unwrap().number, expected);
    }
    tasks.edge();
    let next = FIRST + room + LATE;
    assert_eq!(tasks.frames.dequeue().unwrap().number, next);
    // One place is not enough after a full queue: gaps take longer than samples.
    (0..room + 1).for_each(|_| assert!(tasks.edge()));
    for expected in next + 1..next + 1 + room {
        let half = tasks.frames.len() >= WAITING / 2;
        let dropped = tasks.faults().overrun;
        assert!(tasks.edge());
        assert_eq!(tasks.faults().overrun - dropped, u32::from(half));
        assert_eq!(tasks.frames.dequeue().unwrap().number, expected);
        if !half {
            break;
        }
    }
    while tasks.frames.dequeue().is_some() {}

    assert!(tasks.commands.send(Command::ClearFaults, || ()));
    tasks.edge();
    assert_eq!(tasks.faults().overrun, 0);
}

fn fault_counters_continue_over_a_new_start(by: By) {
    let mut bench = Bench::new(by);
    let mut tasks = bench.tasks();
    let plan = plan(&wired(&[0]));
    for start in 1..4 {
        tasks.start(&plan).unwrap();
        tasks.edges(10);
        tasks.rig.borrow_mut().garble(0, Garble::Noise);
        tasks.edges(10);
        assert_eq!(tasks.faults().converter_checksum, start);
        while tasks.frames.dequeue().is_some() {}
    }
    tasks.commands.send(Command::Stop, || ());
    tasks.edge();
    assert!(!tasks.edge());
}

fn a_failed_converter_is_reported_once(by: By) {
    let mut bench = Bench::new(by);
    let mut tasks = bench.tasks();
    tasks.start(&plan(&wired(&[0, 8]))).unwrap();
    tasks.edges(10);
    tasks.rig.borrow_mut().stick(1, Some(true));
    let failed: Vec<_> = (0..400)
        .filter_map(|_| {
            tasks.edge();
            tasks.counters.take_failed()
        })
        .collect();
    assert_eq!(failed, [1]);
}

fn converters_without_edges_are_restarted(by: By) {
    let mut bench = Bench::new(by);
    let mut tasks = bench.tasks();
    tasks.start(&plan(&wired(&[0]))).unwrap();
    tasks.edges(10);
    while tasks.frames.dequeue().is_some() {}
    // A second without edges, as with a broken line, then edges again.
    let second = u64::from(TICK_HZ);
    let now = tasks.rig.borrow().cycle();
    tasks.rig.borrow_mut().pass_until(now + second);
    tasks.sampler.poll(now + second);
    let before = tasks.faults();
    tasks.edges(10);
    let numbers: Vec<u64> =
        core::iter::from_fn(|| tasks.frames.dequeue().map(|s| s.number)).collect();
    // 512 samples in the second, and 9 before it; a restart moves the grid by up to one.
    assert!((520..=523).contains(&numbers[0]), "{numbers:?}");
    assert!(numbers.windows(2).all(|w| w[1] == w[0] + 1));
    assert!(tasks.faults().converter_missed > before.converter_missed);
}

#[test]
fn an_edge_from_before_a_restart_does_not_set_the_grid() {
    // Drivers restart the converters before the next edge is seen.
    let mut bench = Bench::new(By::Lanes);
    let mut tasks = bench.tasks();
    tasks.start(&plan(&wired(&EACH))).unwrap();
    tasks.edges(10);
    for turn in 1..20 {
        // The chip samples at a random instant from now on.
        tasks.rig.borrow_mut().reset_chip(1);
        while tasks.faults().converter_reset < turn {
            tasks.edge();
        }
        // It is prepared at an edge of the others, and all are restarted at another one. The box is so
        // late there that an edge waits.
        for _ in 0..3 {
            let is_of_the_others = |edge: rig::Edge| edge.ready & 1 != 0;
            while !is_of_the_others(tasks.note()) {
                tasks.end_frames();
                tasks.sampler.resume();
            }
            tasks.note();
            let late = tasks.rig.borrow().cycle() + 400 * u64::from(turn);
            tasks.rig.borrow_mut().pass_until(late);
            for _ in 0..2 {
                tasks.end_frames();
                tasks.sampler.resume();
            }
        }
        tasks.edges(20);
        assert_eq!(tasks.faults().overrun, 0, "an edge beside the grid");
        let last = core::iter::from_fn(|| tasks.frames.dequeue()).last();
        assert_eq!(last.unwrap().health(), [Health::GOOD; INPUTS]);
    }
}

fn edges_of_a_converter_that_is_left_out_do_not_matter(by: By) {
    let mut bench = Bench::new(by);
    let mut tasks = bench.tasks();
    tasks.start(&plan(&wired(&[0, 16]))).unwrap();
    // A hundred of its edges at any time, before, between and beside those of the others.
    let mut samples = 0_u64;
    for turn in 0..100 {
        tasks.rig.borrow_mut().reset_chip(1 + 2 * (turn % 2));
        (0..7).for_each(|_| samples += u64::from(tasks.edge()));
        while tasks.frames.dequeue().is_some() {}
    }
    assert_eq!(samples, 700 - FIRST);
    assert_eq!(tasks.faults(), FaultCounters::default());
}

/// The bus is so slow that samples come while buffers are emptied.
fn filters_settle_until_all_buffers_are_empty(by: By) {
    // The frames of a sample, 4 of 240 bits on one bus, take up to half of the period.
    for percent in 1..50 {
        let mut bench = Bench::new(by);
        let mut tasks = bench.tasks();
        let hz = 960 * 512 * 100 / percent;
        tasks.rig.borrow_mut().set_bus(hz);
        for _ in 0..5 {
            tasks.start(&plan(&wired(&EACH))).unwrap();
            tasks.edges(30);
            let frames: Vec<_> = core::iter::from_fn(|| tasks.frames.dequeue()).collect();
            let late = frames[0].number - FIRST;
            assert!(late <= u64::from(SETTLING), "{percent} %: {late} samples");
            for frame in &frames {
                let number = frame.number;
                assert_eq!(
                    frame.health(),
                    [Health::GOOD; INPUTS],
                    "{percent} %: {number}"
                );
            }
        }
    }
}

fn a_test_pattern_identifies_each_sample_by_its_counts(by: By) {
    let mut bench = Bench::new(by);
    let mut tasks = bench.tasks();
    tasks.commands.send(Command::TestPattern, || ());
    tasks.start(&plan(&wired(&EACH))).unwrap();
    let mut sample = 0;
    while u64::from(sample) < FIRST {
        assert!(!tasks.sampler.test_pattern(1));
        sample += 1;
    }
    for step in [1, 1, 3, 1, 1, 2, 1, 1, 1] {
        assert!(tasks.sampler.test_pattern(step));
        sample += step;
        let frame = tasks.frames.dequeue().unwrap();
        let health = frame.health();
        let RawFrame { number, counts, .. } = frame;
        assert_eq!(number, u64::from(sample - 1));
        if step == 1 {
            assert_eq!(health, [Health::GOOD; INPUTS]);
            assert_eq!(
                counts,
                core::array::from_fn(|i| pattern::count(sample - 1, i))
            );
        }
    }
    assert_eq!(tasks.faults().converter_missed, 3);
}

#[test]
fn a_rate_that_converters_lack_is_refused_with_its_neighbours() {
    let settings = wired(&[]);
    for (rate, low, high) in [
        (500.0, 256.0, 512.0),
        (1.0, 128.0, 128.0),
        // The converters have these rates, the accelerometer has not.
        (8192.0, 4096.0, 4096.0),
        (16_384.0, 4096.0, 4096.0),
        (1e5, 4096.0, 4096.0),
    ] {
        let expected = Problem::range(Field::SampleRate, 0, rate, [low, high]);
        assert_eq!(Plan::new(&settings, rate, PINS, TICK_HZ), Err(expected));
    }
    let two = Plan::new(&wired(&[3, 33]), 4096.0, PINS, TICK_HZ).unwrap();
    assert_eq!(two.rate, 4096.0);
    assert_eq!((two.used, two.period), (0b1_0001, 1024.0));
    assert_eq!((two.inputs, two.read), (34, 0b1_0001));
    assert_eq!((two.gains[3], two.gains[4]), (128, 1));
    let all = plan(&settings);
    assert_eq!((all.inputs, all.read), (INPUTS, 0b1_1111));
    // The accelerometer has no edges of its own.
    assert_eq!(plan(&wired(&[32])).read, 0b1_1111);
}

#[test]
fn the_fastest_rate_follows_from_the_converters_that_are_read() {
    let self_test = Conditions {
        signal: drivers::Signal::Shorted,
        ..PINS
    };
    for (inputs, conditions, fastest) in [
        (&[0][..], PINS, 16_384.0),
        // A bus each.
        (&[15, 16], PINS, 16_384.0),
        (&[0, 31], PINS, 16_384.0),
        // One bus for two.
        (&[0, 8], PINS, 8192.0),
        (&[0, 16, 24], PINS, 8192.0),
        (&[0, 8, 16, 24], PINS, 8192.0),
        (&[0, 34], PINS, 4096.0),
        (&[34], PINS, 4096.0),
        // All inputs are sampled.
        (&[0], self_test, 4096.0),
    ] {
        let settings = wired(inputs);
        let plan = |rate| Plan::new(&settings, rate, conditions, TICK_HZ);
        assert_eq!(plan(fastest).unwrap().rate, fastest, "{inputs:?}");
        let refused = Problem::range(Field::SampleRate, 0, 2.0 * fastest, [fastest; 2]);
        assert_eq!(plan(2.0 * fastest), Err(refused), "{inputs:?}");
    }
}

tests! {
    all_inputs_of_a_sample_come_under_one_number
    a_missing_chip_is_left_out_unless_it_is_in_use
    a_dropped_sample_is_counted_and_missing_in_the_numbers
    fault_counters_continue_over_a_new_start
    a_failed_converter_is_reported_once
    converters_without_edges_are_restarted
    edges_of_a_converter_that_is_left_out_do_not_matter
    filters_settle_until_all_buffers_are_empty
    a_test_pattern_identifies_each_sample_by_its_counts
}
