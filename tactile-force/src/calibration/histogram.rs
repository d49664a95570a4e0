//! The grey histogram of a contact.

/// Least grey level with a bin; the greatest is its opposite.
const LEAST: i32 = -256;
/// Number of bins, one a grey level.
const BINS: usize = 513;

/// The area of a contact by its grey-level difference from the reference, one bin a grey level.
///
/// A difference between two whole grey levels is shared out between them, so that area and integral of the differences are
/// exact. The integral of a curve f over the contact is Σ A(g) f(g).
///
/// ```
/// use ndarray::array;
/// use tactile_force::GreyHistogram;
///
/// let differences = array![10.0, 10.0, 20.25];
/// let histogram = GreyHistogram::from_differences(differences.iter().copied(), 1e-10);
/// assert!((histogram.area_m2() - 3e-10).abs() < 1e-22);
/// assert!((histogram.integral(|grey| grey) - 40.25e-10).abs() < 1e-20);
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GreyHistogram {
    area_m2: Vec<f64>,
    pixel_area_m2: f64,
}

impl Default for GreyHistogram {
    fn default() -> Self {
        Self {
            area_m2: vec![0.0; BINS],
            pixel_area_m2: 0.0,
        }
    }
}

impl GreyHistogram {
    /// Sorts the differences of a contact's pixels, in grey levels, each covering `pixel_area_m2`. Differences beyond ±255 count
    /// as ±255; NaN is left out.
    pub fn from_differences(differences: impl Iterator<Item = f32>, pixel_area_m2: f64) -> Self {
        let mut histogram = Self::default();
        histogram.clear(pixel_area_m2);
        differences
            .filter(|d| !d.is_nan())
            .for_each(|d| histogram.add_many(d, 1.0));
        histogram
    }

    /// Area of the contact in square metres.
    pub fn area_m2(&self) -> f64 {
        self.area_m2.iter().sum()
    }

    /// ∫ f dS over the contact, Σ A(g) f(g), for a function of the grey-level difference.
    pub fn integral(&self, mut f: impl FnMut(f64) -> f64) -> f64 {
        self.bins().map(|(grey, area)| area * f(grey)).sum()
    }

    /// Empties the bins for a contact whose pixels cover this area each.
    pub(crate) fn clear(&mut self, pixel_area_m2: f64) {
        self.area_m2.fill(0.0);
        self.pixel_area_m2 = pixel_area_m2;
    }

    /// Adds a number of pixels of one difference.
    pub(crate) fn add_many(&mut self, difference: f32, pixels: f64) {
        let place = f64::from(difference.clamp(-255.0, 255.0)) - f64::from(LEAST);
        let below = place as usize;
        let (share, area) = (place - below as f64, pixels * self.pixel_area_m2);
        self.area_m2[below] += (1.0 - share) * area;
        self.area_m2[below + 1] += share * area;
    }

    /// Grey level and area of the bins that are not empty.
    pub(crate) fn bins(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let grey = |bin: usize| (bin as i32 + LEAST) as f64;
        self.area_m2
            .iter()
            .enumerate()
            .filter(|(_, area)| **area != 0.0)
            .map(move |(bin, area)| (grey(bin), *area))
    }

    pub(crate) fn pixel_area_m2(&self) -> f64 {
        self.pixel_area_m2
    }

    /// The greatest grey level of the contact.
    pub(crate) fn greatest(&self) -> f64 {
        self.bins().map(|(grey, _)| grey).fold(0.0, f64::max)
    }
}
