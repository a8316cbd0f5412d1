//! Modal data besides the rigid body: the fixed structure's modes with effective masses,
//! and the free structure's, both with their shapes at the accelerometers.

use super::{Answer, AnswerError, Choice, OnProgress, Session, Wanted, condense};
use crate::format::plain;
use crate::measure::{Accelerations, Measurement, Survey};
use crate::parallel;
use crate::setup::{BLOCK_LENGTHS, Setup};
use massline_core::masslines::{FixedMode, FreeModes};
use massline_core::modes::Pole;
use nalgebra::{Complex, DMatrix, DVector, Matrix6, Vector6};

/// Modal data of a setup's recordings.
pub struct Modal {
    /// Modes of the structure on the fixed interface.
    pub fixed: Vec<FixedShape>,
    /// Modes of the free structure; empty unless the runs excite every measured resultant
    /// independently.
    pub free: Vec<FreeShape>,
    /// Warnings to the user.
    pub warnings: Vec<String>,
}

/// A mode of the fixed structure.
pub struct FixedShape {
    /// Pole, effective masses, participation.
    pub mode: FixedMode,
    /// Deflection at each accelerometer in the order of the setup, relative to the base,
    /// largest one; `None` where the base accelerations do not determine it.
    pub shape: Option<Vec<f64>>,
    /// Modal mass for that scaling, kg.
    pub modal_mass: Option<f64>,
    /// `true` if no accelerometer sees the mode, so that it has neither shape nor modal mass.
    pub unseen: bool,
}

/// A mode of the free structure.
pub struct FreeShape {
    /// Natural frequency and damping.
    pub pole: Pole,
    /// Deflection at each accelerometer, largest one.
    pub shape: Option<Vec<f64>>,
}

/// A resolution coarser than this share of the half-power bandwidth of a mode bends its
/// peak by more than about a per cent: the Hann window's main lobe is four lines wide.
const LINES_PER_BANDWIDTH: f64 = 4.0;

/// Share of an effective mass matrix below which one shape does not explain it. Clean lines
/// reach 0.99, and 1 % of noise leaves 0.94 of the satellite's modes; a mode just beyond the
/// last line brings its neighbours to 0.9, and two modes in one leave half.
const ONE_SHAPE: f64 = 0.93;

impl Session<'_> {
    /// The answer of [`Session::answer`] with the modal data beside it.
    ///
    /// # Errors
    /// [`AnswerError`].
    pub fn answer_with_modes(
        &mut self,
        choice: &Choice,
        progress: OnProgress<'_>,
    ) -> Result<Answer, AnswerError> {
        self.with_modes(
            |session, progress| session.answer(choice, progress),
            progress,
        )
    }

    /// The answer of [`Session::wanted_answer`] with the modal data beside it.
    ///
    /// # Errors
    /// [`AnswerError`].
    pub fn wanted_with_modes(
        &mut self,
        wanted: Wanted,
        choice: &Choice,
        progress: OnProgress<'_>,
    ) -> Result<Answer, AnswerError> {
        let answer = |session: &mut Self, progress: OnProgress<'_>| {
            session.wanted_answer(wanted, choice, progress)
        };
        self.with_modes(answer, progress)
    }

    /// An answer with the modal data behind the runs that are referred to a drive or are sines. The free structure's
    /// modes are found beside the answer where the averages are at hand.
    fn with_modes(
        &mut self,
        answer: impl FnOnce(&mut Self, OnProgress<'_>) -> Result<Answer, AnswerError>,
        progress: OnProgress<'_>,
    ) -> Result<Answer, AnswerError> {
        let (setup, threads) = (self.setup, self.threads);
        let (all, survey) = (self.known(&Accelerations::All(None)), self.survey.clone());
        let at_hand: Option<(&Measurement, &Survey)> = all.as_deref().zip(survey.as_deref());
        let (free, answer) = parallel::both(
            threads,
            || at_hand.map(|(all, survey)| free_modes(setup, all, survey)),
            || {
                let answer = answer(self, progress)?;
                let fixed = answer.is_dynamic().then(|| self.fixed(progress));
                Ok::<_, AnswerError>((answer, fixed.transpose()?))
            },
        );
        let (mut answer, fixed) = answer?;
        let Some(fixed) = fixed else {
            return Ok(answer);
        };
        let survey = self.survey(progress)?;
        let free = match free {
            Some(free) => free,
            None => free_modes(
                setup,
                &*self.measurement(&Accelerations::All(None), progress)?,
                &survey,
            ),
        };
        let mut warnings = Vec::new();
        warn_of_resolution(setup, &survey, &fixed, &mut warnings);
        warn_of_mixtures(&fixed, &mut warnings);
        warn_of_unseen(&fixed, &mut warnings);
        // What is said of modes would lead away from what is wrong.
        if answer.refused.is_none() {
            answer.warnings.extend(warnings.iter().cloned());
            if !answer.method.interface_only() {
                warn_of_band(setup, &fixed, &mut answer.warnings);
            }
        }
        answer.modal = Some(Modal {
            free,
            fixed,
            warnings,
        });
        Ok(answer)
    }

    /// Modes of the structure on the fixed interface.
    fn fixed(&mut self, progress: OnProgress<'_>) -> Result<Vec<FixedShape>, AnswerError> {
        let setup = self.setup;
        let interface = self.of_interface(progress)?;
        let survey = self.survey(progress)?;
        let fixed = interface.map(|interface| condense::fixed_modes(setup, &interface));
        Ok(with_shapes(&survey, fixed.transpose()?.unwrap_or_default()))
    }
}

/// Modes of the free structure; none where the runs do not suffice.
fn free_modes(setup: &Setup, all: &Measurement, survey: &Survey) -> Vec<FreeShape> {
    let modes = condense::free_modes(setup, all);
    modes.map_or_else(Vec::new, |modes| free_shapes(survey, &modes))
}

/// Deflections of the fixed modes from the transmissibilities `T = X + Σ φ_r L_r D_r`.
///
/// Modes that lie close together are told apart by their rows: in a motion of the base in
/// which all of them but one rest, the others have no part.
fn with_shapes(survey: &Survey, modes: Vec<FixedMode>) -> Vec<FixedShape> {
    let driven = driven_directions(survey).and_then(|(basis, count)| {
        let t = survey.transmissibilities(&basis, count)?;
        Some((basis, count, t))
    });
    let shapes: Vec<Option<Deflection>> = (0..modes.len())
        .map(|r| {
            let (basis, count, t) = driven.as_ref()?;
            deflection(survey, &modes, r, basis, *count, t)
        })
        .collect();
    modes
        .into_iter()
        .zip(shapes)
        .map(|(mode, found)| {
            // Scaled to unit modal mass so far: 1/√kg.
            let seen = found.as_ref().filter(|d| d.is_seen(&mode));
            FixedShape {
                modal_mass: seen.map(|d| 1.0 / (d.largest * d.largest)),
                shape: seen.and_then(|d| normalised(&d.shape)),
                unseen: found.is_some() && seen.is_none(),
                mode,
            }
        })
        .collect()
}

/// Deflection of the accelerometers by a mode of unit modal mass, 1/√kg.
struct Deflection {
    shape: DVector<f64>,
    /// The largest, and what it may be wrong by.
    largest: f64,
    std: f64,
    /// Its motion of the base: what the largest transmissibility is per unit of deflection.
    row: f64,
}

/// Smallest ratio of a largest deflection to its standard deviation: a modal mass goes with
/// its square, so it is known to a fifth then.
const SURE: f64 = 10.0;
/// Least part that a mode has in the transmissibility at its resonance: what is smaller may as
/// well be cross-talk of a sensor.
const LEAST_PART: f64 = 0.01;

impl Deflection {
    /// `true` if an accelerometer sees the mode: otherwise its modal mass for a deflection of one
    /// there is any large number.
    fn is_seen(&self, mode: &FixedMode) -> bool {
        let at_resonance = self.largest * self.row / (2.0 * mode.pole.damping);
        self.largest > SURE * self.std && at_resonance > LEAST_PART
    }
}

fn deflection(
    survey: &Survey,
    modes: &[FixedMode],
    r: usize,
    basis: &Matrix6<f64>,
    count: usize,
    t: &[DMatrix<Complex<f64>>],
) -> Option<Deflection> {
    let mode = &modes[r];
    let near = |other: &FixedMode| {
        let bandwidth = mode.pole.damping * mode.pole.frequency;
        (other.pole.frequency - mode.pole.frequency).abs() < 6.0 * bandwidth
    };
    let row = |m: &FixedMode| -> DVector<f64> {
        let all = basis * m.participation;
        DVector::from_iterator(count, all.iter().take(count).copied())
    };
    // This mode first, then those close to it.
    let mut rows = vec![row(mode)];
    let mut poles = vec![mode.pole];
    for (s, other) in modes.iter().enumerate().filter(|(s, _)| *s != r) {
        let crowd = near(other);
        // A mode that the driven directions do not tell from this one stays a pole of its own.
        if crowd && rows.len() < count && independent(&rows, &row(other)) {
            rows.push(row(other));
        } else {
            poles.push(modes[s].pole);
        }
    }
    let l = DMatrix::from_fn(rows.len(), count, |i, j| rows[i][j]);
    let gram = (&l * l.transpose()).try_inverse()?;
    // L v = (1, 0 …): in this motion of the base the others rest.
    let motion: DVector<f64> = l.transpose() * gram.column(0);
    let complex = motion.map(|x| Complex::new(x, 0.0));
    let one: Vec<DMatrix<Complex<f64>>> = t
        .iter()
        .map(|t| DMatrix::from_column_slice(t.nrows(), 1, (t * &complex).as_slice()))
        .collect();
    let (residues, std) = residues(&one, &survey.frequencies, &poles)?;
    let shape = residues.first()?.column(0).into_owned();
    let at = shape.iamax();
    Some(Deflection {
        largest: shape[at].abs(),
        std: std.first()?[(at, 0)],
        row: rows[0].norm(),
        shape,
    })
}

/// `true` if a row lies far enough from the span of others.
fn independent(rows: &[DVector<f64>], row: &DVector<f64>) -> bool {
    let mut left = row.clone();
    for _ in 0..2 {
        for other in rows {
            let along = other.dot(&left) / other.norm_squared();
            left -= other * along;
        }
    }
    left.norm() > 0.2 * row.norm()
}

/// Orthonormal directions of base acceleration that the runs drive, one a run: the fewest
/// that still let the transmissibility be solved line by line.
fn driven_directions(survey: &Survey) -> Option<(Matrix6<f64>, usize)> {
    let mut columns: Vec<Vector6<f64>> = Vec::new();
    let largest = |at: usize| {
        let all = survey.runs.iter().flat_map(|r| &r.base);
        all.map(|a| a.fixed_rows::<3>(at).map(|z| z.norm_sqr()).sum())
            .fold(0.0, f64::max)
            .sqrt()
    };
    let (translation, rotation) = (largest(0), largest(3));
    for run in &survey.runs {
        // The plain direction that this run drives most, in units of its own kind.
        let mut energy = Vector6::<f64>::zeros();
        for a in &run.base {
            for j in 0..6 {
                let unit = if j < 3 { translation } else { rotation };
                if unit > 0.0 {
                    energy[j] += a[j].norm_sqr() / (unit * unit);
                }
            }
        }
        let mut axis = Vector6::<f64>::zeros();
        axis[energy.imax()] = 1.0;
        if !columns.contains(&axis) {
            columns.push(axis);
        }
    }
    let mut basis = Matrix6::zeros();
    for (i, axis) in columns.iter().enumerate() {
        basis.set_row(i, &axis.transpose());
    }
    // Runs along one axis only would have their cross-talk taken for that axis' doing.
    (columns.len() == survey.runs.len() && !columns.is_empty()).then_some((basis, columns.len()))
}

fn free_shapes(survey: &Survey, modes: &FreeModes) -> Vec<FreeShape> {
    let poles: Vec<Pole> = modes.poles.to_vec();
    let residues = survey
        .free_responses()
        .and_then(|h| residues(&h, &survey.frequencies, &poles))
        .map(|(residues, _)| residues);
    poles
        .iter()
        .enumerate()
        .map(|(r, pole)| FreeShape {
            pole: *pole,
            shape: residues.as_ref().and_then(|all| {
                // Every column is the shape times what its force does to the mode.
                let column = (0..all[r].ncols()).max_by(|&a, &b| {
                    let size = |c: usize| all[r].column(c).norm() / all[r].norm();
                    size(a).total_cmp(&size(b))
                })?;
                normalised(&all[r].column(column).into_owned())
            }),
        })
        .collect()
}

/// Largest deflection one.
fn normalised(shape: &DVector<f64>) -> Option<Vec<f64>> {
    let largest = shape[shape.iamax()];
    (largest != 0.0 && largest.is_finite()).then(|| (shape / largest).as_slice().to_vec())
}

/// Real residues of all entries for common poles: a constant, a term in ω², and per pole a
/// residue and its quadrature, by least squares over all lines. With the standard deviations
/// that the scatter about the fit tells.
#[allow(clippy::type_complexity)]
fn residues(
    responses: &[DMatrix<Complex<f64>>],
    frequencies: &[f64],
    poles: &[Pole],
) -> Option<(Vec<DMatrix<f64>>, Vec<DMatrix<f64>>)> {
    let (rows, columns) = responses.first()?.shape();
    let unit = frequencies.last()?;
    let terms = 2 + 2 * poles.len();
    // Real parts of all lines, and imaginary parts below them.
    let lines = responses.len();
    let mut basis = DMatrix::zeros(2 * lines, terms);
    let mut values = DMatrix::zeros(2 * lines, rows * columns);
    for (n, (h, &f)) in responses.iter().zip(frequencies).enumerate() {
        let constant = [1.0, (f / unit) * (f / unit)].map(|x| Complex::new(x, 0.0));
        let of_poles = poles.iter().flat_map(|pole| {
            let d = pole.amplification(f);
            [d, d * Complex::new(0.0, f / pole.frequency)]
        });
        for (k, phi) in constant.into_iter().chain(of_poles).enumerate() {
            (basis[(n, k)], basis[(lines + n, k)]) = (phi.re, phi.im);
        }
        for (k, z) in h.iter().enumerate() {
            (values[(n, k)], values[(lines + n, k)]) = (z.re, z.im);
        }
    }
    let inverse = basis.tr_mul(&basis).try_inverse()?;
    let solved = &inverse * basis.tr_mul(&values);
    let left = values - basis * &solved;
    let freedom = (2 * lines).saturating_sub(terms).max(1) as f64;
    let of_pole = |r: usize| 2 + 2 * r;
    let stds = (0..poles.len()).map(|r| {
        let gain = inverse[(of_pole(r), of_pole(r))].max(0.0) / freedom;
        let powers = left.column_iter().map(|left| left.norm_squared());
        DMatrix::from_iterator(rows, columns, powers.map(|power| (power * gain).sqrt()))
    });
    let stds = stds.collect();
    let residues = (0..poles.len()).map(|r| {
        let row = solved.row(of_pole(r));
        DMatrix::from_iterator(rows, columns, row.iter().copied())
    });
    Some((residues.collect(), stds))
}

fn warn_of_unseen(fixed: &[FixedShape], warnings: &mut Vec<String>) {
    let unseen: Vec<String> = fixed
        .iter()
        .filter(|m| m.unseen)
        .map(|m| format!("{:.2} Hz", m.mode.pole.frequency))
        .collect();
    if !unseen.is_empty() {
        warnings.push(format!(
            "modal analysis: no accelerometer moves with the mode at {}, so that it has no shape and no modal mass; its effective masses come from the load cells and stand. Put an accelerometer where the structure moves most",
            unseen.join(", ")
        ));
    }
}

fn warn_of_resolution(
    setup: &Setup,
    survey: &Survey,
    fixed: &[FixedShape],
    warnings: &mut Vec<String>,
) {
    let Some(processing) = &setup.processing else {
        return;
    };
    let [first, second, ..] = survey.frequencies.as_slice() else {
        return;
    };
    let spacing = second - first;
    let random = |r: &crate::setup::Run| r.excitation == crate::setup::Excitation::Random;
    if !setup.runs.iter().any(random) {
        return;
    }
    let narrowest = fixed
        .iter()
        .map(|m| {
            (
                2.0 * m.mode.pole.damping * m.mode.pole.frequency,
                m.mode.pole,
            )
        })
        .min_by(|a, b| a.0.total_cmp(&b.0));
    if let Some((bandwidth, pole)) = narrowest
        && bandwidth < LINES_PER_BANDWIDTH * spacing
    {
        let factor = LINES_PER_BANDWIDTH * spacing / bandwidth;
        let length = (processing.block_length as f64 * factor) as usize;
        let (length, longest) = (length.next_power_of_two(), *BLOCK_LENGTHS.end());
        let would_do = if length <= longest {
            format!("a `block_length` of {length} would do")
        } else {
            format!("no `block_length` up to {longest} would do, if it is a mode and no hum")
        };
        warnings.push(format!(
            "lines {} Hz apart are too coarse for the damping of the mode at {:.2} Hz: its effective mass and damping are bent by leakage; {would_do}",
            plain(spacing, 4),
            pole.frequency
        ));
    }
}

/// Warns of modes within the band that the paper's methods take for rigid.
fn warn_of_band(setup: &Setup, fixed: &[FixedShape], warnings: &mut Vec<String>) {
    let Some([_, highest]) = setup.processing.as_ref().map(|p| p.averaging_band) else {
        return;
    };
    let frequencies = fixed.iter().map(|m| m.mode.pole.frequency);
    let lowest = frequencies.fold(f64::INFINITY, f64::min);
    if lowest <= highest {
        warnings.push(format!(
            "the averaging band, up to {} Hz, holds the mode at {lowest:.2} Hz, and this method takes the structure for rigid there: end it at half of that, or use the recommended method, which models the resonances",
            plain(highest, 4)
        ));
    }
}

fn warn_of_mixtures(fixed: &[FixedShape], warnings: &mut Vec<String>) {
    let mixed: Vec<String> = fixed
        .iter()
        .filter(|m| m.mode.rank_one < ONE_SHAPE)
        .map(|m| format!("{:.2} Hz", m.mode.pole.frequency))
        .collect();
    if !mixed.is_empty() {
        warnings.push(format!(
            "modal analysis: no single shape explains the effective masses at {}: the runs do not move the base in all directions that the load cells measure, or two modes lie closer than the lines can tell (lengthen `block_length`), or one lies just beyond the last line (end `mode_band` farther from it), or the mode is lost in noise. Do not rely on these effective masses",
            mixed.join(", ")
        ));
    }
}
