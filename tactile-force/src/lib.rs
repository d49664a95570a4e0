//! From grey levels to stress, force, contact and shear.
#![forbid(unsafe_code)]
