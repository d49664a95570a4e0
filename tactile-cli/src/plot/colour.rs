//! Colours for categories (readable for the colour-blind) and perceptually uniform colour maps.

/// An opaque sRGB colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Colour(pub u8, pub u8, pub u8);

impl Colour {
    /// Black.
    pub(crate) const BLACK: Self = Self(0, 0, 0);
    /// Mid grey.
    pub(crate) const GREY: Self = Self(130, 130, 130);
    /// Blue of the Okabe–Ito palette.
    pub(crate) const BLUE: Self = Self(0, 114, 178);
    /// Vermilion of the Okabe–Ito palette.
    pub(crate) const RED: Self = Self(213, 94, 0);
    /// Orange of the Okabe–Ito palette.
    pub(crate) const ORANGE: Self = Self(230, 159, 0);
    /// Bluish green of the Okabe–Ito palette.
    pub(crate) const GREEN: Self = Self(0, 158, 115);
    /// Reddish purple of the Okabe–Ito palette.
    pub(crate) const PURPLE: Self = Self(204, 121, 167);
    /// Sky blue of the Okabe–Ito palette.
    pub(crate) const SKY: Self = Self(86, 180, 233);
    /// White.
    pub(crate) const WHITE: Self = Self(255, 255, 255);

    /// Colours told apart by people with any colour vision (Okabe & Ito 2008), in the order to take them.
    pub(crate) const CATEGORIES: [Self; 6] = [
        Self::BLUE,
        Self::ORANGE,
        Self::GREEN,
        Self::RED,
        Self::PURPLE,
        Self::SKY,
    ];
}

/// A map from values to colours; NaN is light grey.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub(crate) enum ColorMap {
    /// Viridis (van der Walt & Smith 2015): perceptually uniform, dark blue to yellow.
    #[default]
    Viridis,
    /// Linear grey, black to white: for camera frames.
    Grey,
}

/// Viridis at 17 equally spaced values; linear between them, within 2 levels of the 256-entry table.
const VIRIDIS: [[f64; 3]; 17] = [
    [68., 1., 84.],
    [72., 24., 106.],
    [71., 45., 123.],
    [66., 64., 134.],
    [59., 82., 139.],
    [51., 99., 141.],
    [44., 114., 142.],
    [38., 130., 142.],
    [33., 145., 140.],
    [31., 160., 136.],
    [40., 174., 128.],
    [63., 188., 115.],
    [94., 201., 98.],
    [132., 212., 75.],
    [173., 220., 48.],
    [216., 226., 25.],
    [253., 231., 37.],
];

impl ColorMap {
    /// The colour at `t`, held to [0, 1]; light grey where `t` is NaN.
    pub(super) fn at(self, t: f64) -> Colour {
        if t.is_nan() {
            return Colour(235, 235, 235);
        }
        match self {
            Self::Viridis => between(&VIRIDIS, t),
            Self::Grey => between(&[[0.0; 3], [255.0; 3]], t),
        }
    }
}

fn between(table: &[[f64; 3]], t: f64) -> Colour {
    let x = t.clamp(0.0, 1.0) * (table.len() - 1) as f64;
    let i = (x as usize).min(table.len() - 2);
    let mix = |k: usize| {
        let v = table[i][k] + (x - i as f64) * (table[i + 1][k] - table[i][k]);
        v.round() as u8
    };
    Colour(mix(0), mix(1), mix(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_run_from_end_to_end() {
        assert_eq!(ColorMap::Viridis.at(0.0), Colour(68, 1, 84));
        assert_eq!(ColorMap::Viridis.at(7.0), Colour(253, 231, 37));
        assert_eq!(ColorMap::Grey.at(0.5), Colour(128, 128, 128));
        assert_eq!(ColorMap::Viridis.at(f64::NAN), Colour(235, 235, 235));
    }
}
