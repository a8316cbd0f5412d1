//! Options that all commands that identify have in common.

use massline_core::masslines::Method;

/// Reads the name of a method; `also` is what else may stand in its place.
pub(super) fn parse_method(name: &str, also: &str) -> Result<Method, String> {
    let found = Method::ALL.into_iter().find(|m| m.name() == name);
    found.ok_or_else(|| {
        let names: Vec<&str> = Method::ALL.iter().map(|m| m.name()).collect();
        format!("the methods are: {}{also}", names.join(", "))
    })
}

/// Procedure and weights of an identification.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(super) struct Procedure {
    /// Move the reference point to the centre of gravity until both coincide
    #[arg(long, overrides_with = "direct")]
    pub(super) iterative: bool,
    /// Solve once at the given reference point (default)
    #[arg(long, overrides_with = "iterative")]
    direct: bool,
    /// Weigh all accelerometers alike
    #[arg(long)]
    no_weights: bool,
}

impl Procedure {
    /// `true` if weights of the accelerometers are used.
    pub(super) const fn weighted(self) -> bool {
        !self.no_weights
    }
}
