//! Total internal reflection in a layered waveguide: angles, Fresnel coefficients, ray-traced leakage.
#![forbid(unsafe_code)]
