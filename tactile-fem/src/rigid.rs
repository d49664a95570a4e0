//! Rigid bodies of revolution.

/// The shape of a rigid body of revolution, with its lowest point at height zero.
#[derive(Debug, Clone, Copy, PartialEq)]
// A flat alone is pressed on objects; the others have the closed forms that tests compare with.
#[cfg_attr(not(test), allow(dead_code))]
pub(crate) enum RigidShape {
    /// A plane at right angles to the axis.
    Flat,
    /// A sphere of this radius.
    Sphere {
        /// Its radius, in metres.
        radius_m: f64,
    },
    /// The paraboloid r² / 2R, of which Hertz's theory speaks.
    Paraboloid {
        /// Its radius of curvature at the pole, in metres.
        radius_m: f64,
    },
    /// The flat end of a cylinder.
    Punch {
        /// Its radius, in metres.
        radius_m: f64,
    },
    /// A cone.
    Cone {
        /// Between its axis and its surface, in radians.
        half_angle_rad: f64,
    },
}

impl RigidShape {
    /// Height at radius r, its slope and second derivative; `None` beyond the shape.
    pub(crate) fn profile(self, r: f64) -> Option<[f64; 3]> {
        match self {
            Self::Flat => Some([0.0; 3]),
            Self::Punch { radius_m } => (r <= radius_m).then_some([0.0; 3]),
            Self::Sphere { radius_m } => {
                let below = radius_m * radius_m - r * r;
                if below <= 0.0 {
                    return None;
                }
                let root = below.sqrt();
                let height = r * r / (radius_m + root);
                Some([height, r / root, radius_m * radius_m / (below * root)])
            }
            Self::Paraboloid { radius_m } => {
                Some([r * r / (2.0 * radius_m), r / radius_m, 1.0 / radius_m])
            }
            Self::Cone { half_angle_rad } => {
                let slope = 1.0 / half_angle_rad.tan();
                Some([r * slope, slope, 0.0])
            }
        }
    }
}
