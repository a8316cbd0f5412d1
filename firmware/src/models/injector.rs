//! Random faults, one at a time, with the counters they should raise.

use super::random::Random;
use super::rig::{Garble, Rig, Signal};
use crate::wire::{FaultCounters, Health};

/// Kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Some bits of a frame are wrong.
    WrongBits,
    /// A stretch of a frame is random.
    Burst,
    /// A frame is random.
    Noise,
    /// The data line is stuck for a frame.
    StuckLine,
    /// The chip gets a frame with a wrong bit.
    WrongRequest,
    /// The bus fails.
    Bus,
    /// The edges of a sample are lost.
    LostSample,
    /// One DRDY line looks high when it should not.
    HiddenReady,
    /// A chip resets itself.
    Reset,
    /// A chip falls behind the others.
    Delay,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 10] = [
        Self::WrongBits,
        Self::Burst,
        Self::Noise,
        Self::StuckLine,
        Self::WrongRequest,
        Self::Bus,
        Self::LostSample,
        Self::HiddenReady,
        Self::Reset,
        Self::Delay,
    ];

    /// The health flag of the fault; `GOOD` if no sample is affected.
    #[must_use]
    pub const fn flag(self) -> Health {
        match self {
            Self::WrongBits | Self::Burst | Self::Noise => Health::CHECKSUM,
            Self::StuckLine => Health::STUCK,
            Self::WrongRequest => Health::GOOD,
            Self::Bus | Self::LostSample | Self::HiddenReady => Health::MISSING,
            Self::Reset => Health::CONVERTER_RESET,
            Self::Delay => Health::OUT_OF_STEP,
        }
    }

    /// Raises the counter that the box should raise.
    pub const fn count(self, faults: &mut FaultCounters) {
        let slot = match self {
            Self::Reset => &mut faults.converter_reset,
            Self::Delay => &mut faults.out_of_step,
            Self::Bus | Self::LostSample | Self::HiddenReady => &mut faults.converter_missed,
            _ => &mut faults.converter_checksum,
        };
        *slot += 1;
    }
}

/// Injects faults at a rate.
#[derive(Clone, Debug)]
pub struct Injector {
    random: Random,
    /// Probability of a fault in each frame.
    rate: f64,
    /// Chip whose line is stuck, for one sample.
    stuck: Option<usize>,
    /// Expected fault counters.
    faults: FaultCounters,
    kinds: [u32; Kind::ALL.len()],
}

impl Injector {
    /// An injector with a probability of a fault in each frame of a chip.
    #[must_use]
    pub fn new(rate: f64, seed: u64) -> Self {
        Self {
            random: Random::new(seed),
            rate,
            stuck: None,
            faults: FaultCounters::default(),
            kinds: [0; Kind::ALL.len()],
        }
    }

    /// Expected fault counters of the box.
    pub const fn faults(&self) -> &FaultCounters {
        &self.faults
    }

    /// Number of faults of each of [`Kind::ALL`].
    pub const fn kinds(&self) -> &[u32; Kind::ALL.len()] {
        &self.kinds
    }

    /// Injects a fault into the next sample at random, if the box is `steady`; to be called between
    /// two samples. The counters of faults during a recovery would depend on their order.
    pub fn disturb<S: Signal, const N: usize>(
        &mut self,
        rig: &mut Rig<S, N>,
        steady: bool,
    ) -> Option<Kind> {
        if let Some(chip) = self.stuck.take() {
            rig.stick(chip, None);
        }
        if !steady || !self.random.chance(self.rate * N as f64) {
            return None;
        }
        let which = self.random.below(Kind::ALL.len() as u64) as usize;
        let kind = *Kind::ALL.get(which)?;
        let chip = self.random.below(N as u64) as usize;
        self.inject(rig, kind, chip);
        Some(kind)
    }

    /// Injects a fault into a chip.
    pub fn inject<S: Signal, const N: usize>(
        &mut self,
        rig: &mut Rig<S, N>,
        kind: Kind,
        chip: usize,
    ) {
        let random = &mut self.random;
        match kind {
            Kind::WrongBits => rig.garble(chip, Garble::Bits(1 + random.below(3) as u8)),
            Kind::Burst => rig.garble(chip, Garble::Burst),
            Kind::Noise => rig.garble(chip, Garble::Noise),
            Kind::StuckLine => {
                rig.stick(chip, Some(random.chance(0.5)));
                self.stuck = Some(chip);
            }
            Kind::WrongRequest => rig.garble_request(chip),
            Kind::Bus => rig.fail_bus(chip),
            Kind::LostSample => rig.lose_sample(),
            Kind::HiddenReady => rig.hide_ready(chip),
            Kind::Reset => rig.reset_chip(chip),
            Kind::Delay => {
                let period = rig.chip(chip).map_or(1, |c| u64::from(c.cycles()));
                // Longer than from an edge to the reading of the lines, shorter than a sample.
                rig.delay_chip(chip, 16 + random.below(period - 32));
            }
        }
        kind.count(&mut self.faults);
        if let Some(k) = Kind::ALL.iter().position(|&k| k == kind)
            && let Some(times) = self.kinds.get_mut(k)
        {
            *times += 1;
        }
    }
}
