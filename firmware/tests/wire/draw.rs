//! Messages out of arbitrary bytes: what the generator gives decides every field.

use massline_firmware::wire::{Count24, Line, Packed, Word};
use proptest::prelude::*;

/// Longest list of readings: 12 channels, 20 samples.
pub const READINGS: usize = 240;
/// Sensors and channels of the largest set-up.
pub const SENSORS: usize = 64;

/// Material that messages are made of.
#[derive(Clone, Debug)]
pub struct Material {
    /// Numbers and choices.
    pub entropy: Vec<u8>,
    /// Texts are its beginnings.
    pub text: String,
    /// Lists are their beginnings.
    pub singles: Vec<f32>,
    /// The same.
    pub doubles: Vec<f64>,
    /// The same.
    pub counts: Vec<i32>,
    /// The same.
    pub counts24: Vec<Count24>,
    /// The same.
    pub flags: Vec<u16>,
    /// The same.
    pub lines: Vec<Line>,
    /// Every number at its largest, every option given, every list full.
    pub full: bool,
}

impl Material {
    /// Made of the given bytes.
    pub fn new(entropy: Vec<u8>, text: String) -> Self {
        let mut words = entropy.iter().cycle().enumerate();
        let mut word = |_| {
            let mut w = 0_u64;
            for _ in 0..8 {
                if let Some((i, b)) = words.next() {
                    w = (w ^ u64::from(*b) ^ i as u64).wrapping_mul(0x0000_0100_0000_01B3);
                }
            }
            w ^ (w >> 29)
        };
        let single = |w: u64| f32::from_bits(w as u32);
        Self {
            singles: (0..READINGS).map(&mut word).map(single).collect(),
            doubles: (0..SENSORS).map(&mut word).map(f64::from_bits).collect(),
            counts: (0..READINGS).map(&mut word).map(|w| w as i32).collect(),
            counts24: (0..READINGS)
                .map(&mut word)
                .filter_map(|w| Count24::new((w as i32) >> 8))
                .collect(),
            flags: (0..SENSORS).map(&mut word).map(|w| w as u16).collect(),
            lines: (0..9)
                .map(|_| Line {
                    drive: single(word(0)),
                    responses: [[0, 1]; 12].map(|pair| pair.map(|i| single(word(i)))),
                })
                .collect(),
            entropy,
            text,
            full: false,
        }
    }

    /// The largest message of every kind.
    pub fn largest() -> Self {
        Self {
            full: true,
            ..Self::new(vec![0xFF; 64], "é".repeat(300))
        }
    }

    /// Starts to draw.
    pub fn draw(&self) -> Draw<'_> {
        Draw {
            material: self,
            at: 0,
        }
    }
}

/// Arbitrary material.
pub fn material() -> impl Strategy<Value = Material> {
    let entropy = proptest::collection::vec(any::<u8>(), 0..600);
    (entropy, ".{0,40}").prop_map(|(entropy, text)| Material::new(entropy, text))
}

/// Takes one thing after the other out of some material; zeros when it is used up.
pub struct Draw<'a> {
    material: &'a Material,
    at: usize,
}

impl<'a> Draw<'a> {
    fn byte(&mut self) -> u8 {
        let byte = self.material.entropy.get(self.at).copied().unwrap_or(0);
        self.at += 1;
        byte
    }

    /// Any number, but the ends of the range more often than chance has it.
    pub fn u64(&mut self) -> u64 {
        if self.material.full {
            return u64::MAX;
        }
        match self.byte() {
            0..=19 => 0,
            20..=39 => u64::MAX,
            40..=99 => u64::from(self.byte()),
            _ => u64::from_le_bytes([0; 8].map(|_: u8| self.byte())),
        }
    }

    pub fn u32(&mut self) -> u32 {
        self.u64() as u32
    }

    pub fn u16(&mut self) -> u16 {
        self.u64() as u16
    }

    pub fn u8(&mut self) -> u8 {
        self.u64() as u8
    }

    pub fn bool(&mut self) -> bool {
        self.u8() & 1 == 1
    }

    /// Any bits.
    pub fn f64(&mut self) -> f64 {
        f64::from_bits(self.u64())
    }

    pub fn f32(&mut self) -> f32 {
        f32::from_bits(self.u32())
    }

    /// `N` times the same.
    pub fn array<T, const N: usize>(&mut self, mut one: impl FnMut(&mut Self) -> T) -> [T; N] {
        [(); N].map(|()| one(self))
    }

    pub fn option<T>(&mut self, mut one: impl FnMut(&mut Self) -> T) -> Option<T> {
        self.bool().then(|| one(self))
    }

    /// One of several; the last of them in the largest message.
    pub fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        let i = if self.material.full {
            of.len() - 1
        } else {
            usize::from(self.byte()) % of.len()
        };
        of[i]
    }

    fn length(&mut self, most: usize) -> usize {
        if self.material.full {
            most
        } else {
            usize::from(self.u16()) % (most + 1)
        }
    }

    /// At most so many bytes.
    pub fn text(&mut self, most: usize) -> &'a str {
        let text = &self.material.text;
        let mut end = self.length(most).min(text.len());
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        &text[..end]
    }

    /// At most so many bytes.
    pub fn bytes(&mut self, most: usize) -> &'a [u8] {
        let bytes = &self.material.entropy;
        &bytes[..self.length(most).min(bytes.len())]
    }

    fn list<T: Word>(&mut self, values: &'a [T], most: usize) -> Packed<'a, T> {
        Packed::new(&values[..self.length(most.min(values.len()))])
    }

    pub fn singles(&mut self, most: usize) -> Packed<'a, f32> {
        self.list(&self.material.singles, most)
    }

    pub fn doubles(&mut self, most: usize) -> Packed<'a, f64> {
        self.list(&self.material.doubles, most)
    }

    pub fn counts(&mut self, most: usize) -> Packed<'a, i32> {
        self.list(&self.material.counts, most)
    }

    pub fn counts24(&mut self, most: usize) -> Packed<'a, Count24> {
        self.list(&self.material.counts24, most)
    }

    pub fn flags(&mut self, most: usize) -> Packed<'a, u16> {
        self.list(&self.material.flags, most)
    }

    pub fn lines(&mut self, most: usize) -> Packed<'a, Line> {
        self.list(&self.material.lines, most)
    }
}
