//! The office: the instrument with all that it deals with, behind one lock.
//!
//! The tasks of the desk, of blocks and of identification take turns at it, one message, one
//! block or one job at a time. Neither the link's interrupt nor sampling ever waits for it: they
//! hand over by queues.

use heapless::spsc::Consumer;
use massline_firmware::instrument::{Identity, Instrument, Job, Memory, RawSample, Transmit};
use massline_firmware::sampling::{INPUTS, Shot};
use massline_firmware::wire::{
    ClockSource, FaultKind, Received, Refused, Reply, ResetReason, Storage,
};

use crate::board;
use crate::clocks::{Clock, Source};
use crate::link::{self, Inbox, Post, Rate};
use crate::services::{Services, TALLY};
use crate::ticks;

/// Samples that are dealt with before a message is: what comes while one is dealt with, and
/// more. A box that is too slow for its samples must still be told to stop.
const SAMPLES_FIRST: usize = 8;

/// The instrument and what it deals with.
pub struct Office {
    instrument: Instrument<'static>,
    services: Services,
    shots: Consumer<'static, Shot>,
    inbox: Inbox,
    post: Post,
    rate: Rate,
}

impl Office {
    /// Opens it in `rooms`.
    #[inline(never)] // On the stack until it has its place, and not beside what else starts.
    pub fn open(
        rooms: &'static mut Option<Self>,
        memory: Memory<'static>,
        identity: Identity<'static>,
        services: Services,
        shots: Consumer<'static, Shot>,
        (inbox, post, rate): (Inbox, Post, Rate),
    ) -> &'static mut Self {
        rooms.insert(Self {
            instrument: Instrument::new(memory, identity),
            services,
            shots,
            inbox,
            post,
            rate,
        })
    }

    /// Deals with one message from the host; whether there may be more.
    ///
    /// Samples come first, so that no traffic keeps them waiting. Without room for a reply it
    /// leaves all messages where they are. The port calls the desk again when it has sent
    /// something.
    pub fn attend(&mut self) -> bool {
        if self.services.is_ending() {
            if self.post.is_empty() {
                self.services.end();
            }
            return false;
        }
        self.post.reserve(self.inbox.is_waiting());
        for _ in 0..SAMPLES_FIRST {
            if !self.take_sample() {
                break;
            }
        }
        if !self.post.has_room() {
            return false;
        }
        let Self {
            instrument,
            services,
            inbox,
            post,
            rate,
            ..
        } = self;
        let taken = inbox.take(|received| match received {
            Received::Message(header, request) => {
                instrument.request(header.request, &request, services, post);
            }
            Received::Refused(header, refusal) => post.reply(
                header.request,
                &Reply::Error(Refused::because(&header, refusal)),
            ),
        });
        post.reserve(inbox.is_waiting());
        rate.tend(ticks::now(), inbox);
        services.note_link(inbox.counters(), post.dropped());
        taken
    }

    /// Does what is due without a request, a block at the most; whether there is more.
    pub fn poll(&mut self) -> bool {
        let is_more = self.take_sample();
        let Self {
            instrument,
            services,
            post,
            ..
        } = self;
        if let Some(converter) = TALLY.take_failed() {
            instrument.fault(FaultKind::Converter, Some(converter), services, post);
        }
        instrument.poll(services, post) || is_more
    }

    /// Takes one sample of the inputs; whether there was one.
    #[inline(never)]
    fn take_sample(&mut self) -> bool {
        if self.services.take_stale() {
            while self.shots.dequeue().is_some() {}
        }
        let Some(taken) = self.shots.peek() else {
            return false;
        };
        self.services.note_sample(taken.number);
        let inputs = self.services.inputs_in_use();
        let sample = RawSample {
            number: taken.number,
            ticks: taken.ticks,
            counts: taken.counts.get(..inputs).unwrap_or(&taken.counts),
            health: taken.health.get(..inputs).unwrap_or(&taken.health),
        };
        self.instrument
            .sample(&sample, &mut self.services, &mut self.post);
        // It was looked at where it lay: a copy takes as long as a converter's checksum.
        let _ = self.shots.dequeue();
        true
    }

    /// What takes seconds, if there is any of it.
    pub fn take_job(&mut self) -> Option<Job<'static>> {
        self.instrument.take_job()
    }

    /// Takes it back and answers; without room for the answer, the job stays out.
    pub fn finish(&mut self, job: Job<'static>) -> Option<Job<'static>> {
        if !self.post.has_room() {
            return Some(job);
        }
        self.instrument
            .finish(job, &mut self.services, &mut self.post);
        None
    }
}

/// Who the box is.
pub fn identity(
    clock: &Clock,
    tick_hz: u32,
    build: &'static str,
    reset: ResetReason,
    resets: u32,
    panic: Option<&'static str>,
    storage: Storage,
) -> Identity<'static> {
    Identity {
        firmware: "massline",
        version: env!("CARGO_PKG_VERSION"),
        build,
        chip: "STM32F405",
        serial: board::serial_number(),
        clock: match clock.source {
            Source::CrystalPll => ClockSource::CrystalPll,
            Source::InternalPll => ClockSource::InternalPll,
            Source::Internal => ClockSource::Internal,
        },
        clock_hz: clock.core.raw(),
        tick_hz,
        storage,
        reset,
        resets,
        panic,
        inputs: INPUTS as u8,
        window: link::WINDOW,
    }
}
