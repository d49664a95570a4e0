//! Checks of inputs.

use tactile_elasticity::ElasticityError;

pub use tactile_elasticity::Quantity;

/// `value` if it is finite and above zero.
pub fn positive(value: f64, quantity: Quantity) -> Result<f64, ElasticityError> {
    quantity.positive(value)
}
