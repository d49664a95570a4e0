//! Warnings that weaken a modulus without preventing it.

/// A typed caution. The estimate is valid with a reservation.
///
/// ```
/// use tactile_elasticity::modulus::Warning;
///
/// let warning = Warning::LargeContact { load: 1, ratio: 0.5, limit: 0.3 };
/// assert!(warning.to_string().contains("0.5"));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum Warning {
    /// a/R is outside the range of small-contact theory.
    LargeContact {
        /// Index of the load.
        load: usize,
        /// a/R.
        ratio: f64,
        /// The limit of the law.
        limit: f64,
    },
    /// The layer is too thin for this law, compared with the contact.
    ThinLayer {
        /// Index of the load.
        load: usize,
        /// χ = √(Rδ)/h, or a/h.
        ratio: f64,
        /// The limit of the law.
        limit: f64,
    },
    /// The strain is too large for a linear law.
    LargeStrain {
        /// Index of the load.
        load: usize,
        /// The strain.
        strain: f64,
        /// The limit.
        limit: f64,
    },
    /// The residuals exceed the standard errors, which were scaled up by the square root of this
    /// ratio.
    ExcessScatter {
        /// χ² over degrees of freedom.
        reduced_chi_squared: f64,
    },
    /// The data do not bound the modulus from above.
    UnboundedAbove,
    /// The intercept of the regression differs from zero at the 95 % level.
    Intercept {
        /// Stress at zero strain, Pa.
        intercept_pa: f64,
        /// Probability of such an intercept if the true one is zero.
        p_value: f64,
    },
    /// There is one load without standard errors, so the interval is unknown.
    NoErrorEstimate,
    /// For a sphere the ratio of stress to strain is not the modulus, because it depends on load
    /// and radius.
    RatioOnSphere {
        /// Index of the load.
        load: usize,
        /// a/R.
        ratio: f64,
    },
    /// The modulus is far from that of the guide under the contact. It is then poorly determined,
    /// or an input has a wrong unit.
    UnlikeGuide {
        /// Ratio of the modulus to that of a deep layer as stiff as the guide.
        ratio: f64,
    },
    /// A contact is outside the range of the law and was skipped.
    OutOfReach {
        /// Index of the load.
        load: usize,
    },
    /// The sample is pressed on a compliant guide, but the estimator treats the guide as rigid: the
    /// modulus is that of sample and guide together.
    GuideIgnored,
    /// Poisson's ratio is negative, unlike that of any rubber, gel or tissue.
    NegativePoissonRatio {
        /// Stated Poisson ratio.
        poisson_ratio: f64,
    },
}

impl Warning {
    /// Ratio of moduli from which a sample is [unlike](Self::UnlikeGuide) its guide.
    pub const UNLIKE_GUIDE: f64 = 10.0;

    /// This caution with its load counted from `first` instead of 0, for messages.
    ///
    /// ```
    /// use tactile_elasticity::modulus::Warning;
    /// let caution = Warning::OutOfReach { load: 2 };
    /// assert!(caution.to_string().starts_with("load 2: "));
    /// assert!(caution.numbered_from(1).to_string().starts_with("load 3: "));
    /// ```
    #[must_use]
    pub fn numbered_from(mut self, first: usize) -> Self {
        match &mut self {
            Self::LargeContact { load, .. }
            | Self::ThinLayer { load, .. }
            | Self::LargeStrain { load, .. }
            | Self::RatioOnSphere { load, .. }
            | Self::OutOfReach { load } => *load += first,
            _ => {}
        }
        self
    }
}

impl core::fmt::Display for Warning {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::LargeContact { load, ratio, limit } => write!(
                f,
                "load {load}: a/R = {ratio:.3} is above {limit:.2}, \
                     small-contact theory is not valid"
            ),
            Self::ThinLayer { load, ratio, limit } => write!(
                f,
                "load {load}: contact over layer thickness = {ratio:.3} \
                     is above the limit {limit:.2} of this law"
            ),
            Self::LargeStrain {
                load,
                strain,
                limit,
            } => write!(
                f,
                "load {load}: strain {strain:.3} is above {limit:.2}, \
                     the linear law is not valid"
            ),
            Self::ExcessScatter {
                reduced_chi_squared,
            } => write!(
                f,
                "scatter exceeds the stated errors \
                     (reduced chi-squared {reduced_chi_squared:.2})"
            ),
            Self::UnboundedAbove => write!(f, "the data do not bound the modulus from above"),
            Self::Intercept {
                intercept_pa,
                p_value,
            } => write!(
                f,
                "the stress at zero strain is {intercept_pa:.1} Pa (p = {p_value:.4}), not zero"
            ),
            Self::NoErrorEstimate => write!(
                f,
                "no standard errors and no repetition: the interval is unknown"
            ),
            Self::RatioOnSphere { load, ratio } => write!(
                f,
                "load {load}: stress over strain is biased on a sphere (a/R = {ratio:.3})"
            ),
            Self::UnlikeGuide { ratio } => {
                let (times, word) = match *ratio < 1.0 {
                    true => (1.0 / ratio, "softer"),
                    false => (*ratio, "stiffer"),
                };
                write!(
                    f,
                    "the sample is {times:.0} times {word} than the guide: are its layers, the \
                     forces, the radius and the pixel size in the expected units?"
                )
            }
            Self::OutOfReach { load } => write!(
                f,
                "load {load}: the contact is outside the range of the law and was not used"
            ),
            Self::GuideIgnored => write!(
                f,
                "the estimator treats the guide as rigid: the modulus is that of sample and guide \
                 together"
            ),
            Self::NegativePoissonRatio { poisson_ratio } => write!(
                f,
                "no rubber, gel or tissue has a Poisson's ratio of {poisson_ratio}: soft samples \
                 have 0.3 to 0.5"
            ),
        }
    }
}
