//! Parameters of a calibrated gel.

/// The parameters found by a calibration of [`GelSensor`](crate::GelSensor), in the file format.
///
/// ```
/// use tactile_gel::{GelModel, GelSensor};
/// let model = GelModel::new(5e-5, [vec![0.0; 60], vec![0.0; 60]]);
/// let flat = ndarray::Array3::from_elem((40, 60, 3), 90);
/// let sensor = GelSensor::new(model, flat.view())?;
/// let frame = sensor.read(flat.view())?;
/// assert!(frame.contacts.is_empty() && frame.depth_m.iter().all(|z| *z == 0.0));
/// # Ok::<(), tactile_gel::GelError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct GelModel {
    /// Size of a pixel on the gel in metres.
    pub pixel_size_m: f64,
    /// Coefficients of n_x and n_y, 60 each. The first 20 belong to the monomials of the
    /// differences in units of 50 grey levels. The others belong to these monomials times x, then
    /// times y, with x and y from −1 to 1.
    pub coefficients: [Vec<f64>; 2],
    /// Standard error of n_x and n_y, from leaving out one press at a time.
    pub normal_standard_error: f64,
    /// Standard error of the depth of one pixel in metres, from leaving out one press at a time.
    pub depth_standard_error_m: f64,
    /// Relative standard error common to all slopes of a frame, from leaving out one press at a
    /// time.
    #[cfg_attr(feature = "serde", serde(default = "unknown_slope_error"))]
    pub slope_standard_error: f64,
}

/// Default for files written before this error existed: that of typical calibrations.
#[cfg(feature = "serde")]
fn unknown_slope_error() -> f64 {
    0.05
}

impl GelModel {
    /// A model without errors.
    pub fn new(pixel_size_m: f64, coefficients: [Vec<f64>; 2]) -> Self {
        Self {
            pixel_size_m,
            coefficients,
            normal_standard_error: 0.0,
            depth_standard_error_m: 0.0,
            slope_standard_error: 0.0,
        }
    }
}
