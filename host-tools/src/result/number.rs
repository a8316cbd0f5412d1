//! Numbers of the result document, with all that is known of their errors.

use crate::identification::{TypeB, estimates};
use massline_core::identify::{Estimate, Identification, InertiaEstimate};
use serde::{Deserialize, Serialize};

/// Type B uncertainty of a number: the stated errors of calibrations, positions and directions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TypeBDocument {
    /// Standard uncertainty, SI.
    pub std: f64,
    /// The source that contributes most, in words; null where none contributes.
    pub source: Option<String>,
    /// Its share of the variance of type B, 0 to 1.
    pub share: Option<f64>,
}

/// Type A and type B together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CombinedDocument {
    /// Combined standard uncertainty, SI.
    pub std: f64,
    /// Half of the 95 % interval, SI.
    pub interval: Option<f64>,
    /// Effective degrees of freedom by Welch and Satterthwaite; null where infinite.
    pub freedom: Option<f64>,
}

/// A number with its error bar; `value` is null where the number is not observable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Number {
    /// The value, SI.
    pub value: Option<f64>,
    /// One standard deviation, SI.
    pub std: Option<f64>,
    /// Half of the 95 % interval, SI.
    pub interval: Option<f64>,
    /// `true` if this test determines the number.
    pub observable: bool,
    /// Type B uncertainty; absent where none is stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub type_b: Option<TypeBDocument>,
    /// Both types together; absent where none is stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub combined: Option<CombinedDocument>,
}

impl Number {
    /// The number of an estimate whose standard deviation has `freedom` degrees of freedom.
    pub(super) fn new(estimate: Option<Estimate>, freedom: f64) -> Self {
        Self {
            value: estimate.map(|e| e.value),
            std: estimate.map(|e| e.std),
            // Without a degree of freedom there is no interval, and JSON knows no infinity.
            interval: estimate
                .map(|e| e.interval(freedom))
                .filter(|half| half.is_finite()),
            observable: estimate.is_some(),
            type_b: None,
            combined: None,
        }
    }

    /// Value and standard deviation, SI; `None` where not observable.
    #[must_use]
    pub fn estimate(&self) -> Option<Estimate> {
        let (value, std) = self.value.zip(self.std)?;
        Some(Estimate { value, std })
    }

    /// Half of the 95 % interval of all that is known of the errors, SI: both types where type B
    /// is known, else that of the noise; infinite without a degree of freedom, zero where the
    /// number is not observable.
    #[must_use]
    pub fn half_width(&self) -> f64 {
        match (self.value, &self.combined) {
            (Some(_), Some(both)) => both.half_width(),
            _ => self.noise_half_width(),
        }
    }

    /// Half of the 95 % interval of the noise alone, SI; infinite and zero as
    /// [`half_width`](Self::half_width) is.
    #[must_use]
    pub fn noise_half_width(&self) -> f64 {
        match self.value {
            Some(_) => self.interval.unwrap_or(f64::INFINITY),
            None => 0.0,
        }
    }

    /// Standard uncertainty of all that is known of the errors, SI; `None` where the number is not
    /// observable.
    #[must_use]
    pub fn std_of_both(&self) -> Option<f64> {
        self.combined.map_or(self.std, |both| Some(both.std))
    }

    /// Adds the type B uncertainty of number `number` of an identification.
    pub(super) fn add_type_b(&mut self, number: usize, i: &Identification, type_b: &TypeB) {
        let estimate = estimates(i).get(number).copied().flatten();
        if let Some(both) = estimate.and_then(|e| type_b.combined(number, &e, i.freedom)) {
            let dominant = type_b.dominant(number);
            self.type_b = Some(TypeBDocument {
                std: both.type_b,
                source: dominant.map(|(source, _)| source.to_owned()),
                share: dominant.map(|(_, share)| share),
            });
            self.combined = Some(CombinedDocument {
                std: both.std,
                interval: Some(both.interval).filter(|half| half.is_finite()),
                freedom: Some(both.freedom).filter(|freedom| freedom.is_finite()),
            });
        }
    }
}

/// Six inertia terms, kg m²; products are ∫ x y dm, with a plus sign.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct InertiaTerms {
    /// ∫ (y² + z²) dm
    pub xx: Number,
    /// ∫ (x² + z²) dm
    pub yy: Number,
    /// ∫ (x² + y²) dm
    pub zz: Number,
    /// ∫ x y dm
    pub xy: Number,
    /// ∫ x z dm
    pub xz: Number,
    /// ∫ y z dm
    pub yz: Number,
}

impl CombinedDocument {
    /// Half of the 95 % interval, SI; infinite where there is no degree of freedom.
    #[must_use]
    pub fn half_width(&self) -> f64 {
        self.interval.unwrap_or(f64::INFINITY)
    }
}

impl InertiaTerms {
    pub(super) fn new(terms: InertiaEstimate, freedom: f64) -> Self {
        let [xx, yy, zz, xy, xz, yz] = terms.map(|term| Number::new(term, freedom));
        Self {
            xx,
            yy,
            zz,
            xy,
            xz,
            yz,
        }
    }

    /// xx, yy, zz, xy, xz, yz.
    #[must_use]
    pub fn terms(&self) -> [&Number; 6] {
        [&self.xx, &self.yy, &self.zz, &self.xy, &self.xz, &self.yz]
    }

    /// xx, yy, zz; `None` where not observable.
    pub fn moments(&self) -> impl Iterator<Item = Option<f64>> + '_ {
        [&self.xx, &self.yy, &self.zz].into_iter().map(|t| t.value)
    }

    /// Largest absolute value of the six, kg m²; zero where none is observable.
    #[must_use]
    pub fn largest(&self) -> f64 {
        let values = self.terms().into_iter().filter_map(|t| t.value);
        values.fold(0.0, |largest, value| f64::max(largest, value.abs()))
    }

    pub(super) fn each(&mut self) -> [&mut Number; 6] {
        [
            &mut self.xx,
            &mut self.yy,
            &mut self.zz,
            &mut self.xy,
            &mut self.xz,
            &mut self.yz,
        ]
    }
}
