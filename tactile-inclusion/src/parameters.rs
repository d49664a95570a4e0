//! What a block's pressure depends on.

/// A block's unknowns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Parameters {
    pub(crate) block_modulus_pa: f64,
    pub(crate) lump: Option<LumpParameters>,
    /// What the approaches read too little.
    pub(crate) zero_m: f64,
    pub(crate) height_m: f64,
    /// Of tissue and inclusion.
    pub(crate) poisson_ratio: f64,
}

/// An inclusion's unknowns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LumpParameters {
    pub(crate) diameter_m: f64,
    pub(crate) depth_m: f64,
    pub(crate) youngs_modulus_pa: f64,
}

/// An unknown as the fit sees it: logarithms of lengths and moduli, where errors are nearly Gaussian.
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
    /// Zero of the approaches, in metres.
    Zero,
    /// ln H.
    Height,
    /// ν.
    PoissonRatio,
}

impl Coordinate {
    /// A change of this coordinate that matters about as much as one of a logarithm by 1.
    pub(crate) fn unit(self) -> f64 {
        match self {
            Self::Zero => 1e-3,
            Self::PoissonRatio => -1e-1,
            _ => 1.0,
        }
    }
}

/// Relative step of the difference quotients: the truncation error is about as large as the step,
/// rounding and the unbalanced force of 1e-8 stay a hundred times below.
const STEP: f64 = 1e-5;

/// Largest Poisson ratio of a fit: the pressure differs from an incompressible block's by 0.1 %, and beyond it
/// the derivatives by sizes lose digits as the bulk modulus grows.
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
            Coordinate::Zero => self.zero_m,
            Coordinate::Height => self.height_m.ln(),
            Coordinate::PoissonRatio => self.poisson_ratio,
        }
    }

    /// These parameters with one coordinate changed by `step`.
    pub(crate) fn moved(&self, coordinate: Coordinate, step: f64) -> Self {
        let mut moved = *self;
        let factor = step.exp();
        match (coordinate, &mut moved.lump) {
            (Coordinate::BlockModulus, _) => moved.block_modulus_pa *= factor,
            (Coordinate::Diameter, Some(lump)) => lump.diameter_m *= factor,
            (Coordinate::Depth, Some(lump)) => lump.depth_m *= factor,
            (Coordinate::LumpModulus, Some(lump)) => lump.youngs_modulus_pa *= factor,
            (Coordinate::Diameter | Coordinate::Depth | Coordinate::LumpModulus, None) => {}
            (Coordinate::Zero, _) => moved.zero_m += step,
            (Coordinate::Height, _) => moved.height_m *= factor,
            (Coordinate::PoissonRatio, _) => {
                moved.poisson_ratio = (moved.poisson_ratio + step).min(LARGEST_POISSON_RATIO);
            }
        }
        moved
    }

    /// Step of a difference quotient.
    ///
    /// By Poisson's ratio it is small against 1 − 2ν: the bulk modulus grows as its reciprocal.
    pub(crate) fn small_step(&self, coordinate: Coordinate) -> f64 {
        match coordinate {
            Coordinate::PoissonRatio => -STEP * (1.0 - 2.0 * self.poisson_ratio),
            _ => STEP * coordinate.unit(),
        }
    }

    /// Whether an inclusion comes nearer to the surface or the stage than a fiftieth of its diameter,
    /// or is as tall as the block allows.
    pub(crate) fn is_at_boundary(&self) -> bool {
        self.lump.is_some_and(|lump| {
            let room = self.height_m - lump.depth_m - lump.diameter_m;
            lump.depth_m.min(room) < 0.02 * lump.diameter_m
        })
    }
}
