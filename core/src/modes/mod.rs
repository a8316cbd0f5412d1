//! Elastic modes: poles from the data.
//!
//! On a rigid interface the apparent mass has the poles of the *fixed* structure, and
//! each of them adds a positive semidefinite matrix. Any power-like scalar of it, such
//! as `a*f / a*W a`, therefore shows every mode with a positive residue: no two modes
//! can cancel, and one scalar function is enough to find the poles of all entries.

mod poles;
mod trace;

#[cfg(test)]
pub(crate) use poles::Resonance;
pub(crate) use poles::{PoleSearch, Residues, Resonances, find_poles, find_resonances};
pub(crate) use trace::Trace;

use nalgebra::Complex;

/// Most modes that are fitted at once.
pub const MAX_MODES: usize = 4;

/// A mode's natural frequency and damping.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Pole {
    /// Undamped natural frequency, Hz.
    pub frequency: f64,
    /// Share of critical damping ζ.
    pub damping: f64,
}

impl Pole {
    /// `D(ω) = ω² / (ω_r² - ω² + 2 j ζ ω_r ω)`: what this mode adds to the apparent mass
    /// per unit of effective mass, at `frequency` Hz.
    #[must_use]
    pub fn amplification(&self, frequency: f64) -> Complex<f64> {
        let ratio = frequency / self.frequency;
        let squared = ratio * ratio;
        let (re, im) = (1.0 - squared, 2.0 * self.damping * ratio);
        let scale = squared / (re * re + im * im);
        Complex::new(re * scale, -im * scale)
    }
}
