//! A model of the box's protocol: its states, what each request needs, and what it may change.
//!
//! It is written from the tables in [`massline_firmware::wire`], not from the instrument, and knows
//! neither samples nor lines: what a run has found is for other tests.

use crate::bench::Settings;
use massline_firmware::wire::*;

/// Runs of the set-ups that are sent.
pub const RUNS: usize = 3;
/// Sensors of them.
pub const SENSORS: usize = 4;
/// Channels of their samples: the sensors and the drive.
pub const CHANNELS: usize = SENSORS + 1;
/// Their sample rate, Hz.
pub const RATE: f64 = 512.0;

/// A request, sound or not: a box in the right state takes the sound ones.
#[derive(Clone, Copy, Debug)]
pub struct Act<'a> {
    pub request: Request<'a>,
    pub is_sound: bool,
}

/// Outcome of a request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// It is done, or will be when its job is.
    Granted,
    /// It is refused.
    Refused,
    /// It is refused for this reason.
    Because(Problem),
}

/// A run that is going on or has ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Going {
    pub start: Start,
    pub next: u64,
    pub missing: u64,
}

/// The box, as far as the model knows it.
#[derive(Clone, Debug)]
pub struct Model {
    pub state: State,
    plan: Option<Plan>,
    processing: Option<Processing>,
    sensors: [bool; SENSORS],
    runs: [bool; RUNS],
    weighted: [bool; RUNS],
    pub surveyed: u32,
    /// Accelerometers behind the stored runs.
    pub stored: [Option<Accelerations>; RUNS],
    summaries: [bool; RUNS],
    pub run: Option<Going>,
    pub ended: Option<Going>,
    /// Number of the request that waits for its job; `true` once the job has been taken.
    pub pending: Option<(u8, bool)>,
    pub answered: bool,
    pub is_streaming: bool,
    /// Conditions of the samples that are recorded.
    conditions: Conditions,
    pub converting: Option<f64>,
    pub settings: Settings,
    pub saved: Settings,
    delivered: Settings,
}

/// Properties of the box that can be seen from outside, and change only where a request may
/// change them.
pub const FIELDS: [&str; 16] = [
    "state",
    "busy",
    "fingerprint",
    "running",
    "stored",
    "surveyed",
    "answered",
    "settings",
    "saved",
    "converting",
    "resets",
    "test patterns",
    "weights",
    "peaks",
    "summaries",
    "lines",
];

/// The fields that a request may change if it is granted.
pub fn may_change(request: &Request<'_>) -> &'static [&'static str] {
    const FORGET: &[&str] = &[
        "state",
        "busy",
        "fingerprint",
        "stored",
        "surveyed",
        "answered",
        "weights",
        "peaks",
        "summaries",
        "lines",
    ];
    const END: &[&str] = &[
        "state",
        "running",
        "converting",
        "stored",
        "surveyed",
        "weights",
        "peaks",
        "summaries",
        "lines",
    ];
    match request {
        Request::Subscribe(_) => &["converting"],
        Request::Reboot => &["resets"],
        Request::Provoke(Provoke::TestPattern) => &["test patterns"],
        Request::Provoke(_) => &["resets"],
        Request::Selftest | Request::BeginSetup(_) => FORGET,
        Request::SetWeights(_) => &["weights"],
        Request::EndSetup => &["state", "lines"],
        Request::Start(_) => &["state", "running", "converting"],
        Request::Samples(_) | Request::Stop => END,
        Request::Abort => &["state", "running", "converting"],
        Request::Identify(_) => &["busy"],
        Request::WriteSetting(_) | Request::ResetSettings => &["settings"],
        Request::SaveSettings => &["saved"],
        _ => &[],
    }
}

impl Model {
    pub fn new(settings: &Settings) -> Self {
        Self {
            state: State::Empty,
            plan: None,
            processing: None,
            sensors: [false; SENSORS],
            runs: [false; RUNS],
            weighted: [false; RUNS],
            surveyed: 0,
            stored: [None; RUNS],
            summaries: [false; RUNS],
            run: None,
            ended: None,
            pending: None,
            answered: false,
            is_streaming: false,
            conditions: Conditions::default(),
            converting: None,
            settings: settings.clone(),
            saved: settings.clone(),
            delivered: settings.clone(),
        }
    }

    fn is_testing(&self) -> bool {
        self.pending
            .is_some_and(|(number, _)| number == Request::Selftest.number())
    }

    /// `true` while a job has the stored runs.
    fn is_lent(&self) -> bool {
        self.pending.is_some_and(|(_, is_taken)| is_taken)
    }

    /// Outcome that a request must have.
    pub fn expect(&self, act: &Act<'_>) -> Verdict {
        let is_running = self.state == State::Running;
        let is_busy = self.pending.is_some();
        let has = |run: u8| self.state != State::Empty && usize::from(run) < self.run_count();
        let granted = match &act.request {
            Request::Samples(samples) => return self.expect_samples(samples),
            Request::Provoke(Provoke::TestPattern) | Request::ResetSettings => {
                !is_running && !self.is_streaming
            }
            Request::Subscribe(subscription) => {
                !is_running || subscription.samples.conditions() == self.conditions
            }
            Request::Probe(Probe::Skew) => true,
            Request::Probe(Probe::Converter(_)) => !is_running && !self.is_streaming,
            // The model of the board has no buses.
            Request::Probe(_) => false,
            Request::Selftest | Request::BeginSetup(_) => !is_running && !is_busy && act.is_sound,
            Request::SetProcessing(_) => self.state == State::SettingUp && act.is_sound,
            Request::SetSensor(_) => self.state == State::SettingUp && act.is_sound,
            Request::SetRun(run) => self.state == State::SettingUp && act.is_sound && has(run.run),
            Request::SetWeights(weights) => {
                matches!(self.state, State::SettingUp | State::Ready)
                    && act.is_sound
                    && has(weights.run)
            }
            Request::EndSetup => match self.state {
                State::Ready => true,
                State::SettingUp => self.is_whole(),
                _ => false,
            },
            Request::Start(start) => self.grants(start),
            Request::Stop => !self.is_testing() && (self.run.is_some() || self.ended.is_some()),
            Request::ReadSummary(run) => has(*run) && self.summaries[usize::from(*run)],
            Request::ReadLines(read) => {
                let stored = |run| self.stored[usize::from(run)].is_some();
                has(read.run) && !self.is_lent() && stored(read.run) && act.is_sound
            }
            Request::ReadPeaks(run) => has(*run) && self.surveyed & 1 << run != 0,
            Request::ReadWeights(run) => has(*run),
            Request::Identify(question) => {
                self.state == State::Ready && !is_busy && act.is_sound && self.answers(question)
            }
            Request::ReadAnswer => self.answered && !self.is_lent(),
            Request::ReadSetting(_) => act.is_sound,
            Request::WriteSetting(Setting::Input(_) | Setting::SampleRate(_)) => {
                !is_running && !self.is_streaming && act.is_sound
            }
            Request::WriteSetting(_) => !is_running && act.is_sound,
            Request::SaveSettings => !is_running && !self.is_streaming && !is_busy,
            _ => true,
        };
        if granted {
            Verdict::Granted
        } else {
            Verdict::Refused
        }
    }

    fn run_count(&self) -> usize {
        self.plan.map_or(0, |plan| plan.runs.into())
    }

    fn is_whole(&self) -> bool {
        self.processing.is_some()
            && self.sensors == [true; SENSORS]
            && self.run_count() > 0
            && self.runs[..self.run_count()].iter().all(|given| *given)
    }

    fn grants(&self, start: &Start) -> bool {
        if self.state == State::Running && self.run.is_some_and(|run| run.start == *start) {
            return true;
        }
        let (Some(processing), State::Ready, None) = (self.processing, self.state, self.pending)
        else {
            return false;
        };
        if usize::from(start.run) >= self.run_count() || start.limit == Some(0) {
            return false;
        }
        let may = match start.pass {
            Pass::Survey => processing.mode_band.is_some(),
            Pass::Measure => {
                processing.accelerations != Accelerations::Weighted
                    || processing.weighting == Weighting::Given
                    || self.weighted[usize::from(start.run)]
            }
        };
        let wired = self.settings.inputs()[..CHANNELS].iter();
        let is_wired = wired
            .clone()
            .all(|input| input.circuit() != Circuit::Unused);
        let in_rate = self.converting.is_none_or(|rate| rate == RATE);
        let is_usual = self.conditions == Conditions::default();
        may && (start.source != Source::Inputs || is_wired && in_rate && is_usual)
    }

    fn answers(&self, question: &Question) -> bool {
        let all = self.stored.iter().enumerate();
        let all = all.fold(0, |bits, (k, run)| bits | u32::from(run.is_some()) << k);
        let runs = match question.runs {
            0 => all,
            some => some,
        };
        let interface = question.method == Method::ApparentMass;
        let mut used = (0..RUNS)
            .filter(|k| runs & 1 << k != 0)
            .filter_map(|k| self.stored[k]);
        runs != 0
            && runs & !all == 0
            && used
                .clone()
                .all(|with| (with == Accelerations::Interface) == interface)
            && used
                .next()
                .is_none_or(|first| used.all(|other| other == first))
    }

    fn expect_samples(&self, samples: &Samples<'_>) -> Verdict {
        let count = samples.count();
        let end = |count: usize| samples.first.checked_add(count as u64);
        let Some(run) = self.run else {
            let Some(Going { start, next, .. }) = self.ended.filter(|_| !self.is_testing()) else {
                return Verdict::Refused;
            };
            let is_full = start.limit.is_some_and(|limit| next >= limit);
            let joins = start.gaps == Gaps::Count || samples.first <= next;
            let has = count
                .and_then(end)
                .is_some_and(|end| end <= next || is_full && joins);
            return match start.source == Source::Host && has {
                true => Verdict::Granted,
                false => Verdict::Refused,
            };
        };
        if run.start.source != Source::Host {
            return Verdict::Because(Problem::Busy(Request::Start(run.start).number()));
        }
        if usize::from(samples.channels) != CHANNELS || count.is_none() {
            return Verdict::Because(Problem::count(
                Item::Channel,
                samples.channels.into(),
                CHANNELS,
            ));
        }
        if count.and_then(end).is_none() {
            return Verdict::Refused;
        }
        if run.start.gaps == Gaps::Refuse && samples.first > run.next {
            return Verdict::Because(Problem::Gap {
                found: samples.first,
                expected: run.next,
            });
        }
        Verdict::Granted
    }

    /// Takes note that a request was granted.
    pub fn grant(&mut self, act: &Act<'_>) {
        match &act.request {
            Request::Subscribe(subscription) => {
                let conditions = subscription.samples.conditions();
                if conditions != self.conditions {
                    // The converters are started anew.
                    self.converting = None;
                }
                self.conditions = conditions;
                self.is_streaming = subscription.samples != Stream::Off;
                if self.is_streaming && self.converting.is_none() {
                    self.converting = Some(self.settings.sample_rate());
                }
                self.tend();
            }
            Request::Selftest => {
                self.forget();
                self.state = State::Empty;
                self.pending = Some((Request::Selftest.number(), false));
            }
            Request::BeginSetup(plan) => {
                self.forget();
                self.state = State::SettingUp;
                self.plan = Some(*plan);
            }
            Request::SetProcessing(processing) => self.processing = Some(*processing),
            Request::SetSensor(sensor) => self.sensors[usize::from(sensor.sensor)] = true,
            Request::SetRun(run) => self.runs[usize::from(run.run)] = true,
            Request::SetWeights(weights) => self.weighted[usize::from(weights.run)] = true,
            Request::EndSetup => self.state = State::Ready,
            Request::Start(start) if self.run.is_none() => {
                self.state = State::Running;
                self.run = Some(Going {
                    start: *start,
                    next: 0,
                    missing: 0,
                });
                if start.source == Source::Inputs {
                    self.converting = Some(RATE);
                }
            }
            Request::Samples(samples) => {
                let count = samples.count().unwrap_or(0) as u64;
                self.advance(samples.first, count);
            }
            Request::Abort if !self.is_testing() && self.run.take().is_some() => {
                self.state = State::Ready;
                self.tend();
            }
            Request::Identify(_) => self.pending = Some((act.request.number(), false)),
            Request::WriteSetting(setting) => {
                let written = self.settings.set(setting);
                assert_eq!(written, Ok(()), "{act:?} was granted");
            }
            Request::ResetSettings => self.settings = self.delivered.clone(),
            Request::SaveSettings => self.saved = self.settings.clone(),
            _ => {}
        }
    }

    /// So many samples from number `first` on have come to the run, if there is one.
    pub fn advance(&mut self, first: u64, count: u64) {
        if let Some(run) = &mut self.run {
            let limit = run.start.limit.unwrap_or(u64::MAX);
            let begin = first.clamp(run.next, limit.max(run.next));
            run.missing += begin - run.next;
            run.next = begin.max((first + count).min(limit));
        }
    }

    /// `true` once the run has all the samples it was started for.
    pub fn is_complete(&self) -> bool {
        let run = self.run;
        run.is_some_and(|run| run.start.limit.is_some_and(|limit| run.next >= limit))
    }

    /// Takes note that the run has ended with this summary.
    pub fn end(&mut self, summary: &Summary, surveyed: u32) {
        let run = self.run.take().expect("a run that ends goes on before");
        let number = usize::from(run.start.run);
        assert_eq!(usize::from(summary.run), number);
        assert_eq!(summary.missing, run.missing);
        assert_eq!(summary.samples, run.next - run.missing, "{run:?}");
        self.state = State::Ready;
        self.ended = Some(run);
        self.summaries[number] = true;
        let processing = self.processing.expect("there is a set-up");
        match run.start.pass {
            Pass::Measure => {
                self.stored[number] = summary.noise.map(|_| processing.accelerations);
            }
            Pass::Survey => {
                assert_eq!(surveyed & !(1 << number), self.surveyed & !(1 << number));
                assert_eq!(self.surveyed & !surveyed, 0, "surveys are not lost");
                self.surveyed = surveyed;
                // It may have been too short to find anything.
                if summary.blocks > 0 {
                    match processing.weighting {
                        Weighting::Given => {}
                        Weighting::EachRun => self.weighted[number] = true,
                        Weighting::Joined => self.weighted = [true; RUNS],
                    }
                }
            }
        }
        self.tend();
    }

    /// Takes note that the job has come back with a reply.
    pub fn finish(&mut self, is_answered: bool) {
        let was_testing = self.is_testing();
        self.pending = None;
        if was_testing {
            self.forget();
            self.state = State::Empty;
        } else {
            self.answered |= is_answered;
        }
    }

    fn tend(&mut self) {
        let is_run = self
            .run
            .is_some_and(|run| run.start.source == Source::Inputs);
        if !is_run && !self.is_streaming {
            self.converting = None;
        }
    }

    fn forget(&mut self) {
        self.plan = None;
        self.processing = None;
        self.sensors = [false; SENSORS];
        self.runs = [false; RUNS];
        self.weighted = [false; RUNS];
        self.surveyed = 0;
        self.stored = [None; RUNS];
        self.summaries = [false; RUNS];
        self.run = None;
        self.ended = None;
        self.answered = false;
    }

    /// The status that the box must tell, the blocks of a run aside.
    pub fn status(&self) -> Status {
        let known = self.state != State::Empty;
        let stored = self.stored.iter().enumerate();
        Status {
            state: self.state,
            busy: self.pending.map(|(number, _)| number),
            fingerprint: self.plan.filter(|_| known).map(|plan| plan.fingerprint),
            running: self.run.filter(|_| known).map(|run| Running {
                run: run.start.run,
                pass: run.start.pass,
                source: run.start.source,
                next: run.next,
                blocks: 0,
            }),
            stored: stored.fold(0, |bits, (k, run)| bits | u32::from(run.is_some()) << k),
            surveyed: self.surveyed,
            answer: self.answered,
            unsaved: self.settings != self.saved,
        }
    }
}
