//! The link cut at the n-th frame, for every n, in all that talks to a box: unplugged, silent from
//! there on, or that one frame lost.
//!
//! The box is the one in this program, so that a silence is noticed at once. What is lost once
//! has to be made up for; what is cut has to be said, in time, and what was recorded before is a
//! whole recording.

mod bench;

use bench::one_run::{self, OneRun};
use massline::acquire::{self, Ending};
use massline::device::{
    Client, ClientMemory, Cut, CutLine, HostBox, HostBoxMemory, Place, Port, PortError,
};
use massline::limits;
use massline::recording::Recording;
use massline::replay;
use massline::rig::{Inputs, Troubles};
use massline_core::masslines::Method;
use massline_firmware::wire::{Pass, Reply, Request, Setting, SettingKey};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// The line, waited for as one to a box on a serial port is. The box in this program has its
/// clients wait until it has nothing more to say, which is never while its inputs run.
struct Line<'m>(CutLine<HostBox<'m>>);

impl Port for Line<'_> {
    fn name(&self) -> String {
        self.0.name()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.0.send(bytes)
    }

    fn receive(&mut self, into: &mut Vec<u8>, timeout: Duration) -> Result<usize, PortError> {
        self.0.receive(into, timeout)
    }

    fn patience(&self) -> Duration {
        Duration::from_millis(200)
    }

    fn longest_work(&self) -> Duration {
        self.0.longest_work()
    }

    fn seconds(&self) -> f64 {
        self.0.seconds()
    }
}

type Link<'c, 'm> = Client<'c, Line<'m>>;

fn inputs() -> Inputs {
    Inputs::fork(Troubles::default()).unwrap()
}

/// Outcome of a conversation: nothing, or the error's text.
type Talked = Result<(), String>;

/// Has a conversation over a line that is cut; the frames and bytes that passed, and its outcome.
fn talk(
    talk: &(dyn Fn(&mut Link<'_, '_>, &Path) -> Talked + Sync),
    inputs: &Inputs,
    cut: Cut,
    place: Place,
) -> ([u64; 2], Talked) {
    let (mut memory, mut own) = (ClientMemory::new(), HostBoxMemory::new());
    let folder = tempfile::tempdir().unwrap();
    let line = CutLine::new(
        HostBox::with_inputs(&mut own, 1, inputs.clone()),
        cut,
        place,
    );
    let mut client = Client::new(Line(line), &mut memory);
    let talked = talk(&mut client, folder.path());
    (client.port().0.passed(), talked)
}

/// Conversations that go on beside each other: in most of them somebody waits.
const BESIDE: usize = 6;

/// Longest that one may take: the time without samples, and the answers that are waited for,
/// four times over on a machine that is busy otherwise.
const LONGEST: Duration = limits::SILENCE.saturating_mul(4);

/// Frames at which every conversation is cut one by one.
const EACH: u64 = 30;

/// Cuts a conversation at every frame, behind the first [`EACH`] at every `stride`-th one, or at
/// none if that is zero.
fn at_every_frame(stride: u64, conversation: &(dyn Fn(&mut Link<'_, '_>, &Path) -> Talked + Sync)) {
    let (passed, whole) = talk(conversation, &inputs(), Cut::Gone, Place::Frame(u64::MAX));
    assert_eq!(whole, Ok(()));
    let [frames, bytes] = passed;
    println!("{frames} frames, {bytes} bytes");
    let steps: Vec<u64> = (0..frames)
        .filter(|&n| n < EACH || (stride > 0 && n % stride == 0))
        .collect();
    let cuts = [Cut::Gone, Cut::Silent, Cut::Once];
    let mut cases: Vec<(Cut, Place)> = Vec::new();
    for cut in cuts {
        cases.extend(steps.iter().map(|&n| (cut, Place::Frame(n))));
    }
    // Each byte of the first frames: a question and most of its answer.
    cases.extend((0..bytes.min(40)).map(|n| (Cut::Once, Place::Byte(n))));
    cases.extend((0..bytes.min(40)).map(|n| (Cut::Gone, Place::Byte(n))));
    let next = AtomicU64::new(0);
    std::thread::scope(|scope| {
        for _ in 0..BESIDE {
            scope.spawn(|| {
                // The models cannot be shared.
                let inputs = inputs();
                while let Some(&(cut, place)) =
                    cases.get(next.fetch_add(1, Ordering::Relaxed) as usize)
                {
                    let since = Instant::now();
                    let (_, talked) = talk(conversation, &inputs, cut, place);
                    let took = since.elapsed();
                    assert!(took < LONGEST, "{cut:?} {place:?}: {took:?}");
                    match (cut, talked) {
                        (Cut::Once, talked) => assert_eq!(talked, Ok(()), "{place:?}"),
                        // The last frames may be ones that nothing depends on.
                        (_, Ok(())) => {}
                        (_, Err(text)) => assert!(
                            ["connection is lost", "no answer to", "no samples for"]
                                .iter()
                                .any(|words| text.contains(words)),
                            "{cut:?} {place:?}: {text}"
                        ),
                    }
                }
            });
        }
    });
}

fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}

#[test]
fn info_and_selftest() {
    at_every_frame(1, &|client, _| {
        client.hello().map_err(text)?;
        client.status().map_err(text)?;
        let selftest = client.selftest().map_err(text)?;
        assert!(selftest.passed);
        Ok(())
    });
}

#[test]
fn settings_that_are_read_changed_and_kept() {
    at_every_frame(1, &|client, _| {
        let info = client.hello().map_err(text)?;
        let name = Request::WriteSetting(Setting::Name("table 2"));
        client.tell(&name).map_err(text)?;
        let read = Request::ReadSetting(SettingKey::Name);
        let name = client.ask(&read, |reply| match reply {
            Reply::Setting(Setting::Name(name)) => Some((*name).to_owned()),
            _ => None,
        });
        assert_eq!(name.map_err(text)?, "table 2");
        let kept = client.ask(&Request::SaveSettings, |reply| {
            matches!(reply, Reply::Saved(_)).then_some(())
        });
        kept.map_err(text)?;
        let entries = client.wired_inputs(info.capacity.inputs).map_err(text)?;
        assert_eq!(entries.len(), 19);
        Ok(())
    });
}

#[test]
fn a_recording() {
    let inputs = one_run::wired(&inputs())[..3].to_vec();
    // The box in this program samples as fast as it computes: behind the 23 frames that half a
    // second and its questions take it sends others, until the end is noticed.
    at_every_frame(0, &|client, folder| {
        let file = folder.join("x.csv");
        let order = acquire::Order {
            firmware: None,
            inputs: inputs.clone(),
            seconds: Some(0.5),
            file: file.clone(),
            replace: false,
        };
        let recorded = acquire::record(client, &order, &mut |_| true);
        let files = std::fs::read_dir(folder).unwrap().count();
        let recorded = recorded.map_err(|error| {
            assert_eq!(files, 0, "{error}");
            text(error)
        })?;
        // One file, and it holds what was told of it.
        assert_eq!(files, 1);
        let mut recording = Recording::open(&file, &[]).unwrap();
        while recording.next_row(&mut []).unwrap() {}
        assert_eq!(recording.rows(), recorded.samples);
        let mut ends = Vec::new();
        recording.notice_end(&mut ends);
        assert_eq!(ends, [""; 0]);
        match recorded.ending {
            Ending::Complete => {
                assert_eq!(recorded.samples, 256);
                Ok(())
            }
            Ending::Stopped => panic!("nobody stopped it"),
            Ending::Failed(error) => Err(text(error)),
        }
    });
}

#[test]
fn levels() {
    let inputs = one_run::wired(&inputs())[..3].to_vec();
    // As a recording.
    at_every_frame(0, &|client, _| {
        let mut seen = 0;
        let done = acquire::monitor(client, &inputs, 0.25, Some(0.5), &mut |_| {
            seen += 1;
            true
        });
        done.map_err(text)?;
        assert_eq!(seen, 2);
        Ok(())
    });
}

#[test]
fn a_test_on_the_box() {
    let (fork, wired) = (OneRun::simulate(4.0), one_run::wired(&inputs()));
    at_every_frame(1, &|client, _| {
        let test = one_run::measured(client, &fork.setup, &wired).map_err(text)?;
        let found = test.identify(client, false).map_err(text)?;
        assert_eq!(found.runs.len(), 1);
        Ok(())
    });
    assert!(fork.folder.path().exists());
}

#[test]
fn a_replay() {
    let fork = OneRun::simulate(4.0);
    let order = replay::Order {
        methods: vec![Method::ApparentMass],
        iterative: false,
        weighted: true,
        blocks: Some(2),
        flip: None,
        resume: false,
    };
    // Each goes through both the box and this machine's own run: every seventh frame of samples.
    at_every_frame(7, &|client, _| {
        let outcome = replay::replay(client, &fork.setup, &order, &mut |_| ()).map_err(text)?;
        assert!(outcome.identical());
        Ok(())
    });
}

/// The box keeps what it has while nobody is connected: a replay that is cut within the survey or
/// the measurement of a run goes on in there, and nothing differs.
#[test]
fn a_replay_that_was_cut_goes_on_where_the_box_stands() {
    let fork = OneRun::simulate(6.0);
    let order = |resume| replay::Order {
        // The weights of this method come from surveys.
        methods: vec![Method::FreeResponsesSquared],
        iterative: false,
        weighted: true,
        blocks: None,
        flip: None,
        resume,
    };
    let replayed = |host_box: &mut HostBox<'_>, resume, frame| {
        let mut memory = ClientMemory::new();
        let line = CutLine::new(host_box, Cut::Gone, Place::Frame(frame));
        let mut client = Client::new(line, &mut memory);
        let outcome = replay::replay(&mut client, &fork.setup, &order(resume), &mut |_| ());
        (client.port().passed()[0], outcome)
    };
    let mut own = HostBoxMemory::new();
    let (frames, whole) = replayed(&mut HostBox::new(&mut own, 1), false, u64::MAX);
    assert!(whole.unwrap().identical());
    let mut cut_within = Vec::new();
    for part in 1..10 {
        let mut own = HostBoxMemory::new();
        let mut host_box = HostBox::new(&mut own, 1);
        let (_, cut) = replayed(&mut host_box, false, frames * part / 10);
        cut.unwrap_err();
        host_box.unplugged();
        let mut memory = ClientMemory::new();
        let status = Client::new(&mut host_box, &mut memory).status().unwrap();
        cut_within.extend(status.running.map(|running| running.pass));
        let (_, resumed) = replayed(&mut host_box, true, u64::MAX);
        let resumed = resumed.unwrap_or_else(|error| panic!("part {part}: {error}"));
        assert!(resumed.identical(), "part {part}");
    }
    for pass in [Pass::Survey, Pass::Measure] {
        assert!(cut_within.contains(&pass), "{cut_within:?}");
    }
}
