//! What is pressed.

/// The pressed object, as far as it is known.
///
/// ```
/// use tactile_imaging::Object;
/// // A ball's modulus comes from the contact alone; a punch's needs the strain, and so surfaces and matches.
/// let ball = Object::sphere(3e-3);
/// assert_eq!((ball.sphere_radius_m(), ball.needs_strain()), (Some(3e-3), false));
/// let punch = Object::FlatPunch { radius_m: 2e-3, poisson_ratio: 0.48 };
/// assert_eq!((punch.sphere_radius_m(), punch.needs_strain()), (None, true));
/// assert_eq!(ball, Object::Sphere { radius_m: 3e-3, poisson_ratio: Object::DEFAULT_POISSON_RATIO });
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(tag = "shape", rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum Object {
    /// A ball.
    Sphere {
        /// Its radius in metres.
        radius_m: f64,
        /// Its Poisson ratio.
        poisson_ratio: f64,
    },
    /// A flat-ended cylinder: loaded uniaxially.
    FlatPunch {
        /// Its radius in metres.
        radius_m: f64,
        /// Its Poisson ratio.
        poisson_ratio: f64,
    },
    /// Nothing is known of its shape: stress over strain is all there is.
    Unknown {
        /// Its Poisson ratio.
        poisson_ratio: f64,
    },
}

impl Object {
    /// Poisson's ratio where none is given: rubber, incompressible.
    pub const DEFAULT_POISSON_RATIO: f64 = 0.5;

    /// A rubber ball of this radius in metres.
    pub fn sphere(radius_m: f64) -> Self {
        Self::Sphere {
            radius_m,
            poisson_ratio: Self::DEFAULT_POISSON_RATIO,
        }
    }

    /// The radius of a ball.
    pub fn sphere_radius_m(&self) -> Option<f64> {
        if let Self::Sphere { radius_m, .. } = self {
            Some(*radius_m)
        } else {
            None
        }
    }

    /// Whether the estimator that fits this object best looks at strain; a ball's looks at the contact alone.
    pub fn needs_strain(&self) -> bool {
        !matches!(self, Self::Sphere { .. })
    }
}
