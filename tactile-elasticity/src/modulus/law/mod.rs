//! Contact laws of the form F = E* f(x), x the contact radius or the indentation.

mod finite_strain;
mod half_space;
mod layer;
mod no_slip;
mod tatara;
mod tip_on_ball;
mod two_contacts;
mod waveguide;

pub(crate) use half_space::{ConeLaw, Punch, Sphere};
pub(crate) use layer::LayerLaw;
pub use layer::LayerTheory;
pub use no_slip::NoSlipLaw;
pub(crate) use tatara::TataraLaw;
pub(crate) use tip_on_ball::TipOnBallLaw;
pub(crate) use two_contacts::TwoContactsLaw;
pub use waveguide::WaveguideLaw;

use crate::modulus::EstimatorKind;

/// ln f = ln(F/E*) at one x, with its slopes in ln x and in the logarithm of the indenter's size.
#[derive(Debug, Clone, Copy)]
pub struct LogForce {
    /// ln f.
    pub value: f64,
    /// d ln f / d ln x.
    pub slope: f64,
    /// d ln f / d ln R, R the size of the indenter.
    pub size_slope: f64,
}

/// A law F = E* f(x), implemented by this crate's indenters.
///
/// `share` is the other body's part of 1/E*, in [0, 1): 0 where it is rigid. Most laws do not depend on it.
pub trait ContactLaw {
    /// Which estimator the law makes.
    fn kind(&self) -> EstimatorKind;

    /// ln f of a contact radius (m); None where the law does not depend on it or does not reach so far.
    fn of_contact_radius(&self, a: f64, share: f64) -> Option<LogForce>;

    /// ln f of an indentation (m); None where the law does not depend on it or does not reach so far.
    fn of_indentation(&self, d: f64, share: f64) -> Option<LogForce>;

    /// a/R of what was measured, for laws with a radius.
    fn contact_ratio(&self, contact_radius: Option<f64>, indentation: Option<f64>) -> Option<f64>;

    /// The largest a/R for which the law is meant.
    fn contact_ratio_limit(&self) -> f64 {
        f64::INFINITY
    }

    /// Contact over layer thickness and its limit, for laws with a layer.
    fn layer_ratio(
        &self,
        _contact_radius: Option<f64>,
        _indentation: Option<f64>,
    ) -> Option<(f64, f64)> {
        None
    }

    /// Whether f depends on the share.
    fn depends_on_share(&self) -> bool {
        false
    }

    /// The share from which the share that belongs to the answer is sought.
    fn first_share(&self) -> f64 {
        0.0
    }

    /// The sample's part of the compliance of a contact of radius a: what the other body's depth leaves of 1 − share.
    fn sample_part(&self, _contact_radius: Option<f64>, share: f64) -> f64 {
        1.0 - share
    }

    /// Standard error of ln F that is the law's own, the same at every load of one size.
    fn model_error(&self, _contact_radius: Option<f64>, _indentation: Option<f64>) -> f64 {
        0.0
    }
}

impl<L: ContactLaw + ?Sized> ContactLaw for Box<L> {
    fn kind(&self) -> EstimatorKind {
        (**self).kind()
    }

    fn of_contact_radius(&self, a: f64, share: f64) -> Option<LogForce> {
        (**self).of_contact_radius(a, share)
    }

    fn of_indentation(&self, d: f64, share: f64) -> Option<LogForce> {
        (**self).of_indentation(d, share)
    }

    fn contact_ratio(&self, contact_radius: Option<f64>, indentation: Option<f64>) -> Option<f64> {
        (**self).contact_ratio(contact_radius, indentation)
    }

    fn contact_ratio_limit(&self) -> f64 {
        (**self).contact_ratio_limit()
    }

    fn layer_ratio(
        &self,
        contact_radius: Option<f64>,
        indentation: Option<f64>,
    ) -> Option<(f64, f64)> {
        (**self).layer_ratio(contact_radius, indentation)
    }

    fn depends_on_share(&self) -> bool {
        (**self).depends_on_share()
    }

    fn first_share(&self) -> f64 {
        (**self).first_share()
    }

    fn sample_part(&self, contact_radius: Option<f64>, share: f64) -> f64 {
        (**self).sample_part(contact_radius, share)
    }

    fn model_error(&self, contact_radius: Option<f64>, indentation: Option<f64>) -> f64 {
        (**self).model_error(contact_radius, indentation)
    }
}
