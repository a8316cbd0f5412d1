//! The board: which pin does what, and the types that follow from it.
//!
//! | pins | peripheral | use |
//! | --- | --- | --- |
//! | PA2 (out), PA3 (in) | USART2, 921600 baud 8N1 | link to the host |
//! | PH0, PH1 | HSE | 8 MHz crystal, optional |
//!
//! Everything sits on APB1 on purpose. The HAL resets a peripheral when it takes it over, and
//! newer emulators crash on a reset through APB2; so does not use USART1, USART6, SPI1, the ADC,
//! SDIO or TIM8 here.

use stm32f4xx_hal::pac::{Peripherals, USART2};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::HSI;
use stm32f4xx_hal::serial::{Config, Tx};

use crate::clocks::{self, Clock};

/// Bit rate of the link, in baud; 8 data bits, no parity, 1 stop bit.
pub const LINK_BAUD: u32 = 921_600;

// 16 clocks a bit even on the slowest clock, so that no choice of clock makes the rate impossible.
const _: () = assert!(HSI / 16 >= LINK_BAUD);

/// The half of the link that talks to the host.
pub type LinkTx = Tx<USART2>;

/// The board, with its clock running and its peripherals set up.
pub struct Board {
    /// The clock that runs.
    pub clock: Clock,
    /// Where bytes for the host go.
    pub link_tx: LinkTx,
}

/// Why a board cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum Fault {
    /// The clock that runs cannot be divided down to [`LINK_BAUD`].
    LinkBaud,
}

impl Board {
    /// Starts the clocks and sets up every peripheral the box uses.
    pub fn start(device: Peripherals) -> Result<Self, Fault> {
        // The log reader looks into memory while the core sleeps, which needs the bus clocked.
        device.DBGMCU.cr().modify(|_, w| w.dbg_sleep().set_bit());

        let (mut rcc, clock) = clocks::start(device.RCC);
        let gpioa = device.GPIOA.split(&mut rcc);
        let link = device
            .USART2
            .serial(
                (gpioa.pa2, gpioa.pa3),
                Config::default().baudrate(LINK_BAUD.bps()),
                &mut rcc,
            )
            .map_err(|_| Fault::LinkBaud)?;
        let (link_tx, _) = link.split();

        Ok(Board { clock, link_tx })
    }
}

/// Logs why the board cannot be used and stops; without a link there is nobody else to tell.
pub fn halt(fault: Fault) -> ! {
    defmt::error!("the board does not start: {}", fault);
    loop {
        cortex_m::asm::wfi();
    }
}
