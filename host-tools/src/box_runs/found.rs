//! The box's answer in this program's own types.

use crate::identification::{Consistency, Judged, refusal};
use crate::measure::blocks_by_word;
use crate::recording::{Traceability, TrueRate};
use crate::result::{Origin, ResultDocument, RunQuality};
use massline_core::identify::{Estimate, Identification, InertiaEstimate};
use massline_core::masslines::Method;
use massline_core::rigid_body::{Margin, Plausibility, PrincipalInertia};
use massline_firmware::wire::{self, Answer, Exact, Summary};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;

/// Answer of a box.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// By which method.
    pub method: Method,
    /// `true` if accelerometers were weighted.
    pub weighted: bool,
    /// `true` if the reference point was iterated to the CG.
    pub iterative: bool,
    /// The ten numbers.
    pub identification: Identification,
    /// As the box told it.
    pub answer: Answer,
    /// Time that the box took, s by its own clock.
    pub seconds: f64,
    /// The runs it was identified from.
    pub runs: Vec<StoredRun>,
    /// Names of the set-up's runs that the box has not.
    pub unmeasured: Vec<String>,
}

/// A run that the box has measured.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredRun {
    /// Its name.
    pub name: String,
    /// Summary of the box.
    pub summary: Summary,
    /// Calibrations of its channels.
    pub calibration: BTreeMap<String, Traceability>,
}

impl StoredRun {
    /// The true sample rate by the box's clock. Converters that are restarted leave their grid
    /// by half a period at the most at either end, so that it is uncertain by a sample's share.
    #[must_use]
    pub fn sample_rate(&self) -> Option<TrueRate> {
        let value = self.summary.sample_rate?.0;
        let samples = self.summary.samples + self.summary.missing;
        Some(TrueRate {
            value,
            uncertainty: value / samples.max(1) as f64,
            clock: "box".to_owned(),
        })
    }

    /// Samples and blocks of the run, for the result document.
    fn quality(&self) -> RunQuality {
        let s = &self.summary;
        RunQuality {
            run: self.name.clone(),
            samples: s.samples,
            blocks: s.blocks,
            rejected: s.rejected,
            rejected_by: blocks_by_word(s.rejected_by),
            faulty_samples: None,
            missing_samples: s.missing,
            true_sample_rate: self.sample_rate(),
            calibration: self.calibration.clone(),
        }
    }
}

impl Found {
    /// Why the numbers must not be believed, and what to do.
    #[must_use]
    pub fn refused(&self) -> Option<String> {
        refusal(&self.judged())
    }

    /// Grounds on which the answer is refused or warned of.
    pub(crate) fn judged(&self) -> Judged<'_> {
        Judged {
            identification: &self.identification,
            type_b: None,
            // It does not tell its masslines either.
            consistency: Consistency::bound(&self.identification),
        }
    }

    /// The result document: what of it a box tells.
    #[must_use]
    pub fn document(&self, title: &str, why: Option<&'static str>) -> ResultDocument {
        let origin = Origin {
            title,
            method: self.method.name(),
            why,
            iterative: self.iterative,
            weighted: self.weighted,
        };
        ResultDocument {
            refused: self.refused(),
            runs: self.runs.iter().map(StoredRun::quality).collect(),
            ..ResultDocument::of_numbers(&origin, &self.identification)
        }
    }
}

fn point(from: &[Exact<f64>; 3]) -> Vector3<f64> {
    Vector3::from(from.map(|x| x.0))
}

fn estimate(from: Option<wire::Estimate>) -> Option<Estimate> {
    from.map(|e| Estimate {
        value: e.value.0,
        std: e.std.0,
    })
}

/// The ten numbers of a box's answer.
pub(super) fn identification(answer: &Answer) -> Identification {
    let margin = |m: Option<wire::Margin>| {
        m.map(|m| Margin {
            relative: m.relative.0,
            uncertainty: m.uncertainty.0,
        })
    };
    let inertia = |terms: [Option<wire::Estimate>; 6]| -> InertiaEstimate { terms.map(estimate) };
    let p = &answer.plausibility;
    Identification {
        reference: point(&answer.reference),
        mass: estimate(answer.mass),
        indicator: estimate(answer.indicator),
        centre_of_gravity: answer.centre_of_gravity.map(estimate),
        inertia_reference: inertia(answer.inertia_reference),
        inertia_cg: inertia(answer.inertia_cg),
        principal: answer.principal.map(|p| PrincipalInertia {
            moments: point(&p.moments),
            axes: Matrix3::from_columns(&p.axes.map(|axis| point(&axis))),
        }),
        observable: core::array::from_fn(|k| answer.observable >> k & 1 == 1),
        condition_number: answer.condition_number.0,
        iterations: answer.iterations,
        consistency: answer.consistency.map(|x| x.0),
        misfit: answer.misfit.0,
        attenuation: answer.attenuation.0,
        freedom: answer.freedom.0,
        plausibility: Plausibility {
            mass: margin(p.mass),
            positive_definite: margin(p.positive_definite),
            triangle: margin(p.triangle),
        },
    }
}
