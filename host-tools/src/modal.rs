//! Modal data besides the rigid body: the fixed structure's modes with effective masses,
//! and the free structure's, both with their shapes at the accelerometers.

use crate::identification::{AnswerError, OnProgress, Session};
use crate::measure::Survey;
use crate::setup::Setup;
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
    /// What the user should know.
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
    /// The modal data behind the runs that are referred to a drive or are sines.
    ///
    /// # Errors
    /// [`AnswerError`] if the recordings cannot be read.
    pub fn modal(&mut self, progress: OnProgress<'_>) -> Result<Modal, AnswerError> {
        let fixed = self.fixed_modes(progress)?;
        let free = self.free_modes(progress)?;
        let survey = self.survey(progress)?;
        let mut warnings = Vec::new();
        let fixed: Vec<FixedShape> = with_shapes(&survey, fixed);
        warn_of_resolution(self.setup(), &survey, &fixed, &mut warnings);
        warn_of_mixtures(&fixed, &mut warnings);
        Ok(Modal {
            free: free.map_or_else(Vec::new, |modes| free_shapes(&survey, &modes)),
            fixed,
            warnings,
        })
    }
}

/// Deflections of the fixed modes from the transmissibilities `T = X + Σ φ_r L_r D_r`.
fn with_shapes(survey: &Survey, modes: Vec<FixedMode>) -> Vec<FixedShape> {
    let poles: Vec<Pole> = modes.iter().map(|m| m.pole).collect();
    let directions = driven_directions(survey);
    let residues = directions.as_ref().and_then(|(basis, count)| {
        let t = survey.transmissibilities(basis, *count)?;
        residues(&t, &survey.frequencies, &poles)
    });
    modes
        .into_iter()
        .enumerate()
        .map(|(r, mode)| {
            let shape = directions.as_ref().and_then(|(basis, count)| {
                let residue = &residues.as_ref()?[r];
                // Participation in the same directions, and the shape that goes with it.
                let l = (basis * mode.participation).rows(0, *count).into_owned();
                let square = l.norm_squared();
                (square > 0.0).then(|| residue * l / square)
            });
            // Scaled to unit modal mass so far: 1/√kg.
            let largest = shape.as_ref().map(|s: &DVector<f64>| s.amax());
            FixedShape {
                modal_mass: largest.filter(|l| *l > 0.0).map(|l| 1.0 / (l * l)),
                shape: shape.as_ref().and_then(normalised),
                mode,
            }
        })
        .collect()
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
        .and_then(|h| residues(&h, &survey.frequencies, &poles));
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
/// residue and its quadrature, by least squares over all lines.
fn residues(
    responses: &[DMatrix<Complex<f64>>],
    frequencies: &[f64],
    poles: &[Pole],
) -> Option<Vec<DMatrix<f64>>> {
    let (rows, columns) = responses.first()?.shape();
    let unit = frequencies.last()?;
    let terms = 2 + 2 * poles.len();
    let mut normal = DMatrix::<f64>::zeros(terms, terms);
    let mut right = vec![DMatrix::<f64>::zeros(rows, columns); terms];
    for (h, &f) in responses.iter().zip(frequencies) {
        let mut phi = vec![
            Complex::new(1.0, 0.0),
            Complex::new((f / unit) * (f / unit), 0.0),
        ];
        for pole in poles {
            let d = pole.amplification(f);
            phi.push(d);
            phi.push(d * Complex::new(0.0, f / pole.frequency));
        }
        for i in 0..terms {
            for j in 0..terms {
                normal[(i, j)] += (phi[i].conj() * phi[j]).re;
            }
            right[i] += h.map(|z| (phi[i].conj() * z).re);
        }
    }
    let inverse = normal.try_inverse()?;
    let solved = |i: usize| {
        (0..terms).fold(DMatrix::zeros(rows, columns), |sum, j| {
            sum + &right[j] * inverse[(i, j)]
        })
    };
    Some((0..poles.len()).map(|r| solved(2 + 2 * r)).collect())
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
        warnings.push(format!(
            "lines {spacing} Hz apart are too coarse for the damping of the mode at {:.2} Hz: its effective mass and damping are bent by leakage; a `block_length` of {} would do",
            pole.frequency,
            length.next_power_of_two()
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
