//! Recordings through the box in this program: the same bits as the workstation's under all errors
//! of the line, and every flipped bit is detected.

mod identical;

use identical::{assert_complete, assert_identical, fork};
use massline::device::{HostBox, HostBoxMemory, Noise, NoisyLine, Port, PortError};
use massline::replay::{Flip, Order, Outcome};
use massline::rig::{self, Trouble, Troubles};
use massline::setup::Setup;
use massline::simulate::{Model, Options, simulate};
use massline_core::masslines::Method;
use massline_firmware::wire::{BODY_MAX, FromBox, Received, Receiver, Request, ToBox, ToHost};
use std::collections::BTreeSet;
use std::time::Duration;

/// Blocks of each run: enough for an answer of every method, and for four turns of each group of
/// surveyed sensors.
const BLOCKS: u32 = 8;

fn order(methods: &[Method]) -> Order {
    identical::order(methods, BLOCKS)
}

fn replayed(order: &Order) -> Outcome {
    let mut memory = HostBoxMemory::new();
    identical::over(HostBox::new(&mut memory, 1), &fork(), order).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn three_methods_give_the_same_bits() {
    let methods = [
        Method::ApparentMass,
        Method::PowerSpectraCholesky,
        Method::FreeResponsesSquared,
    ];
    let outcome = replayed(&order(&methods));
    assert_identical(&outcome);
    // The apparent mass from the interface, the others from all accelerometers.
    assert_eq!(outcome.bases.len(), 2);
    assert_complete(&outcome, BLOCKS);
}

#[test]
fn weighted_and_iterated_give_the_same_bits() {
    let outcome = replayed(&Order {
        iterative: true,
        weighted: true,
        ..order(&[Method::Synthesis])
    });
    assert_identical(&outcome);
    let weights = outcome.bases[0].weights.as_ref().unwrap();
    // A peak and a weight of each of 15 accelerometers and 3 load cells in three runs, and
    // the lengths of the lists.
    assert_eq!(weights.numbers, 2 * 3 * (18 + 1));
}

#[test]
fn weights_of_each_run_give_the_same_bits() {
    assert_identical(&replayed(&Order {
        weighted: true,
        ..order(&[Method::FrequencyResponses])
    }));
}

#[test]
fn one_flipped_bit_is_noticed_and_named() {
    // The lowest bit of a reading in the middle of the second run.
    let flip = Flip::parse("2:2500:a2:0", &fork()).unwrap();
    let outcome = replayed(&Order {
        flip: Some(flip),
        ..order(&[Method::ApparentMass])
    });
    assert!(!outcome.identical());
    let runs = &outcome.bases[0].runs;
    let differs: Vec<bool> = runs.iter().map(|r| !r.comparison.identical()).collect();
    assert_eq!(differs, [false, true, false]);
    let first = runs[1].comparison.first.as_ref().unwrap().to_string();
    assert!(first.starts_with("line "), "{first}");
}

#[test]
fn a_bad_line_changes_nothing() {
    let bad = Noise {
        corrupted: 0.03,
        truncated: 0.03,
        duplicated: 0.03,
    };
    let mut memory = HostBoxMemory::new();
    let mut line = NoisyLine::new(HostBox::new(&mut memory, 1), bad, 20261121);
    let outcome = identical::over(&mut line, &fork(), &order(&[Method::ApparentMass])).unwrap();
    assert_identical(&outcome);
    for damage in [line.to_box(), line.from_box()] {
        assert!(
            damage.corrupted > 10 && damage.truncated > 10 && damage.duplicated > 10,
            "{damage:?}"
        );
    }
    assert!(outcome.link.resent > 0);
}

// The box has to leave out the same blocks as the workstation, and the others must not depend on
// the value in the place of a faulty sample.
#[test]
fn faulty_samples_of_a_recording_are_faulty_on_the_box() {
    let folder = tempfile::tempdir().unwrap();
    let options = Options {
        noise: Some(0.01),
        duration: Some(40.0),
        ..Options::default()
    };
    let mut simulation = simulate(&Model::fork().unwrap(), &options, &mut |_| ()).unwrap();
    let troubles = Troubles {
        kinds: Trouble::ALL.to_vec(),
        per_minute: 9.0,
        seed: 7,
    };
    rig::acquire(&mut simulation, &troubles, &mut |_, _| ()).unwrap();
    let setup = Setup::read(&simulation.write(folder.path()).unwrap()).unwrap();
    let order = Order {
        blocks: None,
        weighted: true,
        ..order(&[Method::ApparentMass, Method::Synthesis])
    };
    let mut memory = HostBoxMemory::new();
    let outcome = identical::over(HostBox::new(&mut memory, 1), &setup, &order).unwrap();
    assert_identical(&outcome);
    for base in &outcome.bases {
        for (run, recording) in base.runs.iter().zip(&simulation.recordings) {
            let faulty = recording.health.iter().filter(|h| !h.is_good()).count();
            assert!(faulty > 0 && run.faulty == faulty as u64, "{run:?}");
            assert!(run.rejected > 0 && run.blocks > 1, "{run:?}");
            // 40 s at 512 samples/s, blocks of two seconds that overlap by half.
            assert_eq!(run.samples, 20_480);
            assert!((37..=39).contains(&(run.blocks + run.rejected)), "{run:?}");
        }
    }
}

/// A port that counts the unanswered requests of samples.
struct Watched<'m, P> {
    port: P,
    to_box: Receiver<'m, ToBox>,
    from_box: Receiver<'m, ToHost>,
    open: BTreeSet<u16>,
    most: usize,
}

impl<P: Port> Port for Watched<'_, P> {
    fn name(&self) -> String {
        self.port.name()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let mut rest = bytes;
        while let Some(received) = self.to_box.next(&mut rest) {
            if let Received::Message(header, Request::Samples(_)) = received {
                self.open.insert(header.request);
                self.most = self.most.max(self.open.len());
            }
        }
        self.port.send(bytes)
    }

    fn receive(&mut self, into: &mut Vec<u8>, timeout: Duration) -> Result<usize, PortError> {
        let before = into.len();
        let count = self.port.receive(into, timeout)?;
        let mut rest = &into[before..];
        while let Some(received) = self.from_box.next(&mut rest) {
            if let Received::Message(header, FromBox::Reply(_)) = received {
                self.open.remove(&header.request);
            }
        }
        Ok(count)
    }

    fn patience(&self) -> Duration {
        self.port.patience()
    }
}

// More would be lost by a box with little memory; fewer leave the link idle.
#[test]
fn as_many_samples_are_on_their_way_as_the_box_allows() {
    let (mut memory, mut sent, mut heard) = (HostBoxMemory::new(), [0; BODY_MAX], [0; BODY_MAX]);
    let mut watched = Watched {
        port: HostBox::new(&mut memory, 1),
        to_box: Receiver::new(&mut sent),
        from_box: Receiver::new(&mut heard),
        open: BTreeSet::new(),
        most: 0,
    };
    let outcome = identical::over(&mut watched, &fork(), &order(&[Method::ApparentMass])).unwrap();
    assert_identical(&outcome);
    assert_eq!(watched.most, usize::from(outcome.device.capacity.window));
    assert!(watched.open.is_empty());
}

#[test]
fn a_flip_that_hits_nothing_is_refused() {
    for (text, reason) in [
        ("1:300:a1", "four parts"),
        ("4:300:a1:20", "no run 4"),
        ("1:x:a1:20", "x is no index"),
        ("1:300:zz:20", "no channel zz"),
        ("1:300:a1:32", "32 is no bit"),
    ] {
        let error = Flip::parse(text, &fork()).unwrap_err().to_string();
        assert!(error.contains(reason), "{error}");
    }
}
