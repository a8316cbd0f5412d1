//! RCC: oscillators, the PLL, clocks and resets of the peripherals (RM0090, 7).

use crate::{Moment, SECOND, Words, flag};

/// Internal oscillator, Hz.
pub const HSI: u32 = 16_000_000;
/// Oscillator of the watchdog, Hz.
pub const LSI: u32 = 32_000;
/// Time until a crystal is stable: 2 ms (data sheet, 5.3.8).
const HSE_START: u64 = SECOND / 500;
/// Time until the PLL has locked: 200 µs (data sheet, 5.3.10).
const PLL_LOCK: u64 = SECOND / 5000;

const CR: u32 = 0x00;
const PLLCFGR: u32 = 0x04;
const CFGR: u32 = 0x08;
const RESETS: std::ops::RangeInclusive<u32> = 0x10..=0x24;
const AHB1ENR: u32 = 0x30;
const CSR: u32 = 0x74;

const HSE_ON: u32 = 1 << 16;
const HSE_READY: u32 = 1 << 17;
const PLL_ON: u32 = 1 << 24;
const PLL_READY: u32 = 1 << 25;

/// Clocks, Hz.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clocks {
    /// Processor and AHB.
    pub core: u32,
    /// APB1.
    pub apb1: u32,
    /// APB2.
    pub apb2: u32,
    /// Timers on APB1.
    pub timers1: u32,
    /// Timers on APB2.
    pub timers2: u32,
    /// The divided crystal that TIM11 can capture; `None` if there is none.
    pub divided_crystal: Option<u32>,
}

/// Causes of resets in CSR.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// The supply came.
    Power,
    /// By software.
    Software,
    /// By the independent watchdog.
    Watchdog,
}

/// Oscillators on the board and in the chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Oscillators {
    /// Crystal, Hz; `None` if it is dead.
    pub crystal: Option<u32>,
    /// `true` if the PLL locks.
    pub pll: bool,
}

/// The registers.
#[derive(Clone, Debug)]
pub struct Rcc {
    words: Words<{ 0x90 / 4 }>,
    oscillators: Oscillators,
    hse_since: Option<u64>,
    pll_since: Option<u64>,
    csr: u32,
}

impl Rcc {
    /// After a reset.
    #[must_use]
    pub fn new(oscillators: Oscillators) -> Self {
        let mut rcc = Self {
            words: Words::default(),
            oscillators,
            hse_since: None,
            pll_since: None,
            csr: 0,
        };
        rcc.reset(Reset::Power);
        rcc
    }

    /// Everything but the causes of earlier resets goes to its initial value.
    pub fn reset(&mut self, cause: Reset) {
        self.words = Words::default();
        self.words.set(CR, 0x83);
        self.words.set(PLLCFGR, 0x2400_3010);
        self.words.set(AHB1ENR, 0x0010_0000);
        (self.hse_since, self.pll_since) = (None, None);
        self.csr |= match cause {
            // Every reset pulls the pin, too.
            Reset::Power => 1 << 27 | 1 << 25 | 1 << 26,
            Reset::Software => 1 << 28 | 1 << 26,
            Reset::Watchdog => 1 << 29 | 1 << 26,
        };
    }

    /// `true` if bit `bit` of the enable register at `offset` is set.
    #[must_use]
    pub fn is_enabled(&self, (offset, bit): (u32, u32)) -> bool {
        self.words.get(offset) >> bit & 1 != 0
    }

    fn hse_ready(&self, now: u64) -> bool {
        let on = self.hse_since.is_some_and(|since| now >= since + HSE_START);
        on && self.oscillators.crystal.is_some()
    }

    fn pll_ready(&self, now: u64) -> bool {
        let on = self.pll_since.is_some_and(|since| now >= since + PLL_LOCK);
        on && self.oscillators.pll && self.vco_input(now).is_some()
    }

    fn vco_input(&self, now: u64) -> Option<u32> {
        let pll = self.words.get(PLLCFGR);
        let source = match pll >> 22 & 1 {
            0 => HSI,
            _ => self.oscillators.crystal.filter(|_| self.hse_ready(now))?,
        };
        source.checked_div(pll & 0x3F)
    }

    fn pll_output(&self, now: u64) -> Option<u32> {
        let pll = self.words.get(PLLCFGR);
        let vco = self.vco_input(now)?.checked_mul(pll >> 6 & 0x1FF)?;
        Some(vco / (2 * ((pll >> 16 & 3) + 1)))
    }

    /// The clocks.
    #[must_use]
    pub fn clocks(&self, now: u64) -> Clocks {
        let system = match self.words.get(CFGR) & 3 {
            1 => self.oscillators.crystal,
            2 => self.pll_output(now),
            _ => Some(HSI),
        };
        let system = system.unwrap_or(HSI);
        let cfgr = self.words.get(CFGR);
        let core = match cfgr >> 4 & 0xF {
            code @ 8..=11 => system >> (code - 7),
            code @ 12..=15 => system >> (code - 6),
            _ => system,
        };
        let bus = |code: u32| match code {
            4..=7 => (core >> (code - 3), (core >> (code - 3)) * 2),
            _ => (core, core),
        };
        let (apb1, timers1) = bus(cfgr >> 10 & 7);
        let (apb2, timers2) = bus(cfgr >> 13 & 7);
        let divider = cfgr >> 16 & 0x1F;
        let crystal = self.oscillators.crystal.filter(|_| self.hse_ready(now));
        Clocks {
            core,
            apb1,
            apb2,
            timers1,
            timers2,
            divided_crystal: crystal.filter(|_| divider > 1).map(|hz| hz / divider),
        }
    }

    /// Reads a register.
    #[must_use]
    pub fn read(&self, offset: u32, now: u64) -> u32 {
        match offset {
            CR => {
                let hse = flag(HSE_READY, self.hse_ready(now));
                let pll = flag(PLL_READY, self.pll_ready(now));
                self.words.get(CR) & !(HSE_READY | PLL_READY) | 2 | hse | pll
            }
            // The switch takes a few cycles.
            CFGR => self.words.get(CFGR) & !0xC | (self.words.get(CFGR) & 3) << 2,
            CSR => self.csr | (self.csr & 1) << 1,
            _ => self.words.get(offset),
        }
    }

    /// Writes a register; the words and bits of a reset register that went from 0 to 1.
    pub fn write(&mut self, offset: u32, value: u32, wait_states: u32, at: &mut Moment<'_>) -> u32 {
        let before = self.words.get(offset);
        let now = at.now;
        match offset {
            CR => {
                if self.words.get(CFGR) & 3 == 2 && value & PLL_ON == 0 {
                    at.forbid("7.3.1: the PLL is switched off while it is the system clock");
                }
                if value & PLL_ON != 0 && before & PLL_ON == 0 {
                    self.check_pll(at);
                }
                let since = |bit: u32, since: Option<u64>| match value & bit {
                    0 => None,
                    _ => since.or(Some(now)),
                };
                self.hse_since = since(HSE_ON, self.hse_since);
                self.pll_since = since(PLL_ON, self.pll_since);
            }
            PLLCFGR if self.words.get(CR) & PLL_ON != 0 && value != before => {
                at.forbid("7.3.2: PLLCFGR is written while the PLL is on");
            }
            CFGR => {
                let ready = match value & 3 {
                    0 => true,
                    1 => self.hse_ready(now),
                    2 => self.pll_ready(now),
                    _ => false,
                };
                if !ready {
                    at.forbid("7.3.3: the system clock is switched to a source that is not ready");
                    return 0;
                }
            }
            CSR => {
                if value & 1 << 24 != 0 {
                    self.csr &= 1;
                }
                self.csr = self.csr & !1 | value & 1;
                return 0;
            }
            _ => {}
        }
        self.words.set(offset, value);
        if offset == CFGR {
            self.check_clocks(wait_states, at);
        }
        if RESETS.contains(&offset) {
            return value & !before;
        }
        0
    }

    fn check_pll(&self, at: &mut Moment<'_>) {
        let input = self.vco_input(at.now).unwrap_or(0);
        if !(950_000..=2_100_000).contains(&input) {
            at.forbid(format!(
                "7.3.2: the VCO's input is {input} Hz, not 1 to 2 MHz"
            ));
        }
        let vco = u64::from(input) * u64::from(self.words.get(PLLCFGR) >> 6 & 0x1FF);
        if !(100_000_000..=432_000_000).contains(&vco) {
            at.forbid(format!(
                "7.3.2: the VCO's output is {vco} Hz, not 100 to 432 MHz"
            ));
        }
    }

    fn check_clocks(&self, wait_states: u32, at: &mut Moment<'_>) {
        let Clocks {
            core, apb1, apb2, ..
        } = self.clocks(at.now);
        for (name, hz, most) in [
            ("core", core, 168_000_000),
            ("APB1", apb1, 42_000_000),
            ("APB2", apb2, 84_000_000),
        ] {
            if hz > most {
                at.forbid(format!("5.3: {name} runs at {hz} Hz, {most} Hz at most"));
            }
        }
        // 30 MHz a wait state at 2.7 V and more (table 10).
        let needed = core.div_ceil(30_000_000).saturating_sub(1);
        if wait_states < needed {
            at.forbid(format!(
                "3.5.1: {core} Hz with {wait_states} wait states, {needed} are needed"
            ));
        }
    }
}
