//! The document of an answer.

use super::framed;
use super::{
    ConsistencyDocument, CovarianceDocument, Deflection, FixedModeDocument, FreeModeDocument,
    InertiaTerms, LikelihoodDocument, LikelihoodMode, NoiseDocument, Number, Offsets, Plausible,
    RejectedBand, ResultDocument, RunQuality, SCHEMA,
};
use crate::frame::Frame;
use crate::identification::{Answer, Consistency, Likelihood, TypeB, number as place};
use crate::likelihood;
use crate::measure::{MeasuredRun, RunNoise};
use crate::setup::Setup;
use massline_core::identify::{Covariance, Estimate, Identification, Procedure};
use massline_core::rigid_body::{Margin, Verdict};

impl Plausible {
    fn new(i: &Identification) -> Self {
        let p = &i.plausibility;
        let margin = |m: Option<Margin>| m.map(|m| m.relative);
        let half = |m: Option<Margin>| m.map(|m| m.uncertainty).filter(|half| half.is_finite());
        Self {
            ok: match p.verdict() {
                Verdict::Holds => Some(true),
                Verdict::Violated => Some(false),
                Verdict::Undecided => None,
            },
            reason: p.reason().map(str::to_owned),
            positive_definite_margin: margin(p.positive_definite),
            positive_definite_interval: half(p.positive_definite),
            triangle_margin: margin(p.triangle),
            triangle_interval: half(p.triangle),
        }
    }
}

impl CovarianceDocument {
    fn new(i: &Identification, matrix: Covariance) -> Self {
        let (first, unit) = match i.indicator {
            Some(_) => ("indicator", "1"),
            None => ("mass", "kg"),
        };
        Self {
            rows: [first, "x", "y", "z", "xx", "yy", "zz", "xy", "xz", "yz"].map(str::to_owned),
            units: core::array::from_fn(|k| {
                let unit = match k {
                    0 => unit,
                    1..4 => "m",
                    _ => "kg m²",
                };
                unit.to_owned()
            }),
            matrix,
        }
    }
}

impl ConsistencyDocument {
    fn new(test: Consistency) -> Self {
        Self {
            ratio: test.ratio,
            freedom: [test.surplus, test.freedom].map(|n| Some(n).filter(|n| n.is_finite())),
            probability: test.probability,
        }
    }
}

fn deflections(channels: &[String], shape: Option<&Vec<f64>>) -> Option<Vec<Deflection>> {
    shape.map(|shape| {
        let pairs = channels.iter().zip(shape);
        pairs
            .map(|(channel, value)| Deflection {
                channel: channel.clone(),
                value: *value,
            })
            .collect()
    })
}

/// Mass along x, y, z and moments of inertia about them, at the reference point.
fn whole(identification: &Identification) -> [Option<f64>; 6] {
    let mass = identification.mass.map(|m| m.value);
    let i = identification.inertia_reference;
    [
        mass,
        mass,
        mass,
        i[0].map(|t| t.value),
        i[1].map(|t| t.value),
        i[2].map(|t| t.value),
    ]
}

fn fixed_modes(
    channels: &[String],
    answer: &Answer,
    identification: &Identification,
    frame: Option<&Frame>,
) -> Vec<FixedModeDocument> {
    let whole = whole(identification);
    let modal = answer.modal.iter().flat_map(|m| &m.fixed);
    modal
        .map(|m| {
            let mode = frame.map_or(m.mode, |frame| framed::mode(frame, &m.mode));
            let diagonal = mode.effective_mass.diagonal();
            let seen = |j: usize, x: f64| (diagonal[j] > 0.0).then_some(x);
            FixedModeDocument {
                frequency: m.mode.pole.frequency,
                damping: m.mode.pole.damping,
                effective_mass: core::array::from_fn(|j| seen(j, diagonal[j])),
                effective_mass_share: core::array::from_fn(|j| {
                    seen(j, diagonal[j]).zip(whole[j]).map(|(e, w)| e / w)
                }),
                participation: core::array::from_fn(|j| seen(j, mode.participation[j])),
                modal_mass: m.modal_mass,
                shape: deflections(channels, m.shape.as_ref()),
                purity: m.mode.rank_one,
            }
        })
        .collect()
}

fn free_modes(channels: &[String], answer: &Answer) -> Vec<FreeModeDocument> {
    let modal = answer.modal.iter().flat_map(|m| &m.free);
    modal
        .map(|m| FreeModeDocument {
            frequency: m.pole.frequency,
            damping: m.pole.damping,
            shape: deflections(channels, m.shape.as_ref()),
        })
        .collect()
}

impl RunQuality {
    fn new(run: &MeasuredRun) -> Self {
        Self {
            run: run.name.clone(),
            samples: run.samples,
            blocks: run.blocks,
            rejected: run.rejected.blocks,
            rejected_by: run.rejected.by_word(),
            faulty_samples: Some(run.rejected.samples),
            missing_samples: run.rejected.missing,
            true_sample_rate: run.preamble.sample_rate.clone(),
            calibration: run.preamble.channel.clone(),
        }
    }
}

impl NoiseDocument {
    fn new(noise: &RunNoise) -> Self {
        Self {
            run: noise.run.clone(),
            accelerations: noise.accelerations.word().to_owned(),
            forces: noise.forces.word().to_owned(),
        }
    }
}

impl LikelihoodDocument {
    fn new(found: &Likelihood) -> Self {
        let fit = found.fit.as_ref();
        let known = |x: f64| Some(x).filter(|x| x.is_finite());
        let highest = fit.map_or(0.0, |f| f.band[1]);
        let mut modes: Vec<LikelihoodMode> = fit
            .iter()
            .flat_map(|fit| fit.model.modes.iter().zip(&fit.pole_deviations))
            .map(|(mode, [frequency, damping])| LikelihoodMode {
                frequency: mode.frequency(),
                frequency_std: known(mode.frequency() * frequency),
                damping: mode.damping(),
                damping_std: known(mode.damping() * damping),
                damping_exponent: mode.exponent,
                among_lines: mode.frequency() <= highest,
            })
            .collect();
        modes.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));
        Self {
            used: found.stepped_back.is_none(),
            stepped_back: found.stepped_back.clone(),
            band: fit.map(|f| f.band),
            lines: fit.map_or(0, |f| f.lines),
            modes,
            residual_ratio: fit.map(likelihood::Fit::ratio),
            residuals: fit.map(|f| f.residuals.clone()).unwrap_or_default(),
            low_line_distance: fit.and_then(|f| f.disagreement),
            converged: fit.is_some_and(|f| f.converged),
            over_bound: found.over_bound,
            rejected: found
                .rejected
                .iter()
                .map(|(highest, reason)| RejectedBand {
                    highest: *highest,
                    reason: reason.clone(),
                })
                .collect(),
        }
    }
}

/// Method and procedure that gave the ten numbers, on this machine or on a box.
#[derive(Clone, Copy, Debug)]
pub struct Origin<'a> {
    /// Title of the setup.
    pub title: &'a str,
    /// Name of the method.
    pub method: &'a str,
    /// Reason for this method, where the user left the choice.
    pub why: Option<&'a str>,
    /// `true` if the reference point was iterated to the CG.
    pub iterative: bool,
    /// `true` if accelerometer weights were used.
    pub weighted: bool,
}

impl ResultDocument {
    /// The document of an answer to `setup`.
    #[must_use]
    pub fn new(setup: &Setup, answer: &Answer) -> Self {
        let channels: Vec<String> = setup
            .accelerometers
            .iter()
            .map(|a| a.channel.clone())
            .collect();
        let origin = Origin {
            title: &setup.title,
            method: answer.method_name(),
            why: answer.why,
            iterative: matches!(answer.procedure, Procedure::Iterative { .. }),
            weighted: answer.weighted(),
        };
        let frame = setup.frame.as_ref();
        let own = &answer.identification;
        let (identification, covariance, type_b) = match frame {
            None => (*own, answer.covariance, answer.type_b.clone()),
            Some(frame) => (
                framed::identification(frame, own, Some(&answer.covariance)),
                framed::covariance(frame, &answer.covariance),
                answer.type_b.as_ref().map(|b| framed::type_b(frame, b)),
            ),
        };
        let offsets = answer.offsets.iter().map(|(run, resultants)| Offsets {
            run: run.clone(),
            resultants: frame.map_or(*resultants, |f| framed::resultants(f, *resultants)),
        });
        let runs = answer.measurement.runs.iter();
        let mut document = Self {
            frame: setup.frame,
            fixed_modes: fixed_modes(&channels, answer, &identification, frame),
            free_modes: free_modes(&channels, answer),
            offsets: offsets.collect(),
            runs: runs.map(RunQuality::new).collect(),
            noise: answer
                .measurement
                .noise
                .iter()
                .map(NoiseDocument::new)
                .collect(),
            likelihood: answer.likelihood.as_ref().map(LikelihoodDocument::new),
            findings: Vec::new(),
            warnings: answer.warnings.clone(),
            refused: answer.refused.as_ref().map(ToString::to_string),
            consistency_test: answer.consistency.map(ConsistencyDocument::new),
            covariance: Some(CovarianceDocument::new(&identification, covariance)),
            ..Self::of_numbers(&origin, &identification)
        };
        if let Some(type_b) = &type_b {
            document.add_type_b(&identification, type_b);
        }
        document
    }

    /// Adds the type B uncertainty of each number.
    fn add_type_b(&mut self, i: &Identification, type_b: &TypeB) {
        let known = i.indicator.is_some();
        let covariance = type_b.covariance(known);
        self.covariance_type_b = Some(CovarianceDocument::new(i, covariance));
        let add = |first: usize, numbers: &mut [&mut Number]| {
            for (k, number) in numbers.iter_mut().enumerate() {
                number.add_type_b(first + k, i, type_b);
            }
        };
        add(place::MASS, &mut [&mut self.mass]);
        if let Some(indicator) = &mut self.indicator {
            add(place::INDICATOR, &mut [indicator]);
        }
        add(place::CENTRE, &mut self.centre_of_gravity.each_mut());
        add(place::INERTIA_REFERENCE, &mut self.inertia_reference.each());
        add(place::INERTIA_CG, &mut self.inertia_cg.each());
    }

    /// The document of the ten numbers alone, in a frame.
    #[must_use]
    pub fn in_frame(origin: &Origin<'_>, i: &Identification, frame: Option<&Frame>) -> Self {
        match frame {
            None => Self::of_numbers(origin, i),
            Some(frame) => Self {
                frame: Some(*frame),
                ..Self::of_numbers(origin, &framed::identification(frame, i, None))
            },
        }
    }

    /// The document of the ten numbers alone.
    #[must_use]
    pub fn of_numbers(origin: &Origin<'_>, i: &Identification) -> Self {
        let number = |e: Option<Estimate>| Number::new(e, i.freedom);
        Self {
            schema: SCHEMA.to_owned(),
            title: origin.title.to_owned(),
            method: origin.method.to_owned(),
            recommended_because: origin.why.map(str::to_owned),
            refused: None,
            iterative: origin.iterative,
            weighted: origin.weighted,
            frame: None,
            reference_point: i.reference.into(),
            mass: number(i.mass),
            indicator: i.indicator.map(|e| number(Some(e))),
            centre_of_gravity: i.centre_of_gravity.map(number),
            products_of_inertia: "integral of x y dm, plus sign".to_owned(),
            inertia_reference: InertiaTerms::new(i.inertia_reference, i.freedom),
            inertia_cg: InertiaTerms::new(i.inertia_cg, i.freedom),
            principal_moments: i.principal.map(|p| p.moments.into()),
            principal_axes: i
                .principal
                .map(|p| core::array::from_fn(|c| p.axes.column(c).into_owned().into())),
            freedom: Some(i.freedom).filter(|freedom| freedom.is_finite()),
            covariance: None,
            covariance_type_b: None,
            condition_number: i.condition_number,
            iterations: i.iterations,
            consistency: i.consistency,
            consistency_test: None,
            misfit: i.misfit,
            plausible: Plausible::new(i),
            fixed_modes: Vec::new(),
            free_modes: Vec::new(),
            offsets: Vec::new(),
            runs: Vec::new(),
            noise: Vec::new(),
            likelihood: None,
            findings: Vec::new(),
            warnings: Vec::new(),
            device: None,
        }
    }
}
