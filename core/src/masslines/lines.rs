//! The averaged spectra as the estimators read them: second moments, line by line.
//!
//! With a drive channel a run gives one pair of amplitudes per line, `a = H_a` and
//! `f = H_f`, weighted with the drive's power; without one it gives the cross-spectral
//! matrix. Both come down to the same three matrices, `Σ a a*`, `Σ f a*` and `Σ f f*`,
//! which is equation (13) before anyone averages over the band.

use super::MasslineError;
use super::driven::Driven;
use super::moments::{Moments, Powers, Squares};
use crate::geometry::ResultantNoise;
use crate::spectra::{BandError, LineRange};
use nalgebra::{Complex, Vector6};

/// Complex amplitudes of acceleration and force at one line.
pub type Amplitudes = (Vector6<Complex<f64>>, Vector6<Complex<f64>>);

/// Averaged spectra of one or more runs that share a reference point, a frame and the
/// equations their load cells complete: [`super::DriveLines`], [`super::CrossLines`] and
/// [`super::SineLines`].
pub trait Lines: Internals {
    /// Number of lines.
    fn count(&self) -> usize;
    /// Frequency of a line, Hz, ascending.
    fn frequency(&self, line: usize) -> f64;
    /// Number of runs.
    fn runs(&self) -> usize;
    /// Adds the moments of one run at one line, times `weight`.
    fn add_moments(&self, run: usize, line: usize, weight: f64, into: &mut Moments);
    /// Covariance of the noise per line that `Σ a a*` and `Σ f f*` of a run contain, mean over
    /// the averaging band, about the reference point.
    fn noise(&self, run: usize) -> ResultantNoise;
}

/// The part of [`Lines`] that only the estimators read; it keeps that trait to the kinds of lines
/// of this crate.
pub trait Internals {
    /// Refuses runs that have too few blocks to tell their noise.
    ///
    /// # Errors
    /// [`MasslineError::TooFewBlocks`].
    fn check(&self) -> Result<(), MasslineError> {
        Ok(())
    }
    /// Independent complex equations that one line of a run holds.
    fn equations_per_line(&self, run: usize) -> f64;
    /// Variance of a mean over lines relative to independent lines and blocks.
    fn correlation(&self) -> f64;
    /// The single pair of amplitudes of a run at a line, if it was referred to a drive.
    fn pair(&self, run: usize, line: usize) -> Option<Amplitudes>;
    /// The same runs in single precision, if that is what they are kept in.
    fn driven(&self) -> Option<Driven<'_>> {
        None
    }
    /// Factor with which the squares of that pair enter the moments.
    fn pair_weight(&self, _run: usize, _line: usize) -> f64 {
        1.0
    }
}

/// Adds the powers of one run at one line, times `weight`.
pub(super) fn add_powers<L: Lines + ?Sized>(
    lines: &L,
    run: usize,
    line: usize,
    weight: f64,
    into: &mut Powers,
) {
    if let Some((a, f)) = lines.pair(run, line) {
        into.add_pair(&a, &f, weight * lines.pair_weight(run, line));
    } else {
        add_powers_of_moments(lines, run, line, weight, into);
    }
}

/// Adds the squares of one run at one line, times `weight`.
pub(super) fn add_squares<L: Lines + ?Sized>(
    lines: &L,
    run: usize,
    line: usize,
    weight: f64,
    into: &mut Squares,
) {
    if let Some((a, f)) = lines.pair(run, line) {
        into.add_pair(&a, &f, weight * lines.pair_weight(run, line));
    } else {
        add_squares_of_moments(lines, run, line, weight, into);
    }
}

#[inline(never)] // Moments are on the stack only where they are needed.
fn add_powers_of_moments<L: Lines + ?Sized>(
    lines: &L,
    run: usize,
    line: usize,
    weight: f64,
    into: &mut Powers,
) {
    let mut m = Moments::zero();
    lines.add_moments(run, line, weight, &mut m);
    into.aa += m.aa.map(|z| z.re);
    into.ff += m.ff.diagonal().map(|z| z.re);
}

#[inline(never)] // Moments are on the stack only where they are needed.
fn add_squares_of_moments<L: Lines + ?Sized>(
    lines: &L,
    run: usize,
    line: usize,
    weight: f64,
    into: &mut Squares,
) {
    let mut m = Moments::zero();
    lines.add_moments(run, line, weight, &mut m);
    into.aa.zip_apply(&m.aa, |sum, z| *sum += z.re);
    into.ff.zip_apply(&m.ff, |sum, z| *sum += z.re);
}

/// The lines of a band (Hz), both ends included: see [`LineRange::among`].
///
/// # Errors
/// [`BandError`] if it is no band, or reaches beyond the lines.
pub fn lines_between<L: Lines + ?Sized>(lines: &L, band: [f64; 2]) -> Result<LineRange, BandError> {
    LineRange::between(lines.count(), |line| lines.frequency(line), band)
}

/// A band's indices, if it was chosen from as many lines as there are.
///
/// # Errors
/// [`MasslineError::OtherLines`].
pub(super) fn indices<L: Lines + ?Sized>(
    lines: &L,
    band: LineRange,
) -> Result<core::ops::Range<usize>, MasslineError> {
    if band.count() != lines.count() {
        return Err(MasslineError::OtherLines {
            band: band.count(),
            lines: lines.count(),
        });
    }
    Ok(band.indices())
}

/// The first two elements a line of lent working memory.
///
/// # Errors
/// [`MasslineError::Work`] if there are fewer.
pub(super) fn two_a_line<'w>(
    lines: &core::ops::Range<usize>,
    work: &'w mut [Complex<f64>],
) -> Result<&'w mut [Complex<f64>], MasslineError> {
    let (needed, given) = (2 * lines.len(), work.len());
    work.get_mut(..needed)
        .ok_or(MasslineError::Work { needed, given })
}
