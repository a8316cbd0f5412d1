//! A line that breaks frames on purpose, the same ones for a seed: what the link promises
//! can then be counted.

use super::{Port, PortError};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::time::Duration;

/// Shares of the frames that suffer, each 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noise {
    /// Some bits are flipped.
    pub corrupted: f64,
    /// The end is missing.
    pub truncated: f64,
    /// It comes twice.
    pub duplicated: f64,
}

/// Damage to the frames of one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Damage {
    /// Frames that came to the line.
    pub frames: u64,
    /// Frames with flipped bits.
    pub corrupted: u64,
    /// Frames whose end is missing.
    pub truncated: u64,
    /// Frames that went on twice.
    pub duplicated: u64,
}

impl Damage {
    /// Frames that did not arrive whole.
    #[must_use]
    pub const fn lost(&self) -> u64 {
        self.corrupted + self.truncated
    }
}

/// A port with a bad line before it.
pub struct NoisyLine<P> {
    port: P,
    noise: Noise,
    random: ChaCha8Rng,
    /// The frame from the box that is not complete yet.
    body: Vec<u8>,
    to_box: Damage,
    from_box: Damage,
}

impl<P: Port> NoisyLine<P> {
    /// A bad line before `port`.
    pub fn new(port: P, noise: Noise, seed: u64) -> Self {
        Self {
            port,
            noise,
            random: ChaCha8Rng::seed_from_u64(seed),
            body: Vec::new(),
            to_box: Damage::default(),
            from_box: Damage::default(),
        }
    }

    /// From now on the line is that good.
    pub const fn set_noise(&mut self, noise: Noise) {
        self.noise = noise;
    }

    /// Damage to the host's frames.
    #[must_use]
    pub const fn to_box(&self) -> &Damage {
        &self.to_box
    }

    /// Damage to the box's frames.
    #[must_use]
    pub const fn from_box(&self) -> &Damage {
        &self.from_box
    }

    /// The port behind the line.
    pub const fn port(&self) -> &P {
        &self.port
    }
}

impl<P: Port> Port for NoisyLine<P> {
    fn name(&self) -> String {
        format!("{}, on a bad line", self.port.name())
    }

    /// One frame at a time.
    fn send(&mut self, frame: &[u8]) -> Result<(), PortError> {
        let mut out = Vec::new();
        pass(
            frame,
            self.noise,
            &mut self.random,
            &mut self.to_box,
            &mut out,
        );
        self.port.send(&out)
    }

    fn receive(&mut self, into: &mut Vec<u8>, timeout: Duration) -> Result<usize, PortError> {
        let before = into.len();
        let mut bytes = Vec::new();
        while into.len() == before {
            bytes.clear();
            if self.port.receive(&mut bytes, timeout)? == 0 {
                return Ok(0);
            }
            for &byte in &bytes {
                if byte != 0 {
                    self.body.push(byte);
                } else if !self.body.is_empty() {
                    let frame = [&[0], &self.body[..], &[0]].concat();
                    self.body.clear();
                    pass(
                        &frame,
                        self.noise,
                        &mut self.random,
                        &mut self.from_box,
                        into,
                    );
                }
            }
        }
        Ok(into.len() - before)
    }

    super::port::ask_within!(self, self.port);
}

/// Lets a frame through, or not quite.
fn pass(
    frame: &[u8],
    noise: Noise,
    random: &mut ChaCha8Rng,
    damage: &mut Damage,
    out: &mut Vec<u8>,
) {
    damage.frames += 1;
    let mut chance = f64::from(random.next_u32()) / 2f64.powi(32);
    let mut strikes = |share: f64| {
        chance -= share;
        chance < 0.0
    };
    // Neither delimiter is touched: with a broken one the frame may still be whole.
    let inner = frame.len().saturating_sub(2).max(1);
    let mut below = |bound: usize| random.next_u32() as usize % bound;
    if strikes(noise.corrupted) {
        damage.corrupted += 1;
        // All within four bytes, which the checksum notices for certain.
        let first = below(inner);
        let flips = 1 + below(4.min(inner - first));
        let mut broken = frame.to_vec();
        for byte in broken.iter_mut().skip(1 + first).take(flips) {
            *byte ^= 1 + below(255) as u8;
        }
        out.extend(broken);
    } else if strikes(noise.truncated) {
        damage.truncated += 1;
        let left = 1 + below(inner);
        out.extend_from_slice(&frame[..left]);
    } else {
        let twice = strikes(noise.duplicated);
        damage.duplicated += u64::from(twice);
        for _ in 0..=u8::from(twice) {
            out.extend_from_slice(frame);
        }
    }
}
