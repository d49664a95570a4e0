#![doc = include_str!("../README.md")]
//!
//! # Overview
//! A scene is computed in one direction: force → contact pressure → light → photons → 8-bit frame.
//! Apart from finite elements, it shares no code with the measuring crates, so that a measurement
//! of a simulated frame is an independent test.
//!
//! | module | contents |
//! |---|---|
//! | [`press`](PressScene) | one sphere pressed at several loads: frames and [`PressTruth`] |
//! | [`contact`](ContactModel) | closed forms, or contacts computed elsewhere ([`ContactState`]) |
//! | `solved` | balls and cylinders by the finite elements of `tactile-fem` (feature `fem`) |
//! | `pixel_average` | exact averages of the contact pressure over pixels |
//! | [`light`](Response) | pressure → grey levels |
//! | [`camera`](Camera) | blur, vignetting, photon and read noise, quantisation |
//! | [`calibration`](CalibrationSeries) | light against gauge force, loading and unloading |
//! | [`stream`](FrameStream) | frames of loading cycles at camera rate, with drifting light |
//! | [`uniaxial`](UniaxialScene) | a squeezed block, whose stress over strain is the modulus |
//! | `folder` | a scene written as files (feature `scene`) |
//!
//! # Conventions
//! Images are `[row, column]`: x is the column, y the row, and z points from the sensor to the
//! object. The centre of the first pixel is (0, 0). Units are SI, except for names that end in
//! `_px` or `_grey`.
//!
//! # Scale of the default frame
//! The paper gives a pixel of 4.65 µm and a sensing side of 30 mm, imaged by 1392 pixels. Both
//! cannot be true on the sensing surface (30 mm / 4.65 µm = 6452). They are consistent if 4.65 µm
//! is the pitch on the camera chip and the lens reduces 30 mm to the chip's 6.47 mm (magnification
//! 0.216). The pixel on the *surface* is then 30 mm / 1392 = 21.55 µm, as in [`Camera::default`].
//!
//! # Reproducibility
//! Random numbers come from ChaCha8, a published algorithm with a fixed stream, whereas those of
//! `StdRng` and `SmallRng` may change with any release of `rand`. The ziggurat of `rand_distr`
//! converts them into normal deviates. Each row of each frame has its own stream, so that frames
//! can be generated in any order, one by one or in parallel, with the same bits.
#![forbid(unsafe_code)]

mod calibration;
mod camera;
mod contact;
mod error;
#[cfg(feature = "scene")]
mod folder;
mod light;
mod materials;
mod pixel_average;
mod press;
#[cfg(feature = "fem")]
mod solved;
mod stream;
mod trial;
mod uniaxial;

pub use calibration::{CalibrationRun, CalibrationSeries};
pub use camera::Camera;
pub use contact::{ContactModel, ContactState, SimulatedContact};
pub use error::SimulateError;
#[cfg(feature = "scene")]
pub use folder::write_folder;
pub use light::{Illumination, Response};
pub use materials::{Elastic, ElasticSphere, LightGuide, WaveguideLayer};
pub use press::{
    Gain, PressLoad, PressOptions, PressScene, PressSimulation, PressTruth, SurfaceScaling,
};
pub use stream::{FrameStream, LoadCycle, StreamedFrame};
pub use tactile_gel::simulate::{ColourGel, ElasticFace, GelObject, HertzPress};
pub use trial::Trial;
pub use uniaxial::{FaceOutline, SurfacePattern, UniaxialOptions, UniaxialScene, UniaxialState};

#[cfg(test)]
mod tests;
