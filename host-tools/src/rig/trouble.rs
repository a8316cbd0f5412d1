//! Faults that are simulated, and their times.

use super::CHIPS;
use super::sensors::{Sensors, Upset};
use massline_firmware::drivers::ads131m08::CLOCK_HZ;
use massline_firmware::models::injector::{Injector, Kind};
use massline_firmware::models::random::Random;
use massline_firmware::models::rig::Rig;
use massline_firmware::wire::Health;

/// Something that goes wrong next to a shaker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// Bits, stretches or all of a frame are garbled on its way from a converter.
    Checksum,
    /// A converter's data-ready edge is not seen, by one or by all.
    Missed,
    /// A converter resets itself.
    Reset,
    /// A converter falls behind the others.
    OutOfStep,
    /// A converter's data line is stuck for some tenths of a second.
    StuckLine,
    /// A sensor is knocked beyond its range.
    Overload,
    /// A sensor's lead is broken for one to three seconds.
    Open,
}

/// In the order of [`Trouble`], each with its name on the command line and the fault that it has to
/// be found out as.
const KINDS: [(Trouble, &str, Health); 7] = [
    (Trouble::Checksum, "checksum", Health::CHECKSUM),
    (Trouble::Missed, "missed", Health::MISSING),
    (Trouble::Reset, "reset", Health::CONVERTER_RESET),
    (Trouble::OutOfStep, "out-of-step", Health::OUT_OF_STEP),
    (Trouble::StuckLine, "stuck-line", Health::STUCK),
    (Trouble::Overload, "overload", Health::OVERLOAD),
    (Trouble::Open, "open", Health::OPEN),
];

impl Trouble {
    /// All of them.
    pub const ALL: [Self; KINDS.len()] = [
        Self::Checksum,
        Self::Missed,
        Self::Reset,
        Self::OutOfStep,
        Self::StuckLine,
        Self::Overload,
        Self::Open,
    ];

    /// Its name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        KINDS[self as usize].1
    }

    /// The one of that name.
    ///
    /// # Errors
    /// The names that there are.
    pub fn parse(name: &str) -> Result<Self, String> {
        let found = KINDS.iter().find(|kind| kind.1 == name);
        found.map(|kind| kind.0).ok_or_else(|| {
            let known = KINDS.map(|kind| kind.1);
            format!("the faults are: {}", known.join(", "))
        })
    }

    /// The fault that it has to be found out as.
    #[must_use]
    pub const fn flag(self) -> Health {
        KINDS[self as usize].2
    }
}

/// Kinds of faults in a recording, and their rate.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Troubles {
    /// The kinds, each as likely as the others; none for a box without faults.
    pub kinds: Vec<Trouble>,
    /// Faults per minute, of all kinds together.
    pub per_minute: f64,
    /// Same seed, same faults.
    pub seed: u64,
}

impl Troubles {
    pub(super) fn begin(&self, rate: f64, chips: usize, inputs: usize, seed: u64) -> Mischief {
        Mischief {
            kinds: self.kinds.clone(),
            chance: self.per_minute / 60.0 / rate,
            random: Random::new(seed ^ 0x7261_7767),
            injector: Injector::new(0.0, seed),
            chips: chips.min(CHIPS) as u64,
            inputs: inputs as u64,
            stuck: None,
        }
    }
}

/// Faults at random while a recording is made.
pub(super) struct Mischief {
    kinds: Vec<Trouble>,
    /// Probability that a sample has a fault.
    chance: f64,
    random: Random,
    injector: Injector,
    chips: u64,
    inputs: u64,
    /// The converter whose line is stuck, and until which cycle.
    stuck: Option<(usize, u64)>,
}

impl Mischief {
    /// To be called between two samples.
    pub(super) fn inject<D: AsRef<[Vec<f32>]>>(&mut self, rig: &mut Rig<Sensors<D>, CHIPS>) {
        let now = rig.cycle();
        if let Some((chip, until)) = self.stuck {
            if now < until {
                return;
            }
            rig.stick(chip, None);
            self.stuck = None;
        }
        if !self.random.chance(self.chance) {
            return;
        }
        let which = self.random.below(self.kinds.len() as u64) as usize;
        let Some(kind) = self.kinds.get(which) else {
            return;
        };
        let chip = self.random.below(self.chips) as usize;
        let input = self.random.below(self.inputs) as usize;
        let mut lasts = |least: f64, most: f64| {
            let tenths = self.random.below(1 << 16) as f64 / 65536.0;
            now + ((least + (most - least) * tenths) * f64::from(CLOCK_HZ)) as u64
        };
        let kind = match kind {
            Trouble::Checksum => {
                let kinds = [Kind::WrongBits, Kind::Burst, Kind::Noise];
                kinds[self.random.below(3) as usize]
            }
            Trouble::Missed => {
                let kinds = [Kind::LostSample, Kind::HiddenReady];
                kinds[self.random.below(2) as usize]
            }
            Trouble::Reset => Kind::Reset,
            Trouble::OutOfStep => Kind::Delay,
            Trouble::StuckLine => {
                self.stuck = Some((chip, lasts(0.2, 0.6)));
                rig.stick(chip, Some(now & 1 != 0));
                return;
            }
            Trouble::Overload => {
                let until = lasts(0.01, 0.03);
                rig.signal().upset(input, Upset::Knock, until);
                return;
            }
            Trouble::Open => {
                let until = lasts(1.2, 3.0);
                rig.signal().upset(input, Upset::Open, until);
                return;
            }
        };
        self.injector.inject(rig, kind, chip);
    }
}
