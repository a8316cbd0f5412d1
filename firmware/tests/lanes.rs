//! Every order in which conversions, ends of frames, interrupts, failures of a bus, stops and starts can
//! come: no sample is lost without being counted, none comes twice, and none is of two conversions.
//!
//! Converters convert their own number, keep two samples and drop the older one for a third. Samples
//! pass the sequencer and the acquisition of the box.

use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};

use massline_firmware::acquisition::{Acquisition, SETTLING};
use massline_firmware::drivers::lanes::{Lane, Lanes, Progress, Step};
use massline_firmware::drivers::{Converter, Fault, Reading, Signal};
use massline_firmware::sampling::acquire;
use massline_firmware::sampling::sequencer::{Edge, Event, Sequencer};

const PERIOD: u64 = 1000;
const LANES: usize = 2;
const STALE: u32 = u32::MAX;

const fn step(converter: u8, first: u8) -> Step {
    Step {
        converter,
        first,
        bytes: 4,
    }
}

/// A converter that keeps two samples, the older one first.
#[derive(Clone, Debug, Default)]
struct Chip {
    kept: Vec<u32>,
}

impl Chip {
    fn convert(&mut self, number: u32) {
        if self.kept.len() == 2 {
            self.kept.remove(0);
        }
        self.kept.push(number);
    }

    fn take(&mut self) -> u32 {
        if self.kept.is_empty() {
            STALE
        } else {
            self.kept.remove(0)
        }
    }
}

fn count(number: u32, counts: &mut [i32]) -> Result<Reading, Fault> {
    if number == STALE {
        return Err(Fault::Stale);
    }
    counts[0] = number as i32;
    Ok(Reading::default())
}

impl Converter for Chip {
    fn channels(&self) -> usize {
        1
    }

    fn choose(&mut self, _: f64, _: &[u8], _: Signal) -> Result<(), Fault> {
        Ok(())
    }

    fn prepare(&mut self) -> Result<(), Fault> {
        self.kept.clear();
        Ok(())
    }

    fn read(&mut self, counts: &mut [i32]) -> Result<Reading, Fault> {
        count(self.take(), counts)
    }

    fn decode(&mut self, received: &[u8], counts: &mut [i32]) -> Result<Reading, Fault> {
        count(u32::from_le_bytes(received.try_into().unwrap()), counts)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Frame {
    Running(Step),
    Ended(Step),
    Failed,
}

/// Lanes whose frames end and fail when a walk says so.
#[derive(Clone, Debug, Default)]
struct Buses {
    frames: [Option<Frame>; LANES],
    received: [[u8; 4]; 4],
}

impl Lanes for Buses {
    fn begin(&mut self, lane: usize, step: Step) -> Progress {
        assert_eq!(self.frames[lane], None, "a frame is begun within another");
        self.frames[lane] = Some(Frame::Running(step));
        Progress::Running
    }

    fn progress(&mut self, lane: usize) -> Progress {
        match self.frames[lane] {
            Some(Frame::Running(_)) => Progress::Running,
            Some(Frame::Failed) => {
                self.frames[lane] = None;
                Progress::Failed
            }
            Some(Frame::Ended(_)) => {
                self.frames[lane] = None;
                Progress::Done
            }
            None => panic!("a lane at rest is asked"),
        }
    }

    fn abort(&mut self, lane: usize) {
        self.frames[lane] = None;
    }

    fn is_edge_noted(&self) -> bool {
        // No edge comes while a sample is handed over.
        false
    }

    fn received(&self, converter: usize) -> &[u8] {
        &self.received[converter]
    }
}

/// An event that can come next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Happening {
    /// All converters convert, and the interrupt of their lines notes the edge.
    Convert,
    /// The sampling task sees the edge.
    Serve,
    /// All bytes of the frame on a lane have come.
    End(usize),
    /// The bus of a lane fails.
    Fail(usize),
    /// The interrupt of a lane is served, whether a frame has ended or not.
    Interrupt(usize),
    Stop,
    Start,
}

#[derive(Clone, Debug)]
struct Walk<const CHIPS: usize> {
    sequencer: Sequencer<LANES>,
    acquisition: Acquisition<CHIPS, CHIPS>,
    chips: [Chip; CHIPS],
    buses: Buses,
    /// Edge that was noted, and that the sampling task has not seen.
    noted: Option<Edge>,
    converted: u32,
    /// Time of the first edge since the start that had a sample.
    first: Option<u64>,
    /// Number of the last sample since the start.
    last: Option<u64>,
    /// Conversions before the start.
    before: u32,
    is_running: bool,
    /// Number of edges that came while another one had not been seen, of failures, and of stops.
    merged: u32,
    failures: u32,
    stops: u32,
    /// Samples with all converters good, and others.
    good: u32,
    bad: u32,
    missed: u32,
    /// Events since the filters settled.
    path: Vec<Happening>,
}

impl<const CHIPS: usize> Walk<CHIPS> {
    fn new(order: [Lane; LANES]) -> Self {
        let mut walk = Self {
            sequencer: Sequencer::new(order),
            acquisition: Acquisition::new(PERIOD as f32),
            chips: core::array::from_fn(|_| Chip::default()),
            buses: Buses::default(),
            noted: None,
            converted: 0,
            first: None,
            last: None,
            before: 0,
            is_running: false,
            merged: 0,
            failures: 0,
            stops: 0,
            good: 0,
            bad: 0,
            missed: 0,
            path: Vec::new(),
        };
        walk.start();
        for _ in 0..=SETTLING {
            walk.act(Happening::Convert);
            walk.act(Happening::Serve);
            while let Some(lane) = walk.buses.frames.iter().position(Option::is_some) {
                walk.act(Happening::End(lane));
                walk.act(Happening::Interrupt(lane));
            }
        }
        assert_eq!(walk.last, Some(SETTLING.into()));
        walk.path.clear();
        walk
    }

    fn start(&mut self) {
        self.sequencer.handle(Event::Stop, &mut self.buses);
        self.acquisition = Acquisition::new(PERIOD as f32);
        let mut chips = self.chips.each_mut().map(|c| -> &mut dyn Converter { c });
        self.acquisition.start(&mut chips, &mut || ()).unwrap();
        self.before = self.converted;
        (self.first, self.last) = (None, None);
        (self.missed, self.is_running) = (0, true);
    }

    /// Events that can come, with so many conversions, failures and stops at the most.
    fn happenings(&self, [conversions, failures, stops]: [u32; 3]) -> Vec<Happening> {
        let mut all = Vec::new();
        if self.converted < conversions {
            all.push(Happening::Convert);
        }
        if self.noted.is_some() {
            all.push(Happening::Serve);
        }
        for (lane, frame) in self.buses.frames.iter().enumerate() {
            if let Some(Frame::Running(_)) = frame {
                all.push(Happening::End(lane));
                if self.failures < failures {
                    all.push(Happening::Fail(lane));
                }
            }
            all.push(Happening::Interrupt(lane));
        }
        match self.is_running {
            true if self.stops < stops => all.push(Happening::Stop),
            false => all.push(Happening::Start),
            true => {}
        }
        all
    }

    fn act(&mut self, happening: Happening) {
        self.path.push(happening);
        match happening {
            Happening::Convert => {
                for chip in &mut self.chips {
                    chip.convert(self.converted);
                }
                let is_merged = self.noted.is_some();
                self.merged += u32::from(is_merged);
                self.noted = Some(Edge {
                    ready: (1 << CHIPS) - 1,
                    at: u64::from(self.converted) * PERIOD,
                    is_merged,
                });
                self.converted += 1;
            }
            Happening::Serve => self.serve(),
            Happening::End(lane) => {
                let Some(Frame::Running(step)) = self.buses.frames[lane] else {
                    unreachable!();
                };
                // The last frame of a converter brings its sample.
                let chip = usize::from(step.converter);
                if step.first == 0 {
                    self.buses.received[chip] = self.chips[chip].take().to_le_bytes();
                }
                self.buses.frames[lane] = Some(Frame::Ended(step));
            }
            Happening::Fail(lane) => {
                self.failures += 1;
                self.buses.frames[lane] = Some(Frame::Failed);
            }
            Happening::Interrupt(lane) => {
                // An edge from before the end of the frame may have cost it its sample.
                self.see_edge();
                let complete = self.sequencer.handle(Event::Lane(lane), &mut self.buses);
                self.hand_over(complete);
                self.serve();
            }
            Happening::Stop => {
                self.sequencer.handle(Event::Stop, &mut self.buses);
                (self.is_running, self.last) = (false, None);
                self.stops += 1;
            }
            Happening::Start => self.start(),
        }
    }

    /// The part of the board's tasks: the newest edge is handled, then the one that waits.
    fn serve(&mut self) {
        self.see_edge();
        let complete = self.sequencer.resume(&mut self.buses);
        self.hand_over(complete);
    }

    fn see_edge(&mut self) {
        if let Some(edge) = self.noted.take()
            && self.is_running
        {
            let complete = self.sequencer.handle(Event::Edge(edge), &mut self.buses);
            self.hand_over(complete);
        }
    }

    fn hand_over(&mut self, is_complete: bool) {
        if !is_complete {
            return;
        }
        let conversion = *self.sequencer.conversion();
        assert!(self.is_running, "a sample comes after the stop");
        let mut chips = self.chips.each_mut().map(|c| -> &mut dyn Converter { c });
        let acquisition = &mut self.acquisition;
        let sample = acquire(
            acquisition,
            &mut chips,
            &mut || (),
            &conversion,
            &self.buses,
            self.sequencer.is_waiting(),
        );
        let sample = sample.expect("all converters are ready at each edge");
        let at = conversion.edge.at;
        let since = at - *self.first.get_or_insert(at);
        assert_eq!(sample.number, since / PERIOD, "another number");
        let passed = self.last.map_or(1, |last| sample.number - last);
        assert!(passed >= 1, "a sample comes twice: {:?}", self.path);
        let mut faulty = 0;
        for (count, health) in sample.counts.iter().zip(sample.health) {
            if health.is_good() {
                assert_eq!(
                    *count as u64,
                    at / PERIOD,
                    "another conversion: {:?}",
                    self.path
                );
            } else {
                faulty += 1;
            }
        }
        let is_settled = sample.number > u64::from(SETTLING);
        self.last = Some(sample.number);
        let missed = self.acquisition.faults().converter_missed;
        let counted = missed - self.missed;
        self.missed = missed;
        assert!(
            u64::from(counted) >= passed - 1,
            "a gap is not counted: {:?}",
            self.path
        );
        if is_settled {
            // A converter's buffer is emptied at the sample after a fault, which is not one more.
            assert!(
                faulty == 0 || missed > 0,
                "a fault is not counted: {:?}",
                self.path
            );
            self.good += u32::from(faulty == 0);
            self.bad += u32::from(faulty > 0);
            let causes = [
                self.merged,
                self.failures,
                self.stops,
                self.sequencer.lost(),
            ];
            let is_clean = causes == [0; 4];
            assert!(
                !is_clean || faulty == 0,
                "a fault without a cause: {:?}",
                self.path
            );
            assert!(
                !is_clean || passed == 1,
                "a gap without a cause: {:?}",
                self.path
            );
        }
    }
}

/// Walks everywhere; the numbers of states, of good samples, and of others.
fn walk_everywhere<const CHIPS: usize>(order: [Lane; LANES], limits: [u32; 3]) -> [u32; 3] {
    let begin = Walk::<CHIPS>::new(order);
    let [conversions, failures, stops] = limits;
    let limits = [begin.converted + conversions, failures, stops];
    let mut seen = HashSet::new();
    let mut found = [0; 3];
    let mut open = vec![begin];
    while let Some(walk) = open.pop() {
        for happening in walk.happenings(limits) {
            let mut next = walk.clone();
            (next.good, next.bad) = (0, 0);
            next.act(happening);
            found[1] += next.good;
            found[2] += next.bad;
            (next.good, next.bad) = (0, 0);
            let mut hasher = DefaultHasher::new();
            let path = std::mem::take(&mut next.path);
            format!("{next:?}").hash(&mut hasher);
            next.path = path;
            if seen.insert(hasher.finish()) {
                found[0] += 1;
                next.check_rest(limits);
                open.push(next);
            }
        }
    }
    found
}

impl<const CHIPS: usize> Walk<CHIPS> {
    /// Where nothing runs and nothing is left to do, the last conversion has had its sample.
    fn check_rest(&self, limits: [u32; 3]) {
        let is_over = self
            .happenings(limits)
            .iter()
            .all(|h| matches!(h, Happening::Interrupt(_) | Happening::Stop));
        let is_at_rest = self.buses.frames.iter().all(Option::is_none);
        if is_over && is_at_rest && self.is_running && self.converted > self.before {
            let last = self
                .first
                .zip(self.last)
                .map(|(first, last)| first / PERIOD + last);
            assert_eq!(last, Some(u64::from(self.converted) - 1), "{:?}", self.path);
        }
    }
}

/// Two lanes with two converters each.
const PAIRS: [Lane; LANES] = [&[step(0, 0), step(1, 0)], &[step(2, 0), step(3, 0)]];
/// Two converters on a lane, and one with two frames on another.
const WITH_ACCELEROMETER: [Lane; LANES] = [&[step(0, 0), step(1, 0)], &[step(2, 0), step(2, 4)]];

/// Conversions, failures of a bus and stops of a walk. After a start the first samples are faulty, while
/// filters settle.
const LIMITS: [[u32; 3]; 3] = [[6, 0, 0], [5, 1, 0], [5, 0, 1]];

fn walk<const CHIPS: usize>(order: [Lane; LANES]) {
    for limits in LIMITS {
        let [states, good, bad] = walk_everywhere::<CHIPS>(order, limits);
        println!("{limits:?}: {states} states, {good} good samples, {bad} others");
        assert!(states > 1000 && good > 30 && bad > 30);
    }
}

#[test]
fn no_order_of_ends_edges_and_stops_loses_doubles_or_mixes_samples() {
    walk::<4>(PAIRS);
}

#[test]
fn nor_does_one_with_a_converter_of_two_frames() {
    walk::<3>(WITH_ACCELEROMETER);
}
