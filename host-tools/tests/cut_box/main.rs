//! Every command that talks to a box, as a user runs it, with the link cut at the n-th frame for
//! every n: the port is gone, nothing arrives any more, or that one frame is lost.
//!
//! A frame that is lost is sent again. A cut ends the command within the stated limits, with
//! a message that names what did not come; a file is then the old one or the whole new one, and
//! nothing lies beside it. `cut_link.rs` does the same to the library, where a silence costs
//! nothing; here it takes eight seconds, so that behind the first frames it comes at some only
//! (`MASSLINE_EVERY_FRAME=1` has it come at all).
#![cfg(unix)]

#[path = "../bench/mod.rs"]
mod bench;
mod fork;
mod stand_in;

use bench::command;
use fork::{FORK, measured};
use massline::device::{Cut, CutLine, HostBox, HostBoxMemory, Place, Port, PortError};
use massline::limits;
use massline::printable::steers;
use massline::recording::Recording;
use massline_firmware::wire::{
    BODY_MAX, FRAME_MAX, Received, Receiver, Reply, Request, Sender, ToBox,
};
use stand_in::beside;
use std::ops::Deref;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

/// The box in this program, which also starts anew where it is asked to.
struct Restarting<'m> {
    host_box: HostBox<'m>,
    heard: Receiver<'m, ToBox>,
    session: u16,
    said: Vec<u8>,
}

impl Restarting<'_> {
    /// The answer to a request to start anew: the first of another session.
    fn restart(&mut self, request: u16) {
        self.session += 1;
        let mut frame = [0; FRAME_MAX];
        let mut sender = Sender::new(self.session);
        let frame = sender.reply(request, &Reply::Done, &mut frame);
        self.said.extend_from_slice(frame.unwrap());
    }
}

impl Port for Restarting<'_> {
    fn name(&self) -> String {
        self.host_box.name()
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), PortError> {
        let mut rest = frame;
        let mut restart = None;
        while let Some(received) = self.heard.next(&mut rest) {
            if let Received::Message(header, Request::Reboot) = received {
                restart = Some(header.request);
            }
        }
        match restart {
            Some(request) => self.restart(request),
            None => self.host_box.send(frame)?,
        }
        Ok(())
    }

    fn receive(&mut self, into: &mut Vec<u8>, timeout: Duration) -> Result<usize, PortError> {
        if self.said.is_empty() {
            return self.host_box.receive(into, timeout);
        }
        let count = self.said.len();
        into.append(&mut self.said);
        Ok(count)
    }

    fn patience(&self) -> Duration {
        self.host_box.patience()
    }

    fn seconds(&self) -> f64 {
        self.host_box.seconds()
    }
}

/// A command, and what holds of the files that it leaves.
struct Case {
    /// Its words.
    command: &'static str,
    prepare: &'static (dyn Fn(&mut HostBox<'_>) + Sync),
    /// The file that it writes, beside those of the test.
    writes: Option<&'static str>,
    /// Its content before.
    old: &'static [u8],
    /// `true` if a file that was written instead is whole.
    is_whole: fn(&Path) -> bool,
    /// Longest that the command may take beyond the silence of a request.
    works: Duration,
}

const TALK: Case = Case {
    command: "",
    prepare: &|_| (),
    writes: None,
    old: b"",
    is_whole: |_| true,
    works: Duration::from_secs(3),
};

/// The end of a command.
#[derive(Debug)]
struct Finished {
    program: stand_in::Ended,
    folder: TempDir,
    passed: [u64; 2],
}

impl Deref for Finished {
    type Target = stand_in::Ended;

    fn deref(&self) -> &stand_in::Ended {
        &self.program
    }
}

/// A request that is not answered is sent eight times, a second apart, and once more it is tried
/// to have the box stop; a busy machine may need twice that.
fn silence() -> Duration {
    2 * (Duration::from_secs(2 * u64::from(limits::ATTEMPTS)) + limits::SILENCE)
}

fn run(case: &Case, cut: Cut, place: Place) -> Finished {
    let folder = tempfile::tempdir().unwrap();
    FORK.copy(folder.path());
    if let Some(file) = case.writes {
        std::fs::write(folder.path().join(file), case.old).unwrap();
    }
    let (mut memory, mut body) = (HostBoxMemory::new(), [0; BODY_MAX]);
    let mut host_box = HostBox::with_inputs(&mut memory, 1, FORK.inputs());
    (case.prepare)(&mut host_box);
    let restarting = Restarting {
        host_box,
        heard: Receiver::new(&mut body),
        session: 1,
        said: Vec::new(),
    };
    let mut line = CutLine::new(restarting, cut, place);
    let command = command(folder.path(), case.command.split(' '));
    let bound = silence() + case.works;
    let about = (case.command, cut, place);
    Finished {
        program: stand_in::run(&mut line, command, bound, &about),
        folder,
        passed: line.passed(),
    }
}

/// Asserts the properties of every end.
fn check(case: &Case, finished: &Finished, cut: Cut, whole: &Finished) {
    let about = format!("{:?} {finished:#?}", case.command);
    assert!(!finished.stderr.contains("panicked"), "{about}");
    for text in [&finished.stdout, &finished.stderr] {
        assert_eq!(text.find(|c| steers(c) && c != '\n'), None, "{about}");
    }
    let errors = finished.stderr.matches("error: ").count();
    match finished.code {
        Some(0) => assert_eq!(errors, 0, "{about}"),
        // A cut is no verdict on data.
        Some(2) if cut != Cut::Once => {
            assert_eq!(errors, 1, "{about}");
            let words = [
                "connection is lost",
                // The box has sent something by itself, and its end was closed before the program
                // had opened the other one, or while it did.
                "No such file or directory; this machine has",
                "I/O error; this machine has",
                "no answer to ",
                "no samples for ",
                "does not come back",
            ];
            let named = words.iter().any(|words| finished.stderr.contains(words));
            assert!(named, "{about}");
        }
        _ => panic!("{about}"),
    }
    let files = |finished: &Finished| {
        let files = std::fs::read_dir(finished.folder.path()).unwrap();
        let mut names: Vec<_> = files.map(|file| file.unwrap().file_name()).collect();
        names.sort();
        names
    };
    assert_eq!(files(finished), files(whole), "{about}");
    if let Some(file) = case.writes {
        let path = finished.folder.path().join(file);
        let is_old = std::fs::read(&path).unwrap() == case.old;
        let told = finished.code == Some(0) || finished.stderr.contains("what came before is in");
        assert_eq!(is_old, !told, "{about}");
        assert!(is_old || (case.is_whole)(&path), "{about}");
    }
    // A document on stdout is whole or not there.
    if case.command.ends_with("--json") && !finished.stdout.is_empty() {
        let document = serde_json::from_str::<serde_json::Value>(&finished.stdout);
        assert!(document.is_ok(), "{about}");
    }
}

/// Commands that run beside each other: in most of them somebody waits. More of them would leave a
/// box on a busy machine without a processor for as long as a host is patient.
const BESIDE: usize = 12;
/// Frames at which every silence comes, and the stride behind them.
const EACH: u64 = 12;
const STRIDE: u64 = 11;

/// Runs a command with the link cut at every frame.
fn at_every_frame(case: &Case) {
    let whole = run(case, Cut::Gone, Place::Frame(u64::MAX));
    assert_eq!(whole.code, Some(0), "{whole:#?}");
    check(case, &whole, Cut::Gone, &whole);
    let frames = whole.passed[0];
    let all = std::env::var_os("MASSLINE_EVERY_FRAME").is_some();
    let mut cases: Vec<(Cut, u64)> = Vec::new();
    for n in 0..frames {
        cases.extend([(Cut::Gone, n), (Cut::Once, n)]);
        if all || n < EACH || n % STRIDE == 0 || n + 2 >= frames {
            cases.push((Cut::Silent, n));
        }
    }
    let count = cases.len();
    let took = beside(BESIDE, cases, |(cut, n)| {
        let finished = run(case, cut, Place::Frame(n));
        check(case, &finished, cut, &whole);
        finished.took
    });
    let longest = took.into_iter().max().unwrap();
    println!(
        "{:?}: {frames} frames, {} cuts, the longest took {longest:.1?} of {:?}",
        case.command,
        count,
        silence() + case.works
    );
}

#[test]
fn info_selftest_and_forget() {
    for command in [
        "board info",
        "board info --json",
        "board selftest",
        "board forget",
        "board restart",
    ] {
        at_every_frame(&Case { command, ..TALK });
    }
}

#[test]
fn settings_that_are_read_changed_and_kept() {
    at_every_frame(&Case {
        command: "board settings --set name=table --inputs wired.toml --save --json",
        ..TALK
    });
}

#[test]
fn settings_that_are_written_to_a_file() {
    at_every_frame(&Case {
        command: "board settings --inputs wired.toml --export kept.toml --force",
        writes: Some("kept.toml"),
        old: b"# the old ones\n",
        is_whole: |path| std::fs::read_to_string(path).unwrap() == FORK.wired,
        ..TALK
    });
}

/// `true` if a file is a recording to its end, of all rows that it says.
fn is_recording(path: &Path) -> bool {
    let mut recording = Recording::open(path, &[]).unwrap();
    while recording.next_row(&mut []).unwrap() {}
    let mut ends = Vec::new();
    recording.notice_end(&mut ends);
    ends == [""; 0] && recording.rows() > 0
}

#[test]
fn a_recording() {
    at_every_frame(&Case {
        command: "board record x.csv --force --inputs 1-3 --seconds 0.5",
        writes: Some("x.csv"),
        old: b"drive\n1\n2\n",
        is_whole: is_recording,
        works: Duration::from_secs_f64(limits::overtime(0.5)),
        ..TALK
    });
}

#[test]
fn levels() {
    at_every_frame(&Case {
        command: "board monitor --inputs 1-3 --seconds 1",
        works: Duration::from_secs_f64(limits::overtime(1.0)),
        ..TALK
    });
}

#[test]
fn a_test_on_the_box() {
    at_every_frame(&Case {
        command: "board measure setup.toml --inputs wired.toml --duration 6 --json",
        works: Duration::from_secs_f64(limits::overtime(6.0)),
        ..TALK
    });
}

#[test]
fn what_the_box_has_found() {
    at_every_frame(&Case {
        command: "board identify setup.toml --inputs wired.toml --json",
        prepare: &measured,
        ..TALK
    });
}

#[test]
fn a_replay() {
    at_every_frame(&Case {
        command: "replay setup.toml --blocks 2 --json",
        ..TALK
    });
}
