//! Parameters that determine the pressure of a block.

/// Relative step of the difference quotients. The truncation error is about as large as the step;
/// rounding and the unbalanced force of 1e-8 are a hundred times smaller.
const STEP: f64 = 1e-5;

/// Position of an inclusion as seen from above, and the elongation of its outline.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Place {
    /// Centre (x, y) relative to the axis of the face.
    pub centre_m: [f64; 2],
    /// Half the logarithm of the ratio of its axes, times cosine and sine of twice the angle from x
    /// to the longer axis.
    pub elongation: [f64; 2],
    /// Displacement of the inclusion by tissue that flows away from the axis, relative to its
    /// distance from the axis and to the approach over the block's height.
    pub carried: f64,
    /// Spread of the load away from the axis below the face, relative to the distance from the axis
    /// and to the cube of the depth in radii of the face.
    pub spread: f64,
}

/// The unknowns of a block.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Parameters {
    pub block_modulus_pa: f64,
    pub lump: Option<LumpParameters>,
    /// Position of the inclusion, on which the pressures of cells depend.
    pub place: Place,
    /// A second inclusion and its position.
    pub second: Option<(LumpParameters, Place)>,
    /// Deviation of the axis of each press from its stated position, for the first presses. The
    /// others have none.
    pub strayed_m: Vec<[f64; 2]>,
    /// Logarithms of the factors of the approaches of single frames, press by press. Those left out
    /// are zero.
    pub pressed: Vec<f64>,
    /// Zero error: the amount by which the measured approaches are too small.
    pub zero_m: f64,
    pub height_m: f64,
    /// Poisson ratio of tissue and inclusion.
    pub poisson_ratio: f64,
}

/// The unknowns of an inclusion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LumpParameters {
    /// Diameter of the ball of equal volume.
    pub diameter_m: f64,
    pub depth_m: f64,
    pub youngs_modulus_pa: f64,
    /// Height over width.
    pub aspect: f64,
}

impl LumpParameters {
    pub(crate) fn ball(diameter_m: f64, depth_m: f64, youngs_modulus_pa: f64) -> Self {
        Self {
            diameter_m,
            depth_m,
            youngs_modulus_pa,
            aspect: 1.0,
        }
    }

    /// Width across the axis and height along it.
    pub(crate) fn axes_m(&self) -> [f64; 2] {
        let root = self.aspect.cbrt();
        [self.diameter_m / root, self.diameter_m * root * root]
    }
}

/// An unknown as used in the fit. Lengths and moduli are logarithms, whose errors are nearly
/// Gaussian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Coordinate {
    /// ln E₀.
    BlockModulus,
    /// ln D.
    Diameter,
    /// ln d.
    Depth,
    /// ln E₁.
    LumpModulus,
    /// Logarithm of the height over the width.
    Aspect,
    /// Zero of the approaches, in metres.
    Zero,
    /// ln H.
    Height,
    /// ν.
    PoissonRatio,
    /// x and y of the inclusion's centre, in metres.
    Centre(usize),
    /// Elongation of the inclusion along x and between the axes.
    Elongation(usize),
    /// Displacement of the inclusion away from the axis.
    Carried,
    /// Spread of the load away from the axis.
    Spread,
    /// x and y of the deviation of a press from its stated position, in metres.
    Strayed(usize, usize),
    /// Logarithm of the factor of the approach of a press's frame.
    Pressed(usize),
    /// A coordinate of the second inclusion.
    OfSecond(&'static Coordinate),
}

impl Coordinate {
    /// A change of this coordinate that matters about as much as a change of a logarithm by 1.
    pub(crate) fn unit(self) -> f64 {
        match self {
            Self::Zero => 1e-3,
            Self::Centre(_) | Self::Strayed(..) => 1e-2,
            Self::PoissonRatio => -1e-1,
            Self::OfSecond(coordinate) => coordinate.unit(),
            _ => 1.0,
        }
    }

    /// The corresponding coordinate of the second inclusion. `None` if it is not a coordinate of an
    /// inclusion.
    pub(crate) fn of_second(self) -> Option<Self> {
        OF_LUMP.iter().find(|c| **c == self).map(Self::OfSecond)
    }

    /// Whether a block without an inclusion has this coordinate.
    pub(crate) fn is_of_block(self) -> bool {
        BLOCK.contains(&self) || matches!(self, Self::Pressed(_))
    }

    /// Whether a block solved with its inclusion on the axis is independent of this coordinate.
    pub(crate) fn is_place(self) -> bool {
        matches!(
            self,
            Self::Centre(_)
                | Self::Elongation(_)
                | Self::Carried
                | Self::Spread
                | Self::Strayed(..)
                | Self::Pressed(_)
        ) || matches!(self, Self::OfSecond(coordinate) if coordinate.is_place())
    }
}

/// Coordinates of the block.
pub(crate) const BLOCK: [Coordinate; 4] = [
    Coordinate::BlockModulus,
    Coordinate::Zero,
    Coordinate::Height,
    Coordinate::PoissonRatio,
];

/// Coordinates of an inclusion.
pub(crate) static OF_LUMP: [Coordinate; 10] = [
    Coordinate::Diameter,
    Coordinate::Depth,
    Coordinate::LumpModulus,
    Coordinate::Aspect,
    Coordinate::Centre(0),
    Coordinate::Centre(1),
    Coordinate::Elongation(0),
    Coordinate::Elongation(1),
    Coordinate::Carried,
    Coordinate::Spread,
];

/// Maximum Poisson ratio of a fit. There the pressure differs from that of an incompressible block
/// by 0.1 %. Above it the derivatives by sizes lose digits as the bulk modulus grows.
pub(crate) const LARGEST_POISSON_RATIO: f64 = 0.499;

impl Parameters {
    pub(crate) fn get(&self, coordinate: Coordinate) -> f64 {
        let lump = |value: fn(&LumpParameters) -> f64| {
            self.lump.as_ref().map_or(0.0, |lump| value(lump).ln())
        };
        match coordinate {
            Coordinate::BlockModulus => self.block_modulus_pa.ln(),
            Coordinate::Diameter => lump(|lump| lump.diameter_m),
            Coordinate::Depth => lump(|lump| lump.depth_m),
            Coordinate::LumpModulus => lump(|lump| lump.youngs_modulus_pa),
            Coordinate::Aspect => lump(|lump| lump.aspect),
            Coordinate::Zero => self.zero_m,
            Coordinate::Height => self.height_m.ln(),
            Coordinate::PoissonRatio => self.poisson_ratio,
            Coordinate::Centre(axis) => self.place.centre_m[axis],
            Coordinate::Elongation(part) => self.place.elongation[part],
            Coordinate::Carried => self.place.carried,
            Coordinate::Spread => self.place.spread,
            Coordinate::OfSecond(coordinate) => self.swapped().get(*coordinate),
            Coordinate::Pressed(frame) => self.pressed.get(frame).copied().unwrap_or(0.0),
            Coordinate::Strayed(press, axis) => self
                .strayed_m
                .get(press)
                .map_or(0.0, |strayed| strayed[axis]),
        }
    }

    /// These parameters with the second inclusion first.
    pub(crate) fn swapped(&self) -> Self {
        let mut swapped = self.clone();
        if let Some((lump, place)) = self.second {
            swapped.second = self.lump.map(|first| (first, self.place));
            (swapped.lump, swapped.place) = (Some(lump), place);
        }
        swapped
    }

    /// These parameters with one coordinate changed by `step`.
    pub(crate) fn moved(&self, coordinate: Coordinate, step: f64) -> Self {
        if let Coordinate::OfSecond(coordinate) = coordinate {
            return self.swapped().moved(*coordinate, step).swapped();
        }
        let mut moved = self.clone();
        let factor = step.exp();
        match (coordinate, &mut moved.lump) {
            (Coordinate::BlockModulus, _) => moved.block_modulus_pa *= factor,
            (Coordinate::Diameter, Some(lump)) => lump.diameter_m *= factor,
            (Coordinate::Depth, Some(lump)) => lump.depth_m *= factor,
            (Coordinate::LumpModulus, Some(lump)) => lump.youngs_modulus_pa *= factor,
            (Coordinate::Aspect, Some(lump)) => lump.aspect *= factor,
            (Coordinate::Zero, _) => moved.zero_m += step,
            (Coordinate::Height, _) => moved.height_m *= factor,
            (Coordinate::PoissonRatio, _) => {
                moved.poisson_ratio = (moved.poisson_ratio + step).min(LARGEST_POISSON_RATIO);
            }
            (Coordinate::Centre(axis), _) => moved.place.centre_m[axis] += step,
            (Coordinate::Elongation(part), _) => moved.place.elongation[part] += step,
            (Coordinate::Carried, _) => moved.place.carried += step,
            (Coordinate::Spread, _) => moved.place.spread += step,
            (Coordinate::Strayed(press, axis), _) => {
                if let Some(strayed) = moved.strayed_m.get_mut(press) {
                    strayed[axis] += step;
                }
            }
            (Coordinate::Pressed(frame), _) => {
                let count = moved.pressed.len().max(frame + 1);
                moved.pressed.resize(count, 0.0);
                moved.pressed[frame] += step;
            }
            // A block without an inclusion has no sizes.
            _ => {}
        }
        moved
    }

    /// Step of a difference quotient.
    ///
    /// For Poisson's ratio it is small compared with 1 − 2ν, because the bulk modulus is
    /// proportional to its reciprocal.
    pub(crate) fn small_step(&self, coordinate: Coordinate) -> f64 {
        match coordinate {
            Coordinate::PoissonRatio => -STEP * (1.0 - 2.0 * self.poisson_ratio),
            _ => STEP * coordinate.unit(),
        }
    }

    /// Whether an inclusion is closer to the surface or the stage than a fiftieth of its diameter,
    /// or is as tall as the block permits.
    pub(crate) fn is_at_boundary(&self) -> bool {
        self.lump.is_some_and(|lump| {
            let height = lump.axes_m()[1];
            let room = self.height_m - lump.depth_m - height;
            lump.depth_m.min(room) < 0.02 * height
        })
    }
}
