//! Checks of inputs.

use tactile_elasticity::ElasticityError;
pub(crate) use tactile_elasticity::Quantity;

/// `value` if it is finite and above zero.
pub(crate) fn positive(value: f64, quantity: Quantity) -> Result<f64, ElasticityError> {
    quantity.positive(value)
}

/// `value` if it is finite and not below zero.
pub(crate) fn not_negative(value: f64, quantity: Quantity) -> Result<f64, ElasticityError> {
    quantity.not_negative(value)
}

/// `value` if it is finite.
pub(crate) fn finite(value: f64, quantity: Quantity) -> Result<f64, ElasticityError> {
    quantity.finite(value)
}
