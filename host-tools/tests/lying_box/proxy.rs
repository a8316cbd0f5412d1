//! A sound box whose replies are rewritten on their way to the host.

use massline::device::{HostBox, Port, PortError};
use massline_firmware::wire::{
    BODY_MAX, Event, FRAME_MAX, FromBox, Grid, Identified, LineGrid, Lines, MethodSet, Packed,
    Peaks, Progress, Received, Receiver, Reply, Request, Running, Sender, State, Summary, ToBox,
    ToHost, Weights,
};
use std::time::Duration;

/// A change of replies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tale {
    /// None.
    None,
    /// Every estimate of an answer is this.
    Estimate(f64),
    /// Every standard deviation of an answer is this.
    Deviation(f64),
    /// All that an answer says of its own quality is this.
    Quality(f64),
    /// An answer has come from so many blocks, after so many ticks.
    Blocks(u32, u64),
    /// The identification never ends.
    AtWork,
    /// A run has so many blocks and samples.
    Counts(u32, u64),
    /// A run's true sample rate and noise are this.
    Rate(f64),
    /// A run is always going on, and stands at this sample.
    Running(u64),
    /// All runs that a status can name are stored, and surveyed.
    Stored,
    /// A run is of another number, and has ended at once.
    OtherRun,
    /// The lines of the set-up are so many, this far apart.
    Grid(u32, f64),
    /// Lines are this, and of another run.
    Lines(f32),
    /// There are no lines, peaks or weights where they are asked for.
    Empty,
    /// Peaks and weights are this, and as many as a message takes.
    Many(f64),
    /// All samples before this one were taken.
    Progress(u64),
    /// The box has room for this, of everything.
    Room(u8),
    /// A block has this coherence, and so many were averaged.
    Coherence(f32, u32),
}

/// A port to a box whose replies a tale rewrites.
pub struct Proxy<'b, 'm> {
    pub host_box: &'b mut HostBox<'m>,
    tale: Tale,
    sender: Sender,
    /// `true` once an identification was requested.
    identifying: bool,
}

impl<'b, 'm> Proxy<'b, 'm> {
    pub fn new(host_box: &'b mut HostBox<'m>, tale: Tale) -> Self {
        Self {
            host_box,
            tale,
            sender: Sender::new(78),
            identifying: false,
        }
    }

    /// The frame of a changed message; empty if it is left out.
    fn rewrite(&mut self, id: u16, message: FromBox<'_>) -> Vec<u8> {
        let mut out = [0; FRAME_MAX];
        let (zeros, lines) = ([0.0; 48], [Default::default(); 4]);
        let mut many = zeros;
        if let Tale::Many(value) = self.tale {
            many.fill(value);
        }
        let mut told = lines;
        if let Tale::Lines(value) = self.tale {
            for line in &mut told {
                let massline_firmware::wire::Line { drive, responses } = line;
                *drive = value;
                *responses = [[value; 2]; 12];
            }
        }
        let frame = match message {
            FromBox::Event(event) => {
                let event = self.event(event);
                self.sender.event(&event, &mut out)
            }
            FromBox::Reply(Reply::Identified(_)) if self.tale == Tale::AtWork => return Vec::new(),
            FromBox::Reply(reply) => {
                let reply = match (self.tale, reply) {
                    (Tale::Lines(_), Reply::Lines(found)) => Reply::Lines(Lines {
                        run: found.run + 1,
                        first: found.first,
                        lines: Packed::new(&told[..found.lines.len().min(4)]),
                    }),
                    (Tale::Empty, Reply::Lines(found)) => Reply::Lines(Lines {
                        lines: Packed::new(&[]),
                        ..found
                    }),
                    (Tale::Empty, Reply::Peaks(found)) => Reply::Peaks(Peaks {
                        peaks: Packed::new(&[]),
                        ..found
                    }),
                    (Tale::Empty, Reply::Weights(found)) => Reply::Weights(Weights {
                        weights: Packed::new(&[]),
                        ..found
                    }),
                    (Tale::Many(_), Reply::Peaks(found)) => Reply::Peaks(Peaks {
                        peaks: Packed::new(&many),
                        ..found
                    }),
                    (Tale::Many(_), Reply::Weights(found)) => Reply::Weights(Weights {
                        weights: Packed::new(&many),
                        ..found
                    }),
                    (_, reply) => self.reply(reply),
                };
                self.sender.reply(id, &reply, &mut out)
            }
        };
        frame.unwrap().to_vec()
    }

    fn reply<'a>(&self, reply: Reply<'a>) -> Reply<'a> {
        match (self.tale, reply) {
            (_, Reply::Identified(found)) => Reply::Identified(self.answer(found)),
            (_, Reply::Summary(found)) => Reply::Summary(self.summary(found)),
            (Tale::AtWork, Reply::Status(mut status)) if self.identifying => {
                status.busy = Some(0x40);
                Reply::Status(status)
            }
            (Tale::Running(next), Reply::Status(mut status)) => {
                if let Some(running) = &mut status.running {
                    *running = Running { next, ..*running };
                }
                Reply::Status(status)
            }
            (Tale::OtherRun, Reply::Status(mut status)) => {
                if let Some(running) = &mut status.running {
                    running.run += 1;
                }
                Reply::Status(status)
            }
            (Tale::Stored, Reply::Status(mut status)) => {
                (status.stored, status.surveyed) = (u32::MAX, u32::MAX);
                if status.state == State::Empty {
                    status.state = State::Ready;
                }
                Reply::Status(status)
            }
            (Tale::Grid(count, spacing), Reply::Grid(found)) => Reply::Grid(Grid {
                lines: LineGrid {
                    count: count as usize,
                    spacing,
                    ..found.lines
                },
                band: [u32::MAX, 0],
                ..found
            }),
            (Tale::Progress(next), Reply::Progress(_)) => Reply::Progress(Progress {
                next,
                missing: u64::MAX,
            }),
            (Tale::Room(room), Reply::Info(mut info)) => {
                let wide = if room == 0 { 0 } else { u32::MAX };
                let c = &mut info.capacity;
                (c.channels, c.sensors, c.runs, c.window) = (room, room, room.min(32), room);
                (c.lines, c.methods, c.block_length) = (wide as u16, MethodSet(wide as u16), wide);
                (info.tick_hz, info.clock_hz) = (wide, wide);
                Reply::Info(info)
            }
            (_, reply) => reply,
        }
    }

    fn answer(&self, mut found: Identified) -> Identified {
        let quality = &mut found.answer.quality;
        let findings = &mut found.answer.findings;
        let answer = &mut found.answer.identification;
        let own = [&mut answer.mass, &mut answer.indicator];
        let all = own
            .into_iter()
            .chain(&mut answer.centre_of_gravity)
            .chain(&mut answer.inertia_reference)
            .chain(&mut answer.inertia_cg);
        for estimate in all.flatten() {
            match self.tale {
                Tale::Estimate(value) => estimate.value = value,
                Tale::Deviation(value) => estimate.std = value,
                _ => {}
            }
        }
        match self.tale {
            Tale::Estimate(value) => answer.reference.fill(value),
            Tale::Quality(value) => {
                (answer.condition_number, answer.misfit) = (value, value);
                (answer.attenuation, answer.freedom) = (value, value);
                (answer.consistency, findings.weakest_excitation) = (Some(value), Some(value));
                let p = &mut answer.plausibility;
                let margins = [&mut p.mass, &mut p.positive_definite, &mut p.triangle];
                for margin in margins.into_iter().flatten() {
                    (margin.relative, margin.uncertainty) = (value, value);
                }
            }
            Tale::Blocks(blocks, ticks) => {
                (quality.blocks, quality.rejected) = (blocks, blocks);
                quality.missing = ticks;
                found.ticks = ticks;
            }
            _ => {}
        }
        found
    }

    fn summary(&self, mut found: Summary) -> Summary {
        match self.tale {
            Tale::Counts(blocks, samples) => {
                (found.blocks, found.rejected) = (blocks, blocks);
                (found.samples, found.missing, found.overloads) = (samples, samples, samples);
                found.rejected_by.fill(blocks);
            }
            Tale::Rate(rate) => {
                found.sample_rate = Some(rate);
                found.noise = Some([rate as f32; 12]);
            }
            Tale::OtherRun => found.run = 200,
            _ => {}
        }
        found
    }

    fn event<'a>(&self, event: Event<'a>) -> Event<'a> {
        match (self.tale, event) {
            (Tale::Coherence(value, averaged), Event::Block(mut block)) => {
                block.coherence = Some([value; 12]);
                (block.averaged, block.block, block.ticks) = (averaged, averaged, averaged);
                Event::Block(block)
            }
            (_, Event::RunEnded(summary)) => Event::RunEnded(self.summary(summary)),
            (_, event) => event,
        }
    }
}

impl Port for Proxy<'_, '_> {
    fn name(&self) -> String {
        self.host_box.name()
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), PortError> {
        let mut body = [0; BODY_MAX];
        let mut receiver = Receiver::<ToBox>::new(&mut body);
        let mut rest = frame;
        while let Some(received) = receiver.next(&mut rest) {
            if let Received::Message(_, Request::Identify(_)) = received {
                self.identifying = true;
            }
        }
        self.host_box.send(frame)
    }

    fn receive(&mut self, into: &mut Vec<u8>, timeout: Duration) -> Result<usize, PortError> {
        let mut bytes = Vec::new();
        // It hands over whole frames.
        self.host_box.receive(&mut bytes, timeout)?;
        let mut body = [0; BODY_MAX];
        let mut receiver = Receiver::<ToHost>::new(&mut body);
        let mut rest = &bytes[..];
        let before = into.len();
        while let Some(received) = receiver.next(&mut rest) {
            if let Received::Message(header, message) = received {
                into.extend(self.rewrite(header.request, message));
            }
        }
        Ok(into.len() - before)
    }

    fn patience(&self) -> Duration {
        self.host_box.patience()
    }

    fn seconds(&self) -> f64 {
        self.host_box.seconds()
    }
}
