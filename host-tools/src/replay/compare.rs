//! Comparison of two runs of the same core, number by number, by their bits.

use super::leaves::leaves;
use crate::identification::Answer;
use crate::measure::{MeasuredRun, Spectra};
use massline_core::geometry::{ACCELERATION_NAMES, RESULTANT_NAMES, RESULTANTS, ResultantNoise};
use massline_core::spectra::LineGrid;
use massline_firmware::wire::{Findings, Health, Identified, Line, NoAnswer, Summary};
use serde::Serialize;
use std::fmt;

/// A number, a word, or nothing.
#[derive(Clone, Debug)]
pub enum Leaf {
    /// A number in single precision.
    Single(f32),
    /// A number in double precision.
    Double(f64),
    /// No value.
    Nothing,
    /// A value that is not a floating-point number.
    Text(String),
}

/// Floating-point numbers are equal if their bits are.
impl PartialEq for Leaf {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Single(a), Self::Single(b)) => a.to_bits() == b.to_bits(),
            (Self::Double(a), Self::Double(b)) => a.to_bits() == b.to_bits(),
            (Self::Nothing, Self::Nothing) => true,
            (Self::Text(a), Self::Text(b)) => a == b,
            _ => false,
        }
    }
}

impl fmt::Display for Leaf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Single(x) => write!(f, "{:#010x} ({x:e})", x.to_bits()),
            Self::Double(x) => write!(f, "{:#018x} ({x:e})", x.to_bits()),
            Self::Nothing => f.write_str("nothing"),
            Self::Text(text) => f.write_str(text),
        }
    }
}

/// A number that differs between two runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Name of the number.
    pub place: String,
    /// Value of the host.
    pub host: Leaf,
    /// Value of the box.
    pub device: Leaf,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            place,
            host,
            device,
        } = self;
        write!(f, "{place}: host {host}, box {device}")
    }
}

/// Outcome of a comparison.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    /// Count of the numbers that were compared.
    pub numbers: usize,
    /// Numbers that differ.
    pub different: usize,
    /// The first number that differs.
    pub first: Option<Difference>,
}

impl Comparison {
    /// `true` if numbers were compared and all of them are the same.
    #[must_use]
    pub const fn identical(&self) -> bool {
        self.different == 0 && self.numbers > 0
    }

    /// Compares a run: samples, blocks, noise and lines.
    pub(super) fn of_run(
        host: &MeasuredRun,
        grid: &LineGrid,
        summary: &Summary,
        lines: &[Line],
    ) -> Self {
        let mut comparison = Self::default();
        comparison.same("samples", &host.samples, &summary.samples);
        comparison.same("missing samples", &0, &summary.missing);
        comparison.same("blocks", &host.blocks, &summary.blocks);
        let rejected = host.rejected.blocks;
        comparison.same("rejected blocks", &rejected, &summary.rejected);
        // Faulty samples are sent to the box as NaN, whatever was wrong with them.
        let reason = if rejected > 0 {
            Health::NOT_FINITE
        } else {
            Health::GOOD
        };
        comparison.same("reasons of rejection", &reason, &summary.health);
        if let Spectra::Drive {
            responses,
            drive,
            noise,
            ..
        } = &host.spectra
        {
            comparison.same("number of lines", &responses.len(), &lines.len());
            let host = responses.iter().zip(drive);
            for (k, ((responses, drive), device)) in host.zip(lines).enumerate() {
                let host = Line {
                    drive: *drive,
                    responses: responses.map(|z| [z.re, z.im]),
                };
                comparison.line(k, grid.frequency(k), &host, device);
            }
            let variances = ResultantNoise::unpacked(noise).variances();
            comparison.noise(&variances.map(|v| v as f32), summary.noise);
        }
        comparison
    }

    /// Compares two answers, or the reasons for none.
    pub(super) fn of_answers(
        host: &Result<Answer, NoAnswer>,
        device: &Result<Identified, NoAnswer>,
    ) -> Self {
        let mut comparison = Self::default();
        let refusal = |why: Option<&NoAnswer>| why.map(ToString::to_string);
        comparison.same(
            "answer",
            &refusal(host.as_ref().err()),
            &refusal(device.as_ref().err()),
        );
        if let (Ok(host), Ok(device)) = (host, device) {
            let device = &device.answer;
            comparison.values("", &host.identification, &device.identification);
            let mut findings = Findings::default();
            for fit in &host.fits {
                findings.add_fit(fit);
            }
            for modes in &host.free_modes {
                findings.add_modes(modes);
            }
            comparison.values("", &findings, &device.findings);
            let blocks = host.measurement.runs.iter().map(|r| r.blocks).sum::<u32>();
            comparison.same("blocks", &blocks, &device.quality.blocks);
        }
        comparison
    }

    fn leaf(&mut self, place: impl FnOnce() -> String, host: &Leaf, device: &Leaf) {
        self.numbers += 1;
        if host != device {
            self.different += 1;
            self.first.get_or_insert_with(|| Difference {
                place: place(),
                host: host.clone(),
                device: device.clone(),
            });
        }
    }

    fn single(&mut self, place: impl FnOnce() -> String, host: f32, device: f32) {
        self.leaf(place, &Leaf::Single(host), &Leaf::Single(device));
    }

    /// Compares two values that are not floating-point numbers.
    pub fn same<T: fmt::Debug>(&mut self, place: &str, host: &T, device: &T) {
        let leaf = |value: &T| Leaf::Text(format!("{value:?}"));
        self.leaf(|| place.to_owned(), &leaf(host), &leaf(device));
    }

    /// Compares two values field by field; `name` is theirs, if they have one.
    pub fn values<T: Serialize>(&mut self, name: &str, host: &T, device: &T) {
        let (Ok(host), Ok(device)) = (leaves(host), leaves(device)) else {
            // No type of the core refuses to be serialised; if one did, nothing would be known.
            return self.same(name, &"not serialisable", &"");
        };
        let of = |all: &[(String, Leaf)], path: &String| {
            let found = all.iter().find(|(other, _)| other == path);
            found.map_or(Leaf::Nothing, |(_, leaf)| leaf.clone())
        };
        for (path, leaf) in &host {
            self.leaf(|| format!("{name}{path}"), leaf, &of(&device, path));
        }
        for (path, leaf) in &device {
            // One side may have a value where the other one has none.
            if host.iter().all(|(other, _)| other != path) {
                self.leaf(|| format!("{name}{path}"), &Leaf::Nothing, leaf);
            }
        }
    }

    /// Compares two lists of numbers of this name.
    pub fn list(&mut self, name: &str, host: &[f64], device: &[f64]) {
        self.same(&format!("number of {name}s"), &host.len(), &device.len());
        for (k, (h, d)) in host.iter().zip(device).enumerate() {
            let place = || format!("{name} {k}");
            self.leaf(place, &Leaf::Double(*h), &Leaf::Double(*d));
        }
    }

    /// Compares noise powers of the twelve resultants.
    pub fn noise(&mut self, host: &[f32; RESULTANTS], device: Option<[f32; RESULTANTS]>) {
        self.same("noise", &true, &device.is_some());
        for (c, device) in device.into_iter().flatten().enumerate() {
            self.single(|| format!("noise of {}", resultant(c)), host[c], device);
        }
    }

    /// Compares line `k` of a run, which lies at `frequency` Hz.
    pub fn line(&mut self, k: usize, frequency: f64, host: &Line, device: &Line) {
        let at = format!("line {k} ({frequency} Hz)");
        self.single(
            || format!("{at}, power of the drive"),
            host.drive,
            device.drive,
        );
        for c in 0..RESULTANTS {
            for (part, name) in ["real part", "imaginary part"].into_iter().enumerate() {
                self.single(
                    || format!("{at}, {}, {name}", resultant(c)),
                    host.responses[c][part],
                    device.responses[c][part],
                );
            }
        }
    }
}

/// Name of a resultant among the twelve.
fn resultant(c: usize) -> &'static str {
    let names = ACCELERATION_NAMES.iter().chain(&RESULTANT_NAMES);
    names.copied().nth(c).unwrap_or("?")
}

#[cfg(test)]
mod tests {
    use super::*;
    use massline_core::modes::Pole;

    #[test]
    fn the_first_difference_is_named_with_both_bit_patterns() {
        let host = Line::default();
        let mut device = host;
        device.responses[8][1] = -0.0;
        device.responses[9][0] = 1.0;
        let mut comparison = Comparison::default();
        comparison.line(11, 6.0, &host, &device);
        assert_eq!((comparison.numbers, comparison.different), (25, 2));
        assert_eq!(
            comparison.first.unwrap().to_string(),
            "line 11 (6 Hz), fz, imaginary part: host 0x00000000 (0e0), box 0x80000000 (-0e0)"
        );
    }

    #[test]
    fn every_field_of_an_answer_is_compared() {
        let pole = |damping| {
            Some(Pole {
                frequency: 32.0,
                damping,
            })
        };
        let host = Findings {
            excited: Some(6),
            weakest_excitation: None,
            poles: [pole(0.5), pole(f64::NAN), None, None],
        };
        let mut comparison = Comparison::default();
        comparison.values("", &host, &host);
        assert_eq!((comparison.numbers, comparison.different), (8, 0));
        let mut device = host;
        device.weakest_excitation = Some(0.0);
        device.poles[0] = pole(-0.5);
        device.poles[3] = pole(0.25);
        comparison.values("", &host, &device);
        // A number and a pole of two numbers in the place of nothing, and another damping.
        assert_eq!((comparison.numbers, comparison.different), (18, 4));
        assert_eq!(
            comparison.first.unwrap().to_string(),
            "weakest_excitation: host nothing, box 0x0000000000000000 (0e0)"
        );
    }

    #[test]
    fn a_nan_is_itself_and_nothing_compared_is_not_identical() {
        let mut comparison = Comparison::default();
        assert!(!comparison.identical());
        comparison.list("weight", &[f64::NAN], &[f64::NAN]);
        assert!(comparison.identical());
        comparison.list("weight", &[1.0], &[]);
        assert!(!comparison.identical());
    }
}
