//! Numbers of the result document, with all that is known of their errors.

use crate::identification::{TypeB, estimates};
use massline_core::identify::{Estimate, Identification, InertiaEstimate};
use serde::Serialize;

/// What a number owes to errors of calibrations, places and directions that are stated.
#[derive(Clone, Debug, Serialize)]
pub struct TypeBDocument {
    /// Standard uncertainty, SI.
    pub std: f64,
    /// The source that contributes most, in words; null where none contributes.
    pub source: Option<String>,
    /// Its share of the variance of type B, 0 to 1.
    pub share: Option<f64>,
}

/// Type A and type B together.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct CombinedDocument {
    /// Combined standard uncertainty, SI.
    pub std: f64,
    /// Half of the 95 % interval, SI.
    pub interval: Option<f64>,
    /// Effective degrees of freedom by Welch and Satterthwaite; null where infinite.
    pub freedom: Option<f64>,
}

/// A number with its error bar; `value` is null where the test does not tell it.
#[derive(Clone, Debug, Serialize)]
pub struct Number {
    /// The value, SI.
    pub value: Option<f64>,
    /// One standard deviation, SI.
    pub std: Option<f64>,
    /// Half of the 95 % interval, SI.
    pub interval: Option<f64>,
    /// Whether this test determines it.
    pub observable: bool,
    /// Type B uncertainty; absent where none is stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub type_b: Option<TypeBDocument>,
    /// Both types together; absent where none is stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub combined: Option<CombinedDocument>,
}

impl Number {
    /// Of an estimate whose standard deviation has so many degrees of freedom.
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

    /// Adds what type B says of number `number` of an identification.
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
#[derive(Clone, Debug, Serialize)]
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
