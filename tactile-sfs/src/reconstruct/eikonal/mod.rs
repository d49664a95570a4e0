//! The eikonal equation of shading, by fast sweeping.
//!
//! Under frontal light a Lambertian surface obeys |∇z| = √(1/R² − 1), R the reflectance. Its viscosity solutions are
//! shortest-path distances: from known heights z_k upwards, z(x) = min_k (z_k + d(x, k)), or downwards,
//! z(x) = max_k (z_k − d(x, k)), d the least integral of the slope along a path. A smooth surface is the *rising* one if
//! its minima and rim are known (from any point the steepest descent ends there), and the *falling* one if its maxima
//! are known. No sign structure is needed: further known heights never hurt either.
//!
//! Three things make it accurate where textbook sweeping (first order in the slope at the pixel) is not:
//!
//! - *Chord rule.* Between neighbours with normal angles θ₁, θ₂ the slope is tan((θ₁ + θ₂)/2) =
//!   (sin θ₁ + sin θ₂)/(cos θ₁ + cos θ₂): second order, exact on a circular profile, and finite up to a vertical rim.
//! - *Deferred correction.* A second solve uses the directions of the first to bring the slopes of both axes to the same
//!   place, which makes smooth parts second order.
//! - *Sub-pixel rim.* Between the last pixel of the mask and the next lies the rim. Where sin θ, continued outwards,
//!   reaches 1 within that pixel the contour is occluding, and the last pixel is cos θ/|∇ sin θ| above it (the
//!   radius of curvature is 1/|∇ sin θ|); else the rim is taken half a pixel away.
//!
//! Oblique light makes the equation anisotropic: R √(1 + |∇z|²) + s·∇z = s_z. Each of the four triangles around a pixel
//! is solved with its causality condition (Kao, Osher & Qian 2004; Qian, Zhang & Zhao 2007).
//!
//! References: Rouy & Tourin 1992 (viscosity), Zhao 2005 (fast sweeping), Bak, McLaughlin & Renzi 2010 (locking),
//! Prados & Faugeras 2005 (oblique light).

mod branch;
mod frontal;
mod grid;
mod load;
mod oblique;
mod rim;

pub(crate) use grid::EikonalBuffers;

use crate::error::{in_range, positive};
use crate::{Domain, Frame, Lighting, Scalar, SfsError, StopReason, Surface};
use crate::{SurfaceReconstruction, Workspace};
use load::Input;

/// The height at the border of the mask.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{Domain, Eikonal, Lighting, Rim, SfsError, SurfaceReconstruction};
/// let mask = Array2::from_shape_fn((21, 21), |(r, c)| (r as f64 - 10.0).hypot(c as f64 - 10.0) < 8.0);
/// let (image, domain) = (Array2::from_elem((21, 21), 0.5_f64.sqrt()), Domain::pixels().with_mask(mask.view()));
/// let method = Eikonal::new(Lighting::frontal());
/// let heights = method.with_rim(Rim::Height(3.0))?.reconstruct(image.view(), &domain)?.heights;
/// assert!((heights[[10, 10]] - 11.0).abs() < 1.0); // slope 1 from the rim, 8 px away
/// let free = method.with_rim(Rim::Free)?.reconstruct(image.view(), &domain);
/// assert_eq!(free, Err(SfsError::NoKnownHeight));
/// # Ok::<(), SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Rim<T> {
    /// Nothing is known there but what the domain's known heights say.
    Free,
    /// The surface meets this height at the border of the mask (not where the frame cuts it off).
    Height(T),
}

/// Which way heights run from the known ones: convex or concave is a choice the image does not make.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{Branch, Domain, Eikonal, Lighting, SurfaceReconstruction};
/// // n·s = 1/√2: slope 1 everywhere. The centre is known to be at 10.
/// let image = Array2::from_elem((15, 15), 0.5_f64.sqrt());
/// let known = Array2::from_shape_fn((15, 15), |at| if at == (7, 7) { 10.0 } else { f64::NAN });
/// let border = |branch| {
///     let method = Eikonal::new(Lighting::frontal()).with_branch(branch);
///     let surface = method.reconstruct(image.view(), &Domain::pixels().with_known_heights(known.view()))?;
///     Ok::<_, tactile_sfs::SfsError>(surface.heights[[7, 12]])
/// };
/// assert!((border(Branch::Rising)? - 15.0).abs() < 0.1); // a funnel
/// assert!((border(Branch::Falling)? - 5.0).abs() < 0.1); // a cone
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Branch {
    /// Rising if no height inside the mask is known; else both are computed and the one whose shading is nearer to the
    /// image is returned (its false folds betray the wrong one).
    Auto,
    /// Heights rise from the known ones (a bump on its rim): right if all minima and the rim are known.
    Rising,
    /// Heights fall from the known ones (a bump from its top): right if all maxima are known.
    Falling,
}

/// Shape from shading by the eikonal equation, for frontal and oblique light.
///
/// Known heights inside the mask hold at the pixel's centre; those outside, next to the mask, are the height the
/// surface reaches at the mask's border. Pixels no known height reaches are flagged `UNREACHED`.
///
/// Cost: a few sweeps over the bounding box, O(pixels); `report.iterations` counts them, `report.residual` is the last
/// change of height. Error on smooth surfaces: at least first order in the pixel, under frontal light nearly second.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{Domain, Eikonal, Lighting, Rim, SurfaceReconstruction};
/// // A hemisphere of radius 20 px: R = z/20, vertical at its rim.
/// let z = Array2::from_shape_fn((45, 45), |(r, c)| {
///     (400.0 - (r as f64 - 22.0).powi(2) - (c as f64 - 22.0).powi(2)).max(0.0).sqrt()
/// });
/// let (image, mask) = (z.mapv(|z| z / 20.0), z.mapv(|z| z > 0.0));
/// let method = Eikonal::new(Lighting::frontal()).with_rim(Rim::Height(0.0))?;
/// let surface = method.reconstruct(image.view(), &Domain::pixels().with_mask(mask.view()))?;
/// assert!((surface.heights[[22, 22]] - 20.0).abs() < 0.3);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eikonal<T> {
    lighting: Lighting<T>,
    rim: Rim<T>,
    branch: Branch,
    max_slope: T,
    tolerance: T,
    max_sweeps: usize,
}

impl<T: Scalar> Eikonal<T> {
    /// The method with a free rim, [`Branch::Auto`], slopes up to 100, a tolerance of 10⁻⁵ pixels and at most 400 sweeps.
    pub fn new(lighting: Lighting<T>) -> Self {
        Self {
            lighting,
            rim: Rim::Free,
            branch: Branch::Auto,
            max_slope: T::of(100.0),
            tolerance: T::of(1e-5),
            max_sweeps: 400,
        }
    }

    /// The height at the border of the mask.
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] for a height that is not finite.
    pub fn with_rim(self, rim: Rim<T>) -> Result<Self, SfsError> {
        if let Rim::Height(height) = rim {
            in_range("rim height", "a finite height", height.as_f64(), true)?;
        }
        Ok(Self { rim, ..self })
    }

    /// Which way heights run from the known ones.
    pub fn with_branch(self, branch: Branch) -> Self {
        Self { branch, ..self }
    }

    /// Steepest slope: pixels darker than 1/√(1 + slope²) are cut to it and flagged `DARK`.
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] unless positive and finite.
    pub fn with_max_slope(self, max_slope: T) -> Result<Self, SfsError> {
        positive("steepest slope", max_slope.as_f64())?;
        Ok(Self { max_slope, ..self })
    }

    /// Sweeping ends when no height changes by more than `tolerance` pixels (widths of a pixel).
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] unless positive and finite.
    pub fn with_tolerance(self, tolerance: T) -> Result<Self, SfsError> {
        positive("tolerance", tolerance.as_f64())?;
        Ok(Self { tolerance, ..self })
    }

    /// Most sweeps of one solve (four directions are four sweeps).
    ///
    /// ```
    /// use ndarray::array;
    /// use tactile_sfs::{Branch, Domain, Eikonal, Lighting, PixelFlags, SurfaceReconstruction};
    /// let known = array![[0.0, f64::NAN, f64::NAN, f64::NAN]];
    /// let method = Eikonal::new(Lighting::frontal())
    ///     .with_branch(Branch::Rising)
    ///     .with_max_slope(2.0)? // black would be infinitely steep
    ///     .with_tolerance(1e-6)?
    ///     .with_max_sweeps(50)?;
    /// let domain = Domain::pixels().with_known_heights(known.view());
    /// let surface = method.reconstruct(array![[1.0, 1.0, 0.0, 1.0]].view(), &domain)?;
    /// assert!(surface.flags[[0, 2]].contains(PixelFlags::DARK));
    /// assert!(surface.heights[[0, 3]].is_finite() && surface.report.iterations <= 100);
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] for 0.
    pub fn with_max_sweeps(self, max_sweeps: usize) -> Result<Self, SfsError> {
        positive("most sweeps", max_sweeps as f64)?;
        Ok(Self { max_sweeps, ..self })
    }

    /// Solves the branch asked for, or both and keeps the better; tells whether it rises.
    fn choose(&self, workspace: &mut Workspace<T>, known_inside: bool) -> (Outcome<T>, bool) {
        let rising = self.branch != Branch::Falling;
        let first = self.solve(workspace, rising);
        if self.branch != Branch::Auto || !known_inside || first.stop == StopReason::Cancelled {
            return (first, rising);
        }
        workspace.eikonal.keep();
        let second = self.solve(workspace, false);
        let sweeps = first.sweeps + second.sweeps;
        if workspace.eikonal.kept_is_better(&self.lighting) {
            workspace.eikonal.restore();
            return (Outcome { sweeps, ..first }, true);
        }
        (Outcome { sweeps, ..second }, false)
    }

    /// Solves one branch into the buffers' values; under frontal light twice, the second time with the directions of the
    /// first.
    fn solve(&self, workspace: &mut Workspace<T>, rising: bool) -> Outcome<T> {
        workspace.eikonal.corrected = false;
        let first = self.sweep(workspace, rising, 0);
        if !self.lighting.is_frontal() || first.stop != StopReason::Converged {
            return first;
        }
        frontal::measure_directions(&mut workspace.eikonal);
        workspace.eikonal.corrected = true;
        self.sweep(workspace, rising, first.sweeps)
    }

    /// Sweeps until nothing changes.
    fn sweep(&self, workspace: &mut Workspace<T>, rising: bool, done: usize) -> Outcome<T> {
        workspace.eikonal.start(rising);
        let light = self.lighting.direction();
        let mut outcome = Outcome {
            stop: StopReason::IterationLimit,
            sweeps: done,
            change: T::infinity(),
        };
        while outcome.sweeps < done + self.max_sweeps {
            let buffers = &mut workspace.eikonal;
            outcome.change = T::zero();
            for order in 0..4 {
                let change = if self.lighting.is_frontal() {
                    frontal::sweep(buffers, order, self.tolerance)
                } else {
                    oblique::sweep(buffers, light, rising, order, self.tolerance)
                };
                outcome.change = outcome.change.max(change);
            }
            outcome.sweeps += 4;
            if outcome.change <= self.tolerance {
                outcome.stop = StopReason::Converged;
                break;
            }
            if let Some(stop) =
                workspace.report(outcome.sweeps, done + self.max_sweeps, outcome.change)
            {
                outcome.stop = stop;
                break;
            }
        }
        outcome
    }
}

/// How one branch was solved.
#[derive(Clone, Copy)]
struct Outcome<T> {
    stop: StopReason,
    sweeps: usize,
    change: T,
}

impl<T: Scalar> SurfaceReconstruction<T> for Eikonal<T> {
    fn reconstruct_with(
        &self,
        workspace: &mut Workspace<T>,
        frame: Frame<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        surface.enter(frame.dim(), domain)?;
        let slope2 = self.max_slope * self.max_slope;
        let input = Input {
            frame: &frame,
            domain,
            lighting: &self.lighting,
            least: (T::one() + slope2).sqrt().recip(),
            rim: if let Rim::Height(height) = self.rim {
                Some(height)
            } else {
                None
            },
        };
        let known = workspace.eikonal.load(&input, surface)?;
        let (outcome, rising) = self.choose(workspace, known.inside > 0);
        let width = domain.pixel_size_m[0];
        surface.report.stop = outcome.stop;
        surface.report.iterations = outcome.sweeps;
        surface.report.residual = outcome.change * width;
        workspace
            .eikonal
            .store(if rising { width } else { -width }, domain, surface);
        surface.finish(domain);
        Ok(())
    }
}
