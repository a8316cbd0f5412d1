//! The box's answer to a hello.

use massline::device::firmware;
use massline_firmware::wire::{ClockSource, Info, ResetReason, Storage};

use crate::golden;
use crate::talk::Talk;

/// The answer to a hello as text, a line for each field.
fn text(info: &Info<'_>) -> String {
    format!("{info:#?}\n")
}

// The build id differs with every change and compiler; it has a test of its own.
#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn the_answer_to_a_hello_is_golden() {
    let mut talk = Talk::boot();
    let text = talk.hello(|info| {
        text(&Info {
            build: "(build)",
            version: "(version)",
            ..*info
        })
    });
    golden::compare("hello.txt", &text);
}

#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn reports_its_version_and_the_build_id_of_its_elf() {
    let elf = firmware::find(None).unwrap_or_else(|error| panic!("{error}"));
    let elf = std::fs::read(&elf).expect("the firmware can be read");
    // The note's header and name, before the id.
    let name = b"\x04\0\0\0\x14\0\0\0\x03\0\0\0GNU\0";
    let at = elf.windows(name.len()).position(|bytes| bytes == name);
    let digest = &elf[at.expect("the linker has left a digest") + name.len()..][..8];
    let expected: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
    Talk::boot().hello(|info| {
        assert_eq!(info.build, expected);
        assert_eq!(info.version, env!("CARGO_PKG_VERSION"));
    });
}

// The emulator raises neither "crystal ready" nor "PLL locked", like a board with a broken crystal
// and PLL, so the last fallback must run. Its flash cannot be programmed.
#[test]
#[ignore = "needs the firmware and QEMU, run it by `cargo xtask test --only emulator`"]
fn reports_the_fallback_of_clock_and_storage() {
    Talk::boot().hello(|info| {
        assert_eq!(info.clock, ClockSource::Internal);
        assert_eq!(info.clock_hz, 16_000_000);
        assert_eq!(info.storage, Storage::Volatile);
        assert_eq!((info.reset, info.resets), (ResetReason::PowerOn, 0));
    });
}

#[test]
fn xtask_and_the_host_tool_use_the_same_names() {
    use massline::device::emulator;
    use massline_tests::emulator as xtask;
    assert_eq!(firmware::FIRMWARE_ELF, xtask::FIRMWARE_ELF);
    assert_eq!(emulator::QEMU, xtask::QEMU);
    assert_eq!(emulator::DEFAULT_PROGRAM, xtask::DEFAULT_PROGRAM);
}
