//! The self-test: the box's own body, through the whole box, and back.

use crate::bench::{Bench, Heard, Said};
use massline_firmware::wire::*;

#[test]
fn the_body_comes_back_within_its_bound() {
    let mut bench = Bench::switch_on();
    let Said::Selftest(found) = bench.await_reply(&Request::Selftest) else {
        panic!("no self-test");
    };
    assert!(found.passed, "{found:?}");
    assert_eq!(found.health, Health::GOOD);
    let names = "mass x y z xx yy zz xy xz yz".split(' ');
    for (name, check) in names.zip(found.checks) {
        let off = check.found.expect(name) - check.truth;
        assert!(off.abs() <= check.bound, "{name} is off by {off}");
        // Not a bound that anything passes: mass and inertia of the body are of order one.
        assert!(check.bound < 2e-5, "{name}");
    }
    // Its runs are its own: a host hears of the start, and of nothing else.
    assert_eq!(bench.events(), [Heard::Started]);
    assert_eq!(bench.status().state, State::Empty);
    assert_eq!(bench.status().stored, 0);
}

#[test]
fn it_says_the_same_every_time() {
    let mut bench = Bench::switch_on();
    let first = bench.await_reply(&Request::Selftest);
    assert_eq!(bench.await_reply(&Request::Selftest), first);
}

#[test]
fn while_it_goes_on_the_box_answers_and_starts_nothing_else() {
    let mut bench = Bench::switch_on();
    let id = bench.send(&Request::Selftest);
    for _ in 0..50 {
        assert!(bench.poll());
    }
    let number = Request::Selftest.number();
    let status = bench.status();
    assert_eq!((status.state, status.busy), (State::Empty, Some(number)));
    assert_eq!(status.running, None);
    let plan = Plan {
        sensors: 1,
        runs: 1,
        reference_point: [0.0; 3],
        fingerprint: 1,
    };
    for request in [Request::Selftest, Request::BeginSetup(plan)] {
        assert_eq!(bench.refused(&request), Problem::Busy(number));
    }
    // A run that nobody has started can be neither stopped nor thrown away.
    let missing = Problem::missing(Item::Summary, 0);
    assert_eq!(bench.refused(&Request::Stop), missing);
    bench.done(&Request::Abort);
    bench.work();
    let [(to, Said::Selftest(found))] = bench.host.replies.as_slice() else {
        panic!("{:?}", bench.host.replies);
    };
    assert!(*to == id && found.passed);
}
