//! Plausible ranges of sizes, moduli and forces. A value outside is likely in a wrong unit.
use super::files::number;
use serde::de::{self, Deserialize, Deserializer};

/// A quantity that users enter by hand, with its plausible range for an optical tactile sensor and
/// its objects.
///
/// ```
/// use tactile_files::io::InputQuantity;
/// // 3 mm is a plausible length, 3 m is not.
/// assert!(InputQuantity::Length.allows(3e-3) && !InputQuantity::Length.allows(3.0));
/// assert!(InputQuantity::Modulus.allows(60e3) && !InputQuantity::Modulus.allows(f64::NAN));
/// assert!(InputQuantity::PixelSide.allows(40e-6));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum InputQuantity {
    /// Radii, thicknesses and heights in metres.
    Length,
    /// The side of a pixel on the sensing surface in metres.
    PixelSide,
    /// Young's modulus in pascals.
    Modulus,
    /// Force in newtons.
    Force,
}

impl InputQuantity {
    /// The largest ratio of a pixel's sides.
    pub const MOST_UNEQUAL_SIDES: f64 = 10.0;

    /// Least and greatest value in SI units.
    #[must_use]
    pub fn limits(self) -> [f64; 2] {
        match self {
            // From the thinnest film to a block of one metre.
            Self::Length => [1e-7, 1.0],
            // From a microscope's pixel to one that spans a small sensor.
            Self::PixelSide => [1e-8, 5e-3],
            // From the softest gel to beyond diamond.
            Self::Modulus => [1.0, 1e13],
            // No gel survives more.
            Self::Force => [1e-9, 1e3],
        }
    }

    /// Whether a value lies within the limits. NaN does not.
    #[must_use]
    pub fn allows(self, value: f64) -> bool {
        let [least, greatest] = self.limits();
        (least..=greatest).contains(&value)
    }

    fn expected(self) -> &'static str {
        match self {
            Self::Length => "a length in metres from 1e-7 to 1 (3 mm are 3e-3)",
            Self::PixelSide => "the side of a pixel in metres from 1e-8 to 5e-3 (40 µm are 40e-6)",
            Self::Modulus => "a modulus in pascals from 1 to 1e13 (60 kPa are 60e3)",
            Self::Force => "a force in newtons from 1e-9 to 1000 (700 mN are 0.7)",
        }
    }
}

pub(crate) fn length<'de, D: Deserializer<'de>, T: From<f64>>(d: D) -> Result<T, D::Error> {
    number(d, InputQuantity::Length.expected(), |v| {
        InputQuantity::Length.allows(v)
    })
}

pub(crate) fn modulus<'de, D: Deserializer<'de>, T: From<f64>>(d: D) -> Result<T, D::Error> {
    number(d, InputQuantity::Modulus.expected(), |v| {
        InputQuantity::Modulus.allows(v)
    })
}

pub(crate) fn force<'de, D: Deserializer<'de>, T: From<f64>>(d: D) -> Result<T, D::Error> {
    number(d, InputQuantity::Force.expected(), |v| {
        InputQuantity::Force.allows(v)
    })
}

/// Width and height of a pixel. Their ratio is at most ten.
pub(crate) fn pixel_size<'de, D: Deserializer<'de>, T: From<[f64; 2]>>(
    d: D,
) -> Result<T, D::Error> {
    #[derive(serde::Deserialize)]
    struct Side(#[serde(deserialize_with = "side")] f64);
    let [width, height] = <[Side; 2]>::deserialize(d)?.map(|side| side.0);
    if (width / height).max(height / width) > InputQuantity::MOST_UNEQUAL_SIDES {
        return Err(de::Error::custom(format_args!(
            "a pixel cannot have sides of {width:e} and {height:e} m: is one of them in another \
             unit?"
        )));
    }
    Ok([width, height].into())
}

fn side<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    number(d, InputQuantity::PixelSide.expected(), |v| {
        InputQuantity::PixelSide.allows(v)
    })
}
