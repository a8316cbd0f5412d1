//! Streams of the DMA controllers, in direct mode, byte by byte (RM0090, 10).

use stm32f4xx_hal::pac::dma1::RegisterBlock;
use stm32f4xx_hal::pac::dma1::st::ST;

/// Looks at a stream that was switched off until it counts as stuck: it ends with the byte it is at.
const LOOKS: u32 = 1000;

/// Flags of a stream in LISR and HISR: transfer complete, and the errors of transfer and direct mode.
const COMPLETE: u32 = 1 << 5;
const ERRORS: u32 = 1 << 3 | 1 << 2;
/// All flags of a stream.
const ALL: u32 = 0x3D;

/// Direction of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// From the peripheral into the memory, with an interrupt at the end.
    Receive,
    /// From the memory to the peripheral, without an interrupt: what is received ends later.
    Send,
}

/// State of a stream that was begun.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    Running,
    Done,
    Failed,
}

/// A stream on one channel, with the places of its registers: a frame looks at them four times.
#[derive(Clone, Copy)]
pub struct Stream {
    st: *const ST,
    /// LISR or HISR, and LIFCR or HIFCR.
    flags: *const u32,
    clear: *mut u32,
    /// Place of the stream's flags in these.
    shift: u32,
    /// CR with the stream on.
    on: u32,
}

// SAFETY: pointers to registers, which are where they are for every task. One task has the stream.
unsafe impl Send for Stream {}

impl Stream {
    /// Sets a stream up: its number, its channel, the address of the peripheral's data register. The
    /// controller's clock is on, and the stream is off.
    pub fn start(
        registers: *const RegisterBlock,
        number: usize,
        channel: u8,
        direction: Direction,
        peripheral: u32,
    ) -> Self {
        // SAFETY: registers of the chip, at the address that the HAL gives.
        let controller = unsafe { &*registers };
        let st = controller.st(number & 7);
        let is_received = direction == Direction::Receive;
        // SAFETY: the address of a data register, which lasts.
        st.par().write(|w| unsafe { w.pa().bits(peripheral) });
        st.cr().write(|w| {
            let w = if is_received {
                w.dir().peripheral_to_memory()
            } else {
                w.dir().memory_to_peripheral()
            };
            // What is received must not wait for what is sent.
            let w = if is_received {
                w.pl().very_high()
            } else {
                w.pl().high()
            };
            w.chsel().set(channel).minc().set_bit();
            w.tcie().bit(is_received).teie().bit(is_received)
        });
        let (flags, clear) = match number {
            0..=3 => (controller.lisr().as_ptr(), controller.lifcr().as_ptr()),
            _ => (controller.hisr().as_ptr(), controller.hifcr().as_ptr()),
        };
        Self {
            st,
            flags,
            clear,
            shift: match number & 3 {
                0 => 0,
                1 => 6,
                2 => 16,
                _ => 22,
            },
            on: st.cr().read().bits() | 1,
        }
    }

    /// `true` if the controller keeps what is written to it: emulators without DMA read zero.
    pub fn is_there(&self) -> bool {
        self.st().ndtr().write(|w| w.ndt().set(1));
        self.st().ndtr().read().ndt().bits() == 1
    }

    fn st(&self) -> &'static ST {
        // SAFETY: registers of the chip.
        unsafe { &*self.st }
    }

    /// Clears the stream's flags, without which it does not begin.
    pub fn clear(&self) {
        // SAFETY: writing ones clears the flags of this stream alone.
        unsafe { self.clear.write_volatile(ALL.wrapping_shl(self.shift)) };
    }

    /// Begins to move so many bytes.
    ///
    /// # Safety
    ///
    /// The bytes at `memory` are in the SRAM, last, and are touched by nothing else until the stream
    /// has ended or was stopped.
    pub unsafe fn begin(&self, memory: u32, bytes: u16) {
        self.clear();
        let st = self.st();
        // SAFETY: the caller vouches for the bytes at that address.
        st.m0ar().write(|w| unsafe { w.m0a().bits(memory) });
        st.ndtr().write(|w| w.ndt().set(bytes));
        // SAFETY: what `start` has written there, with the stream on.
        st.cr().write(|w| unsafe { w.bits(self.on) });
    }

    /// State of what was begun.
    pub fn state(&self) -> State {
        // SAFETY: a read of a register that has no effect.
        let flags = unsafe { self.flags.read_volatile() }.wrapping_shr(self.shift);
        if flags & ERRORS != 0 {
            State::Failed
        } else if flags & COMPLETE != 0 {
            State::Done
        } else {
            State::Running
        }
    }

    /// Switches the stream off, within the byte that it moves.
    pub fn stop(&self) {
        self.st().cr().modify(|_, w| w.en().clear_bit());
        for _ in 0..LOOKS {
            if self.st().cr().read().en().bit_is_clear() {
                break;
            }
        }
        // A stream that is switched off early says that it is complete (10.3.17).
        self.clear();
    }
}
