//! What is known before a search: the block, the guide, the errors of the sensor, and the priors of
//! the parameters.

use crate::covariance::{Observed, ObservedCells};
use crate::fit::Prior;
use crate::forward::Forward;
use crate::parameters::{Coordinate, LARGEST_POISSON_RATIO, Parameters, Place};
use crate::picture::{Cells, extent};
use crate::scan::Scan;
use crate::tissue_block::{PressureProfile, SensorErrors, TissueBlock};
use std::sync::Arc;
use tactile_elasticity::{ElasticityError, Quantity};
use tactile_fem::{Guide, Interface, Kinematics};

/// Prior standard deviation of an inclusion's elongations (logarithms).
const ELONGATION: f64 = 0.2;

/// With fewer rings the shape of an inclusion is not resolved.
const MIN_RINGS: usize = 8;

/// Fraction of the guide's radius within which pressures are used. Further out the singular rim
/// dominates, where meshes differ by several per cent.
pub(crate) const USED_FACE: f64 = 0.75;

/// Radial displacement of tissue under a face, relative to the radius and the mean strain of the
/// block, and its standard error. For incompressible tissue it is half the strain at that depth,
/// which exceeds the mean by several tenths because the strain decreases with depth. Solutions in
/// three dimensions give 0.53 to 0.70.
const CARRIED: (f64, f64) = (0.6, 0.1);

/// Spread of the load below the face ([`Place::spread`]), and its standard error. With half of it,
/// balls of 11 mm, 4 mm off the axis, seemed 0.15 mm further out, by two standard errors.
const SPREAD: (f64, f64) = (0.13, 0.15);

/// Default standard error of the logarithm of an inclusion's height over its width: the 95 % range
/// extends from 1 : 1.75 to 1.75 : 1.
const SHAPE_ERROR: f64 = 0.29;

/// Finds a spheroidal inclusion in a block from the pressure on a guide's face at several
/// approaches.
///
/// The maximum a posteriori estimate is found by Levenberg–Marquardt with finite-strain finite
/// elements, from several starts. The unknowns are ln D, ln d, ln E₁, the height over width of the
/// inclusion, ln E₀, the block's height, ν and the approach zero. A score test first decides
/// whether an inclusion would explain more than the homogeneous block. Intervals follow the
/// posterior along ln E₁. The probability of an inclusion follows from the evidence with and
/// without one.
///
/// ```no_run
/// use core::ops::ControlFlow;
/// use tactile_fem::{Guide, GuideLayer, Material};
/// use tactile_inclusion::{
///     AssumedInclusion, InclusionSearch, PressureProfile, SensorErrors, TissueBlock,
/// };
///
/// # fn example(radii_m: Vec<f64>, frames: Vec<PressureProfile>) -> Result<(), tactile_elasticity::ElasticityError> {
/// let layer = GuideLayer { thickness_m: 10e-3, material: Material::new(60e3, 0.495)? };
/// let guide = Guide::new(vec![layer], 16e-3)?;
/// let search = InclusionSearch::new(TissueBlock::new(30e-3, 40e-3)?, guide)?;
/// // A sensor whose calibration is twice as good as usual.
/// let search =
///     search.with_sensor_errors(SensorErrors { common: 1.5e-3, ..SensorErrors::default() })?;
/// // Are two frames enough for a small lump?
/// let lump = AssumedInclusion {
///     diameter_m: 8e-3,
///     depth_m: 4e-3,
///     youngs_modulus_pa: 40e3,
///     block_modulus_pa: 5e3,
/// };
/// let errors =
///     search.expected_errors(&lump, &[1.5e-3, 3e-3], &radii_m, &vec![1.0; radii_m.len()])?;
/// println!("its diameter would be known within {:.0} %", 100.0 * errors.diameter);
/// let estimate = search.search_with_progress(&radii_m, &frames, &mut |progress| {
///     println!("{} of {}", progress.done, progress.total);
///     ControlFlow::Continue(())
/// })?;
/// if let (true, Some(inclusion)) = (estimate.found, &estimate.inclusion) {
///     println!("{:?}", inclusion.diameter_m);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone)]
pub struct InclusionSearch {
    specimen: TissueBlock,
    guide: Guide,
    sensor: SensorErrors,
    shape_error: f64,
}

impl InclusionSearch {
    /// A search in a block under a guide, with [`SensorErrors::default`].
    ///
    /// # Errors
    /// An error for a block that is no wider than the guide.
    pub fn new(specimen: TissueBlock, guide: Guide) -> Result<Self, ElasticityError> {
        if specimen.radius_m() <= guide.radius_m() {
            return Err(Quantity::Radius.beyond(specimen.radius_m(), guide.radius_m()));
        }
        Ok(Self {
            specimen,
            guide,
            sensor: SensorErrors::default(),
            shape_error: SHAPE_ERROR,
        })
    }

    /// Sets the standard error of the logarithm of an inclusion's height over its width (default
    /// 0.29). The ratio is fitted with the other parameters, and its uncertainty enters the
    /// intervals. With 0 every inclusion is a ball.
    ///
    /// # Errors
    /// An error for a negative value or NaN.
    pub fn with_shape_error(mut self, error: f64) -> Result<Self, ElasticityError> {
        self.shape_error = Quantity::StandardError.not_negative(error)?;
        Ok(self)
    }

    /// Sets the smooth errors of the sensor.
    ///
    /// # Errors
    /// An error for a negative value or NaN, or a correlation length or force error of zero.
    pub fn with_sensor_errors(mut self, errors: SensorErrors) -> Result<Self, ElasticityError> {
        self.sensor = errors.checked()?;
        Ok(self)
    }

    /// The values of all presses, with the approaches of each.
    pub(crate) fn observed_scan(
        &self,
        scan: &Scan,
    ) -> Result<(Observed, Vec<f64>), ElasticityError> {
        let (cells, frames) = scan.joined(USED_FACE * self.guide.radius_m())?;
        let radii_m: Vec<f64> = (cells.positions_m.iter())
            .map(|[x, y]| x.hypot(*y))
            .collect();
        let approaches_m: Vec<f64> = frames.iter().map(|frame| frame.approach_m).collect();
        let mut observed = self.observed(&radii_m, &frames)?;
        let [_, (_, zero_error_m), _] = self.specimen.known();
        observed.cells = Some(ObservedCells::new(
            cells,
            [scan.position_error_m, zero_error_m],
            &observed.values,
            &approaches_m,
        ));
        Ok((observed, approaches_m))
    }

    pub(crate) fn observed(
        &self,
        radii_m: &[f64],
        frames: &[PressureProfile],
    ) -> Result<Observed, ElasticityError> {
        let used = self.rings_within_reach(radii_m)?;
        let mut values = Vec::new();
        let mut white = Vec::new();
        for frame in frames {
            values.extend(used.iter().map(|&k| frame.pressure_pa[k]));
            white.extend(used.iter().map(|&k| frame.standard_error_pa[k]));
        }
        let area = core::f64::consts::PI * self.guide.radius_m().powi(2);
        for frame in frames {
            let mean = frame.pressure_pa.iter().sum::<f64>() / frame.pressure_pa.len() as f64;
            let expected = mean * area;
            values.push(frame.force_n.unwrap_or(expected));
            // An unknown force has no weight.
            white.push(if frame.force_n.is_some() {
                0.0
            } else {
                1e3 * expected.abs()
            });
        }
        Ok(Observed {
            radii_m: used.iter().map(|&k| radii_m[k]).collect(),
            values,
            white,
            frames: frames.len(),
            cells: None,
        })
    }

    /// Priors of the effects of each approach's own error, if there is one. Pressures are nearly
    /// proportional to the approach.
    pub(crate) fn approach_priors(&self, presses: usize, approaches_m: &[f64]) -> Vec<Prior> {
        let error_m = self.specimen.each_approach_error_m();
        let all = approaches_m
            .iter()
            .cycle()
            .take(presses * approaches_m.len());
        let priors = all.filter(|_| error_m > 0.0).enumerate();
        priors
            .map(|(k, approach)| Prior::new(Coordinate::Pressed(k), (0.0, error_m / approach)))
            .collect()
    }

    pub(crate) fn forward(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        interface: Interface,
        fineness: usize,
    ) -> Forward {
        Forward {
            guide: self.guide.clone(),
            block_radius_m: self.specimen.radius_m(),
            interface,
            approaches_m: approaches_m.to_vec(),
            radii_m: observed.radii_m.clone(),
            cells: observed.cells.as_ref().map(|cells| Cells {
                positions: Arc::clone(&cells.positions),
                plain: None,
                squeezed: (approaches_m.iter())
                    .map(|approach| approach / self.specimen.height_m())
                    .collect(),
                face_radius_m: self.guide.radius_m(),
                reach_m: USED_FACE * self.guide.radius_m(),
            }),
            fineness,
            kinematics: Kinematics::Finite,
        }
    }

    pub(crate) fn known_block(&self, block_modulus_pa: f64) -> Parameters {
        Parameters {
            block_modulus_pa,
            lump: None,
            place: Place {
                carried: CARRIED.0,
                spread: SPREAD.0,
                ..Place::default()
            },
            second: None,
            strayed_m: Vec::new(),
            pressed: Vec::new(),
            zero_m: 0.0,
            height_m: self.specimen.height_m(),
            poisson_ratio: self.specimen.poisson_ratio().min(LARGEST_POISSON_RATIO),
        }
    }

    /// Priors of the block. `guess` is used for its modulus if none is stated.
    pub(crate) fn block_priors(&self, guess: f64) -> Vec<Prior> {
        let [height, zero, (poisson_ratio, error)] = self.specimen.known();
        let poisson = (poisson_ratio.min(LARGEST_POISSON_RATIO), error);
        // Three decades on either side.
        let modulus = self.specimen.block_modulus().unwrap_or((guess.ln(), 3.5));
        vec![
            Prior::new(Coordinate::BlockModulus, modulus),
            Prior::new(Coordinate::Zero, zero),
            Prior::new(Coordinate::Height, height),
            Prior::new(Coordinate::PoissonRatio, poisson),
        ]
    }

    /// Priors of the sizes, depths and contrasts that a face of this radius can detect. The 95 %
    /// ranges are 0.2 to 2 radii for D, 0.06 to 1.5 radii for d, and 0.4 to 47 times E₀ for E₁. The
    /// shape has a prior unless it is certainly a ball.
    pub(crate) fn lump_priors(&self, block_modulus_pa: f64) -> Vec<Prior> {
        let face = self.guide.radius_m();
        let mut priors = vec![
            Prior::new(Coordinate::Diameter, ((0.65 * face).ln(), 0.6)),
            Prior::new(Coordinate::Depth, ((0.3 * face).ln(), 0.8)),
            Prior::new(
                Coordinate::LumpModulus,
                ((4.5 * block_modulus_pa).ln(), 1.2),
            ),
        ];
        if self.shape_error > 0.0 {
            priors.push(Prior::new(Coordinate::Aspect, (0.0, self.shape_error)));
        }
        priors
    }

    /// Priors of the inclusion's position, if it is observable: under the face, with axes up to
    /// 1.75 : 1 in two of three cases. Also priors of the deviations of presses from their stated
    /// positions.
    pub(crate) fn place_priors(&self, observed: &Observed) -> Vec<Prior> {
        let Some(cells) = &observed.cells else {
            return Vec::new();
        };
        let axes_m = &cells.positions.axes_m;
        let ([x, y], half_width) = extent(axes_m);
        let centre = 0.4 * self.guide.radius_m() + half_width;
        let mut known = vec![
            Prior::new(Coordinate::Centre(0), (x, centre)),
            Prior::new(Coordinate::Centre(1), (y, centre)),
            Prior::new(Coordinate::Elongation(0), (0.0, ELONGATION)),
            Prior::new(Coordinate::Elongation(1), (0.0, ELONGATION)),
            Prior::new(Coordinate::Carried, CARRIED),
            Prior::new(Coordinate::Spread, SPREAD),
        ];
        let error = cells.place_error_m;
        if error > 0.0 {
            let strayed = |press| [0, 1].map(|axis| Coordinate::Strayed(press, axis));
            let strayed = (0..axes_m.len()).flat_map(strayed);
            known.extend(strayed.map(|coordinate| Prior::new(coordinate, (0.0, error))));
        }
        known
    }

    pub(crate) fn sensor(&self) -> &SensorErrors {
        &self.sensor
    }

    /// The guide.
    pub fn guide(&self) -> &Guide {
        &self.guide
    }

    /// The block.
    pub fn specimen(&self) -> &TissueBlock {
        &self.specimen
    }

    /// Indices of the rings within reach.
    pub(crate) fn rings_within_reach(
        &self,
        radii_m: &[f64],
    ) -> Result<Vec<usize>, ElasticityError> {
        let limit = USED_FACE * self.guide.radius_m();
        let used: Vec<usize> = (0..radii_m.len())
            .filter(|&k| radii_m[k] <= limit)
            .collect();
        Quantity::Samples.at_least(used.len(), MIN_RINGS)?;
        Ok(used)
    }
}
