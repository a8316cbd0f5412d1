//! Static poses join the masslines, and their offsets come out.

use super::{AnswerError, Consistency};
use crate::measure::MeasuredPoses;
use massline_core::identify::{self, Estimate, Identification, Question, Workspace};
use massline_core::masslines::{Masslines, StaticFit};
use massline_core::rigid_body::{Inertia, RigidBody};
use nalgebra::Vector6;

/// Offsets of the six resultants, by run.
type Offsets = Vec<(String, [f64; 6])>;

/// Identifies from `sets` and the poses. A second pass weights the poses with what the
/// rigid body of the first leaves of them.
pub(super) fn identify_with(
    poses: &[MeasuredPoses],
    mut sets: Vec<Masslines>,
    question: &Question,
    space: &mut Workspace,
) -> Result<(Identification, Option<Consistency>, Offsets), AnswerError> {
    let dynamic = sets.len();
    add(poses, None, &mut sets)?;
    let first = identify::identify_in(&sets, question, space)?;
    // The second pass holds poses against what a rigid body left of them: that always fits. The
    // residuals of poses count as independent, which they are not: resultants share sensors.
    let consistency = Consistency::bound(&first);
    sets.truncate(dynamic);
    let fits = add(poses, Some(&first), &mut sets)?;
    let identification = identify::identify_in(&sets, question, space)?;
    let offsets = poses
        .iter()
        .zip(&fits)
        .map(|(poses, fit)| (poses.name.clone(), offsets(&identification, fit)))
        .collect();
    Ok((identification, consistency, offsets))
}

fn add(
    runs: &[MeasuredPoses],
    first: Option<&Identification>,
    sets: &mut Vec<Masslines>,
) -> Result<Vec<StaticFit>, AnswerError> {
    let matrix = first.map(|i| at_rest(i).mass_matrix(&i.reference));
    let mut fits = Vec::new();
    for poses in runs {
        let fit = poses
            .poses
            .masslines(
                poses.geometry.reference,
                &poses.geometry.equations,
                &poses.noise,
                matrix.as_ref(),
            )
            .map_err(|e| AnswerError::lacking("static poses", e))?;
        sets.push(fit.masslines.clone());
        fits.push(fit);
    }
    Ok(fits)
}

/// The body as far as it matters where nothing turns: unknown terms are zero.
fn at_rest(identification: &Identification) -> RigidBody {
    let value = |e: Option<Estimate>| e.map_or(0.0, |e| e.value);
    RigidBody {
        mass: value(identification.mass),
        centre_of_gravity: identification.centre_of_gravity.map(value).into(),
        inertia: Inertia::default(),
    }
}

/// Offsets of the load cells: the part of their readings that is not `M (a - g)`.
fn offsets(identification: &Identification, fit: &StaticFit) -> [f64; 6] {
    let matrix = at_rest(identification).mass_matrix(&identification.reference);
    let left: Vector6<f64> = fit.mean_force - matrix * fit.mean_acceleration;
    left.into()
}
