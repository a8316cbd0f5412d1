//! The record that survives a reset: number and cause of resets, fault counters, and the message of
//! the last failure.
//!
//! The record lies in memory that the start-up code does not initialise. After power was off that
//! memory is noise, which the record's checksum detects. The binary places it; here it is bytes.

use core::fmt::{self, Write};

use crate::wire::{CRC32, FaultCounters, PANIC_MAX, ResetReason};

/// Bytes of a record in memory, its checksum included.
pub const SIZE: usize = 4 * WORDS + 2 + 2 + 1 + 1 + PANIC_MAX + 2 + 4;

/// Number of fault counters.
const FAULTS: usize = 11;

/// Words of 32 bits at the beginning: mark, resets and fault counters.
const WORDS: usize = 2 + FAULTS;

/// First word of a record; its last digit is the version of the layout.
const MARK: u32 = 0x6D4C_0001;

/// Cause of a reset that the program itself has noted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// A panic.
    Panic,
    /// A fault of the processor.
    HardFault,
    /// The stack ran into its guard.
    StackOverflow,
    /// A task did not check in with the task watchdog.
    Watchdog,
    /// The host requested it.
    Request,
}

impl Cause {
    const ALL: [Self; 5] = [
        Self::Panic,
        Self::HardFault,
        Self::StackOverflow,
        Self::Watchdog,
        Self::Request,
    ];

    /// Number of the cause in memory; zero means none.
    const fn code(self) -> u8 {
        self as u8 + 1
    }

    fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|cause| cause.code() == code)
    }

    const fn reason(self) -> ResetReason {
        match self {
            Self::Panic => ResetReason::Panic,
            Self::HardFault => ResetReason::HardFault,
            Self::StackOverflow => ResetReason::StackOverflow,
            Self::Watchdog => ResetReason::Watchdog,
            Self::Request => ResetReason::Request,
        }
    }
}

/// Flags of the chip's reset controller. Several may be set at once, and none in the emulator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ResetFlags {
    /// The supply came up.
    pub power_on: bool,
    /// The supply was below the brown-out level; also set when it comes up.
    pub brown_out: bool,
    /// The chip's own watchdog bit.
    pub watchdog: bool,
    /// The reset pin; also set by every other reset, which pulls that pin.
    pub pin: bool,
    /// The program, or a debugger, requested the reset.
    pub software: bool,
}

/// Record that survives a reset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Record {
    /// Number of resets since the box was last switched on.
    pub resets: u32,
    /// Number of this session on the link.
    pub session: u16,
    /// Fault counters.
    pub faults: FaultCounters,
    cause: Option<Cause>,
    message: Text,
}

impl Record {
    /// The record at a start, and the reason of the start.
    ///
    /// `noise` is the number of the first session after power was off; noise of the memory makes it
    /// another one each time.
    #[must_use]
    pub fn start(previous: Option<Self>, flags: ResetFlags, noise: u16) -> (Self, ResetReason) {
        let previous = previous.filter(|_| !flags.power_on);
        let Some(mut record) = previous else {
            let mut record = Self::new(noise);
            // Memory is lost without "power on" if the supply was too low.
            let is_brown_out = flags.brown_out && !flags.power_on;
            if is_brown_out {
                record.faults.brown_out = 1;
            }
            return (
                record,
                if is_brown_out {
                    ResetReason::BrownOut
                } else {
                    ResetReason::PowerOn
                },
            );
        };
        record.resets = record.resets.saturating_add(1);
        record.session = record.session.wrapping_add(1);
        let reason = match record.cause.take() {
            Some(cause) => cause.reason(),
            None if flags.watchdog => {
                count(&mut record.faults.watchdog);
                ResetReason::Watchdog
            }
            None if flags.brown_out => {
                count(&mut record.faults.brown_out);
                ResetReason::BrownOut
            }
            // Requested by a debugger, or by a program without this record.
            None if flags.software => ResetReason::Other,
            None if flags.pin => ResetReason::Pin,
            None => ResetReason::Other,
        };
        (record, reason)
    }

    fn new(session: u16) -> Self {
        Self {
            resets: 0,
            session,
            faults: FaultCounters::default(),
            cause: None,
            message: Text::new(),
        }
    }

    /// Notes the cause of the coming reset and its message, which is ignored for
    /// [`Cause::Request`].
    pub fn end(&mut self, cause: Cause, message: fmt::Arguments<'_>) {
        self.cause = Some(cause);
        let counter = match cause {
            Cause::Panic => &mut self.faults.panic,
            Cause::HardFault => &mut self.faults.hard_fault,
            Cause::StackOverflow => &mut self.faults.stack_overflow,
            Cause::Watchdog => &mut self.faults.watchdog,
            Cause::Request => return,
        };
        count(counter);
        self.message = Text::new();
        // A message that is too long is cut.
        let _ = self.message.write_fmt(message);
    }

    /// Message of the last failure.
    #[must_use]
    pub fn message(&self) -> Option<&str> {
        Some(self.message.as_str()).filter(|message| !message.is_empty())
    }

    /// Clears the fault counters and the message.
    pub fn clear_faults(&mut self) {
        self.faults = FaultCounters::default();
        self.message = Text::new();
    }

    /// The bytes of the record in memory.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; SIZE] {
        let mut bytes = [0; SIZE];
        let mut rest = &mut bytes[..];
        let mut faults = self.faults;
        let faults = counters(&mut faults).map(|counter| *counter);
        for word in [MARK, self.resets].into_iter().chain(faults) {
            put(&mut rest, word.to_le_bytes());
        }
        put(&mut rest, self.session.to_le_bytes());
        put(&mut rest, self.message.length.to_le_bytes());
        put(&mut rest, [self.cause.map_or(0, Cause::code), 0]);
        put(&mut rest, self.message.bytes);
        if let Some((covered, checksum)) = bytes.split_last_chunk_mut() {
            *checksum = CRC32.checksum(covered).to_le_bytes();
        }
        bytes
    }

    /// Reads a record; `None` if the bytes are none.
    #[must_use]
    pub fn from_bytes(bytes: &[u8; SIZE]) -> Option<Self> {
        let (covered, checksum) = bytes.split_last_chunk::<4>()?;
        if CRC32.checksum(covered) != u32::from_le_bytes(*checksum) {
            return None;
        }
        let mut rest = covered;
        let mark = u32::from_le_bytes(take(&mut rest)?);
        let resets = u32::from_le_bytes(take(&mut rest)?);
        let mut faults = FaultCounters::default();
        for counter in counters(&mut faults) {
            *counter = u32::from_le_bytes(take(&mut rest)?);
        }
        let session = u16::from_le_bytes(take(&mut rest)?);
        let length = u16::from_le_bytes(take(&mut rest)?);
        let [code, _] = take(&mut rest)?;
        let text = Text {
            length,
            bytes: take(&mut rest)?,
        };
        (mark == MARK).then_some(Self {
            resets,
            session,
            faults,
            cause: Cause::from_code(code),
            message: text,
        })
    }
}

/// The fault counters in their order in memory.
const fn counters(faults: &mut FaultCounters) -> [&mut u32; FAULTS] {
    [
        &mut faults.watchdog,
        &mut faults.brown_out,
        &mut faults.panic,
        &mut faults.hard_fault,
        &mut faults.stack_overflow,
        &mut faults.converter_checksum,
        &mut faults.converter_missed,
        &mut faults.converter_reset,
        &mut faults.out_of_step,
        &mut faults.overrun,
        &mut faults.storage,
    ]
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

/// Removes bytes from the beginning of `rest`.
fn take<const N: usize>(rest: &mut &[u8]) -> Option<[u8; N]> {
    let (front, back) = rest.split_first_chunk()?;
    *rest = back;
    Some(*front)
}

/// Writes bytes at the beginning of `rest`, and removes them from it.
fn put<const N: usize>(rest: &mut &mut [u8], bytes: [u8; N]) {
    if let Some((front, back)) = core::mem::take(rest).split_first_chunk_mut() {
        *front = bytes;
        *rest = back;
    }
}

/// A text that is cut after the last character that fits.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Text {
    length: u16,
    bytes: [u8; PANIC_MAX],
}

impl Text {
    const fn new() -> Self {
        Self {
            length: 0,
            bytes: [0; PANIC_MAX],
        }
    }

    fn as_str(&self) -> &str {
        let bytes = self
            .bytes
            .get(..usize::from(self.length))
            .unwrap_or(&self.bytes);
        core::str::from_utf8(bytes).unwrap_or_default()
    }
}

impl Write for Text {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for character in text.chars() {
            let begin = usize::from(self.length);
            let Some(slot) = self.bytes.get_mut(begin..begin + character.len_utf8()) else {
                // No text may follow a character that did not fit.
                return Err(fmt::Error);
            };
            character.encode_utf8(slot);
            self.length = (begin + slot.len()) as u16;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLD: ResetFlags = ResetFlags {
        power_on: true,
        brown_out: true,
        watchdog: false,
        pin: true,
        software: false,
    };
    const NOTHING: ResetFlags = ResetFlags {
        power_on: false,
        brown_out: false,
        watchdog: false,
        pin: false,
        software: false,
    };

    /// A restart, with the record passed on as bytes.
    fn restart(record: &Record, flags: ResetFlags) -> (Record, ResetReason) {
        Record::start(Record::from_bytes(&record.to_bytes()), flags, 77)
    }

    #[test]
    fn comes_back_from_memory_as_it_was() {
        let (mut record, _) = Record::start(None, COLD, 0xBEEF);
        record.faults = FaultCounters {
            watchdog: 1,
            brown_out: 2,
            panic: 3,
            hard_fault: 4,
            stack_overflow: 5,
            converter_checksum: 6,
            converter_missed: 7,
            converter_reset: 8,
            out_of_step: 9,
            overrun: 10,
            storage: u32::MAX,
        };
        record.end(Cause::StackOverflow, format_args!("at {}", "the bottom: Θ"));
        assert_eq!(Record::from_bytes(&record.to_bytes()), Some(record));
    }

    #[test]
    fn one_wrong_bit_is_no_record() {
        let (mut record, _) = Record::start(None, COLD, 1);
        record.end(Cause::Panic, format_args!("text"));
        let bytes = record.to_bytes();
        for bit in 0..8 * SIZE {
            let mut bytes = bytes;
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(Record::from_bytes(&bytes), None, "bit {bit}");
        }
        assert_eq!(Record::from_bytes(&[0; SIZE]), None);
        assert_eq!(Record::from_bytes(&[0xFF; SIZE]), None);
    }

    #[test]
    fn the_noted_cause_comes_before_the_chips_flags() {
        let (mut record, reason) = Record::start(None, COLD, 9);
        assert_eq!(
            (reason, record.resets, record.session),
            (ResetReason::PowerOn, 0, 9)
        );
        let ends = [
            (Cause::Panic, ResetReason::Panic),
            (Cause::HardFault, ResetReason::HardFault),
            (Cause::StackOverflow, ResetReason::StackOverflow),
            (Cause::Watchdog, ResetReason::Watchdog),
            (Cause::Request, ResetReason::Request),
        ];
        for (k, (cause, expected)) in ends.into_iter().enumerate() {
            record.end(cause, format_args!("number {k}"));
            let software = ResetFlags {
                software: true,
                pin: true,
                ..NOTHING
            };
            let (next, reason) = restart(&record, software);
            assert_eq!(reason, expected);
            assert_eq!(next.resets as usize, k + 1);
            assert_eq!(usize::from(next.session), 9 + k + 1);
            record = next;
            // The cause is reported once.
            assert_eq!(restart(&record, NOTHING).1, ResetReason::Other);
        }
        assert_eq!(
            record.message(),
            Some("number 3"),
            "a request has no message"
        );
        let faults = record.faults;
        let counted = [
            faults.panic,
            faults.hard_fault,
            faults.stack_overflow,
            faults.watchdog,
        ];
        assert_eq!(counted, [1; 4]);
        record.clear_faults();
        assert_eq!(
            (record.message(), record.faults),
            (None, FaultCounters::default())
        );
        assert_eq!(record.resets, 5, "resets are not faults");
    }

    #[test]
    fn without_a_noted_cause_the_chips_flags_count() {
        let (record, _) = Record::start(None, COLD, 9);
        let after = |flags| {
            let (record, reason) = restart(&record, flags);
            (reason, record.faults.watchdog, record.faults.brown_out)
        };
        let pin = ResetFlags {
            pin: true,
            ..NOTHING
        };
        let watchdog = ResetFlags {
            watchdog: true,
            ..pin
        };
        let brown_out = ResetFlags {
            brown_out: true,
            ..pin
        };
        let debugger = ResetFlags {
            software: true,
            ..pin
        };
        assert_eq!(after(pin), (ResetReason::Pin, 0, 0));
        assert_eq!(after(watchdog), (ResetReason::Watchdog, 1, 0));
        assert_eq!(after(brown_out), (ResetReason::BrownOut, 0, 1));
        assert_eq!(after(debugger), (ResetReason::Other, 0, 0));
        assert_eq!(after(NOTHING), (ResetReason::Other, 0, 0));
        assert_eq!(after(COLD), (ResetReason::PowerOn, 0, 0), "power on clears");
        let (record, reason) = Record::start(None, brown_out, 3);
        assert_eq!(
            (reason, record.faults.brown_out),
            (ResetReason::BrownOut, 1)
        );
    }

    #[test]
    fn long_messages_are_cut_between_characters() {
        let (mut record, _) = Record::start(None, COLD, 1);
        // Three bytes each, of which 256 is no multiple.
        let long = "√".repeat(100);
        record.end(Cause::Panic, format_args!("{long}{}", "never"));
        assert_eq!(record.message(), Some("√".repeat(PANIC_MAX / 3).as_str()));
        let back = Record::from_bytes(&record.to_bytes());
        assert_eq!(back, Some(record));
    }
}
