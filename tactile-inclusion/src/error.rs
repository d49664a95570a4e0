//! Checks of inputs.

use tactile_elasticity::ElasticityError;

pub use tactile_elasticity::Quantity;

/// `value` if it is finite and above zero.
pub fn positive(value: f64, quantity: Quantity) -> Result<f64, ElasticityError> {
    quantity.positive(value)
}

/// `value` if it is finite and not below zero.
pub fn not_negative(value: f64, quantity: Quantity) -> Result<f64, ElasticityError> {
    quantity.not_negative(value)
}

/// `value` if it is finite.
pub fn finite(value: f64, quantity: Quantity) -> Result<f64, ElasticityError> {
    quantity.finite(value)
}
