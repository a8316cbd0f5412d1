//! Two runs of the same core, number by number, by their bits.

use crate::identification::Answer;
use crate::measure::{MeasuredRun, Spectra};
use massline_core::geometry::{ACCELERATION_NAMES, RESULTANT_NAMES, ResultantNoise};
use massline_core::identify::{Estimate, Identification};
use massline_core::spectra::LineGrid;
use massline_firmware::instrument::{self, Findings};
use massline_firmware::wire::{
    self, Exact, Health, Identified, Line, NoAnswer, RESULTANTS, Summary,
};
use std::fmt;

/// A number, or what there is in its place.
#[derive(Clone, Debug, PartialEq)]
pub enum Found {
    /// Single precision.
    Single(f32),
    /// Double precision.
    Double(f64),
    /// There is none.
    Nothing,
    /// Something that is no number.
    Text(String),
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Single(x) => write!(f, "{:#010x} ({x:e})", x.to_bits()),
            Self::Double(x) => write!(f, "{:#018x} ({x:e})", x.to_bits()),
            Self::Nothing => f.write_str("nothing"),
            Self::Text(text) => f.write_str(text),
        }
    }
}

/// The first place at which two runs part.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Name of the number.
    pub place: String,
    /// The host's.
    pub host: Found,
    /// The box's.
    pub device: Found,
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
    /// Numbers compared.
    pub numbers: usize,
    /// Numbers that differ.
    pub different: usize,
    /// The first one.
    pub first: Option<Difference>,
}

impl Comparison {
    /// `true` if all is the same, and there was something to compare.
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
        // Faulty samples go to the box as what is no number, whatever was wrong with them.
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
            comparison.answer(&host.identification, device);
            comparison.findings(host, device);
            let blocks = host.measurement.runs.iter().map(|r| r.blocks).sum::<u32>();
            comparison.same("blocks", &blocks, &device.quality.blocks);
        }
        comparison
    }

    /// Compares what the fits say beside the ten numbers.
    fn findings(&mut self, host: &Answer, device: &wire::Answer) {
        let mut findings = Findings::default();
        for fit in &host.fits {
            findings.add_fit(fit);
        }
        for modes in &host.free_modes {
            findings.add_modes(modes);
        }
        let host = instrument::answer(
            device.question,
            device.accelerations,
            device.quality,
            &host.identification,
            &findings,
        );
        self.same("excited directions", &host.excited, &device.excited);
        let value = |x: Option<Exact<f64>>| x.map(|x| x.0);
        self.optional(
            || "weakest excitation".to_owned(),
            value(host.weakest_excitation),
            value(device.weakest_excitation),
        );
        for (k, (host, device)) in host.poles.iter().zip(device.poles).enumerate() {
            let of = |x: Option<wire::Pole>| (x.map(|p| p.frequency.0), x.map(|p| p.damping.0));
            let (host, device) = (of(*host), of(device));
            self.optional(|| format!("frequency of pole {k}"), host.0, device.0);
            self.optional(|| format!("damping of pole {k}"), host.1, device.1);
        }
    }

    fn note(&mut self, same: bool, difference: impl FnOnce() -> Difference) {
        self.numbers += 1;
        if !same {
            self.different += 1;
            self.first.get_or_insert_with(difference);
        }
    }

    fn single(&mut self, place: impl FnOnce() -> String, host: f32, device: f32) {
        self.note(host.to_bits() == device.to_bits(), || Difference {
            place: place(),
            host: Found::Single(host),
            device: Found::Single(device),
        });
    }

    fn double(&mut self, place: impl FnOnce() -> String, host: f64, device: f64) {
        self.optional(place, Some(host), Some(device));
    }

    fn optional(&mut self, place: impl FnOnce() -> String, host: Option<f64>, device: Option<f64>) {
        let found = |x: Option<f64>| x.map_or(Found::Nothing, Found::Double);
        let bits = |x: Option<f64>| x.map(f64::to_bits);
        self.note(bits(host) == bits(device), || Difference {
            place: place(),
            host: found(host),
            device: found(device),
        });
    }

    /// Compares something that is no floating-point number.
    pub fn same<T: PartialEq + fmt::Debug>(&mut self, place: &str, host: &T, device: &T) {
        self.note(host == device, || Difference {
            place: place.to_owned(),
            host: Found::Text(format!("{host:?}")),
            device: Found::Text(format!("{device:?}")),
        });
    }

    /// Compares lists of numbers, `what` each.
    pub fn list(&mut self, what: &str, host: &[f64], device: &[f64]) {
        self.same(&format!("number of {what}s"), &host.len(), &device.len());
        for (k, (h, d)) in host.iter().zip(device).enumerate() {
            self.double(|| format!("{what} {k}"), *h, *d);
        }
    }

    /// Compares noise powers of the twelve resultants.
    pub fn noise(&mut self, host: &[f32; RESULTANTS], device: Option<[Exact<f32>; RESULTANTS]>) {
        self.same("noise", &true, &device.is_some());
        for (c, device) in device.into_iter().flatten().enumerate() {
            self.single(|| format!("noise of {}", resultant(c)), host[c], device.0);
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

    fn estimate(&mut self, what: &str, host: Option<Estimate>, device: Option<wire::Estimate>) {
        let value = device.map(|d| d.value.0);
        self.optional(|| what.to_owned(), host.map(|h| h.value), value);
        let std = device.map(|d| d.std.0);
        self.optional(|| format!("error bar of {what}"), host.map(|h| h.std), std);
    }

    /// Compares an answer.
    pub fn answer(&mut self, host: &Identification, device: &wire::Answer) {
        const AXES: [&str; 3] = ["x", "y", "z"];
        const TERMS: [&str; 6] = ["xx", "yy", "zz", "xy", "xz", "yz"];
        self.estimate("mass", host.mass, device.mass);
        self.estimate("indicator", host.indicator, device.indicator);
        for (j, axis) in AXES.iter().enumerate() {
            self.double(
                || format!("{axis} of A"),
                host.reference[j],
                device.reference[j].0,
            );
            let (h, d) = (host.centre_of_gravity[j], device.centre_of_gravity[j]);
            self.estimate(&format!("{axis} of the CG"), h, d);
        }
        for (j, term) in TERMS.iter().enumerate() {
            let (h, d) = (host.inertia_reference[j], device.inertia_reference[j]);
            self.estimate(&format!("Θ{term} about A"), h, d);
            let (h, d) = (host.inertia_cg[j], device.inertia_cg[j]);
            self.estimate(&format!("Θ{term} about the CG"), h, d);
        }
        for k in 0..3 {
            let (h, d) = (&host.principal, &device.principal);
            let (moment, found) = (h.as_ref().map(|p| p.moments[k]), d.map(|p| p.moments[k].0));
            self.optional(|| format!("principal moment {k}"), moment, found);
            for (j, axis) in AXES.iter().enumerate() {
                let place = || format!("{axis} of principal axis {k}");
                let (h, d) = (
                    h.as_ref().map(|p| p.axes[(j, k)]),
                    d.map(|p| p.axes[k][j].0),
                );
                self.optional(place, h, d);
            }
        }
        let observable = |k: usize| device.observable >> k & 1 == 1;
        for (k, host) in host.observable.iter().enumerate() {
            self.same(
                &format!("observability of unknown {k}"),
                host,
                &observable(k),
            );
        }
        self.double(
            || "condition number".to_owned(),
            host.condition_number,
            device.condition_number.0,
        );
        self.same("iterations", &host.iterations, &device.iterations);
        let consistency = device.consistency.map(|c| c.0);
        self.optional(|| "consistency".to_owned(), host.consistency, consistency);
        self.double(|| "misfit".to_owned(), host.misfit, device.misfit.0);
        self.double(
            || "attenuation".to_owned(),
            host.attenuation,
            device.attenuation.0,
        );
        self.double(
            || "degrees of freedom".to_owned(),
            host.freedom,
            device.freedom.0,
        );
        let (h, d) = (&host.plausibility, &device.plausibility);
        for (what, h, d) in [
            ("margin of the mass", h.mass, d.mass),
            (
                "margin of the inertia",
                h.positive_definite,
                d.positive_definite,
            ),
            ("margin of the triangle inequality", h.triangle, d.triangle),
        ] {
            let share = d.map(|m| m.relative.0);
            self.optional(|| what.to_owned(), h.map(|m| m.relative), share);
            let bar = d.map(|m| m.uncertainty.0);
            self.optional(
                || format!("error bar of the {what}"),
                h.map(|m| m.uncertainty),
                bar,
            );
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
    fn a_nan_is_itself_and_nothing_compared_is_not_identical() {
        let mut comparison = Comparison::default();
        assert!(!comparison.identical());
        comparison.list("weight", &[f64::NAN], &[f64::NAN]);
        assert!(comparison.identical());
        comparison.list("weight", &[1.0], &[]);
        assert!(!comparison.identical());
    }
}
