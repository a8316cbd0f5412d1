//! Every command that asks a box, against boxes that lie: it comes to an end within the limits
//! that are stated, says what is wrong in words that show as they stand, and what it has recorded
//! is a recording.
//!
//! Most of the time here is waiting, so that the commands run beside each other.
#![cfg(unix)]

#[path = "../bench/mod.rs"]
mod bench;
#[path = "../cut_box/fork.rs"]
mod fork;
mod peer;
mod proxy;
#[path = "../../../firmware/tests/wire/reference.rs"]
#[allow(dead_code, reason = "no test begins with any header")]
mod reference;
#[path = "../cut_box/stand_in.rs"]
mod stand_in;
mod tales;

use bench::command;
use massline::limits;
use massline::printable::steers;
use peer::{Lie, Peer, RATE};
use stand_in::{Program, begin, beside};
use std::ops::Deref;
use std::process::Command;
use std::time::Duration;
use tempfile::TempDir;

/// The end of a command.
#[derive(Debug)]
struct Ended {
    lie: Lie,
    arguments: &'static [&'static str],
    program: stand_in::Ended,
    folder: TempDir,
}

impl Deref for Ended {
    type Target = stand_in::Ended;

    fn deref(&self) -> &stand_in::Ended {
        &self.program
    }
}

/// A message waits a second for its reply on a serial port, so a request that is never answered
/// takes eight, and being handed over five at the most. A busy machine may need twice that.
fn handshake() -> Duration {
    2 * (Duration::from_secs(limits::ATTEMPTS.into()) + limits::SENDING)
}

fn spawn(peer: &Peer, arguments: &[&str], folder: &TempDir) -> Program {
    let all = [&["board"], arguments].concat();
    begin(command(folder.path(), all), &peer.path)
}

/// Waits for a command, and ends it if it takes longer than `bound` from its begin.
fn finish(
    mut program: Program,
    lie: Lie,
    arguments: &'static [&'static str],
    bound: Duration,
    folder: TempDir,
) -> Ended {
    while !program.is_over(bound, &(lie, arguments)) {
        std::thread::sleep(Duration::from_millis(20));
    }
    Ended {
        lie,
        arguments,
        program: program.ended(),
        folder,
    }
}

fn run(lie: Lie, arguments: &'static [&'static str], bound: Duration) -> Ended {
    let peer = Peer::new(lie);
    let folder = tempfile::tempdir().unwrap();
    let program = spawn(&peer, arguments, &folder);
    finish(program, lie, arguments, bound, folder)
}

/// Asserts the properties of every end.
fn check(ended: &Ended) {
    let about = format!("{ended:#?}");
    assert!(matches!(ended.code, Some(0..=2)), "{about}");
    assert!(!ended.stderr.contains("panicked"), "{about}");
    for text in [&ended.stdout, &ended.stderr] {
        let hidden = text.find(|c| steers(c) && c != '\n');
        assert_eq!(hidden, None, "{about}");
    }
    let said = ended.stderr.lines().any(|line| line.starts_with("error: "));
    assert_eq!(said, ended.code != Some(0), "{about}");
    // A recording is there if the command says so, and nothing is left beside it.
    let file = ended.folder.path().join("x.csv");
    let told = ended.code == Some(0) || ended.stderr.contains("what came before is in");
    let wanted = ended.arguments[0] == "record" && told;
    assert_eq!(file.exists(), wanted, "{about}");
    let files = std::fs::read_dir(ended.folder.path()).unwrap().count();
    assert_eq!(files, usize::from(wanted), "{about}");
    println!(
        "{:?} {}: {:?}, {:.1?}",
        ended.lie, ended.arguments[0], ended.code, ended.took
    );
    println!("    {}", ended.stderr.trim_end());
}

const INFO: &[&str] = &["info"];
const SELFTEST: &[&str] = &["selftest"];
const SETTINGS: &[&str] = &["settings"];
const MONITOR: &[&str] = &["monitor", "--seconds", "1"];
const RECORD: &[&str] = &["record", "x.csv", "--seconds", "1"];
const FORGET: &[&str] = &["forget"];
const ALL: [&[&str]; 6] = [INFO, SELFTEST, SETTINGS, MONITOR, RECORD, FORGET];

/// Commands that run beside each other.
const BESIDE: usize = 8;

/// Runs commands beside each other, and checks each.
fn all(cases: Vec<(Lie, &'static [&'static str], Duration)>) -> Vec<Ended> {
    beside(BESIDE, cases, |(lie, arguments, bound)| {
        let ended = run(lie, arguments, bound);
        check(&ended);
        ended
    })
}

#[test]
fn a_sound_box_is_believed() {
    let cases = [INFO, SETTINGS, MONITOR, RECORD, FORGET];
    for ended in all(cases.map(|a| (Lie::None, a, handshake())).to_vec()) {
        assert_eq!(ended.code, Some(0), "{ended:#?}");
    }
}

#[test]
fn what_is_no_conversation_ends_in_time() {
    let lies = [
        Lie::Silent,
        Lie::Deaf,
        Lie::Noise(None),
        Lie::Noise(Some(0)),
        Lie::Noise(Some(1)),
        Lie::Events,
        Lie::HalfFrames,
        Lie::ShortPayload,
        Lie::Close,
        Lie::Restart,
        Lie::WrongKind,
        Lie::UnknownNumber,
        Lie::Version,
        Lie::OtherId,
    ];
    // Each command with some of the lies, the first with all: none gets further than its hello.
    let cases = lies.iter().enumerate().flat_map(|(k, &lie)| {
        let also = ALL[1 + k % (ALL.len() - 1)];
        [(lie, INFO, handshake()), (lie, also, handshake())]
    });
    for ended in all(cases.collect()) {
        // Each answer of a box that starts anew before it is an answer, if it is the first frame.
        let answered = ended.lie == Lie::Restart && [INFO, FORGET].contains(&ended.arguments);
        let code = if answered { 0 } else { 2 };
        assert_eq!(ended.code, Some(code), "{ended:#?}");
    }
}

#[test]
fn answers_that_come_again_are_taken_once() {
    for ended in all(ALL.map(|a| (Lie::Repeats, a, 2 * handshake())).to_vec()) {
        let known = ended.arguments != SELFTEST;
        assert_eq!(ended.code, Some(if known { 0 } else { 2 }), "{ended:#?}");
    }
}

#[test]
fn answers_that_drip_come_in_time_or_are_given_up() {
    let slow = Lie::Drip(Duration::from_millis(15));
    let bound = 2 * (limits::READING_SETTINGS + handshake());
    all([INFO, SETTINGS, RECORD].map(|a| (slow, a, bound)).to_vec());
}

#[test]
fn rates_that_no_box_has_are_refused() {
    let rates = [1e300, f64::NAN, f64::INFINITY, 0.0, -512.0, 1e-300];
    let cases = rates.iter().flat_map(|&rate| {
        [RECORD, MONITOR, SETTINGS].map(|arguments| (Lie::Rate(rate), arguments, handshake()))
    });
    for ended in all(cases.collect()) {
        assert_eq!(ended.code, Some(2), "{ended:#?}");
        let words = "a sample rate of ";
        assert!(ended.stderr.contains(words), "{ended:#?}");
        assert!(ended.stderr.contains("1 to 200000 Hz"), "{ended:#?}");
    }
}

#[test]
fn numbers_that_no_sample_has_end_a_recording_that_is_kept() {
    let minute = (limits::LONGEST_GAP * RATE) as u64;
    // A gap may also be one that the time since the first sample cannot have brought.
    let gap = ["missing at once", "says to have taken"];
    for (lie, words) in [
        (Lie::Jump(1 << 60), gap),
        (Lie::Jump(1 << 50), gap),
        (Lie::Jump(minute + 1), gap),
        // Each gap on its own would be bridged.
        (Lie::Jump(minute - 10), ["says to have taken"; 2]),
        (Lie::First(u64::MAX - 12), ["beyond the last number"; 2]),
        (Lie::First(1 << 53), ["beyond the last number"; 2]),
    ] {
        // Long enough not to be over before the box lies.
        let long: &[&str] = &["record", "x.csv", "--seconds", "100000"];
        for arguments in [long, MONITOR] {
            let ended = run(lie, arguments, handshake());
            check(&ended);
            let over = arguments == MONITOR && ended.code == Some(0);
            let said = words.iter().any(|words| ended.stderr.contains(words));
            assert!(over || said, "{ended:#?}");
            assert!(over || ended.code == Some(2), "{ended:#?}");
            // A minute and what came before it, of two readings of at most 16 bytes.
            let size = ended
                .folder
                .path()
                .join("x.csv")
                .metadata()
                .map_or(0, |m| m.len());
            assert!(size < 2 * minute * 40, "{size}");
        }
    }
}

#[test]
fn samples_of_other_channels_and_samples_that_hardly_come() {
    let slow = Duration::from_secs_f64(limits::overtime(1.0)) + handshake();
    let cases = vec![
        (Lie::Channels(0), RECORD, handshake() + 2 * limits::SILENCE),
        (Lie::Channels(1), RECORD, handshake()),
        (Lie::Channels(50), RECORD, handshake()),
        (Lie::Trickle, RECORD, 2 * slow),
        (Lie::Trickle, MONITOR, 2 * slow),
        (Lie::Faults, RECORD, handshake()),
        (Lie::Faults, MONITOR, handshake()),
    ];
    for ended in all(cases) {
        let code = match ended.lie {
            Lie::Channels(0 | 1) | Lie::Trickle => 2,
            _ => 0,
        };
        assert_eq!(ended.code, Some(code), "{ended:#?}");
    }
}

#[test]
fn a_box_that_is_busy_for_ever_is_given_up() {
    // What it is asked before, and the last poll.
    let bound = limits::LONGEST_WORK + handshake();
    let ended = run(Lie::Busy, SELFTEST, bound);
    check(&ended);
    assert_eq!(ended.code, Some(2));
    assert!(
        ended.stderr.contains("still at work on Selftest"),
        "{ended:#?}"
    );
    assert!(ended.stderr.contains("board restart"), "{ended:#?}");
}

#[test]
fn texts_of_a_box_do_not_steer_a_terminal() {
    let json: &[&str] = &["info", "--json"];
    let settings: &[&str] = &["settings", "--json"];
    let commands = [INFO, SETTINGS, RECORD, MONITOR, json, settings];
    for ended in all(commands.map(|a| (Lie::Texts, a, handshake())).to_vec()) {
        assert_eq!(ended.code, Some(0), "{ended:#?}");
        if ended.arguments == INFO {
            // The end of a line in its name would begin another one.
            assert!(
                ended
                    .stdout
                    .contains("\\u{1b}[2J\\u{9b}31m\\nerror: a\\u{202e}b")
            );
            assert!(ended.stderr.contains("\\u{1b}]0;x"), "{ended:#?}");
        }
    }
}

#[test]
fn ctrl_c_ends_a_recording_whatever_comes() {
    for lie in [Lie::None, Lie::Faults, Lie::Trickle] {
        let peer = Peer::new(lie);
        let folder = tempfile::tempdir().unwrap();
        let arguments: &[&str] = &["record", "x.csv", "--seconds", "100000"];
        let mut program = spawn(&peer, arguments, &folder);
        let runs = Duration::from_secs(4);
        std::thread::sleep(runs);
        assert_eq!(program.child.try_wait().unwrap(), None, "{lie:?}");
        let id = program.child.id().to_string();
        let kill = Command::new("kill").args(["-INT", &id]).status();
        assert!(kill.unwrap().success());
        let ended = finish(program, lie, arguments, runs + handshake(), folder);
        check(&ended);
        assert_eq!(ended.code, Some(0), "{ended:#?}");
    }
}
