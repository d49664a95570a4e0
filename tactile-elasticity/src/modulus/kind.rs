//! The names of estimators.

/// The estimators, by name.
///
/// ```
/// use tactile_elasticity::modulus::EstimatorKind;
///
/// assert_eq!(EstimatorKind::PaperRatio.to_string(), "stress over mean strain");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
#[allow(missing_docs)]
pub enum EstimatorKind {
    PaperRatio,
    StressStrainRegression,
    HertzSphere,
    SphereOnWaveguide,
    /// A soft ball on a rigid flat, at finite strain.
    SphereOnFlat,
    /// A soft ball on the guide of a contact table.
    TabulatedContact,
    FlatPunch,
    Cone,
    LayerIntegralEquation,
    FreeLayerIntegralEquation,
    /// A law that ignores an existing guide, as if it were rigid. Its result differs from that of
    /// the law with this name.
    GuideIgnored,
    /// An estimator from outside this crate, with its name.
    Other(&'static str),
}

impl core::fmt::Display for EstimatorKind {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::PaperRatio => "stress over mean strain",
            Self::StressStrainRegression => "regression of stress on strain",
            Self::HertzSphere => "Hertz sphere",
            Self::SphereOnWaveguide => "sphere on a layered waveguide",
            Self::SphereOnFlat => "sphere on a rigid flat, finite strain",
            Self::TabulatedContact => "sphere, tabulated contacts",
            Self::FlatPunch => "flat punch",
            Self::Cone => "cone",
            Self::LayerIntegralEquation => "sphere on a layer, integral equation",
            Self::FreeLayerIntegralEquation => "sphere on a sliding layer, integral equation",
            Self::GuideIgnored => "contact law on a rigid guide",
            Self::Other(name) => name,
        })
    }
}
