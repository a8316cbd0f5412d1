//! All sensors of one run, made into the map from its samples to resultants.

use super::{
    AccelerationFit, Accelerometer, Equations, ForceResultants, GeometryError, LoadCell, Placement,
    RESULTANTS, ResultantMap,
};
use nalgebra::{Vector3, Vector6};

/// A sensor of a run, as it was described: in the frame of the table, or in that of the
/// specimen if it is glued to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RunSensor {
    /// An accelerometer with its weight in this run.
    Accelerometer(Accelerometer, f64),
    /// A load cell.
    LoadCell(LoadCell),
}

/// Geometry of one run in the specimen's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct RunGeometry {
    /// The reference point A, m.
    pub reference: Vector3<f64>,
    /// SI samples of the sensors, in their order, to the twelve resultants at A.
    pub map: ResultantMap,
    /// The equations the load cells complete.
    pub equations: Equations,
    /// Share of each acceleration component that the accelerometers determine, 0 to 1.
    pub determined: [f64; 6],
}

impl RunGeometry {
    /// The geometry of a run in which the specimen stands as `placement` says, about the
    /// reference point A (m).
    ///
    /// # Errors
    /// [`GeometryError`] if the sensors cannot give accelerations and resultants.
    pub fn new<S>(
        sensors: S,
        placement: &Placement,
        reference: &Vector3<f64>,
    ) -> Result<Self, GeometryError>
    where
        S: IntoIterator<Item = RunSensor, IntoIter: Clone>,
    {
        let mut geometry = Self::empty();
        geometry.describe(sensors, placement, reference, |_| ())?;
        Ok(geometry)
    }

    /// The equations of motion that those of these sensors complete which are load cells: what
    /// [`Self::new`] finds of them, without the rest.
    ///
    /// # Errors
    /// [`GeometryError::NoLoadCell`] if none is, [`GeometryError::NotFinite`].
    pub fn equations_of(
        sensors: impl Iterator<Item = RunSensor> + Clone,
        placement: &Placement,
        reference: &Vector3<f64>,
    ) -> Result<Equations, GeometryError> {
        Ok(*resultants(sensors, placement, reference)?.equations())
    }

    /// No sensors yet.
    #[must_use]
    pub const fn empty() -> Self {
        Self {
            reference: Vector3::new(0.0, 0.0, 0.0),
            map: ResultantMap::new(),
            equations: Equations::none(),
            determined: [0.0; 6],
        }
    }

    /// Does in place what [`Self::new`] does, with two kilobytes less of stack, and shows
    /// `column` each sensor's contribution to the resultants in double precision, in the sensors'
    /// order. After an error this is no geometry of anything.
    ///
    /// # Errors
    /// Those of [`Self::new`].
    pub fn describe<S>(
        &mut self,
        sensors: S,
        placement: &Placement,
        reference: &Vector3<f64>,
        mut column: impl FnMut([f64; RESULTANTS]),
    ) -> Result<(), GeometryError>
    where
        S: IntoIterator<Item = RunSensor, IntoIter: Clone>,
    {
        let sensors = sensors.into_iter();
        let accelerometers = sensors.clone().filter_map(|s| match s {
            RunSensor::Accelerometer(a, weight) => Some((placement.accelerometer(&a), weight)),
            RunSensor::LoadCell(_) => None,
        });
        let fit = AccelerationFit::new(accelerometers, reference)?;
        let resultants = resultants(sensors.clone(), placement, reference)?;
        self.map.clear();
        for sensor in sensors {
            let mut wide = [0.0; RESULTANTS];
            let (half, contribution): (_, Vector6<f64>) = match sensor {
                RunSensor::Accelerometer(a, weight) => {
                    let contribution = fit.column(&placement.accelerometer(&a), weight);
                    self.map.push_acceleration(&contribution)?;
                    (&mut wide[..6], contribution)
                }
                RunSensor::LoadCell(cell) => {
                    let contribution = resultants.column(&placement.load_cell(&cell));
                    self.map.push_force(&contribution)?;
                    (&mut wide[6..], contribution)
                }
            };
            half.copy_from_slice(contribution.as_slice());
            column(wide);
        }
        self.reference = *reference;
        self.equations = *resultants.equations();
        self.determined = core::array::from_fn(|j| fit.determined(j));
        Ok(())
    }
}

/// The resultants of those of these sensors that are load cells.
fn resultants(
    sensors: impl Iterator<Item = RunSensor> + Clone,
    placement: &Placement,
    reference: &Vector3<f64>,
) -> Result<ForceResultants, GeometryError> {
    let cells = sensors.filter_map(|s| match s {
        RunSensor::LoadCell(cell) => Some(placement.load_cell(&cell)),
        RunSensor::Accelerometer(..) => None,
    });
    ForceResultants::new(cells, reference)
}
