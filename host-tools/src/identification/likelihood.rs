//! The method `ml`: a maximum likelihood fit of the apparent mass through the resonances, beside the
//! band's method, whose numbers stay where the fit does not pass its tests.

use super::coupling::Coupling;
use super::drift;
use super::notice::notice;
use super::odd_run::OddRun;
use super::plausible::plausibility;
use super::refusal::refusal;
use super::second_order::second_order;
use super::{Answer, AnswerError, Choice, Judged, OnProgress, Session, TypeB, estimates};
use crate::likelihood::{
    self, Covariance10, Doubt, Fit, Options, RIGID, Stage, bound, covariance_of, numbers,
};
use crate::measure::{NoRecords, NoiseOrigin, Progress, Records, Work, read_records};
use crate::parallel::processors;
use crate::setup::Setup;
use massline_core::identify::{Estimate, Identification, Procedure, Question, identify};
use massline_core::masslines::{Masslines, Method};
use massline_core::rigid_body::PrincipalInertia;
use nalgebra::{Vector3, Vector6};

/// Name of the method.
pub const NAME: &str = "ml";

/// Description of the method in words.
pub(crate) const DESCRIPTION: &str =
    "maximum likelihood fit of the apparent mass through the resonances";

/// Share of a mode's frequency at which fewer lines end.
const ABOVE: f64 = 1.2;
/// Share of a variance that the guess of the inertia adds, from which it is said: it doubles the error bar.
const GUESSED: f64 = 0.75;
/// The same in words.
const GUESS: &str = "method ml: the base rotates along with its translations, by too little to tell the inertia: the centre of gravity rests on a guess of it (radius of gyration like the distance of the accelerometers from an axis, give or take as much), and the mass on one of coordinates that are not told (those of their middle, give or take twice as much); add runs that rotate";
/// Scores a record gives, which the larger covariance rests on.
const SCORES: f64 = 20.0;

/// Outcome of the fit.
#[derive(Clone, Debug)]
pub struct Likelihood {
    /// The fit whose numbers are given, or the last one that failed its tests; `None` where there
    /// is none.
    pub fit: Option<Fit>,
    /// Reason why the numbers are those of the band's method.
    pub stepped_back: Option<String>,
    /// Reasons why wider fits were not used, with the highest line of each in Hz.
    pub rejected: Vec<(f64, String)>,
    /// Standard deviations over the Cramér-Rao bound of the fitted model and these records, root
    /// mean square over the observable numbers.
    pub over_bound: Option<f64>,
    /// Source of the noise.
    pub noise: Option<NoiseOrigin>,
    /// The run that contradicts the others, where all together fit no structure.
    pub odd_run: Option<OddRun>,
}

impl Likelihood {
    /// No fit, for this reason.
    pub(super) fn stepped_back(reason: String) -> Self {
        Self {
            fit: None,
            stepped_back: Some(reason),
            rejected: Vec::new(),
            over_bound: None,
            noise: None,
            odd_run: None,
        }
    }

    /// `true` if the numbers are those of the fit.
    #[must_use]
    pub fn is_used(&self) -> bool {
        self.stepped_back.is_none()
    }

    /// Note on numbers that are those of the band's method.
    fn note(&self) -> Option<String> {
        let why = self.stepped_back.as_ref()?;
        Some(format!(
            "method ml: the numbers are those of apparent-mass in the averaging band: {why}"
        ))
    }

    /// `true` if lines were fitted, whether the fit is used or not.
    fn was_tried(&self) -> bool {
        self.fit.is_some() || !self.rejected.is_empty()
    }

    /// The numbers of the fit, of those that the band's method observes; `None` after a step back, which
    /// error bars make that are no narrower than the band's. Plausibility is judged with type B uncertainty, too.
    pub(crate) fn numbers(
        &mut self,
        band: &Identification,
        known_mass: Option<f64>,
        type_b: Option<&TypeB>,
    ) -> Option<(Identification, massline_core::identify::Covariance)> {
        let (None, Some(fit)) = (&self.stepped_back, &self.fit) else {
            return None;
        };
        let fitted = identification(band, fit, known_mass, type_b);
        if is_wider(&fitted.0, band) {
            self.stepped_back = Some("its error bars are no narrower".to_owned());
            return None;
        }
        Some(fitted)
    }
}

/// Lines that a fit uses at most, Hz: from the beginning of the averaging band to where the interface is
/// rigid, but those of `fit_band` where there is no such statement, and else to where lines are kept.
#[must_use]
pub fn widest_band(setup: &Setup) -> Option<[f64; 2]> {
    let p = setup.processing.as_ref()?;
    let estimation = &setup.estimation;
    Some(match (estimation.rigid_up_to, estimation.fit_band) {
        (Some(highest), _) => [p.averaging_band[0], highest],
        (None, Some(band)) => band,
        (None, None) => [p.averaging_band[0], p.kept_up_to(p.sample_rate)],
    })
}

/// Lines that a fit leaves out that nobody asked for, since it would be slow.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LeftOut {
    /// Frequency beyond which they lie, Hz.
    pub(super) beyond: f64,
    /// Reason.
    pub(super) reason: String,
}

/// Fits records, from the widest band downwards until a fit passes its tests.
pub(crate) fn fit_records(
    read: &Records,
    band: &[f64; 2],
    answer: &Identification,
    threads: usize,
    progress: &mut dyn FnMut(likelihood::Progress),
) -> Likelihood {
    let rigid = told_of(answer);
    let mut found = Likelihood {
        fit: None,
        stepped_back: None,
        rejected: Vec::new(),
        over_bound: None,
        noise: Some(read.origin),
        odd_run: None,
    };
    let mut highest = band[1];
    // About the point about which the noise was estimated, so that the numbers are the same wherever A lies. Where the
    // test leaves mass or centre of gravity open, other terms may be told about another point.
    let whole = rigid[..4].iter().all(|told| *told);
    let about = read.middle.filter(|_| whole).unwrap_or_else(Vector3::zeros);
    let options = Options {
        start: None,
        threads,
        rigid: Some(rigid),
        near: near(answer, &(answer.reference + about)),
        resting: false,
    };
    // Two narrower bands: above the second mode, and above the first.
    for _ in 0..3 {
        let cut: Vec<_> = read
            .records
            .iter()
            .map(|r| r.thinned(0, 1, highest).about(&about))
            .collect();
        let fit = match likelihood::fit(&cut, &options, progress) {
            Ok(fit) => fit,
            Err(reason) => {
                found.rejected.push((highest, reason.to_string()));
                break;
            }
        };
        let doubt = fit.doubt();
        let mut modes: Vec<f64> = fit.model.modes.iter().map(|m| m.frequency()).collect();
        modes.sort_by(f64::total_cmp);
        let covariance = fit.covariance;
        let model = fit.model.clone();
        found.fit = Some(fit.about(&-about));
        let Some(doubt) = doubt else {
            if let Ok(bound) = bound::bound(&cut, &model, rigid) {
                found.over_bound = Some(ratio(&covariance, &bound));
            }
            return found;
        };
        let is_first = found.rejected.is_empty();
        found.rejected.push((highest, doubt.to_string()));
        let is_of_runs = matches!(
            doubt,
            Doubt::Residuals(_) | Doubt::NotConverged | Doubt::RunApart(_)
        );
        if is_first && is_of_runs {
            found.odd_run = OddRun::among(&cut, &options, progress);
        }
        // Of another sample rate or structure fewer lines are wrong, too.
        if found.odd_run.is_some() {
            break;
        }
        let narrower = [modes.get(1), modes.first()].into_iter().flatten();
        let narrower = narrower.map(|f| f * ABOVE).find(|f| *f < 0.98 * highest);
        let Some(narrower) = narrower.filter(|f| *f > 2.0 * band[0]) else {
            break;
        };
        highest = narrower;
    }
    let reasons: Vec<String> = found
        .rejected
        .iter()
        .map(|(f, why)| format!("up to {f:.1} Hz {why}"))
        .collect();
    found.stepped_back = Some(reasons.join("; "));
    found
}

/// Mass and first moments about a point, where the band's method has a mass; zero for those that it has not.
fn near(band: &Identification, point: &Vector3<f64>) -> Option<[f64; 4]> {
    let mass = band.mass?.value;
    let moment = |i: usize| {
        let centre = band.centre_of_gravity[i].map(|c| c.value - point[i]);
        mass * centre.unwrap_or(0.0)
    };
    Some([mass, moment(0), moment(1), moment(2)])
}

/// Parameters σ that the band's method observes.
pub(crate) fn told_of(band: &Identification) -> [bool; RIGID] {
    core::array::from_fn(|i| match i {
        0 => band.mass.is_some(),
        1..4 => band.centre_of_gravity[i - 1].is_some(),
        _ => band.inertia_reference[i - 4].is_some() || band.inertia_cg[i - 4].is_some(),
    })
}

/// Root mean square ratio of standard deviations, over those that the bound has.
fn ratio(covariance: &Covariance10, bound: &Covariance10) -> f64 {
    let seen = (0..RIGID).filter(|&i| bound[(i, i)] > 0.0 && bound[(i, i)].is_finite());
    let ratios: Vec<f64> = seen.map(|i| covariance[(i, i)] / bound[(i, i)]).collect();
    (ratios.iter().sum::<f64>() / ratios.len().max(1) as f64).sqrt()
}

impl Session<'_> {
    /// The answer of the method `ml`: that of the apparent mass in the band, with the numbers of the
    /// maximum likelihood fit in their place where it passes its tests.
    ///
    /// # Errors
    /// [`AnswerError`] as the band's method has.
    pub fn answer_by_likelihood(
        &mut self,
        choice: &Choice,
        progress: OnProgress<'_>,
    ) -> Result<Answer, AnswerError> {
        let band_choice = Choice {
            method: Some(Method::ApparentMass),
            ..*choice
        };
        let answer = self.answer(&band_choice, progress)?;
        // What contradicts a rigid body at low frequency is not mended by more lines.
        let mut answer = if answer.refused.is_some() {
            Answer {
                likelihood: Some(Likelihood::stepped_back(
                    "they are refused as it is".to_owned(),
                )),
                ..answer
            }
        } else {
            self.fitted(answer, None, progress)?
        };
        // Who names the method is told, too, where there was nothing to fit.
        if let Some(found) = answer.likelihood.as_ref().filter(|l| !l.was_tried()) {
            answer.warnings.extend(found.note());
        }
        Ok(answer)
    }

    /// An answer of the apparent mass, with the numbers of the maximum likelihood fit in their place where
    /// there is one that passes its tests.
    pub(super) fn fitted(
        &mut self,
        mut answer: Answer,
        left_out: Option<LeftOut>,
        progress: OnProgress<'_>,
    ) -> Result<Answer, AnswerError> {
        let setup = self.setup();
        let limit = self.limit;
        let mut warnings = Vec::new();
        let widest = widest_band(setup);
        let band = (widest.zip(left_out.as_ref()))
            .map_or(widest, |([low, _], left_out)| Some([low, left_out.beyond]));
        let mut found = match band {
            None => Likelihood::stepped_back("the set-up has no random runs".to_owned()),
            Some(band) => match read_records(setup, band, limit, &mut warnings, progress) {
                Err(NoRecords::Measure(e)) => return Err(e.into()),
                Err(reason) => Likelihood::stepped_back(reason.to_string()),
                Ok(read) => {
                    let threads = self.threads.unwrap_or_else(processors).max(1);
                    fit_records(&read, &band, &answer.identification, threads, &mut |p| {
                        let (name, share) = told(p);
                        progress(Progress {
                            work: Work::Fitting,
                            run: 0,
                            runs: 1,
                            name: &name,
                            share,
                        });
                    })
                }
            },
        };
        if let (true, Some([_, highest]), Some(left_out)) = (found.was_tried(), widest, left_out) {
            found.rejected.insert(0, (highest, left_out.reason));
        }
        answer.warnings.extend(warnings);
        let odd = found.odd_run.as_ref().map(|odd| odd.refusal(setup));
        take(&mut answer, found, setup);
        answer.refused = answer.refused.or(odd);
        Ok(answer)
    }
}

/// A step of the fit in words, and its share of the whole as far as it can be told.
fn told(p: likelihood::Progress) -> (String, f64) {
    match p.stage {
        Stage::Modes => (
            format!("looking for modes: {}", p.modes),
            0.6 * (1.0 - 0.75_f64.powi(1 + p.modes as i32)),
        ),
        Stage::Lines => (
            format!("all lines, {} modes, step {}", p.modes, p.iteration + 1),
            1.0 - 0.4 * 0.8_f64.powi(1 + p.iteration as i32),
        ),
    }
}

/// Puts the numbers of a fit in the place of the band's.
fn take(answer: &mut Answer, mut found: Likelihood, setup: &Setup) {
    let (band, type_b) = (&answer.identification, answer.type_b.as_ref());
    let fitted = found.numbers(band, setup.known_mass, type_b);
    if let Some((identification, covariance)) = fitted {
        answer.identification = identification;
        answer.covariance = covariance;
        answer.procedure = Procedure::Direct;
        // What contradicts a rigid body is in the data, whichever lines are used.
        let judged = Judged {
            identification: &answer.identification,
            type_b: answer.type_b.as_ref(),
            consistency: answer.consistency,
            widened: false,
        };
        let coupling = answer.coupling.as_ref();
        let coupled = coupling.and_then(Coupling::refusal);
        answer.refused = coupled.or_else(|| refusal(&judged));
        let mut warnings = answer.measurement.warnings.clone();
        if let Some(type_b) = &answer.type_b {
            warnings.extend(type_b.gaps(&answer.identification));
        }
        notice(&judged, &answer.measurement, &mut warnings);
        if answer.refused.is_none() {
            warnings.extend(coupling.map(Coupling::warning));
        }
        let held = answer.type_b.is_some();
        drift::notice(&answer.drifts, &answer.measurement, held, &mut warnings);
        answer.distorted.notice(setup, held, &mut warnings);
        let own = answer
            .warnings
            .iter()
            .filter(|w| w.starts_with("method ml"));
        warnings.extend(own.cloned().collect::<Vec<_>>());
        answer.warnings = warnings;
        if (found.fit.as_ref()).is_some_and(|fit| fit.guess_share > GUESSED) {
            answer.warnings.push(GUESS.to_owned());
        }
        for (highest, why) in &found.rejected {
            answer.warnings.push(format!(
                "method ml: lines up to {highest:.1} Hz were not used: {why}"
            ));
        }
    }
    if found.was_tried() {
        answer.warnings.extend(found.note());
    }
    answer.likelihood = Some(found);
}

/// `true` if the error bars of a fit are wider than those of the band's method, root mean square: the fit's lines
/// contain the band's, and have to tell more.
fn is_wider(fitted: &Identification, band: &Identification) -> bool {
    let pairs = estimates(fitted).into_iter().zip(estimates(band));
    let ratios: Vec<f64> = pairs
        .filter_map(|(fitted, band)| Some((fitted?.std / band?.std).powi(2)))
        .filter(|x| x.is_finite())
        .collect();
    ratios.iter().sum::<f64>() > ratios.len() as f64
}

/// The numbers of a fit, of those that the band's method observes.
fn identification(
    band: &Identification,
    fit: &Fit,
    known_mass: Option<f64>,
    type_b: Option<&TypeB>,
) -> (Identification, massline_core::identify::Covariance) {
    let sigma = &fit.model.rigid;
    let (values, slopes) = numbers(sigma, &band.reference, known_mass);
    let covariance = slopes * fit.covariance * slopes.transpose();
    let centre = covariance.fixed_view::<3, 3>(1, 1).into_owned();
    let bent = second_order(known_mass.unwrap_or(values[0]), &centre);
    let std = |variance: f64| variance.max(0.0).sqrt();
    let of = |i: usize, seen: bool| {
        let second = if i < 4 { 0.0 } else { bent[(i - 4, i - 4)] };
        seen.then(|| Estimate {
            value: values[i],
            std: std(covariance[(i, i)] + second),
        })
    };
    let mut found = *band;
    match known_mass {
        None => found.mass = of(0, band.mass.is_some()),
        Some(_) => found.indicator = of(0, band.indicator.is_some()),
    }
    found.centre_of_gravity =
        core::array::from_fn(|i| of(1 + i, band.centre_of_gravity[i].is_some()));
    found.inertia_cg = core::array::from_fn(|i| of(4 + i, band.inertia_cg[i].is_some()));
    found.inertia_reference = core::array::from_fn(|i| {
        band.inertia_reference[i].map(|_| Estimate {
            value: sigma[4 + i],
            std: std(fit.covariance[(4 + i, 4 + i)]),
        })
    });
    found.iterations = fit.iterations as u32;
    found.attenuation = 0.0;
    found.freedom = (SCORES * fit.residuals.len() as f64).max(1.0);
    if found.inertia_cg.iter().all(Option::is_some) {
        found.principal = principal(&fit.model.rigid_matrix(), &band.reference);
    }
    let first = if known_mass.is_some() {
        found.indicator.is_some()
    } else {
        found.mass.is_some()
    };
    let observable: [bool; RIGID] = core::array::from_fn(|i| match i {
        0 => first,
        1..4 => found.centre_of_gravity[i - 1].is_some(),
        _ => found.inertia_cg[i - 4].is_some(),
    });
    let covariance = covariance_of(&covariance, &observable);
    found.plausibility = plausibility(&found, &covariance, type_b);
    (found, covariance)
}

/// Principal moments and axes of the body with a mass matrix about `reference`.
fn principal(
    matrix: &nalgebra::Matrix6<f64>,
    reference: &nalgebra::Vector3<f64>,
) -> Option<PrincipalInertia> {
    let pairs = (0..6).map(|j| {
        let unit = Vector6::from_fn(|i, _| f64::from(u8::from(i == j)));
        (unit, matrix * unit)
    });
    let exact = Masslines::exact(*reference, pairs).ok()?;
    identify(&[exact], &Question::default()).ok()?.principal
}
