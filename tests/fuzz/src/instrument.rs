//! Requests to the box, with samples and time in between.

use crate::bench::{Bench, OWN_ID, Sent, Shelf};
use crate::link;
use crate::script::{Bytes, steps};
use massline_firmware::instrument::{Job, RawSample};
use massline_firmware::sampling::INPUTS;
use massline_firmware::wire::{
    Count24, FaultKind, Health, Packed, Progress, Reply, Request, Samples, SettingKey, State,
    Status, Values,
};

/// Most steps of a script.
const STEPS: usize = 200;
/// Most samples of a script.
const SAMPLES: u32 = 6000;
/// Most jobs of a script: each takes milliseconds.
const JOBS: u32 = 2;
/// Most requests of a script before and after which the whole state is read.
const LOOKS: u32 = 20;

/// Runs the target; see the module.
pub fn run(bytes: &[u8]) {
    let mut shelf = Shelf::default();
    let mut talk = Talk {
        bench: Bench::new(&mut shelf),
        job: None,
        pending: None,
        samples: SAMPLES,
        jobs: JOBS,
        looks: LOOKS,
        reached: 0,
        noise: 1,
        id: 0,
    };
    for (step, bytes) in steps(bytes).take(STEPS) {
        talk.step(step, bytes);
    }
    talk.end();
}

struct Talk<'m> {
    bench: Bench<'m>,
    /// A job that has not come back yet.
    job: Option<Job<'m>>,
    /// A request without its final reply.
    pending: Option<u16>,
    samples: u32,
    jobs: u32,
    looks: u32,
    /// Greatest progress of any run; the status repeats that of an ended run.
    reached: u64,
    noise: u32,
    id: u16,
}

impl Talk<'_> {
    fn step(&mut self, step: u8, mut bytes: Bytes<'_>) {
        match step % 8 {
            0..=2 => link::request(bytes.u8(), bytes.0, |request| self.request(request)),
            3 => self.feed(&mut bytes),
            4 => self.convert(&mut bytes),
            5 => {
                self.bench.hardware.ticks += u64::from(bytes.u32());
                let times = bytes.u8();
                self.poll(times.into());
            }
            6 => self.work(bytes.u8()),
            _ => {
                let kind = match bytes.u8() % 5 {
                    0 => FaultKind::Overrun,
                    1 => FaultKind::Converter,
                    2 => FaultKind::Storage,
                    3 => FaultKind::Clock,
                    _ => FaultKind::Stack,
                };
                let Bench {
                    instrument,
                    hardware,
                    out,
                } = &mut self.bench;
                instrument.fault(kind, Some(bytes.u8()), hardware, out);
            }
        }
        self.check_events();
    }

    /// Sends a request of the script.
    fn request(&mut self, request: &Request<'_>) {
        // The last id is that of the bench.
        self.id = (self.id + 1) % OWN_ID;
        let id = self.id.max(1);
        self.check_events();
        let before = self.look();
        let status = self.status();
        self.bench.send(id, request);
        let sent: Vec<Sent> = self.bench.out.sent.drain(..).collect();
        let replies: Vec<&Sent> = sent.iter().filter(|sent| sent.id == id).collect();
        for sent in &sent {
            // No other long request can be ended by a request.
            assert!(sent.id == 0 || sent.id == id, "{sent:?} to {request:?}");
        }
        let reply = match replies.as_slice() {
            [] => {
                let takes_long = matches!(request, Request::Identify(_) | Request::Selftest);
                assert!(
                    takes_long && self.pending.is_none(),
                    "no reply: {request:?}"
                );
                assert_eq!(self.status().busy, Some(request.number()));
                self.pending = Some(id);
                return;
            }
            [reply] => *reply,
            more => panic!("{request:?} has replies {more:?}"),
        };
        reply.read(|reply| match reply {
            Reply::Error(refused) => {
                assert_eq!(refused.request, request.number());
                assert_eq!(self.status(), status, "{request:?}, {refused:?}");
                if before.is_some() {
                    self.looks += 1;
                    assert_eq!(self.look(), before, "{request:?}, {refused:?}");
                }
            }
            Reply::Progress(taken) => {
                self.taken(request, taken);
                self.reached = self.reached.max(taken.next);
            }
            _ => {}
        });
    }

    /// Asserts that the reported progress is no more than was sent.
    fn taken(&self, request: &Request<'_>, taken: &Progress) {
        let Request::Samples(samples) = request else {
            panic!("{request:?} has taken samples: {taken:?}");
        };
        let count = samples.count().unwrap_or(0) as u64;
        let sent = samples.first.saturating_add(count);
        assert!(
            taken.next <= self.reached.max(sent) && taken.missing <= taken.next,
            "{taken:?} after {} and {sent}",
            self.reached
        );
    }

    /// Feeds samples in order from the run's position.
    fn feed(&mut self, bytes: &mut Bytes<'_>) {
        let count = u32::from(bytes.u16()).min(self.samples);
        let channels = bytes.u8().clamp(1, 48);
        let jump = u64::from(bytes.u8() & 7);
        self.samples -= count;
        let mut left = count as usize;
        let next = self.status().running.map_or(0, |run| run.next);
        // A run may be at the last number.
        let mut first = next.saturating_add(jump);
        while left > 0 {
            let fit = Samples::fit(channels, 3).min(left);
            let mut values = Vec::new();
            for _ in 0..fit {
                let common = self.random() >> 16;
                for channel in 0..u32::from(channels) {
                    // Correlated noise, and a part of their own.
                    let own = self.random() >> 24;
                    let value = (common * (1 + channel * 5 % 7)) as i32 - (1 << 18) + own as i32;
                    values.extend(Count24::new(value.clamp(-8_388_608, 8_388_607)));
                }
            }
            self.request(&Request::Samples(Samples {
                first,
                channels,
                values: Values::Counts24(Packed::new(&values)),
            }));
            first = first.saturating_add(fit as u64);
            left -= fit;
        }
    }

    fn random(&mut self) -> u32 {
        self.noise = self
            .noise
            .wrapping_mul(1_664_525)
            .wrapping_add(1_013_904_223);
        self.noise
    }

    /// Feeds samples of the box's own converters.
    fn convert(&mut self, bytes: &mut Bytes<'_>) {
        let count = u32::from(bytes.u16()).min(self.samples);
        self.samples -= count;
        let jump = u64::from(bytes.u8());
        let faulty = usize::from(bytes.u8()) % INPUTS;
        let fault = Health(bytes.u16());
        let scale = bytes.u8() & 15;
        self.bench.hardware.samples += jump;
        for _ in 0..count {
            let mut counts = [0; INPUTS];
            for count in &mut counts {
                *count = (self.random() as i32 >> 8) >> scale;
            }
            let mut health = [Health::GOOD; INPUTS];
            health[faulty] = fault;
            let Bench {
                instrument,
                hardware,
                out,
            } = &mut self.bench;
            hardware.ticks += 1953;
            let sample = RawSample {
                number: hardware.samples,
                ticks: hardware.ticks,
                counts: &counts,
                health: &health,
            };
            hardware.samples += 1;
            instrument.sample(&sample, hardware, out);
        }
    }

    fn poll(&mut self, times: u32) {
        for _ in 0..times {
            // A poll computes up to eight samples.
            if self.samples < 8 {
                return;
            }
            if !self.bench.poll() {
                return;
            }
            self.samples -= 8;
        }
    }

    /// The task of low priority takes the job, runs it, or returns it.
    fn work(&mut self, how: u8) {
        let mut job = self.job.take().or_else(|| self.bench.instrument.take_job());
        if how & 1 == 1
            && self.jobs > 0
            && let Some(job) = &mut job
        {
            self.jobs -= 1;
            job.run();
        }
        if how & 2 == 2 {
            self.job = job;
        } else if let Some(job) = job {
            let Bench {
                instrument,
                hardware,
                out,
            } = &mut self.bench;
            instrument.finish(job, hardware, out);
        }
    }

    /// Checks events and late replies.
    fn check_events(&mut self) {
        let sent: Vec<Sent> = self.bench.out.sent.drain(..).collect();
        for sent in sent.iter().filter(|sent| sent.id != 0) {
            assert_eq!(Some(sent.id), self.pending.take(), "{sent:?}");
        }
        let next = self.status().running.map_or(0, |run| run.next);
        self.reached = self.reached.max(next);
    }

    fn status(&mut self) -> Status {
        let sent = self.bench.request(&Request::Status);
        let mut status = None;
        sent.read(|reply| {
            if let Reply::Status(found) = reply {
                status = Some(*found);
            }
        });
        let status = status.expect("a status is never refused");
        assert_eq!(status.state == State::Running, status.running.is_some());
        status
    }

    /// Reads the whole state, up to [`LOOKS`] times.
    fn look(&mut self) -> Option<Vec<Sent>> {
        self.looks = self.looks.checked_sub(1)?;
        let mut all = vec![self.bench.request(&Request::ReadAnswer)];
        for run in 0..6 {
            all.push(self.bench.request(&Request::ReadSummary(run)));
            all.push(self.bench.request(&Request::ReadWeights(run)));
            all.push(self.bench.request(&Request::ReadPeaks(run)));
        }
        for key in [
            SettingKey::Name,
            SettingKey::LinkBaud,
            SettingKey::SampleRate,
            SettingKey::Input(0),
            SettingKey::Input(INPUTS as u8 - 1),
        ] {
            all.push(self.bench.request(&Request::ReadSetting(key)));
        }
        Some(all)
    }

    /// Polls until the box is idle: then every request has its reply.
    fn end(&mut self) {
        self.check_events();
        if self.job.is_some() {
            self.work(0);
        }
        self.work(0);
        self.check_events();
        // A self-test takes thousands of samples more.
        let status = self.status();
        let testing = status.busy == Some(Request::Selftest.number());
        if !testing {
            assert_eq!((self.pending, status.busy), (None, None));
        }
    }
}
