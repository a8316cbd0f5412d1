//! The order of frames at a conversion: which converter is read when, and what belongs together.
//!
//! # Design
//!
//! An edge of the DRDY lines begins the first frame of every lane; the end of a frame begins the next
//! one of its lane; with the last one the [`Conversion`] is complete. Its bytes stay in the lanes until
//! [`Sequencer::resume`], so that they are decoded where they were received.
//!
//! A converter keeps two samples. While a conversion is read, one more edge may therefore come: it
//! waits, and is read after this one. With a second one, converters that were not read yet have
//! dropped the sample that is being read, so that the conversion would be mixed from two. It is given
//! up, and the newest edge is reported with all its converters as failed; numbers of samples follow
//! from the edges' times, so that those in between are counted as missing.
//!
//! | event | at rest | while frames run | complete, until it resumes |
//! | --- | --- | --- | --- |
//! | edge | frames begin | waits; a second one ends the conversion | waits; the newest one stays |
//! | lane | ignored | next frame, or complete | ignored |
//! | stop | nothing | frames are broken off | conversion and edge are dropped |

use crate::drivers::lanes::{Lane, Lanes, Progress};

/// An edge of the DRDY lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// Bit k: converter k has a sample.
    pub ready: u32,
    /// Time, ticks.
    pub at: u64,
    /// `true` if there were edges before it that nobody has seen.
    pub is_merged: bool,
}

/// Events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Converters are ready.
    Edge(Edge),
    /// A frame on a lane may have ended, or its bus may have failed.
    Lane(usize),
    /// Nothing is to be read any more.
    Stop,
}

/// A conversion whose frames have ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Conversion {
    /// Its edge.
    pub edge: Edge,
    /// Bit k: all frames of converter k have come.
    pub read: u32,
    /// Bit k: a frame of converter k has failed. Converters in neither set were left to their drivers.
    pub failed: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Rest,
    /// Frames run.
    Reading,
    /// The conversion was handed on, and its bytes are in use.
    Complete,
}

/// Reads conversions over lanes.
#[derive(Clone, Debug)]
pub struct Sequencer<const LANES: usize> {
    order: [Lane; LANES],
    state: State,
    /// The conversion that is read.
    current: Conversion,
    /// The edge that waits.
    next: Option<Edge>,
    /// Place of the frame that runs on each lane.
    running: [Option<usize>; LANES],
    /// Edges whose conversion was not handed on.
    lost: u32,
}

impl<const LANES: usize> Sequencer<LANES> {
    /// A sequencer at rest, with the frames of each lane.
    #[must_use]
    pub const fn new(order: [Lane; LANES]) -> Self {
        let edge = Edge {
            ready: 0,
            at: 0,
            is_merged: false,
        };
        Self {
            order,
            state: State::Rest,
            current: Conversion {
                edge,
                read: 0,
                failed: 0,
            },
            next: None,
            running: [None; LANES],
            lost: 0,
        }
    }

    /// Edges that were seen and whose conversion was neither handed on nor stopped. Samples that
    /// are missing because of it are counted by the numbers of those that follow.
    #[must_use]
    pub const fn lost(&self) -> u32 {
        self.lost
    }

    /// `true` if an edge waits until the conversion before it is done with.
    #[must_use]
    pub const fn is_waiting(&self) -> bool {
        self.next.is_some()
    }

    /// `true` while frames run.
    #[must_use]
    #[inline]
    pub fn is_reading(&self) -> bool {
        self.state == State::Reading
    }

    /// The conversion that is read, or was complete last.
    #[must_use]
    pub const fn conversion(&self) -> &Conversion {
        &self.current
    }

    /// Handles an event. `true` if [`Self::conversion`] is complete with it.
    #[inline]
    pub fn handle(&mut self, event: Event, lanes: &mut impl Lanes) -> bool {
        match (event, self.state) {
            (Event::Lane(lane), State::Reading) => self.advance(lane, lanes),
            (Event::Lane(_), _) => false,
            (Event::Edge(edge), State::Rest) => self.begin(edge, lanes),
            (Event::Edge(edge), _) => self.wait(edge, lanes),
            (Event::Stop, _) => {
                self.abort(lanes);
                self.next = None;
                self.state = State::Rest;
                false
            }
        }
    }

    /// Forgets the edge that waits, if any: the converters were restarted after it.
    pub fn forget_edge(&mut self) {
        let waiting = self.next.take();
        self.lost = self.lost.saturating_add(u32::from(waiting.is_some()));
    }

    /// Ends the use of the last conversion's bytes, and begins with the edge that waits, if any. `true` if
    /// its conversion is complete at once.
    pub fn resume(&mut self, lanes: &mut impl Lanes) -> bool {
        if self.is_reading() {
            return false;
        }
        self.state = State::Rest;
        let next = self.next.take();
        next.is_some_and(|edge| self.begin(edge, lanes))
    }

    /// Begins to read the conversion of an edge. `true` if it is complete at once.
    fn begin(&mut self, edge: Edge, lanes: &mut impl Lanes) -> bool {
        self.state = State::Reading;
        self.current = Conversion {
            edge,
            read: 0,
            failed: 0,
        };
        for lane in 0..LANES {
            self.begin_next(lane, 0, lanes);
        }
        self.completed()
    }

    /// Begins the next frame of a lane, from a place in its order on.
    fn begin_next(&mut self, lane: usize, from: usize, lanes: &mut impl Lanes) {
        let Some((steps, running)) = self.order.get(lane).zip(self.running.get_mut(lane)) else {
            return;
        };
        let mut place = from;
        while let Some(step) = steps.get(place) {
            let wanted = self.current.edge.ready & !self.current.failed;
            if wanted & step.bit() != 0 {
                match lanes.begin(lane, *step) {
                    Progress::Running => {
                        *running = Some(place);
                        return;
                    }
                    Progress::Done => self.current.read |= step.bit(),
                    Progress::Failed => self.current.failed |= step.bit(),
                    Progress::ByDriver => {}
                }
            }
            place = place.saturating_add(1);
        }
    }

    /// Handles an interrupt of a lane. `true` if the conversion is complete.
    fn advance(&mut self, lane: usize, lanes: &mut impl Lanes) -> bool {
        let places = self.running.get_mut(lane).zip(self.order.get(lane));
        let Some((running, steps)) = places else {
            return false;
        };
        let Some((place, step)) = running.and_then(|place| Some((place, steps.get(place)?))) else {
            return false;
        };
        match lanes.progress(lane) {
            // An interrupt of a frame that was broken off.
            Progress::Running => return false,
            Progress::Done | Progress::ByDriver => self.current.read |= step.bit(),
            Progress::Failed => self.current.failed |= step.bit(),
        }
        *running = None;
        self.begin_next(lane, place.saturating_add(1), lanes);
        self.completed()
    }

    /// `true` if no frame of the conversion runs.
    fn completed(&mut self) -> bool {
        if self.running.iter().any(Option::is_some) {
            return false;
        }
        self.state = State::Complete;
        // A converter with several frames has failed with one of them.
        self.current.read &= !self.current.failed;
        true
    }

    /// Keeps an edge that comes before the last one's conversion is done with. `true` if it ends that.
    fn wait(&mut self, edge: Edge, lanes: &mut impl Lanes) -> bool {
        let waiting = self.next.take();
        self.lost = self.lost.saturating_add(u32::from(waiting.is_some()));
        let is_second = waiting.is_some() || edge.is_merged;
        if self.state == State::Complete || !is_second {
            let is_merged = is_second;
            self.next = Some(Edge { is_merged, ..edge });
            return false;
        }
        // The conversion that was being read is lost; the newest edge stands for it.
        self.lost = self.lost.saturating_add(1);
        self.abort(lanes);
        self.current = Conversion {
            edge,
            read: 0,
            failed: edge.ready,
        };
        self.state = State::Complete;
        true
    }

    fn abort(&mut self, lanes: &mut impl Lanes) {
        for lane in 0..LANES {
            if let Some(running) = self.running.get_mut(lane)
                && running.take().is_some()
            {
                lanes.abort(lane);
            }
        }
    }
}
