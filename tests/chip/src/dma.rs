//! DMA1 and DMA2: streams between the data registers of SPI and the SRAM (RM0090, 10).
//!
//! Modelled: channels, directions, sizes, increments, counts, the circular mode, flags and interrupts, in
//! direct mode. A request is served at once. The FIFO, the double buffer, bursts and transfers between
//! memories are refused.

use std::sync::Arc;

use rsemu::core::space::RamStore;

use crate::{Moment, flag};

const STREAMS: usize = 8;
/// First offset of the streams' registers, and bytes of each stream.
const FIRST: u32 = 0x10;
const SIZE: u32 = 0x18;

/// Offsets within a stream's registers.
const CR: u32 = 0x00;
const NDTR: u32 = 0x04;
const PAR: u32 = 0x08;
const M0AR: u32 = 0x0C;
const FCR: u32 = 0x14;

const ON: u32 = 1;
/// Bits of CR that may change while a stream is on: the stream itself, and its interrupts.
const FREE: u32 = 0b11111;
const CIRCULAR: u32 = 1 << 8;
const PERIPHERAL_INCREMENT: u32 = 1 << 9;
const MEMORY_INCREMENT: u32 = 1 << 10;
const DOUBLE_BUFFER: u32 = 1 << 18;
const BURSTS: u32 = 0xF << 21;

const DIRECT_MODE_ERROR: u32 = 1 << 2;
const TRANSFER_ERROR: u32 = 1 << 3;
const HALF: u32 = 1 << 4;
const COMPLETE: u32 = 1 << 5;

/// First address and bytes of the SRAM.
const SRAM: (u32, u32) = (0x2000_0000, 128 << 10);

/// A request: of which SPI, from 1 on, and whether it is that of the receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Line {
    /// Number of the SPI.
    pub spi: usize,
    /// `true` for what was received.
    pub is_received: bool,
}

/// Requests of a controller's stream on a channel (tables 42 and 43).
const LINES: [(usize, usize, u32, usize, bool); 10] = [
    (1, 0, 0, 3, true),
    (1, 2, 0, 3, true),
    (1, 3, 0, 2, true),
    (1, 4, 0, 2, false),
    (1, 5, 0, 3, false),
    (1, 7, 0, 3, false),
    (2, 0, 3, 1, true),
    (2, 2, 3, 1, true),
    (2, 3, 3, 1, false),
    (2, 5, 3, 1, false),
];

/// Address of the data register of an SPI.
const fn data(spi: usize) -> u32 {
    match spi {
        1 => 0x4001_300C,
        2 => 0x4000_380C,
        _ => 0x4000_3C0C,
    }
}

#[derive(Clone, Copy, Debug)]
struct Stream {
    cr: u32,
    /// Items to come, and those when it was switched on.
    left: u32,
    items: u32,
    peripheral: u32,
    memory: [u32; 2],
    fcr: u32,
    flags: u32,
    /// Items that were moved since the reset.
    moved: u64,
}

impl Default for Stream {
    fn default() -> Self {
        Self {
            cr: 0,
            left: 0,
            items: 0,
            peripheral: 0,
            memory: [0; 2],
            fcr: 0x21,
            flags: 0,
            moved: 0,
        }
    }
}

impl Stream {
    const fn is_on(&self) -> bool {
        self.cr & ON != 0
    }

    /// Bytes of an item.
    const fn bytes(&self) -> u32 {
        1 << (self.cr >> 11 & 3)
    }

    const fn asks(&self) -> bool {
        // The enabling bits of CR lie one below their flags.
        self.flags & self.cr << 1 & (COMPLETE | HALF | TRANSFER_ERROR | DIRECT_MODE_ERROR) != 0
    }
}

/// A controller.
#[derive(Debug)]
pub struct Dma {
    /// 1 or 2.
    number: usize,
    streams: [Stream; STREAMS],
    memory: Arc<RamStore>,
}

impl Dma {
    /// A controller of this number, 1 or 2, after a reset; its masters reach this SRAM.
    #[must_use]
    pub fn new(number: usize, memory: Arc<RamStore>) -> Self {
        Self {
            number,
            streams: [Stream::default(); STREAMS],
            memory,
        }
    }

    /// All registers go to their initial values.
    pub fn reset(&mut self) {
        self.streams = [Stream::default(); STREAMS];
    }

    /// Items that each stream has moved since the reset.
    #[must_use]
    pub fn moved(&self) -> [u64; STREAMS] {
        self.streams.map(|stream| stream.moved)
    }

    /// Interrupts of the streams, and whether they are asked for (table 62).
    pub fn interrupts(&self) -> impl Iterator<Item = (u16, bool)> {
        let numbers: [u16; STREAMS] = match self.number {
            1 => [11, 12, 13, 14, 15, 16, 17, 47],
            _ => [56, 57, 58, 59, 60, 68, 69, 70],
        };
        numbers
            .into_iter()
            .zip(self.streams.iter().map(Stream::asks))
    }

    /// Place of a stream's flags in their register.
    const fn shift(stream: usize) -> u32 {
        [0, 6, 16, 22][stream % 4]
    }

    /// Reads a register.
    #[must_use]
    pub fn read(&self, offset: u32) -> u32 {
        if offset < 8 {
            let first = offset as usize;
            let four = (first..first + 4).map(|n| self.streams[n].flags << Self::shift(n));
            return four.fold(0, |word, flags| word | flags);
        }
        let Some((stream, register)) = place(offset) else {
            return 0;
        };
        let stream = &self.streams[stream];
        match register {
            CR => stream.cr,
            NDTR => stream.left,
            PAR => stream.peripheral,
            M0AR => stream.memory[0],
            FCR => stream.fcr,
            _ => stream.memory[1],
        }
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32, at: &mut Moment<'_>) {
        if (8..FIRST).contains(&offset) {
            let first = offset as usize - 8;
            for n in first..first + 4 {
                self.streams[n].flags &= !(value >> Self::shift(n));
            }
            return;
        }
        let Some((number, register)) = place(offset) else {
            return;
        };
        let name = format!("DMA{} stream {number}", self.number);
        let stream = &mut self.streams[number];
        if register != CR {
            if stream.is_on() {
                at.forbid(format!(
                    "10.5.6: a register of {name} is written while it is on"
                ));
                return;
            }
            match register {
                NDTR => stream.left = value & 0xFFFF,
                PAR => stream.peripheral = value,
                M0AR => stream.memory[0] = value,
                FCR => stream.fcr = value & 0x87 | 0x20,
                _ => stream.memory[1] = value,
            }
            return;
        }
        let before = stream.cr;
        if stream.is_on() && (before ^ value) & !FREE != 0 {
            at.forbid(format!("10.5.5: {name} is set up while it is on"));
            return;
        }
        stream.cr = value & 0x0FEF_FFFF;
        if before & ON != 0 && value & ON == 0 && stream.left > 0 {
            // 10.3.17: the end of a stream that is switched off is its completion.
            stream.flags |= COMPLETE;
        }
        if before & ON == 0 && value & ON != 0 {
            let wrong = self.wrong(number);
            let stream = &mut self.streams[number];
            stream.items = stream.left;
            if stream.left == 0 || !wrong.is_empty() {
                stream.cr &= !ON;
            }
            if !is_reached(stream) {
                stream.flags |= TRANSFER_ERROR;
            }
            for words in wrong {
                at.forbid(format!("{name} {words}"));
            }
        }
    }

    /// Faults of a stream that is switched on.
    fn wrong(&self, number: usize) -> Vec<String> {
        let stream = &self.streams[number];
        let mut wrong = Vec::new();
        let mut rule = |is_kept: bool, words: &str| {
            if !is_kept {
                wrong.push(words.to_owned());
            }
        };
        rule(stream.flags == 0, "is switched on with flags set (10.3.18)");
        rule(stream.left > 0, "is switched on without items (10.5.6)");
        let is_plain = stream.cr & (DOUBLE_BUFFER | BURSTS) == 0 && stream.fcr & 4 == 0;
        rule(
            is_plain,
            "has a FIFO, bursts or two buffers, which are not modelled",
        );
        rule(
            stream.cr & PERIPHERAL_INCREMENT == 0,
            "leaves the data register (10.3.6)",
        );
        rule(
            is_reached(stream),
            "has a memory that DMA does not reach (2.1): only the SRAM is",
        );
        rule(
            stream.memory[0].is_multiple_of(stream.bytes()),
            "has a memory that is not aligned (10.3.11)",
        );
        // In direct mode both sizes are that of the peripheral.
        rule(
            stream.cr >> 13 & 3 == stream.cr >> 11 & 3,
            "has two sizes in direct mode (10.3.12)",
        );
        match self.line(number) {
            None => rule(false, "has a channel without a request (tables 42 and 43)"),
            Some(line) => {
                rule(
                    stream.peripheral == data(line.spi),
                    "has another data register than that of its channel (tables 42 and 43)",
                );
                let direction = flag(1 << 6, !line.is_received);
                rule(
                    stream.cr & 0b11 << 6 == direction,
                    "moves in the other direction than its channel (tables 42 and 43)",
                );
            }
        }
        wrong
    }

    fn line(&self, number: usize) -> Option<Line> {
        let channel = self.streams[number].cr >> 25 & 7;
        let of_it = |(dma, stream, on, spi, is_received)| {
            let is_it = (dma, stream, on) == (self.number, number, channel);
            is_it.then_some(Line { spi, is_received })
        };
        LINES.into_iter().find_map(of_it)
    }

    /// The stream that serves a request, if one is on.
    fn serving(&self, line: Line) -> Option<usize> {
        (0..STREAMS).find(|n| self.streams[*n].is_on() && self.line(*n) == Some(line))
    }

    /// Stores what an SPI has received, in words of so many bits. `false` if no stream is on.
    pub fn take(
        &mut self,
        spi: usize,
        bits: u32,
        word: impl FnOnce() -> u16,
        at: &mut Moment<'_>,
    ) -> bool {
        let line = Line {
            spi,
            is_received: true,
        };
        let Some(number) = self.serving(line) else {
            return false;
        };
        let bytes = word().to_le_bytes();
        let place = self.advance(number, bits, at);
        let size = self.streams[number].bytes().min(2) as usize;
        if self.memory.write_at(place.into(), &bytes[..size]).is_err() {
            at.forbid("2.3: a stream writes beyond the SRAM");
        }
        true
    }

    /// The next word that an SPI sends, in words of so many bits. `None` if no stream is on.
    pub fn give(&mut self, spi: usize, bits: u32, at: &mut Moment<'_>) -> Option<u16> {
        let line = Line {
            spi,
            is_received: false,
        };
        let number = self.serving(line)?;
        let place = self.advance(number, bits, at);
        let size = self.streams[number].bytes().min(2) as usize;
        let mut bytes = [0; 2];
        if self
            .memory
            .read_at(place.into(), &mut bytes[..size])
            .is_err()
        {
            at.forbid("2.3: a stream reads beyond the SRAM");
        }
        Some(u16::from_le_bytes(bytes))
    }

    /// Counts an item: its offset in the SRAM.
    fn advance(&mut self, number: usize, bits: u32, at: &mut Moment<'_>) -> u32 {
        let stream = &mut self.streams[number];
        if stream.bytes() * 8 != bits {
            at.forbid(format!(
                "28.3.9: DMA{} stream {number} moves {} bytes, and the word has {bits} bits",
                self.number,
                stream.bytes()
            ));
        }
        let moved = stream.items - stream.left;
        let step = if stream.cr & MEMORY_INCREMENT != 0 {
            stream.bytes()
        } else {
            0
        };
        stream.left -= 1;
        stream.moved += 1;
        if stream.left == stream.items / 2 {
            stream.flags |= HALF;
        }
        if stream.left == 0 {
            stream.flags |= COMPLETE;
            if stream.cr & CIRCULAR != 0 {
                stream.left = stream.items;
            } else {
                stream.cr &= !ON;
            }
        }
        stream.memory[0] + moved * step - SRAM.0
    }
}

/// `true` if all of a stream's memory is in the SRAM; the core-coupled memory is the processor's alone.
fn is_reached(stream: &Stream) -> bool {
    let length = stream.left * stream.bytes();
    (SRAM.0..=SRAM.0 + SRAM.1 - length).contains(&stream.memory[0])
}

/// Stream and register at an offset.
fn place(offset: u32) -> Option<(usize, u32)> {
    let behind = offset.checked_sub(FIRST)?;
    let stream = (behind / SIZE) as usize;
    (stream < STREAMS).then_some((stream, behind % SIZE))
}
