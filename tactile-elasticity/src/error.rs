//! Errors of the input, one variant each.

use tactile_core::{CustomError, Readable};

/// Why a strain, a stress or a modulus cannot be computed.
///
/// ```
/// use tactile_elasticity::{ElasticityError, modulus::HertzSphere};
///
/// let error = HertzSphere::new(3e-3_f64, 0.7).unwrap_err();
/// assert_eq!(error, ElasticityError::PoissonRatio { found: 0.7 });
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum ElasticityError {
    /// An input is NaN or infinite.
    #[error("{quantity} is not a finite number")]
    NotFinite {
        /// The input.
        quantity: Quantity,
    },
    /// An input is not greater than zero, or NaN.
    #[error("{quantity} must be greater than zero and finite, found {}", Readable(*found))]
    NotPositive {
        /// The input.
        quantity: Quantity,
        /// The value given.
        found: f64,
    },
    /// An input is negative, or NaN.
    #[error("{quantity} must not be negative, found {}", Readable(*found))]
    Negative {
        /// The input.
        quantity: Quantity,
        /// The value given.
        found: f64,
    },
    /// A Poisson ratio is outside (−1, ½], the stable range of an isotropic solid.
    #[error("Poisson's ratio must lie in (-1, 1/2], found {}", Readable(*found))]
    PoissonRatio {
        /// The value given.
        found: f64,
    },
    /// det F = 0: the material has collapsed to a plane, a line or a point.
    #[error("the deformation gradient is singular: this measure does not exist")]
    SingularDeformation,
    /// det F < 0: the material is turned inside out.
    #[error("the deformation gradient turns the material inside out (det F = {determinant})")]
    InvertedDeformation {
        /// det F.
        determinant: f64,
    },
    /// The contact is at least as stiff as the other body alone, so no compliance remains for the
    /// sample.
    #[error(
        "the sample is stiffer than can be resolved through this waveguide or indenter{}",
        bounded_below(*.lower_bound_pa)
    )]
    StifferThanResolvable {
        /// 95 % lower limit of the modulus. `None` if the errors are unknown, or if the contact is
        /// stiffer than any sample could make it.
        lower_bound_pa: Option<f64>,
    },
    /// The contact of a load is outside the range of the law, and no other load is within it.
    #[error("load {load}: the contact is outside the range of the law")]
    BeyondLaw {
        /// Index of the load.
        load: usize,
    },
    /// The value of the strain measure along an axis depends on the stretches across it, so no
    /// stress along the axis is conjugate to it.
    #[error("no stress is conjugate to the strain measure {measure}")]
    NoConjugateStress {
        /// Name of the measure.
        measure: &'static str,
    },
    /// There are fewer usable loads than the estimator needs.
    #[error("{found} usable loads, at least {expected} are needed")]
    TooFewLoads {
        /// Number of loads that the estimator needs.
        expected: usize,
        /// Number of loads with the required quantities.
        found: usize,
    },
    /// All loads are equal, so they determine no slope.
    #[error("all loads are equal: a slope needs at least two different ones")]
    EqualLoads,
    /// The strain is zero: stress over strain is undefined.
    #[error("the strain is zero: stress over strain is undefined")]
    ZeroStrain,
    /// Consecutive loads are not in the order of time.
    #[error("load {load} was at {found_s} s, before the preceding load ({before_s} s)")]
    TimeDecreases {
        /// Index of the load.
        load: usize,
        /// Time of the preceding load.
        before_s: f64,
        /// Time of this load.
        found_s: f64,
    },
    /// Stress and strain have opposite signs.
    #[error("stress ({stress_pa} Pa) and strain ({strain}) have opposite signs")]
    OppositeSigns {
        /// The stress.
        stress_pa: f64,
        /// The strain.
        strain: f64,
    },
    /// A load lacks a quantity that this estimator needs.
    #[error("load {load} has no {quantity}")]
    Missing {
        /// Index of the load.
        load: usize,
        /// The missing quantity.
        quantity: Quantity,
    },
    /// Two corresponding inputs differ in length.
    #[error("{quantity}: expected {expected} entries, found {found}")]
    LengthMismatch {
        /// The input.
        quantity: Quantity,
        /// Required length, from the other input.
        expected: usize,
        /// The length given.
        found: usize,
    },
    /// A covariance matrix is not symmetric and positive semidefinite.
    #[error("the covariance of {quantity} is not positive semidefinite")]
    Covariance {
        /// The quantity of the covariance.
        quantity: Quantity,
    },
    /// A value is outside the range of the law, such as a contact radius larger than the sphere's
    /// radius.
    #[error("{quantity} = {} is beyond the law's range ({})", Readable(*found), Readable(*limit))]
    OutOfRange {
        /// The input.
        quantity: Quantity,
        /// The value given.
        found: f64,
        /// The limit.
        limit: f64,
    },
    /// A contact table was made for another ball or guide.
    #[error("the contact table was made for {quantity} {expected}, not {found}")]
    TableMismatch {
        /// The quantity that differs.
        quantity: Quantity,
        /// Value of the table.
        expected: f64,
        /// Value given.
        found: f64,
    },
    /// A contact table has another format version.
    #[error("a contact table of version {expected} is needed, found version {found}")]
    TableVersion {
        /// The version that this crate reads.
        expected: u32,
        /// The version of the file.
        found: u32,
    },
    /// The contacts of a table do not give a force that increases with contact radius and modulus.
    #[error("the force of the table does not always increase with contact radius and modulus")]
    NotMonotone,
    /// The finite elements did not converge at a contact that a table needs.
    #[error(
        "the solver stopped at {force_n} N with E = {youngs_modulus_pa} Pa: \
         the table lacks larger contacts"
    )]
    NotReached {
        /// Modulus of the ball.
        youngs_modulus_pa: f64,
        /// The largest force with an equilibrium.
        force_n: f64,
    },
    /// The caller cancelled the computation.
    #[error("cancelled")]
    Cancelled,
    /// No load could be solved by finite elements.
    #[error(
        "the finite elements find no solution: \
         approaches too large for this block or sizes that do not fit"
    )]
    NoSolution,
    /// An element of a finite-element mesh is degenerate or turned inside out.
    #[error("element {element} of the mesh is degenerate or turned inside out")]
    DegenerateElement {
        /// Index of the element.
        element: usize,
    },
    /// A user-defined estimator, law or measure failed.
    #[error(transparent)]
    Custom(CustomError),
}

impl ElasticityError {
    /// This error with its load counted from `first` instead of 0, for messages.
    ///
    /// ```
    /// use tactile_elasticity::ElasticityError;
    /// let error = ElasticityError::BeyondLaw { load: 2 }.numbered_from(1);
    /// assert!(error.to_string().starts_with("load 3: "));
    /// ```
    #[must_use]
    pub fn numbered_from(mut self, first: usize) -> Self {
        match &mut self {
            Self::BeyondLaw { load }
            | Self::TimeDecreases { load, .. }
            | Self::Missing { load, .. } => *load += first,
            _ => {}
        }
        self
    }

    /// Wraps the error of a user-defined estimator, law or measure.
    ///
    /// ```
    /// use tactile_elasticity::ElasticityError;
    /// let error = ElasticityError::custom("no weights");
    /// assert_eq!(error.to_string(), "no weights");
    /// ```
    pub fn custom(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self::Custom(CustomError::new(error))
    }
}

/// The quantity to which an error refers.
///
/// ```
/// use tactile_elasticity::{ElasticityError, Quantity, laws::HertzLaw};
///
/// let error = HertzLaw::new(-2e-3).unwrap_err();
/// assert_eq!(error, ElasticityError::NotPositive { quantity: Quantity::Radius, found: -2e-3 });
/// assert!(error.to_string().starts_with("radius"));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
#[allow(missing_docs)]
pub enum Quantity {
    DeformationGradient,
    Strain,
    Force,
    ContactRadius,
    ContactArea,
    Indentation,
    Radius,
    HalfAngle,
    Elements,
    Thickness,
    YoungsModulus,
    ReducedModulus,
    Pressure,
    Distance,
    StandardError,
    Correlation,
    DegreesOfFreedom,
    Weight,
    Layers,
    Samples,
    PoissonRatio,
    Time,
}

impl core::fmt::Display for Quantity {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::DeformationGradient => "deformation gradient",
            Self::Strain => "strain",
            Self::Force => "force",
            Self::ContactRadius => "contact radius",
            Self::ContactArea => "contact area",
            Self::Indentation => "indentation",
            Self::Radius => "radius",
            Self::HalfAngle => "half angle",
            Self::Elements => "number of elements",
            Self::Thickness => "thickness",
            Self::YoungsModulus => "Young's modulus",
            Self::ReducedModulus => "reduced modulus",
            Self::Pressure => "pressure",
            Self::Distance => "distance",
            Self::StandardError => "standard error",
            Self::Correlation => "correlation",
            Self::DegreesOfFreedom => "degrees of freedom",
            Self::Weight => "weight",
            Self::Layers => "layers",
            Self::Samples => "samples",
            Self::PoissonRatio => "Poisson ratio",
            Self::Time => "time",
        })
    }
}

impl Quantity {
    /// Returns `value` if it is finite and above zero.
    ///
    /// ```
    /// use tactile_elasticity::Quantity;
    /// assert_eq!(Quantity::Radius.positive(3e-3), Ok(3e-3));
    /// assert!(Quantity::Radius.positive(f64::NAN).is_err());
    /// ```
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn positive(self, value: f64) -> Result<f64, ElasticityError> {
        if value > 0.0 && value.is_finite() {
            Ok(value)
        } else {
            Err(ElasticityError::NotPositive {
                quantity: self,
                found: value,
            })
        }
    }

    /// Returns `value` if it is finite and not negative.
    ///
    /// # Errors
    /// [`ElasticityError::Negative`].
    pub fn not_negative(self, value: f64) -> Result<f64, ElasticityError> {
        if value >= 0.0 && value.is_finite() {
            Ok(value)
        } else {
            Err(ElasticityError::Negative {
                quantity: self,
                found: value,
            })
        }
    }

    /// Returns `value` if it is finite.
    ///
    /// # Errors
    /// [`ElasticityError::NotFinite`].
    pub fn finite(self, value: f64) -> Result<f64, ElasticityError> {
        if value.is_finite() {
            Ok(value)
        } else {
            Err(ElasticityError::NotFinite { quantity: self })
        }
    }

    /// Rejects a number of entries other than the expected one.
    ///
    /// # Errors
    /// [`ElasticityError::LengthMismatch`].
    pub fn entries(self, found: usize, expected: usize) -> Result<(), ElasticityError> {
        self.between(found, expected, expected)
    }

    /// Rejects fewer entries than expected.
    ///
    /// # Errors
    /// [`ElasticityError::LengthMismatch`].
    pub fn at_least(self, found: usize, expected: usize) -> Result<(), ElasticityError> {
        self.between(found, expected, usize::MAX)
    }

    fn between(self, found: usize, fewest: usize, most: usize) -> Result<(), ElasticityError> {
        if (fewest..=most).contains(&found) {
            return Ok(());
        }
        Err(ElasticityError::LengthMismatch {
            quantity: self,
            expected: fewest,
            found,
        })
    }

    /// Rejects numbers that are not positive or not in strictly ascending order.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::OutOfRange`].
    pub fn growing(self, values: impl IntoIterator<Item = f64>) -> Result<(), ElasticityError> {
        let mut last = 0.0;
        for value in values {
            self.positive(value)?;
            if value <= last {
                return Err(self.beyond(value, last));
            }
            last = value;
        }
        Ok(())
    }

    /// The error for a value outside a limit.
    ///
    /// ```
    /// use tactile_elasticity::Quantity;
    /// let error = Quantity::ContactRadius.beyond(2e-3, 1e-3);
    /// assert_eq!(error.to_string(), "contact radius = 0.002 is beyond the law's range (0.001)");
    /// ```
    pub fn beyond(self, found: f64, limit: f64) -> ElasticityError {
        ElasticityError::OutOfRange {
            quantity: self,
            found,
            limit,
        }
    }
}

/// Returns `value` if it is a Poisson ratio in (−1, ½].
pub(crate) fn poisson(value: f64) -> Result<f64, ElasticityError> {
    if value > -1.0 && value <= 0.5 {
        Ok(value)
    } else {
        Err(ElasticityError::PoissonRatio { found: value })
    }
}

/// The end of the message: the lower limit of the modulus, or what to check if no sample could
/// explain the contact.
fn bounded_below(lower_bound_pa: Option<f64>) -> String {
    match lower_bound_pa {
        Some(bound) => format!(
            ": its modulus is above {:.3} kPa with 95 % confidence",
            bound * 1e-3
        ),
        None => ": the contact is no larger than a rigid one would be; check forces, pixel size, \
                 radius and the moduli of the layers"
            .into(),
    }
}
