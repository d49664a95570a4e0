//! From deformation gradients to strain, and from stress and strain to Young modulus, with uncertainty.
#![forbid(unsafe_code)]
