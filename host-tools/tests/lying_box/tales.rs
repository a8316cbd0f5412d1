//! The commands that have a box measure, identify and repeat, against one that lies about it.

use crate::bench::command;
use crate::fork::{FORK, measured};
use crate::handshake;
use crate::proxy::{Proxy, Tale};
use crate::stand_in::{self, beside};
use massline::device::{HostBox, HostBoxMemory};
use massline::limits;
use massline::printable::steers;
use std::ops::Deref;
use std::time::Duration;

/// The end of a command.
#[derive(Debug)]
struct Told {
    tale: Tale,
    words: &'static str,
    program: stand_in::Ended,
}

impl Deref for Told {
    type Target = stand_in::Ended;

    fn deref(&self) -> &stand_in::Ended {
        &self.program
    }
}

const IDENTIFY: &str = "board identify setup.toml --inputs wired.toml";
const MEASURE: &str = "board measure setup.toml --inputs wired.toml --duration 6";
const SURVEY: &str =
    "board measure setup.toml --inputs wired.toml --duration 6 --method b-cholesky";
const REPLAY: &str = "replay setup.toml --blocks 2";
const WEIGHTED: &str = "replay setup.toml --method c-squared";

fn run(tale: Tale, words: &'static str) -> Told {
    let inputs = FORK.inputs();
    let mut memory = HostBoxMemory::new();
    let mut host_box = HostBox::with_inputs(&mut memory, 1, inputs);
    if words == IDENTIFY {
        measured(&mut host_box);
    }
    let folder = tempfile::tempdir().unwrap();
    FORK.copy(folder.path());
    let mut proxy = Proxy::new(&mut host_box, tale);
    let limit = limits::LONGEST_WORK + handshake() + limits::SILENCE;
    let bound = limit + Duration::from_secs_f64(limits::overtime(6.0));
    let command = command(folder.path(), words.split(' '));
    let program = stand_in::run(&mut proxy, command, bound, &(tale, words));
    let told = Told {
        tale,
        words,
        program,
    };
    let about = format!("{told:#?}");
    assert!(matches!(told.code, Some(0..=2)), "{about}");
    assert!(!told.stderr.contains("panicked"), "{about}");
    for text in [&told.stdout, &told.stderr] {
        assert_eq!(text.find(|c| steers(c) && c != '\n'), None, "{about}");
    }
    let errors = told.stderr.matches("error: ").count();
    assert_eq!(errors, usize::from(told.code != Some(0)), "{about}");
    // What no sound answer has does not pass for one.
    let numbers = ["NaN", "inf"].map(|word| told.stdout.contains(word));
    assert!(told.code != Some(0) || numbers == [false; 2], "{about}");
    println!("{tale:?} {words}: {:?}, {:.1?}", told.code, told.took);
    println!("    {}", told.stderr.trim_end().replace('\n', "\n    "));
    told
}

/// Runs commands beside each other.
fn all(cases: Vec<(Tale, &'static str)>) -> Vec<Told> {
    beside(6, cases, |(tale, words)| run(tale, words))
}

#[test]
fn a_box_that_tells_the_truth_is_believed() {
    let words = [IDENTIFY, MEASURE, SURVEY, REPLAY, WEIGHTED];
    for told in all(words.map(|words| (Tale::None, words)).to_vec()) {
        assert_eq!(told.code, Some(0), "{told:#?}");
    }
}

#[test]
fn answers_that_are_none_are_refused() {
    let mut cases = Vec::new();
    for tale in [
        Tale::Estimate(f64::NAN),
        Tale::Estimate(f64::INFINITY),
        Tale::Deviation(f64::NAN),
        Tale::Deviation(-1.0),
        Tale::Deviation(f64::INFINITY),
        Tale::Quality(f64::NAN),
        Tale::Blocks(u32::MAX, 0),
        Tale::Blocks(1, u64::MAX),
        Tale::Counts(u32::MAX, 0),
        Tale::Counts(1, u64::MAX),
        Tale::Rate(f64::NAN),
        Tale::Rate(-512.0),
    ] {
        cases.extend([IDENTIFY, MEASURE, REPLAY].map(|words| (tale, words)));
    }
    for told in all(cases) {
        // A replay is refused an answer that is none, or says that both differ.
        let codes: &[i32] = if told.words == REPLAY { &[1, 2] } else { &[2] };
        assert!(codes.contains(&told.code.unwrap()), "{told:#?}");
    }
}

#[test]
fn large_numbers_are_judged_as_numbers() {
    for tale in [
        Tale::Estimate(1e308),
        Tale::Estimate(-1e308),
        Tale::Deviation(1e308),
        Tale::Deviation(0.0),
        Tale::Quality(1e308),
        Tale::Quality(-1e308),
        Tale::Blocks(limits::BLOCKS, limits::LAST_SAMPLE),
        Tale::Counts(limits::BLOCKS, limits::LAST_SAMPLE),
    ] {
        all([IDENTIFY, MEASURE, REPLAY]
            .map(|words| (tale, words))
            .to_vec());
    }
}

#[test]
fn counts_that_do_not_fit_come_to_an_end() {
    let tales = [
        Tale::Grid(0, 0.0),
        Tale::Grid(u32::MAX, f64::NAN),
        Tale::Lines(f32::NAN),
        Tale::Lines(f32::MAX),
        Tale::Empty,
        Tale::Many(f64::NAN),
        Tale::Many(-1.0),
        Tale::Many(0.5),
        Tale::Progress(0),
        Tale::Progress(u64::MAX),
        Tale::Room(0),
        Tale::Room(255),
        Tale::Stored,
        Tale::OtherRun,
        Tale::Running(u64::MAX),
        Tale::Coherence(f32::NAN, u32::MAX),
    ];
    let words = [IDENTIFY, MEASURE, SURVEY, REPLAY, WEIGHTED];
    let cases = tales.into_iter().flat_map(|tale| words.map(|w| (tale, w)));
    for told in all(cases.collect()) {
        let replays = [REPLAY, WEIGHTED].contains(&told.words);
        let wrong = match told.tale {
            Tale::Grid(..) | Tale::Lines(_) | Tale::Progress(_) => replays,
            Tale::Many(value) => [SURVEY, WEIGHTED].contains(&told.words) && value != 0.5,
            Tale::Room(0) => true,
            _ => false,
        };
        assert!(!wrong || told.code != Some(0), "{told:#?}");
    }
}

#[test]
fn work_without_an_end_is_given_up() {
    let cases = vec![
        (Tale::AtWork, IDENTIFY),
        (Tale::AtWork, REPLAY),
        // A run that stands still.
        (Tale::Running(3), MEASURE),
    ];
    for told in all(cases) {
        let words = match told.tale {
            Tale::AtWork => "still at work on Identify",
            _ => return,
        };
        assert_eq!(told.code, Some(2), "{told:#?}");
        assert!(told.stderr.contains(words), "{told:#?}");
    }
}
