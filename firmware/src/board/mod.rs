//! The board: pins, clocks, buses, memory and interrupts of one chip. No other folder of the
//! firmware names a pin, a peripheral or the HAL.
//!
//! | file | content |
//! | --- | --- |
//! | `mod` | pins and peripherals, and the types that follow from them |
//! | `tasks` | tasks, their interrupts and priorities |
//! | `clocks` | crystal, PLL, and the substitutes for them |
//! | `bus` | SPI of the converters, word by word |
//! | `dma` | streams of the DMA controllers |
//! | `lanes` | frames of the converters by DMA |
//! | `port` | serial port of the link |
//! | `edges` | DRDY lines, and the timer that stands in for them in a test pattern |
//! | `ticks` | clock of all tick counts |
//! | `flash` | sectors of the flash in which settings are saved |
//! | `memory` | core-coupled memory, in which runs are stored |
//!
//! | pins | peripheral | use |
//! | --- | --- | --- |
//! | PA2 (out), PA3 (in) | USART2, 8N1 | link to the host |
//! | PH0, PH1 | HSE | crystal of 8, 12 or 16 MHz, optional |
//! | PB13, PB14, PB15 | SPI2 SCK, MISO, MOSI | ADS131M08 number 0 and 1, mode 1, 10.5 MHz |
//! | PC10, PC11, PB5 | SPI3 SCK, MISO, MOSI | ADS131M08 number 2 and 3, the same |
//! | PC2, PC3, PC4, PC5 (out) | | their chip selects |
//! | PC6, PC7, PB8, PB9 (in) | TIM3 channels 1 and 2, TIM4 channels 3 and 4 | their DRDY lines |
//! | PA6 (out) | | SYNC/RESET of all four |
//! | PB3, PB4, PA7 | SPI1 SCK, MISO, MOSI | ADXL355, mode 0, 10 MHz at most |
//! | PC1 (out) | | its chip select |
//! | PC12 (out) | | status LED, lit while low |
//! | none | DMA1 streams 0, 3, 4, 5, DMA2 streams 0, 3 | frames of the converters |
//! | none | FLASH | settings, in the last two sectors |
//! | none | TIM2 | clock of all tick counts |
//! | none | TIM5 | stands in for DRDY lines in a test pattern |
//! | none | TIM11 | measures the crystal, before anything else |
//! | none | SysTick | task watchdog, a hundred times a second |
//! | none | IWDG | watchdog |
//! | none | CAN1's first interrupt, CAN2's | interrupts of tasks without hardware of their own |
//!
//! Free for what comes next: PA4, PA5 (DAC), PA11, PA12 (USB), PA1 (TIM2 channel 2, for a pulse a
//! second), PB10 (TIM2 channel 3, for a trigger), PA0 (button).
//!
//! Every peripheral that is reset is on APB1, on purpose. The HAL resets a peripheral when it takes
//! it over, and newer emulators crash on a reset through APB2. SPI1 is there, too, but is only switched
//! on.

pub mod bus;
pub mod clocks;
mod dma;
pub mod edges;
pub mod flash;
pub mod lanes;
pub mod memory;
pub mod port;
mod tasks;
pub mod ticks;

use cortex_m::peripheral::NVIC;
use cortex_m::peripheral::syst::SystClkSource;
use embedded_hal::delay::DelayNs;
use embedded_hal_bus::spi::{AtomicDevice, ExclusiveDevice};
use embedded_hal_bus::util::AtomicCell;
use massline_firmware::drivers::{ads131m08, adxl355};
use massline_firmware::link::rate::LinkRate;
use massline_firmware::retained::ResetFlags;
use massline_firmware::sampling::{self, Converters};
use massline_firmware::settings::LINK_BAUD;
use stm32f4xx_hal::gpio::{AnyPin, Output, PinState, Speed};
use stm32f4xx_hal::pac::{
    DMA1, DMA2, GPIOC, Interrupt, Peripherals, RCC, SPI1, SPI2, SPI3, SYST, USART2,
};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Enable, HSI};
use stm32f4xx_hal::serial::{Config, Rx, Tx};
use stm32f4xx_hal::time::Hertz;
use stm32f4xx_hal::watchdog::IndependentWatchdog;

use crate::faults;
use bus::{Bus, Registers};
use clocks::Clock;
use edges::{Edges, TestClock};
use flash::Flash;
use lanes::DmaLanes;
use port::BitRate;

// 16 clocks a bit even on the slowest clock, so that no choice of clock makes the rate that a box
// is delivered with impossible.
const _: () = assert!(HSI / 16 >= LINK_BAUD);

/// Rounds of the task watchdog in a second.
pub const ROUNDS: u32 = 100;

/// Clock of the converters' bus, Hz: a fourth of what the bus has at 168 MHz. At twice as much half a
/// period has 23.8 ns, of which the converter's output takes 20 and the chip's input 6.5.
const CONVERTERS_HZ: u32 = 10_500_000;
/// Most of the accelerometer's bus, Hz: 5.25 MHz with a clock of 168 MHz.
const ACCELEROMETER_HZ: u32 = 7_000_000;

// Twice as much can be chosen for a test of the wires.
const _: () = assert!(2 * CONVERTERS_HZ <= ads131m08::SPI_HZ_MAX);
const _: () = assert!(ACCELEROMETER_HZ <= adxl355::SPI_HZ_MAX);

/// A bus that two ADS131M08 share.
type SharedBus = AtomicCell<Bus>;
/// An ADS131M08 on it.
type Ads = AtomicDevice<'static, Bus, AnyPin<Output>, Delay>;
/// The ADXL355 on a bus of its own.
type Adxl = ExclusiveDevice<Bus, AnyPin<Output>, Delay>;

/// The sampling task on this board.
pub type Sampler = sampling::Sampler<'static, Ads, Adxl, AnyPin<Output>, Delay, DmaLanes>;

/// The board, with its clock running and its peripherals set up.
pub struct Board {
    /// The clock that runs.
    pub clock: Clock,
    /// Rate of [`ticks`].
    pub ticks: Hertz,
    /// Serial port of the link, to and from the host.
    pub link: (Tx<USART2>, Rx<USART2>),
    /// Bit rate of the link.
    pub link_rate: BitRate,
    /// Status LED, lit while low.
    pub led: AnyPin<Output>,
    /// Not started yet.
    pub watchdog: IndependentWatchdog,
    /// Converters of the inputs.
    pub converters: Converters<Ads, Adxl, AnyPin<Output>, Delay>,
    /// The buses of the converters, by DMA.
    pub lanes: DmaLanes,
    /// Their DRDY lines.
    pub edges: Edges,
    /// Timer that stands in for these lines in a test pattern.
    pub test_clock: TestClock,
}

/// Reasons why a board cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum Fault {
    /// The clock that runs cannot be divided down to the link's bit rate.
    LinkBaud,
    /// It has been started before.
    Twice,
}

impl Board {
    /// Starts the clocks and sets up every peripheral the box uses. `open` gets the flash, if it
    /// can be written, and returns the settings with the bit rate of the link.
    ///
    /// # Errors
    ///
    /// [`Fault`].
    pub fn start<S>(
        device: Peripherals,
        open: impl FnOnce(Option<Flash>) -> (S, u32),
    ) -> Result<(Self, S), Fault> {
        // The log reader looks into memory while the core sleeps, which needs the bus clocked.
        device.DBGMCU.cr().modify(|_, w| w.dbg_sleep().set_bit());
        let watchdog = IndependentWatchdog::new(device.IWDG);
        watchdog.stop_on_debug(&device.DBGMCU, true);

        let (mut rcc, clock) = clocks::start(device.RCC, &device.TIM11);
        let (a, b, c) = (
            device.GPIOA.split(&mut rcc),
            device.GPIOB.split(&mut rcc),
            device.GPIOC.split(&mut rcc),
        );
        // A rate that only the crystal makes possible must not lock the host out without it.
        let fastest = rcc.clocks.pclk1().raw() / 16;
        let (settings, baud) = open(Flash::new(device.FLASH));
        let baud = if baud <= fastest { baud } else { LINK_BAUD };
        let link = device
            .USART2
            .serial(
                (a.pa2, a.pa3),
                Config::default().baudrate(baud.bps()),
                &mut rcc,
            )
            .map_err(|_| Fault::LinkBaud)?;

        let delay = Delay {
            megahertz: clock.core.to_MHz(),
        };
        // The pins keep their functions.
        let _ = (
            b.pb13.into_alternate::<5>().speed(Speed::VeryHigh),
            b.pb14.into_alternate::<5>(),
            b.pb15.into_alternate::<5>().speed(Speed::VeryHigh),
        );
        let _ = (
            c.pc10.into_alternate::<6>().speed(Speed::VeryHigh),
            c.pc11.into_alternate::<6>(),
            b.pb5.into_alternate::<6>().speed(Speed::VeryHigh),
        );
        let _ = (
            b.pb3.into_alternate::<5>().speed(Speed::High),
            b.pb4.into_alternate::<5>(),
            a.pa7.into_alternate::<5>().speed(Speed::High),
        );
        SPI2::enable(&mut rcc);
        SPI3::enable(&mut rcc);
        // Not reset: emulators do not bear that on APB2.
        SPI1::enable(&mut rcc);
        let (slow, fast) = (rcc.clocks.pclk1().raw(), rcc.clocks.pclk2().raw());
        let buses = [
            Registers::start(SPI2::ptr(), ads131m08::SPI_MODE, slow, CONVERTERS_HZ),
            Registers::start(SPI3::ptr(), ads131m08::SPI_MODE, slow, CONVERTERS_HZ),
            Registers::start(SPI1::ptr(), adxl355::SPI_MODE, fast, ACCELEROMETER_HZ),
        ];
        let [first, second, third] = buses;
        let first: &'static SharedBus =
            cortex_m::singleton!(: SharedBus = AtomicCell::new(Bus::of_frames(first)))
                .ok_or(Fault::Twice)?;
        let second: &'static SharedBus =
            cortex_m::singleton!(: SharedBus = AtomicCell::new(Bus::of_frames(second)))
                .ok_or(Fault::Twice)?;
        let high = PinState::High;
        let [a_select, b_select, c_select, d_select] = [
            c.pc2.into_push_pull_output_in_state(high).erase(),
            c.pc3.into_push_pull_output_in_state(high).erase(),
            c.pc4.into_push_pull_output_in_state(high).erase(),
            c.pc5.into_push_pull_output_in_state(high).erase(),
        ];
        let ads = [
            ignore(AtomicDevice::new(first, a_select, delay)),
            ignore(AtomicDevice::new(first, b_select, delay)),
            ignore(AtomicDevice::new(second, c_select, delay)),
            ignore(AtomicDevice::new(second, d_select, delay)),
        ];
        let select = c.pc1.into_push_pull_output_in_state(high).erase();
        let adxl = ignore(ExclusiveDevice::new(Bus::of_bytes(third), select, delay));
        DMA1::enable(&mut rcc);
        DMA2::enable(&mut rcc);
        let lanes = DmaLanes::start(buses, [DMA1::ptr(), DMA2::ptr()]);
        defmt::info!("frames by DMA: {}", lanes.is_there());
        let sync = a.pa6.into_push_pull_output_in_state(PinState::High).erase();

        // The pins keep their functions, and are high without a converter.
        let _ = (
            c.pc6.into_alternate::<2>().internal_pull_up(true),
            c.pc7.into_alternate::<2>().internal_pull_up(true),
            b.pb8.into_alternate::<2>().internal_pull_up(true),
            b.pb9.into_alternate::<2>().internal_pull_up(true),
        );

        let ticks = ticks::start(device.TIM2, &mut rcc);
        let choice = LinkRate::new(baud, LINK_BAUD, ticks.raw());
        let board = Board {
            clock,
            ticks,
            link_rate: BitRate::new(choice, rcc.clocks.pclk1()),
            link: link.split(),
            watchdog,
            converters: Converters::new(ads, adxl, sync, delay),
            lanes,
            led: c.pc12.into_push_pull_output_in_state(high).erase(),
            edges: Edges::start(device.TIM3, device.TIM4, &mut rcc),
            test_clock: TestClock::new(device.TIM5, &mut rcc),
        };
        Ok((board, settings))
    }
}

/// The value of a result that cannot fail, as that of a pin of the chip's own.
fn ignore<T>(result: Result<T, core::convert::Infallible>) -> T {
    match result {
        Ok(value) => value,
    }
}

/// Delays that count cycles; interrupts make them longer.
#[derive(Clone, Copy)]
pub struct Delay {
    megahertz: u32,
}

impl DelayNs for Delay {
    fn delay_ns(&mut self, ns: u32) {
        let cycles = u64::from(ns) * u64::from(self.megahertz) / 1000;
        cortex_m::asm::delay(cycles as u32 + 1);
    }
}

/// Starts the clock of the task watchdog.
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

/// Calls the sampling task, which runs at once if the caller's priority is lower.
pub fn call_sampling() {
    NVIC::pend(Interrupt::CAN1_TX);
    // Otherwise it would begin some instructions later.
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

/// Calls the port, which looks for bytes to send.
pub fn pend_link() {
    NVIC::pend(Interrupt::USART2);
}

/// Calls the task that serves requests.
pub fn pend_requests() {
    NVIC::pend(Interrupt::CAN2_TX);
}

/// Calls the task of samples and blocks.
pub fn pend_block() {
    NVIC::pend(Interrupt::CAN2_RX0);
}

/// Calls the task of telemetry.
pub fn pend_telemetry() {
    NVIC::pend(Interrupt::CAN2_RX1);
}

/// Calls the task of jobs that take seconds.
pub fn pend_identify() {
    NVIC::pend(Interrupt::CAN2_SCE);
}

/// Logs why the board cannot be used, and blinks once or twice every two seconds: [`Fault::LinkBaud`],
/// [`Fault::Twice`]. There is no link to report it on.
pub fn halt(fault: Fault) -> ! {
    /// Cycles of a quarter of a second at the fastest clock.
    const QUARTER: u32 = 42_000_000;
    defmt::error!("the board does not start: {}", fault);
    // SAFETY: nothing else runs any more.
    let (rcc, port) = unsafe { (RCC::steal(), GPIOC::steal()) };
    rcc.ahb1enr().modify(|_, w| w.gpiocen().set_bit());
    port.moder().modify(|_, w| w.moder12().output());
    let blinks = 1 + fault as u8;
    loop {
        for quarter in 0..8 {
            let is_lit = quarter % 2 == 0 && quarter / 2 < blinks;
            port.odr().modify(|_, w| w.odr12().bit(!is_lit));
            cortex_m::asm::delay(QUARTER);
        }
    }
}
