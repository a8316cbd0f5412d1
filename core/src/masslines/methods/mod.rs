//! The list of methods. All that the crate knows of a method beside its own file stands in the
//! table at the end of this one.

pub(in crate::masslines) mod apparent_mass;
mod curve_fit;
mod free_responses;
mod frequency_responses;
mod power_spectra;
mod synthesis;

use crate::masslines::bands::Bands;
use crate::masslines::moved::Moved;
use crate::masslines::workspace::{Found, Workspace};
use crate::masslines::{Lines, MasslineError, Masslines};
use apparent_mass::apparent_mass;
use curve_fit::curve_fit;
use free_responses::free_responses;
use frequency_responses::frequency_responses;
use nalgebra::{Complex, Vector3};
use power_spectra::{Factorisation, power_spectra};
use synthesis::synthesis;

/// Input and working memory of a method.
pub(super) struct Task<'t, L: ?Sized, const PAIRS: usize> {
    /// Lines about the reference point of `set`.
    pub(super) lines: &'t Moved<'t, L>,
    /// The same lines about their own reference point, from which that of `set` lies `shift` away.
    pub(super) given: &'t L,
    /// Distance of the two reference points, m.
    pub(super) shift: &'t Vector3<f64>,
    /// Bands, limit of modes and weights.
    pub(super) bands: &'t Bands,
    /// Set to which the pairs are added.
    pub(super) set: &'t mut Masslines<PAIRS>,
    /// Memory of the estimators.
    pub(super) space: &'t mut Workspace,
    /// Memory of two elements per line.
    pub(super) work: &'t mut [Complex<f64>],
}

/// Makes [`Method`] and all that depends on the method of its table.
macro_rules! methods {
    ($(
        $(#[$attribute:meta])*
        $method:ident {
            name: $name:literal,
            description: $description:literal,
            interface_only: $interface_only:literal,
            leaves: $found:ident,
            run: |$task:ident| $run:expr,
        }
    )*) => {
        /// The ways from averaged lines to masslines.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        #[non_exhaustive]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        pub enum Method {
            $($(#[$attribute])* $method,)*
        }

        impl Method {
            /// All methods, the recommended one first, then in the paper's order.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$method),*];

            /// Short name, as typed on a command line.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$method => $name,)*
                }
            }

            /// Description in one line.
            #[must_use]
            pub const fn description(self) -> &'static str {
                match self {
                    $(Self::$method => $description,)*
                }
            }

            /// `true` if the base acceleration comes from the interface accelerometers alone. The
            /// paper's methods use all accelerometers, equation (4).
            #[must_use]
            pub const fn interface_only(self) -> bool {
                match self {
                    $(Self::$method => $interface_only,)*
                }
            }
        }

        /// The result that a method leaves in the workspace.
        pub(super) const fn leaves(method: Method) -> Found {
            match method {
                $(Method::$method => Found::$found,)*
            }
        }

        /// Adds the pairs of a method to the task's set.
        pub(super) fn run<L: Lines + ?Sized, const PAIRS: usize>(
            method: Method,
            task: Task<'_, L, PAIRS>,
        ) -> Result<(), MasslineError> {
            match method {
                $(Method::$method => {
                    let $task = task;
                    $run
                })*
            }
        }
    };
}

methods! {
    /// Apparent mass with elastic terms.
    #[default]
    ApparentMass {
        name: "apparent-mass",
        description: "apparent mass with elastic terms",
        interface_only: true,
        leaves: ApparentMass,
        run: |t| apparent_mass(t.given, t.shift, t.bands, t.set, t.space, t.work),
    }
    /// Method a, averaged frequency responses.
    FrequencyResponses {
        name: "a",
        description: "averaged frequency responses (method a)",
        interface_only: false,
        leaves: Nothing,
        run: |t| frequency_responses(t.lines, t.bands, t.set),
    }
    /// Method b, averaged power spectra.
    PowerSpectra {
        name: "b",
        description: "averaged power spectra (method b)",
        interface_only: false,
        leaves: Nothing,
        run: |t| power_spectra(t.lines, t.bands, Factorisation::None, t.set),
    }
    /// Method b with Cholesky factorisation.
    PowerSpectraCholesky {
        name: "b-cholesky",
        description: "averaged power spectra, Cholesky (method b)",
        interface_only: false,
        leaves: Nothing,
        run: |t| power_spectra(t.lines, t.bands, Factorisation::Cholesky, t.set),
    }
    /// Method c, averaged frequency responses of the free system.
    FreeResponses {
        name: "c",
        description: "averaged responses of the free system (method c)",
        interface_only: false,
        leaves: Nothing,
        run: |t| free_responses(t.lines, t.bands, false, t.set),
    }
    /// Method c with a term in ω².
    FreeResponsesSquared {
        name: "c-squared",
        description: "responses of the free system at ω = 0 (method c with ω² term)",
        interface_only: false,
        leaves: Nothing,
        run: |t| free_responses(t.lines, t.bands, true, t.set),
    }
    /// Method d, curve fit.
    CurveFit {
        name: "d",
        description: "curve fit of the free system's responses (method d)",
        interface_only: false,
        leaves: FreeModes,
        run: |t| curve_fit(t.lines, t.bands, t.set, t.space, t.work),
    }
    /// Method e, synthesised rigid-body responses.
    Synthesis {
        name: "e",
        description: "synthesised rigid-body responses (method e)",
        interface_only: false,
        leaves: FreeModes,
        run: |t| synthesis(t.lines, t.bands, t.set, t.space, t.work),
    }
}
