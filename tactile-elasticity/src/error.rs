//! What can be wrong with the input, one variant each.

use tactile_core::{CustomError, Readable};

/// Why a strain, a stress or a modulus cannot be given.
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
        /// Which input.
        quantity: Quantity,
    },
    /// An input that must be greater than zero is not (NaN included).
    #[error("{quantity} must be greater than zero and finite, found {}", Readable(*found))]
    NotPositive {
        /// Which input.
        quantity: Quantity,
        /// The value given.
        found: f64,
    },
    /// An input that must not be negative is (NaN included).
    #[error("{quantity} must not be negative, found {}", Readable(*found))]
    Negative {
        /// Which input.
        quantity: Quantity,
        /// The value given.
        found: f64,
    },
    /// A Poisson ratio outside (−1, ½], where an isotropic solid is stable.
    #[error("Poisson ratio must lie in (-1, 1/2], found {}", Readable(*found))]
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
    /// The contact is no softer than the other body alone: no compliance is left for the sample.
    #[error(
        "the sample is stiffer than can be resolved through this waveguide or indenter{}",
        bounded_below(*.lower_bound_pa)
    )]
    StifferThanResolvable {
        /// The 95 % lower limit of the modulus. None where the errors are unknown, and where the
        /// contact is stiffer than any sample could make it.
        lower_bound_pa: Option<f64>,
    },
    /// The contact of a load is beyond what the law describes, and no other load is within it.
    #[error("load {}: the contact is beyond what the law describes", load + 1)]
    BeyondLaw {
        /// Index of the load.
        load: usize,
    },
    /// A measure of strain whose value along an axis depends on the stretches across it: no stress
    /// along the axis does its work.
    #[error("no stress is conjugate to the strain measure {measure}")]
    NoConjugateStress {
        /// The measure's name.
        measure: &'static str,
    },
    /// Fewer usable loads than the estimator needs.
    #[error("{found} usable loads, at least {expected} are needed")]
    TooFewLoads {
        /// How many the estimator needs.
        expected: usize,
        /// How many of those given carry what it needs.
        found: usize,
    },
    /// All the loads are equal, so that no slope can be formed.
    #[error("all loads are equal: a slope needs at least two different ones")]
    EqualLoads,
    /// The strain is zero: stress over strain is undefined.
    #[error("the strain is zero: stress over strain is undefined")]
    ZeroStrain,
    /// Loads that follow each other are not in the order of time.
    #[error("load {load} was at {found_s} s, before the one that it follows ({before_s} s)")]
    TimeDecreases {
        /// Its index among the loads given.
        load: usize,
        /// The time of the load before.
        before_s: f64,
        /// The time given.
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
        /// Its index among the loads given.
        load: usize,
        /// What is missing.
        quantity: Quantity,
    },
    /// Two inputs that belong together differ in length.
    #[error("{quantity}: expected {expected} entries, found {found}")]
    LengthMismatch {
        /// Which input.
        quantity: Quantity,
        /// The length the other input asks for.
        expected: usize,
        /// The length given.
        found: usize,
    },
    /// A covariance matrix is not symmetric and positive semidefinite.
    #[error("the covariance of {quantity} is not positive semidefinite")]
    Covariance {
        /// Of what.
        quantity: Quantity,
    },
    /// The law does not reach this far (a contact radius beyond the sphere's own, say).
    #[error("{quantity} = {} is beyond the law's reach ({})", Readable(*found), Readable(*limit))]
    OutOfRange {
        /// Which input.
        quantity: Quantity,
        /// The value given.
        found: f64,
        /// The limit.
        limit: f64,
    },
    /// A contact table was made for another ball or guide.
    #[error("the contact table was made for {quantity} {expected}, not {found}")]
    TableMismatch {
        /// What differs.
        quantity: Quantity,
        /// The table's.
        expected: f64,
        /// What was given.
        found: f64,
    },
    /// A contact table of another version of its format.
    #[error("a contact table of version {expected} is needed, found version {found}")]
    TableVersion {
        /// The version that this crate reads.
        expected: u32,
        /// The file's.
        found: u32,
    },
    /// The contacts of a table do not make a force that grows with contact radius and modulus.
    #[error("the table's force does not grow with contact radius and modulus everywhere")]
    NotMonotone,
    /// Finite elements did not reach a contact that a table needs.
    #[error(
        "the solver stopped at {force_n} N with E = {youngs_modulus_pa} Pa: \
         the table lacks larger contacts"
    )]
    NotReached {
        /// The ball's modulus.
        youngs_modulus_pa: f64,
        /// The largest force in equilibrium.
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
        /// Its index.
        element: usize,
    },
    /// An estimator, a law or a measure of a user's own failed.
    #[error(transparent)]
    Custom(CustomError),
}

impl ElasticityError {
    /// The failure of an estimator, a law or a measure of one's own.
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

/// The quantity that an error is about.
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
    /// `value` if it is finite and above zero.
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

    /// `value` if it is finite and not below zero.
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

    /// `value` if it is finite.
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

    /// Refuses another number of entries than expected.
    ///
    /// # Errors
    /// [`ElasticityError::LengthMismatch`].
    pub fn entries(self, found: usize, expected: usize) -> Result<(), ElasticityError> {
        self.between(found, expected, expected)
    }

    /// Refuses fewer entries than expected.
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

    /// Refuses numbers that are not above zero, and each above the one before.
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

    /// The error of a value beyond a limit.
    ///
    /// ```
    /// use tactile_elasticity::Quantity;
    /// let error = Quantity::ContactRadius.beyond(2e-3, 1e-3);
    /// assert_eq!(error.to_string(), "contact radius = 0.002 is beyond the law's reach (0.001)");
    /// ```
    pub fn beyond(self, found: f64, limit: f64) -> ElasticityError {
        ElasticityError::OutOfRange {
            quantity: self,
            found,
            limit,
        }
    }
}

/// `value` if it is a Poisson ratio in (−1, ½].
pub(crate) fn poisson(value: f64) -> Result<f64, ElasticityError> {
    if value > -1.0 && value <= 0.5 {
        Ok(value)
    } else {
        Err(ElasticityError::PoissonRatio { found: value })
    }
}

/// The end of a sentence: above what the modulus lies, or what to look at where no sample would do.
fn bounded_below(lower_bound_pa: Option<f64>) -> String {
    match lower_bound_pa {
        Some(bound) => format!(
            ": it has more than {:.3} kPa with 95 % confidence",
            bound * 1e-3
        ),
        None => ": the contact is no larger than a rigid one would be; check forces, pixel size, \
                 radius and the moduli of the layers"
            .into(),
    }
}
