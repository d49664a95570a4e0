//! Parameters of a calibrated gel.

use tactile_core::{InvalidOption, Requirement};
use tactile_sfs::{DepthTable, SfsError};

/// Darkening that counts as contact, in grey levels. It is above the noise of an 8-bit camera.
const THRESHOLD_GREY: f64 = 3.0;

/// The parameters of a [`GelSensor`](crate::GelSensor), by the kind of the gel.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(untagged))]
#[non_exhaustive]
pub enum GelModel {
    /// A gel lit in colours.
    Colour(ColourModel),
    /// A gel that darkens where it is pressed.
    Dark(DarkModel),
}

/// The parameters of a gel lit in colours, in the file format.
///
/// ```
/// use tactile_gel::{ColourModel, GelSensor};
/// let model = ColourModel::new(5e-5, [vec![0.0; 60], vec![0.0; 60]]);
/// let flat = ndarray::Array3::from_elem((40, 60, 3), 90);
/// let sensor = GelSensor::new(model, &flat)?;
/// let frame = sensor.read(&flat)?;
/// assert!(frame.contacts.is_empty() && frame.depth_m.iter().all(|z| *z == 0.0));
/// # Ok::<(), tactile_gel::GelError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct ColourModel {
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

impl ColourModel {
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

/// The parameters of a gel that darkens, in the file format.
///
/// No darkness means no depth. A table with the entry (0, 0) is used unchanged. In other tables,
/// such as those of 9DTact, depths are counted from a contact circle that was first visible at some
/// darkness. If such a table determines its zero, it is [zeroed](DepthTable::zeroed), otherwise it
/// is used unchanged.
///
/// ```
/// use tactile_gel::DarkModel;
/// // One level is 30 µm deep, and depth was counted from the first three visible levels.
/// let mut table: Vec<_> = (3..60).map(|s| [f64::from(s), 30e-6 * f64::from(s - 3)]).collect();
/// let depth = |table: &[[f64; 2]]| {
///     let model = DarkModel::new(1e-4, table.to_vec());
///     model.depth_table().map(|table| table.depth(10.0).0)
/// };
/// assert!((depth(&table)? - 0.30e-3).abs() < 1e-12);
/// table.insert(0, [0.0, 0.0]);
/// assert!((depth(&table)? - 0.21e-3).abs() < 1e-12);
/// # Ok::<(), tactile_gel::GelError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct DarkModel {
    /// Size of a pixel on the gel in metres.
    pub pixel_size_m: f64,
    /// Darkness that counts as contact, in grey levels below the reference.
    #[cfg_attr(feature = "serde", serde(default = "threshold_grey"))]
    pub threshold_grey: f64,
    /// Entries of darkness in grey levels and depth in metres. Both increase.
    pub table: Vec<[f64; 2]>,
    /// Standard error of the depth of one pixel in metres, from leaving out one press at a time. 0
    /// for a table without a statement of its error.
    #[cfg_attr(feature = "serde", serde(default))]
    pub depth_standard_error_m: f64,
    /// Relative standard error common to all depths of a frame, from leaving out one press at a
    /// time. 0 for a table without a statement of its error.
    #[cfg_attr(feature = "serde", serde(default))]
    pub slope_standard_error: f64,
}

#[cfg(feature = "serde")]
fn threshold_grey() -> f64 {
    THRESHOLD_GREY
}

impl DarkModel {
    /// A model without errors. A darkness of more than 3 grey levels counts as contact.
    pub fn new(pixel_size_m: f64, table: Vec<[f64; 2]>) -> Self {
        Self {
            pixel_size_m,
            threshold_grey: THRESHOLD_GREY,
            table,
            depth_standard_error_m: 0.0,
            slope_standard_error: 0.0,
        }
    }

    /// The depth as a function of the darkness, zero at no darkness. Negative entries are dropped.
    ///
    /// # Errors
    /// [`SfsError`] for a table of fewer than two entries or one that does not increase, and for a
    /// negative threshold.
    pub fn depth_table(&self) -> Result<DepthTable<f64>, SfsError> {
        let entries = self
            .table
            .iter()
            .map(|[darkness, depth]| (*darkness, *depth));
        let kept: Vec<_> = entries.filter(|(d, z)| *d >= 0.0 && *z >= 0.0).collect();
        let unchanged = DepthTable::new(&kept)?.with_contact_threshold(self.threshold_grey)?;
        if kept.contains(&(0.0, 0.0)) {
            return Ok(unchanged);
        }
        Ok(unchanged.clone().zeroed().unwrap_or(unchanged))
    }
}

impl From<ColourModel> for GelModel {
    fn from(model: ColourModel) -> Self {
        Self::Colour(model)
    }
}

impl From<DarkModel> for GelModel {
    fn from(model: DarkModel) -> Self {
        Self::Dark(model)
    }
}

impl GelModel {
    /// Size of a pixel on the gel in metres.
    pub fn pixel_size_m(&self) -> f64 {
        match self {
            Self::Colour(model) => model.pixel_size_m,
            Self::Dark(model) => model.pixel_size_m,
        }
    }

    /// Standard error of the depth of one pixel in metres.
    pub fn depth_standard_error_m(&self) -> f64 {
        match self {
            Self::Colour(model) => model.depth_standard_error_m,
            Self::Dark(model) => model.depth_standard_error_m,
        }
    }

    /// Relative standard error common to all slopes of a frame.
    pub fn slope_standard_error(&self) -> f64 {
        match self {
            Self::Colour(model) => model.slope_standard_error,
            Self::Dark(model) => model.slope_standard_error,
        }
    }

    /// Rejects sizes that are not positive and errors that are negative.
    pub(crate) fn check(&self) -> Result<(), InvalidOption> {
        Requirement::Positive.check("pixel size", self.pixel_size_m())?;
        Requirement::NonNegative.check("depth error", self.depth_standard_error_m())?;
        Requirement::NonNegative.check("slope error", self.slope_standard_error())?;
        match self {
            Self::Colour(model) => {
                Requirement::NonNegative.check("normal error", model.normal_standard_error)?
            }
            Self::Dark(model) => {
                Requirement::Positive.check("contact threshold", model.threshold_grey)?
            }
        };
        Ok(())
    }
}
