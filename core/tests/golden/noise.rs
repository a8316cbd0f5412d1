//! Noise of the bodies whose numbers are kept to the last bit.

/// Numbers between -1 and 1, by whole numbers and one division: the same everywhere.
pub struct Noise(pub u32);

impl Noise {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from((self.0 >> 8) as i32 - (1 << 23)) / f64::from(1 << 23)
    }
}
