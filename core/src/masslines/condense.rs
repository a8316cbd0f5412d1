//! One door to all methods: averaged lines in, masslines out.

use super::apparent_mass::apparent_mass;
use super::averaging::noise_of_runs;
use super::moved::Moved;
use super::workspace::Found;
use super::{
    ApparentMass, Factorisation, FreeModes, Lines, MasslineError, Masslines, Workspace, curve_fit,
    free_responses, frequency_responses, power_spectra, synthesis,
};
use crate::geometry::{Equations, least_translation};
use crate::modes::MAX_MODES;
use crate::spectra::LineRange;
use nalgebra::{Complex, Vector3};

/// The ways to masslines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Method {
    /// Apparent mass with elastic terms.
    #[default]
    ApparentMass,
    /// Method a, averaged frequency responses.
    FrequencyResponses,
    /// Method b, averaged power spectra.
    PowerSpectra,
    /// Method b with Cholesky factorisation.
    PowerSpectraCholesky,
    /// Method c, averaged frequency responses of the free system.
    FreeResponses,
    /// Method c with a term in ω².
    FreeResponsesSquared,
    /// Method d, curve fit.
    CurveFit,
    /// Method e, synthesised rigid-body responses.
    Synthesis,
}

impl Method {
    /// All of them, the recommended one first, then in the paper's order.
    pub const ALL: [Self; 8] = [
        Self::ApparentMass,
        Self::FrequencyResponses,
        Self::PowerSpectra,
        Self::PowerSpectraCholesky,
        Self::FreeResponses,
        Self::FreeResponsesSquared,
        Self::CurveFit,
        Self::Synthesis,
    ];

    /// Short name, as typed on a command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::ApparentMass => "apparent-mass",
            Self::FrequencyResponses => "a",
            Self::PowerSpectra => "b",
            Self::PowerSpectraCholesky => "b-cholesky",
            Self::FreeResponses => "c",
            Self::FreeResponsesSquared => "c-squared",
            Self::CurveFit => "d",
            Self::Synthesis => "e",
        }
    }

    /// What it does, in one line.
    #[must_use]
    pub const fn description(self) -> &'static str {
        match self {
            Self::ApparentMass => "apparent mass with elastic terms",
            Self::FrequencyResponses => "averaged frequency responses (method a)",
            Self::PowerSpectra => "averaged power spectra (method b)",
            Self::PowerSpectraCholesky => "averaged power spectra, Cholesky (method b)",
            Self::FreeResponses => "averaged responses of the free system (method c)",
            Self::FreeResponsesSquared => {
                "responses of the free system at ω = 0 (method c with ω² term)"
            }
            Self::CurveFit => "curve fit of the free system's responses (method d)",
            Self::Synthesis => "synthesised rigid-body responses (method e)",
        }
    }

    /// Whether the base acceleration comes from the interface accelerometers alone. The
    /// paper's methods use all accelerometers, equation (4).
    #[must_use]
    pub const fn interface_only(self) -> bool {
        matches!(self, Self::ApparentMass)
    }
}

/// How the six equations of motion of a pair are weighed against each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EquationWeights {
    /// By the noise of the run. The answer does not depend on the reference point.
    #[default]
    Noise,
    /// All alike, newtons and newton metres, about the given reference point: as the paper
    /// has it. The apparent mass does not know this.
    Unit,
}

/// Which of the kept lines serve for what, and how equations count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bands {
    /// The averaging band: the rigid body is read from these.
    pub averaging: LineRange,
    /// Lines in which elastic modes are looked for and fitted.
    pub fit: LineRange,
    /// Most elastic modes that methods d and e take account of.
    pub modes: usize,
    /// How equations are weighed by methods a to e.
    pub equations: EquationWeights,
}

impl Bands {
    /// The averaging band, with modes looked for in all the lines it was chosen from.
    #[must_use]
    pub fn new(averaging: LineRange) -> Self {
        Self {
            averaging,
            fit: LineRange::all(averaging.count()),
            modes: MAX_MODES,
            equations: EquationWeights::Noise,
        }
    }
}

/// What a method gave.
#[derive(Clone, Debug, PartialEq)]
pub struct Condensed {
    /// The pairs.
    pub masslines: Masslines,
    /// The fit behind them, for [`Method::ApparentMass`].
    pub apparent_mass: Option<ApparentMass>,
    /// The modes behind them, for [`Method::CurveFit`] and [`Method::Synthesis`].
    pub free_modes: Option<FreeModes>,
}

/// Condenses `lines` to masslines about `reference` by `method`. `work` holds two elements
/// per line. For stacks of some 64 KiB or more; see [`condense_into`].
///
/// # Errors
/// [`MasslineError`], what the method lacks.
pub fn condense<L: Lines + ?Sized>(
    method: Method,
    lines: &L,
    bands: &Bands,
    reference: Vector3<f64>,
    equations: &Equations,
    work: &mut [Complex<f64>],
) -> Result<Condensed, MasslineError> {
    let mut masslines = Masslines::new(reference, *equations);
    let mut space = Workspace::EMPTY;
    condense_into(method, lines, bands, &mut masslines, &mut space, work)?;
    Ok(Condensed {
        masslines,
        apparent_mass: space.apparent_mass().cloned(),
        free_modes: space.free_modes().cloned(),
    })
}

/// Condenses `lines` by `method` to masslines, which are added to the empty `set` about the
/// reference point and in the equations that it has. `work` holds two elements per line.
///
/// # Errors
/// [`MasslineError`], what the method lacks.
pub fn condense_into<L: Lines + ?Sized, const PAIRS: usize>(
    method: Method,
    lines: &L,
    bands: &Bands,
    set: &mut Masslines<PAIRS>,
    space: &mut Workspace,
    work: &mut [Complex<f64>],
) -> Result<(), MasslineError> {
    lines.check()?;
    // Read only where the method has succeeded.
    space.found = match method {
        Method::ApparentMass => Found::ApparentMass,
        Method::CurveFit | Method::Synthesis => Found::FreeModes,
        _ => Found::Nothing,
    };
    // Estimators work at a point of the body, whichever reference point was given: their
    // choices and their rounding then do not depend on it.
    let shift = match bands.equations {
        EquationWeights::Noise => centre_of_noise(lines),
        EquationWeights::Unit => Vector3::zeros(),
    };
    let given = set.equations;
    set.reference += shift;
    set.equations = given.at(&shift);
    condense_there(method, lines, &shift, bands, set, space, work)?;
    match space.found {
        Found::ApparentMass => space.apparent_mass.move_by(&shift),
        Found::FreeModes => space.free_modes.move_by(&shift, &given, &given.at(&shift)),
        Found::Nothing => {}
    }
    set.move_by(&-shift);
    Ok(())
}

/// From A to the point at which the noise of the translations is least, m.
#[inline(never)] // The noise is off the stack when a method works.
fn centre_of_noise<L: Lines + ?Sized>(lines: &L) -> Vector3<f64> {
    least_translation(&noise_of_runs(lines, 1).acceleration)
}

/// Condenses lines about a point from which the set's reference point lies `shift` (m) away.
fn condense_there<L: Lines + ?Sized, const PAIRS: usize>(
    method: Method,
    given: &L,
    shift: &Vector3<f64>,
    bands: &Bands,
    set: &mut Masslines<PAIRS>,
    space: &mut Workspace,
    work: &mut [Complex<f64>],
) -> Result<(), MasslineError> {
    let band = bands.averaging;
    let fit = bands.fit;
    let (modes, weights) = (bands.modes, bands.equations);
    let lines = &Moved::new(given, shift);
    match method {
        Method::ApparentMass => apparent_mass(given, shift, band, fit, set, space, work),
        Method::FrequencyResponses => frequency_responses(lines, band, weights, set),
        Method::PowerSpectra => power_spectra(lines, band, Factorisation::None, weights, set),
        Method::PowerSpectraCholesky => {
            power_spectra(lines, band, Factorisation::Cholesky, weights, set)
        }
        Method::FreeResponses => free_responses(lines, band, false, weights, set),
        Method::FreeResponsesSquared => free_responses(lines, band, true, weights, set),
        Method::CurveFit => curve_fit(lines, band, fit, modes, weights, set, space, work),
        Method::Synthesis => synthesis(lines, band, fit, modes, weights, set, space, work),
    }
}
