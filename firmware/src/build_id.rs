//! The build id: the digest that the linker makes of the program.

use core::fmt::Write;

use heapless::String;

unsafe extern "C" {
    /// The note with the digest, see `sections.x`.
    static __build_id: u8;
    /// Its end.
    static __build_id_end: u8;
}

/// Bytes of the digest that are reported.
const REPORTED: usize = 8;
/// Bytes before it: three lengths and kinds, and the name `GNU` with its end.
const NOTE_HEADER: usize = 16;

/// The first half of the digest, in hexadecimal digits.
pub fn read() -> String<{ 2 * REPORTED }> {
    let begin = &raw const __build_id;
    let length = (&raw const __build_id_end) as usize - begin as usize;
    let mut text = String::new();
    for i in NOTE_HEADER..(NOTE_HEADER + REPORTED).min(length) {
        // SAFETY: `i` is below the length of the note, which the linker has put in flash.
        let byte = unsafe { begin.add(i).read() };
        // It has just the room.
        let _ = write!(text, "{byte:02x}");
    }
    text
}
