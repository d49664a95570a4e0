//! What a calibration found.
use super::file::Sensor;
use super::input::Indenter;
use crate::force::{Branch, Estimate, LensFit};

/// What one press was found to be.
///
/// ```
/// use tactile_imaging::force::{Branch, Estimate};
/// use tactile_imaging::sensor::{Indenter, PressFinding};
/// let finding = PressFinding {
///     indenter: Indenter::Punch { radius_m: 2e-3 },
///     branch: Branch::Loading,
///     force_n: 0.5,
///     read_force_n: Some(0.503),
///     contact_radius_m: Some(Estimate::new(2.01e-3, 2e-6)),
///     layers_force_n: None,
/// };
/// assert!(finding.read_force_n.is_some_and(|read| (read / finding.force_n - 1.0).abs() < 0.01));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressFinding {
    /// What was pressed.
    pub indenter: Indenter,
    /// Rising or falling force.
    pub branch: Branch,
    /// The gauge's force in newtons.
    pub force_n: f64,
    /// The force read from the frame with the fitted curve. `None` where no contact is seen, and the press was not used.
    pub read_force_n: Option<f64>,
    /// The fitted contact radius.
    pub contact_radius_m: Option<Estimate>,
    /// The force that the fitted layers have at that radius. `None` for presses that the layers were not fitted to.
    pub layers_force_n: Option<f64>,
}

/// One parameter of a layer before and after the calibration.
///
/// ```
/// use tactile_imaging::{force::Estimate, sensor::LayerFinding};
/// let modulus = LayerFinding {
///     layer: 0,
///     parameter: "youngs_modulus_pa",
///     stated: Estimate::new(120e3, 15e3),
///     fitted: Estimate::new(135e3, 3e3),
///     identified: true,
/// };
/// assert!(modulus.fitted.standard_error < 0.7 * modulus.stated.standard_error);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerFinding {
    /// The layer, counted from the object's side from 0.
    pub layer: usize,
    /// The field of the sensor file.
    pub parameter: &'static str,
    /// What the user stated.
    pub stated: Estimate,
    /// What the presses and the statement say together.
    pub fitted: Estimate,
    /// Whether the presses told of it: its error fell below 0.7 times the stated one. What was not identified is the statement.
    pub identified: bool,
}

/// A calibrated sensor and how it was found. Made by [`SensorCalibration::run`](super::SensorCalibration::run).
///
/// ```no_run
/// use tactile_imaging::sensor::{CalibratedSensor, SensorCalibration};
/// let found: CalibratedSensor = SensorCalibration::read("calibration.toml")?.run()?;
/// println!("{} of {} layers' parameters were identified",
///     found.layers.iter().filter(|layer| layer.identified).count(), found.layers.len());
/// # Ok::<(), tactile_imaging::sensor::SensorError>(())
/// ```
#[derive(Clone, Debug)]
pub struct CalibratedSensor {
    /// The sensor.
    pub sensor: Sensor,
    /// The lens as the target showed it. `None` without a target.
    pub lens: Option<LensFit>,
    /// Every press.
    pub presses: Vec<PressFinding>,
    /// Every parameter of the layers.
    pub layers: Vec<LayerFinding>,
}
