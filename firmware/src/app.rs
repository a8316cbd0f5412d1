//! The application: the instrument with its services and the ends of its queues, behind one lock.
//!
//! The tasks of requests, of blocks and of identification take the lock for one message, one block
//! or one job at a time. The link's interrupt and sampling never wait for the lock: they use
//! queues.

use heapless::spsc::Consumer;
use massline_firmware::instrument::{Identity, Instrument, Job, Memory, RawSample, Transmit};
use massline_firmware::link::{self, Rx, Tx};
use massline_firmware::sampling::{INPUTS, RawFrame};
use massline_firmware::wire::{
    ClockSource, FaultKind, Received, Refused, Reply, ResetReason, Storage,
};

use crate::board::clocks::{Clock, Source};
use crate::board::port::BitRate;
use crate::board::{self, ticks};
use crate::services::{COUNTERS, Services};

/// Most samples that are processed in a row, and before each message: more than come while a message is
/// processed, and few enough that a box which is too slow for its samples can still be stopped.
const SAMPLES_FIRST: usize = 8;

/// The instrument, its services and the ends of its queues.
pub struct App {
    instrument: Instrument<'static>,
    services: Services,
    frames: Consumer<'static, RawFrame>,
    receive: Rx<'static>,
    transmit: Tx<'static>,
    link_rate: BitRate,
}

impl App {
    /// Starts the application in `place`.
    #[inline(never)] // On the stack until it has its place, and not beside what else starts.
    pub fn start(
        place: &'static mut Option<Self>,
        memory: Memory<'static>,
        identity: Identity<'static>,
        services: Services,
        frames: Consumer<'static, RawFrame>,
        (receive, transmit, link_rate): (Rx<'static>, Tx<'static>, BitRate),
    ) -> &'static mut Self {
        place.insert(Self {
            instrument: Instrument::new(memory, identity),
            services,
            frames,
            receive,
            transmit,
            link_rate,
        })
    }

    /// Serves one message from the host. `true` if there may be more.
    ///
    /// Samples come first, so that no traffic keeps them waiting. Without room for a reply all
    /// messages stay in the queue; the port calls the task again when it has sent something.
    pub fn serve_request(&mut self) -> bool {
        if self.services.is_ending() {
            if self.transmit.is_empty() {
                self.services.end();
            }
            return false;
        }
        self.transmit.reserve(self.receive.is_waiting());
        self.take_samples();
        if !self.transmit.has_room() {
            return false;
        }
        let Self {
            instrument,
            services,
            receive,
            transmit,
            link_rate,
            ..
        } = self;
        let is_taken = receive.take(|received| match received {
            Received::Message(header, request) => {
                instrument.request(header.request, &request, services, transmit);
            }
            Received::Refused(header, refusal) => transmit.reply(
                header.request,
                &Reply::Error(Refused::because(&header, refusal)),
            ),
        });
        transmit.reserve(receive.is_waiting());
        link_rate.update(ticks::now(), receive.counters().frames, receive.bytes());
        services.note_link(receive, transmit.dropped());
        is_taken
    }

    /// Does the work that is due without a request: some samples, or a block. `true` if there is more.
    pub fn poll(&mut self) -> bool {
        let is_more = self.take_samples();
        let Self {
            instrument,
            services,
            transmit,
            ..
        } = self;
        if let Some(converter) = COUNTERS.take_failed() {
            instrument.fault(FaultKind::Converter, Some(converter), services, transmit);
        }
        instrument.poll(services, transmit) || is_more
    }

    /// Processes some samples of the inputs. `true` if there may be more.
    fn take_samples(&mut self) -> bool {
        (0..SAMPLES_FIRST).all(|_| self.take_sample())
    }

    /// Processes one sample of the inputs. `true` if there was one.
    #[inline(never)]
    fn take_sample(&mut self) -> bool {
        if self.services.take_stale() {
            while self.frames.dequeue().is_some() {}
        }
        let Some(frame) = self.frames.peek() else {
            return false;
        };
        self.services.note_sample(frame.number);
        let (converters, inputs) = self.services.inputs_in_use();
        // A converter that is left out has a fault in every sample, and its inputs have no role in a run: only
        // who records all inputs has to know.
        let is_good = frame.is_good(converters, inputs)
            && (!self.instrument.is_recording() || frame.is_good(u32::MAX, inputs));
        let faults = (!is_good).then(|| frame.health());
        let faults = faults.as_ref().map_or(&[][..], |faults| faults);
        let sample = RawSample {
            number: frame.number,
            ticks: frame.ticks,
            counts: frame.counts.get(..inputs).unwrap_or(&frame.counts),
            health: faults.get(..inputs).unwrap_or(faults),
        };
        self.instrument
            .sample(&sample, &mut self.services, &mut self.transmit);
        // It was read in place: a copy takes as long as a converter's checksum.
        let _ = self.frames.dequeue();
        true
    }

    /// The job that takes seconds, if there is one.
    pub fn take_job(&mut self) -> Option<Job<'static>> {
        self.instrument.take_job()
    }

    /// Takes a job back and replies; without room for the reply it returns the job.
    pub fn finish(&mut self, job: Job<'static>) -> Option<Job<'static>> {
        if !self.transmit.has_room() {
            return Some(job);
        }
        self.instrument
            .finish(job, &mut self.services, &mut self.transmit);
        None
    }
}

/// Identity of the box.
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
