//! The board: which pin does what, and the types that follow from it.
//!
//! | pins | peripheral | use |
//! | --- | --- | --- |
//! | PA2 (out), PA3 (in) | USART2, 8N1 | link to the host |
//! | PH0, PH1 | HSE | 8 MHz crystal, optional |
//! | none | TIM2 | clock of all tick counts |
//! | none | SysTick | roll call, a hundred times a second |
//! | none | IWDG | watchdog |
//! | none | CAN2's interrupts | how tasks without hardware of their own are called |
//!
//! Everything sits on APB1 on purpose. The HAL resets a peripheral when it takes it over, and
//! newer emulators crash on a reset through APB2; so does not use USART1, USART6, SPI1, the ADC,
//! SDIO or TIM8 here.

use cortex_m::peripheral::NVIC;
use cortex_m::peripheral::syst::SystClkSource;
use massline_firmware::retained::ResetFlags;
use stm32f4xx_hal::pac::{Interrupt, Peripherals, RCC, SYST, USART2};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::HSI;
use stm32f4xx_hal::serial::{Config, Rx, Tx};
use stm32f4xx_hal::time::Hertz;
use stm32f4xx_hal::watchdog::IndependentWatchdog;

use crate::clocks::{self, Clock};
use crate::faults;
use crate::ticks;

/// Bit rate of the link unless the settings say otherwise, in baud; 8 data bits, no parity, 1
/// stop bit.
pub const LINK_BAUD: u32 = 921_600;

// 16 clocks a bit even on the slowest clock, so that no choice of clock makes the rate impossible.
const _: () = assert!(HSI / 16 >= LINK_BAUD);

/// Rounds of the roll call in a second.
pub const ROUNDS: u32 = 100;

/// The board, with its clock running and its peripherals set up.
pub struct Board {
    /// The clock that runs.
    pub clock: Clock,
    /// Rate of [`ticks`].
    pub ticks: Hertz,
    /// Bytes from the host.
    pub link_rx: Rx<USART2>,
    /// Bytes to the host.
    pub link_tx: Tx<USART2>,
    /// Not started yet.
    pub watchdog: IndependentWatchdog,
}

/// Why a board cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum Fault {
    /// The clock that runs cannot be divided down to the link's bit rate.
    LinkBaud,
}

impl Board {
    /// Starts the clocks and sets up every peripheral the box uses.
    ///
    /// # Errors
    ///
    /// [`Fault`].
    pub fn start(device: Peripherals, baud: u32) -> Result<Self, Fault> {
        // The log reader looks into memory while the core sleeps, which needs the bus clocked.
        device.DBGMCU.cr().modify(|_, w| w.dbg_sleep().set_bit());
        let watchdog = IndependentWatchdog::new(device.IWDG);
        watchdog.stop_on_debug(&device.DBGMCU, true);

        let (mut rcc, clock) = clocks::start(device.RCC);
        let gpioa = device.GPIOA.split(&mut rcc);
        let link = device
            .USART2
            .serial(
                (gpioa.pa2, gpioa.pa3),
                Config::default().baudrate(baud.bps()),
                &mut rcc,
            )
            .map_err(|_| Fault::LinkBaud)?;
        let (link_tx, link_rx) = link.split();

        Ok(Board {
            clock,
            ticks: ticks::start(device.TIM2, &mut rcc),
            link_rx,
            link_tx,
            watchdog,
        })
    }
}

/// Starts the clock of the roll call.
pub fn start_rounds(mut timer: SYST, core: Hertz) {
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(core.raw() / ROUNDS - 1);
    timer.clear_current();
    timer.enable_interrupt();
    timer.enable_counter();
}

/// Reads why the chip was reset, and clears it for the next time.
pub fn reset_flags(rcc: &RCC) -> ResetFlags {
    let csr = rcc.csr().read();
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    ResetFlags {
        power_on: csr.porrstf().bit_is_set(),
        brown_out: csr.borrstf().bit_is_set(),
        watchdog: csr.wdgrstf().bit_is_set() || csr.wwdgrstf().bit_is_set(),
        pin: csr.padrstf().bit_is_set(),
        software: csr.sftrstf().bit_is_set(),
    }
}

/// The chip's serial number; zeros in an emulator that has none.
pub fn serial_number() -> [u8; 12] {
    const UNIQUE_ID: *const u32 = 0x1FFF_7A10 as *const u32;
    let mut serial = [0; 12];
    for (i, bytes) in serial.chunks_exact_mut(4).enumerate() {
        // SAFETY: three aligned words of read-only memory, or of nothing at all.
        let word = unsafe { faults::read_if_there(UNIQUE_ID.wrapping_add(i)) };
        bytes.copy_from_slice(&word.unwrap_or(0).to_le_bytes());
    }
    serial
}

/// Has the port look for bytes to send.
pub fn pend_link() {
    NVIC::pend(Interrupt::USART2);
}

/// Has requests attended to.
pub fn pend_desk() {
    NVIC::pend(Interrupt::CAN2_TX);
}

/// Has samples and blocks dealt with.
pub fn pend_block() {
    NVIC::pend(Interrupt::CAN2_RX0);
}

/// Has the box look after itself.
pub fn pend_telemetry() {
    NVIC::pend(Interrupt::CAN2_RX1);
}

/// Has what takes seconds begin.
pub fn pend_identify() {
    NVIC::pend(Interrupt::CAN2_SCE);
}

/// Waits until the port has sent the byte it is at, or for a thousand bytes' time.
pub fn let_link_finish() {
    for _ in 0..200_000 {
        // SAFETY: one read of a status register, which has no effect as no data are read after.
        if unsafe { (*USART2::ptr()).sr().read().tc().bit_is_set() } {
            return;
        }
    }
}

/// Logs why the board cannot be used and stops; without a link there is nobody else to tell.
pub fn halt(fault: Fault) -> ! {
    defmt::error!("the board does not start: {}", fault);
    loop {
        cortex_m::asm::wfi();
    }
}
