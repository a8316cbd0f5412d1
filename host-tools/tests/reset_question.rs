//! `board settings --reset --save` asks before calibrations are thrown away for good: a terminal,
//! and nobody else.
#![cfg(unix)]

mod bench;
#[path = "cut_box/stand_in.rs"]
#[allow(dead_code, reason = "programs without a terminal begin there")]
mod stand_in;

use bench::command;
use massline::device::{HostBox, HostBoxMemory};
use massline::rig::{Inputs, Troubles};
use serialport::{SerialPort, TTYPort};
use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

/// A program at a port, and who sits at its terminal, if it has one.
struct Asked {
    child: Child,
    /// Both ends: what was said last is lost where nobody holds the other one.
    terminal: Option<[TTYPort; 2]>,
    answer: Option<&'static str>,
    /// Its output on the terminal.
    said: String,
    since: Instant,
}

/// The end of a program: exit code, document, and output on the terminal.
#[derive(Debug)]
struct Ended {
    code: Option<i32>,
    stdout: String,
    said: String,
}

const PROMPT: &str = "Type yes to go on: ";

impl Asked {
    fn begin(path: &str, words: &str, answer: Option<&'static str>) -> Self {
        let mut command = command(Path::new("."), words.split(' '));
        command.args(["--json", "--port", path]);
        command.stdout(Stdio::piped());
        let mut terminal = None;
        if answer.is_some() {
            let (ours, theirs) = TTYPort::pair().unwrap();
            let path = theirs.name().unwrap();
            let open = || -> File {
                let opened = OpenOptions::new().read(true).write(true).open(&path);
                opened.unwrap()
            };
            command.stdin(open()).stderr(open());
            terminal = Some([ours, theirs]);
        } else {
            command.stdin(Stdio::null()).stderr(Stdio::piped());
        }
        Self {
            child: command.spawn().unwrap(),
            terminal,
            answer,
            said: String::new(),
            since: Instant::now(),
        }
    }

    /// Reads what it says, answers once it has asked, and tells whether it has ended.
    fn is_over(&mut self) -> bool {
        let over = self.child.try_wait().unwrap().is_some();
        if let Some([terminal, _]) = &mut self.terminal {
            terminal.set_timeout(Duration::from_millis(1)).unwrap();
            let mut chunk = [0; 1024];
            while let Ok(count @ 1..) = terminal.read(&mut chunk) {
                self.said += std::str::from_utf8(&chunk[..count]).unwrap();
            }
            if self.said.ends_with(PROMPT)
                && let Some(answer) = self.answer.take()
            {
                terminal.write_all(answer.as_bytes()).unwrap();
            }
        }
        assert!(self.since.elapsed() < Duration::from_secs(60), "it goes on");
        over
    }
}

/// Runs a command against a box that outlives it.
fn run(host_box: &mut HostBox<'_>, words: &str, answer: Option<&'static str>) -> Ended {
    let asked = stand_in::serve(
        host_box,
        |path| Asked::begin(path, words, answer),
        Asked::is_over,
    );
    let output = asked.child.wait_with_output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Ended {
        code: output.status.code(),
        stdout: text(output.stdout),
        said: asked.said + &text(output.stderr),
    }
}

const RESET: &str = "board settings --reset --save";

#[test]
fn calibrations_are_thrown_away_only_by_who_has_said_so() {
    let mut memory = HostBoxMemory::new();
    let inputs = Inputs::fork(Troubles::default()).unwrap();
    let mut host_box = HostBox::with_inputs(&mut memory, 1, inputs);
    let named = |host_box: &mut HostBox<'_>| {
        let read = run(host_box, "board settings", None);
        let document: serde_json::Value = serde_json::from_str(&read.stdout).unwrap();
        document["name"].as_str().unwrap().to_owned()
    };
    let set = run(&mut host_box, "board settings --set name=mine --save", None);
    assert_eq!(set.code, Some(0), "{set:?}");
    // Without a terminal nobody can be asked.
    let refused = run(&mut host_box, RESET, None);
    assert_eq!((refused.code, &*refused.stdout), (Some(2), ""));
    for words in ["--export FILE", "--yes"] {
        assert!(refused.said.contains(words), "{refused:?}");
    }
    assert_eq!(named(&mut host_box), "mine");
    // At one, only yes is yes.
    for answer in ["no\n", "\n", "y\n", "yes please\n", "YES\n"] {
        let kept = run(&mut host_box, RESET, Some(answer));
        assert_eq!((kept.code, &*kept.stdout), (Some(2), ""), "{answer:?}");
        let asked = kept.said.contains("19 inputs") && kept.said.contains(PROMPT);
        assert!(
            asked && kept.said.contains("nothing was changed"),
            "{kept:?}"
        );
        assert_eq!(named(&mut host_box), "mine", "{answer:?}");
    }
    let done = run(&mut host_box, RESET, Some(" yes \n"));
    assert_eq!(done.code, Some(0), "{done:?}");
    assert!(done.said.contains(PROMPT), "{done:?}");
    assert_eq!(named(&mut host_box), "massline");
    // What is not kept, or was said before, is no question.
    for words in [
        "board settings --reset",
        "board settings --reset --save --yes",
    ] {
        let set = run(&mut host_box, "board settings --set name=mine --save", None);
        assert_eq!(set.code, Some(0), "{set:?}");
        let done = run(&mut host_box, words, Some("no\n"));
        assert_eq!(done.code, Some(0), "{done:?}");
        assert!(!done.said.contains("yes"), "{done:?}");
        assert_eq!(named(&mut host_box), "massline");
    }
}
