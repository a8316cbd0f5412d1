//! The rows of the study: which methods, ranges and weights.

use massline_core::masslines::Method;
use serde::Serialize;

/// Lines from which the rigid body is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Range {
    /// Up to about 45 % of the first elastic natural frequency.
    I,
    /// Up to about 80 % of it.
    II,
    /// Lines of the fit of method d, which averages nothing.
    Fit,
}

impl Range {
    /// As the paper writes it; empty for method d.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::I => "I",
            Self::II => "II",
            Self::Fit => "",
        }
    }
}

/// One row of table 3, or one that the paper lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
    /// Method by which masslines are found.
    pub method: Method,
    /// From which lines.
    pub range: Range,
    /// `true` if the accelerometers are weighted as in chapter 7.
    pub weighted: bool,
}

/// The methods of table 3 in the paper's order.
const PAPER: [Method; 6] = [
    Method::FrequencyResponses,
    Method::PowerSpectra,
    Method::PowerSpectraCholesky,
    Method::FreeResponses,
    Method::CurveFit,
    Method::Synthesis,
];

impl Row {
    /// The 22 rows of table 3 in the paper's order.
    #[must_use]
    pub fn of_the_paper() -> Vec<Self> {
        PAPER.into_iter().flat_map(Self::of_method).collect()
    }

    /// The rows that the paper lacks: those of all other methods, the recommended one last.
    #[must_use]
    pub fn beyond_the_paper() -> Vec<Self> {
        let others = Method::ALL.into_iter().rev();
        let others = others.filter(|method| !PAPER.contains(method));
        others.flat_map(Self::of_method).collect()
    }

    /// All of them.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let mut rows = Self::of_the_paper();
        rows.extend(Self::beyond_the_paper());
        rows
    }

    /// The rows of table 4: range I, weighted where weights are used at all.
    #[must_use]
    pub fn iterated() -> Vec<Self> {
        let mut rows = Self::all();
        rows.retain(|row| {
            row.range != Range::II
                && (row.weighted || row.method.interface_only())
                && row.method != Method::PowerSpectra
        });
        rows
    }

    fn of_method(method: Method) -> Vec<Self> {
        let ranges: &[Range] = match method {
            Method::CurveFit => &[Range::Fit],
            _ => &[Range::I, Range::II],
        };
        // The interface accelerometers alone need no weights: none of them sees a mode.
        let weights: &[bool] = if method.interface_only() {
            &[false]
        } else {
            &[false, true]
        };
        let mut rows = Vec::new();
        for &range in ranges {
            for &weighted in weights {
                rows.push(Self {
                    method,
                    range,
                    weighted,
                });
            }
        }
        rows
    }

    /// The method as a column heading has it.
    #[must_use]
    pub const fn method_name(&self) -> &'static str {
        match self.method {
            Method::PowerSpectraCholesky => "b Cholesky",
            Method::FreeResponsesSquared => "c with ω²",
            Method::ApparentMass => "apparent mass",
            other => other.name(),
        }
    }

    /// `with W`, `w/o W`, or nothing where weights have no place.
    #[must_use]
    pub const fn weight_name(&self) -> &'static str {
        match (self.method.interface_only(), self.weighted) {
            (true, _) => "",
            (false, true) => "with W",
            (false, false) => "w/o W",
        }
    }

    /// All of it in one line.
    #[must_use]
    pub fn name(&self) -> String {
        let parts = [self.method_name(), self.range.name(), self.weight_name()];
        let said: Vec<&str> = parts.into_iter().filter(|p| !p.is_empty()).collect();
        said.join(" ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_has_22_rows_and_five_iterated() {
        assert_eq!(Row::of_the_paper().len(), 22);
        assert_eq!(Row::beyond_the_paper().len(), 6);
        let names: Vec<String> = Row::iterated().iter().map(Row::name).collect();
        assert_eq!(
            names,
            [
                "a I with W",
                "b Cholesky I with W",
                "c I with W",
                "d with W",
                "e I with W",
                "c with ω² I with W",
                "apparent mass I"
            ]
        );
    }
}
