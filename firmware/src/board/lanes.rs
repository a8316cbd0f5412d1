//! Lanes by DMA: each bus of converters exchanges a frame by two streams, and interrupts at its end.
//!
//! | lane | bus | received by | sent by | converters |
//! | --- | --- | --- | --- | --- |
//! | 0 | SPI2 | DMA1 stream 3, channel 0 | DMA1 stream 4, channel 0 | ADS131M08 number 0, 1 |
//! | 1 | SPI3 | DMA1 stream 0, channel 0 | DMA1 stream 5, channel 0 | ADS131M08 number 2, 3 |
//! | 2 | SPI1 | DMA2 stream 0, channel 3 | DMA2 stream 3, channel 3 | ADXL355 |
//!
//! Streams and channels are those of RM0090, tables 42 and 43. A frame is enabled in the order of its
//! 28.3.9: requests of the receiver, streams, requests of the transmitter. The bus itself stays on, since
//! its clock line is not driven while it is off.
//!
//! The drivers exchange words by the same buses and chip selects while no frame runs (`bus`).

use core::cell::UnsafeCell;
use core::sync::atomic::{Ordering, fence};

use embedded_hal::spi::SpiBus;
use massline_firmware::drivers::lanes::{BusClock, Lanes, Progress, Step};
use massline_firmware::sampling::{CHIPS, LANES, REQUESTS};
use stm32f4xx_hal::pac::GPIOC;
use stm32f4xx_hal::pac::dma1::RegisterBlock;

use super::bus::{Bus, Registers};
use super::dma::{Direction, State, Stream};
use super::edges;

/// Pins of port C that select the converters.
const SELECTS: [u8; CHIPS] = [2, 3, 4, 5, 1];
/// Number of the lanes of ADS131M08, the first ones.
const CONVERTER_LANES: usize = 2;
/// Code of a bus's slowest clock.
const SLOWEST: u8 = 7;
/// Bytes of the longest request, and more.
const BYTES: usize = 32;

/// Bytes that are sent to each converter, and those that were received from it.
#[repr(C, align(4))]
struct Buffers {
    sent: [[u8; BYTES]; CHIPS],
    received: [[u8; BYTES]; CHIPS],
}

struct Place(UnsafeCell<Buffers>);

// SAFETY: reached by `DmaLanes` only, of which there is one.
unsafe impl Sync for Place {}

/// In the SRAM, which DMA reaches, like all variables but those of the section `.ccm`.
#[unsafe(link_section = ".bss.dma")]
static BUFFERS: Place = Place(UnsafeCell::new(Buffers {
    sent: [[0; BYTES]; CHIPS],
    received: [[0; BYTES]; CHIPS],
}));

fn sent(converter: usize) -> *mut u8 {
    // SAFETY: within the variable; no reference to it is made.
    let rows = unsafe { &raw mut (*BUFFERS.0.get()).sent };
    rows.cast::<u8>()
        .wrapping_add(usize::wrapping_mul(converter, BYTES))
}

fn received(converter: usize) -> *mut u8 {
    // SAFETY: within the variable; no reference to it is made.
    let rows = unsafe { &raw mut (*BUFFERS.0.get()).received };
    rows.cast::<u8>()
        .wrapping_add(usize::wrapping_mul(converter, BYTES))
}

/// A bus with its streams.
struct Lane {
    bus: Registers,
    /// Code of its usual clock.
    divider: u8,
    receive: Stream,
    send: Stream,
    /// Bit of the pin that selects the converter of the frame.
    select: u32,
}

impl Lane {
    /// Raises the chip select, once the clock has come to rest: half a period after the last bit was
    /// received.
    fn end(&self) -> bool {
        let is_at_rest = self.bus.rest();
        self.bus.cr2().reset();
        // The lower half of the register lets pins go high.
        set_pins(self.select);
        is_at_rest
    }

    /// Ends a frame before its last byte: no word begins any more, and those on their way are received.
    fn break_off(&self) {
        self.send.stop();
        self.end();
        self.receive.stop();
        self.bus.forget();
    }
}

/// Writes BSRR of the port of the chip selects.
fn set_pins(bits: u32) {
    // SAFETY: one write that sets one pin and leaves the others. Its driver does not exchange words
    // while a frame runs.
    unsafe { (*GPIOC::ptr()).bsrr().write(|w| w.bits(bits)) };
}

/// The lanes of the box.
pub struct DmaLanes {
    lanes: [Lane; LANES],
    /// `false` in emulators without DMA.
    is_there: bool,
}

impl DmaLanes {
    /// Lanes on three buses that are set up, by the streams of DMA1 and DMA2, whose clocks are on.
    ///
    /// To be called once.
    pub fn start([a, b, c]: [Registers; LANES], [dma1, dma2]: [*const RegisterBlock; 2]) -> Self {
        let lane = |bus: Registers, dma, [rx, tx]: [usize; 2], channel| Lane {
            receive: Stream::start(dma, rx, channel, Direction::Receive, bus.data()),
            send: Stream::start(dma, tx, channel, Direction::Send, bus.data()),
            divider: bus.divider(),
            bus,
            select: 0,
        };
        let lanes = [
            lane(a, dma1, [3, 4], 0),
            lane(b, dma1, [0, 5], 0),
            lane(c, dma2, [0, 3], 3),
        ];
        for (converter, request) in (0..).zip(REQUESTS) {
            let bytes = request.len().min(BYTES);
            // SAFETY: both have so many bytes, and no frame has begun yet.
            unsafe { sent(converter).copy_from_nonoverlapping(request.as_ptr(), bytes) };
        }
        Self {
            is_there: lanes.iter().all(|lane| lane.receive.is_there()),
            lanes,
        }
    }

    /// `true` if there is DMA, `false` in emulators without.
    pub const fn is_there(&self) -> bool {
        self.is_there
    }
}

impl Lanes for DmaLanes {
    fn begin(&mut self, lane: usize, step: Step) -> Progress {
        if !self.is_there {
            return Progress::ByDriver;
        }
        let Some(lane) = self.lanes.get_mut(lane) else {
            return Progress::Failed;
        };
        let converter = usize::from(step.converter);
        let Some(pin) = SELECTS.get(converter) else {
            return Progress::Failed;
        };
        lane.select = 1_u32.wrapping_shl((*pin).into());
        let first = usize::from(step.first);
        let address = |row: *mut u8| row.wrapping_add(first).expose_provenance() as u32;
        let bytes = u16::from(step.bytes);
        lane.bus.set_wide(false);
        lane.bus.cr2().write(|w| w.rxdmaen().set_bit());
        // What was written into the buffer is there before the stream reads it.
        fence(Ordering::SeqCst);
        // SAFETY: rows of a static variable in the SRAM, with room for each step of the box's order.
        // They are reached again after the frame's end only, see `received`.
        unsafe {
            lane.receive.begin(address(received(converter)), bytes);
            lane.send.begin(address(sent(converter)), bytes);
        }
        // The upper half pulls pins low.
        set_pins(lane.select << 16);
        lane.bus
            .cr2()
            .write(|w| w.rxdmaen().set_bit().txdmaen().set_bit());
        Progress::Running
    }

    fn progress(&mut self, lane: usize) -> Progress {
        let Some(lane) = self.lanes.get(lane) else {
            return Progress::Failed;
        };
        match lane.receive.state() {
            State::Running => Progress::Running,
            State::Done if lane.end() => {
                lane.receive.clear();
                lane.send.clear();
                Progress::Done
            }
            State::Done | State::Failed => {
                lane.break_off();
                Progress::Failed
            }
        }
    }

    fn abort(&mut self, lane: usize) {
        if let Some(lane) = self.lanes.get(lane) {
            lane.break_off();
        }
    }

    fn exchange(&mut self, lane: usize, bytes: &mut [u8]) -> bool {
        let Some(lane) = self.lanes.get(lane).filter(|_| self.is_there) else {
            return false;
        };
        Bus::of_bytes(lane.bus).transfer_in_place(bytes).is_ok()
    }

    fn choose_clock(&mut self, clock: BusClock) {
        for lane in self.lanes.iter().take(CONVERTER_LANES) {
            let code = match clock {
                BusClock::Usual => lane.divider,
                BusClock::Half => lane.divider.wrapping_add(1).min(SLOWEST),
                BusClock::Double => lane.divider.saturating_sub(1),
            };
            lane.bus.set_divider(code);
        }
    }

    fn is_edge_noted(&self) -> bool {
        edges::is_noted()
    }

    fn watch_edges(&mut self, converters: u32) {
        edges::watch(converters);
    }

    fn forget_edge(&mut self) {
        edges::forget();
    }

    fn received(&self, converter: usize) -> &[u8] {
        // What the stream has written is read after its end was seen.
        fence(Ordering::SeqCst);
        let converter = converter.min(CHIPS - 1);
        // SAFETY: a row of a static variable. A stream writes to it from `begin` on, which borrows the
        // lanes, until the sequencer has seen the end of the frame.
        unsafe { core::slice::from_raw_parts(received(converter), BYTES) }
    }
}
