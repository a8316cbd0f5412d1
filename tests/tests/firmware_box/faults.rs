//! A box reports the cause of a failure after its reset, until the faults are cleared.

use massline_firmware::wire::{FaultCounters, Provoke, Request, ResetReason};

use crate::talk::Talk;

/// Makes the box fail and waits for its new session.
fn provoke(talk: &mut Talk, fault: Provoke) {
    talk.done(&Request::Provoke(fault));
    talk.started();
}

/// Failures in a hello: reason, resets, message, counters.
fn failures(talk: &mut Talk) -> (ResetReason, u32, Option<String>, FaultCounters) {
    talk.hello(|info| {
        (
            info.reset,
            info.resets,
            info.panic.map(str::to_owned),
            info.faults,
        )
    })
}

#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn a_panic_is_reported_after_the_reset_until_it_is_cleared() {
    let mut talk = Talk::boot();
    provoke(&mut talk, Provoke::Panic);
    let counted = FaultCounters {
        panic: 1,
        ..FaultCounters::default()
    };
    for _ in 0..2 {
        let (reset, resets, message, faults) = failures(&mut talk);
        assert_eq!((reset, resets, faults), (ResetReason::Panic, 1, counted));
        let message = message.expect("a panic has a message");
        let place = message.strip_suffix(": provoked by the host");
        let line = place.and_then(|place| place.strip_prefix("firmware/src/services.rs:"));
        assert!(
            line.is_some_and(|line| line.parse::<u32>().is_ok()),
            "{message}"
        );
    }
    // A restart does not clear it.
    talk.done(&Request::Reboot);
    let started = talk.started();
    assert_eq!((started.reset, started.resets), (ResetReason::Request, 2));
    let (reset, resets, message, faults) = failures(&mut talk);
    assert_eq!((reset, resets, faults), (ResetReason::Request, 2, counted));
    assert!(message.is_some());
    talk.done(&Request::ForgetFaults);
    let (_, _, message, faults) = failures(&mut talk);
    assert_eq!((message, faults), (None, FaultCounters::default()));
    talk.done(&Request::Reboot);
    talk.started();
    let (_, resets, message, faults) = failures(&mut talk);
    assert_eq!(
        (resets, message, faults),
        (3, None, FaultCounters::default())
    );
}

#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn an_overflow_of_the_stack_runs_into_its_guard() {
    let mut talk = Talk::boot();
    provoke(&mut talk, Provoke::StackOverflow);
    let (reset, _, message, faults) = failures(&mut talk);
    assert_eq!(reset, ResetReason::StackOverflow);
    assert_eq!(faults.stack_overflow, 1);
    let message = message.expect("an overflow has a message");
    assert!(
        message.ends_with("the stack ends at 0x20000000"),
        "{message}"
    );
}

#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn the_watchdog_resets_after_a_hanging_task_and_names_it() {
    let mut talk = Talk::boot();
    talk.done(&Request::Provoke(Provoke::Hang));
    // Tasks of higher priority continue.
    talk.hello(|info| assert_eq!(info.reset, ResetReason::PowerOn));
    talk.started();
    let (reset, _, message, faults) = failures(&mut talk);
    assert_eq!(reset, ResetReason::Watchdog);
    assert_eq!(faults.watchdog, 1);
    assert_eq!(message.as_deref(), Some("task block did not check in"));
}
