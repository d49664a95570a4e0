//! Where displacement gradients come from, and where they are sampled.

use crate::error::{ElasticityError, Quantity, positive};
use crate::scalar::{narrow, widen};
use nalgebra::{Matrix3, Point3, RealField};

/// A field of displacement gradients H = ∂u/∂X. Any closure `Fn(&Point3<T>) -> Matrix3<T>` is one.
///
/// ```
/// use nalgebra::{Matrix3, Point3};
/// use tactile_elasticity::field::DisplacementGradient;
///
/// // Shear that grows with depth, as a closure.
/// let shear = |p: &Point3<f64>| Matrix3::new(0.0, 0.0, 0.2 * p.z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
/// assert_eq!(shear.displacement_gradient(&Point3::new(0.0, 0.0, 0.5))[(0, 2)], 0.1);
/// ```
pub trait DisplacementGradient<T: RealField + Copy> {
    /// H at a point of the undeformed material.
    fn displacement_gradient(&self, point: &Point3<T>) -> Matrix3<T>;
}

impl<T: RealField + Copy, F: Fn(&Point3<T>) -> Matrix3<T>> DisplacementGradient<T> for F {
    fn displacement_gradient(&self, point: &Point3<T>) -> Matrix3<T> {
        self(point)
    }
}

/// Turns the Jacobian of a map of positions (a spline, say) into a displacement gradient: H = ∇f − I.
///
/// ```
/// use nalgebra::{Matrix3, Point3};
/// use tactile_elasticity::field::{DisplacementGradient, JacobianOf};
///
/// // A map that stretches by 5 % has the displacement gradient 0.05.
/// let stretch = JacobianOf(|_: &Point3<f64>| Matrix3::from_diagonal_element(1.05));
/// assert!((stretch.displacement_gradient(&Point3::origin())[(1, 1)] - 0.05).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct JacobianOf<F>(
    /// The Jacobian.
    pub F,
);

impl<T: RealField + Copy, F: Fn(&Point3<T>) -> Matrix3<T>> DisplacementGradient<T>
    for JacobianOf<F>
{
    fn displacement_gradient(&self, point: &Point3<T>) -> Matrix3<T> {
        (self.0)(point) - Matrix3::identity()
    }
}

/// Points with the area or volume each stands for.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(serialize = "T: nalgebra::Scalar + serde::Serialize"))
)]
pub struct Samples<T: RealField> {
    /// Where.
    pub points: Vec<Point3<T>>,
    /// How much each counts.
    pub weights: Vec<T>,
}

impl<T: RealField + Copy> Samples<T> {
    /// The cell centres of a box, `counts` along x, y and z; each weighs its cell's volume (area where one side is flat).
    ///
    /// # Errors
    /// [`ElasticityError::NotFinite`] corners, [`ElasticityError::TooFewLoads`] where a count is zero.
    ///
    /// ```
    /// use nalgebra::Point3;
    /// use tactile_elasticity::field::Samples;
    ///
    /// let block = Samples::grid(Point3::origin(), Point3::new(2.0, 1.0, 1.0), [4, 2, 2])?;
    /// assert_eq!((block.points.len(), block.points[0]), (16, Point3::new(0.25, 0.25, 0.25)));
    /// assert!((block.weights.iter().sum::<f64>() - 2.0).abs() < 1e-14);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn grid(
        low: Point3<T>,
        high: Point3<T>,
        counts: [usize; 3],
    ) -> Result<Self, ElasticityError> {
        if low.iter().chain(high.iter()).any(|x| !x.is_finite()) {
            return Err(ElasticityError::NotFinite {
                quantity: Quantity::Distance,
            });
        }
        if counts.contains(&0) {
            return Err(ElasticityError::TooFewLoads {
                expected: 1,
                found: 0,
            });
        }
        let size = high - low;
        let at =
            |k: usize, i: usize| low[k] + size[k] * narrow((i as f64 + 0.5) / counts[k] as f64);
        let mut points = Vec::with_capacity(counts.iter().product());
        for z in 0..counts[2] {
            for y in 0..counts[1] {
                points.extend((0..counts[0]).map(|x| Point3::new(at(0, x), at(1, y), at(2, z))));
            }
        }
        let cell = (0..3).fold(T::one(), |v, k| {
            if size[k] == T::zero() {
                v
            } else {
                v * size[k].abs() / narrow(counts[k] as f64)
            }
        });
        Ok(Self {
            weights: vec![cell; points.len()],
            points,
        })
    }

    /// The volume of a contact: a disc of radius a around `centre`, from its z down to `depth` above it, in rings and sectors of
    /// equal volume.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`] radius or depth, [`ElasticityError::TooFewLoads`] where a count is zero.
    ///
    /// ```
    /// use nalgebra::Point3;
    /// use tactile_elasticity::field::Samples;
    /// let contact = Samples::contact_volume(Point3::origin(), 1e-3, 2e-3, [8, 24, 4])?;
    /// let volume: f64 = contact.weights.iter().sum();
    /// assert!((volume / (std::f64::consts::PI * 2e-9) - 1.0).abs() < 1e-12);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn contact_volume(
        centre: Point3<T>,
        radius: T,
        depth: T,
        [rings, sectors, layers]: [usize; 3],
    ) -> Result<Self, ElasticityError> {
        positive(widen(radius), Quantity::ContactRadius)?;
        positive(widen(depth), Quantity::Thickness)?;
        if [rings, sectors, layers].contains(&0) {
            return Err(ElasticityError::TooFewLoads {
                expected: 1,
                found: 0,
            });
        }
        let mut points = Vec::with_capacity(rings * sectors * layers);
        for layer in 0..layers {
            let z = depth * narrow((layer as f64 + 0.5) / layers as f64);
            for ring in 0..rings {
                let r = radius * narrow::<T>((ring as f64 + 0.5) / rings as f64).sqrt();
                for sector in 0..sectors {
                    let angle: T = T::two_pi() * narrow((sector as f64 + 0.5) / sectors as f64);
                    points.push(Point3::new(
                        centre.x + r * angle.cos(),
                        centre.y + r * angle.sin(),
                        centre.z + z,
                    ));
                }
            }
        }
        let cell = T::pi() * radius * radius * depth / narrow(points.len() as f64);
        Ok(Self {
            weights: vec![cell; points.len()],
            points,
        })
    }
}
