//! The eikonal equation of shading, by fast sweeping.
//!
//! Under frontal light a Lambertian surface obeys |∇z| = √(1/R² − 1), R the reflectance. Its
//! viscosity solutions are shortest-path distances, d the least integral of the slope along a path.
//! From known heights z_k upwards, z(x) = min_k (z_k + d(x, k)), or downwards, z(x) = max_k (z_k −
//! d(x, k)). These are the two readings of frontal shading, convex and concave as seen from a known
//! boundary. A bump is the first if its minima and boundary are known (from any point the steepest
//! descent ends there). It is the second if its maxima are. No sign structure is needed: further
//! known heights never hurt either.
//!
//! Three things make it accurate where textbook sweeping (first order in the slope at the pixel) is
//! not:
//!
//! - *Chord rule.* Between neighbours with normal angles θ₁, θ₂ the slope is tan((θ₁ + θ₂)/2) =
//!   (sin θ₁ + sin θ₂)/(cos θ₁ + cos θ₂): second order, exact on a circular profile, and finite up
//!   to a vertical rim.
//! - *Deferred correction.* A second solve uses the directions of the first to bring the slopes of
//!   both axes to the same place, which makes smooth parts second order. Where a profile is fitted
//!   to the contact its directions are taken, and one solve is enough. Half a ball of 26 pixels
//!   comes out within 0.04 pixels instead of 0.13.
//! - *Sub-pixel boundary.* The boundary lies between the last pixel of the mask and the next. Where
//!   sin θ, continued outwards, reaches 1 within that pixel the contour is occluding. The last
//!   pixel then is cos θ/|∇ sin θ| above it (the radius of curvature is 1/|∇ sin θ|). Elsewhere the
//!   boundary is taken half a pixel away.
//!
//! Oblique light makes the equation anisotropic: R √(1 + |∇z|²) + s·∇z = s_z. Each of the four
//! triangles around a pixel is solved with its causality condition (Kao, Osher & Qian 2004, Qian,
//! Zhang & Zhao 2007).
//!
//! A fitted profile also gives nearly the order in which a front from the rim reaches the pixels.
//! Every node is upwind of those that it lowers: visited in the order of their values, all have
//! their final value after one pass (Tsitsiklis 1995, Sethian 1996). That order is only a start:
//! sweeps follow until nothing changes.
//!
//! References: Rouy & Tourin 1992 (viscosity), Zhao 2005 (fast sweeping), Bak, McLaughlin & Renzi
//! 2010 (locking), Prados & Faugeras 2005 (oblique light).

mod grid;
mod profile;
mod sweep;

use tactile_core::{Requirement, StopReason};

pub(crate) use profile::ProfileBuffers;

use crate::{
    Domain, Frame, Image, Lighting, PixelScalar, SfsError, Surface, SurfaceReconstruction,
    SurfaceWorkspace,
};
use profile::Profile;

/// The height at the border of the mask.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{
///     BoundaryCondition, Domain, Eikonal, Image, Lighting, SfsError, SurfaceReconstruction,
/// };
/// let mask = Array2::from_shape_fn((21, 21), |(r, c)| {
///     (r as f64 - 10.0).hypot(c as f64 - 10.0) < 8.0
/// });
/// let (image, domain) = (
///     Array2::from_elem((21, 21), 0.5_f64.sqrt()),
///     Domain::default().with_mask(mask.view()),
/// );
/// let method = Eikonal::new(Lighting::default());
/// let heights = method
///     .with_boundary(BoundaryCondition::Height(3.0))?
///     .reconstruct(Image::new(image.view(), domain))?
///     .heights;
/// assert!((heights[[10, 10]] - 11.0).abs() < 1.0); // slope 1 from the boundary, 8 px away
/// let free = method
///     .with_boundary(BoundaryCondition::Free)?
///     .reconstruct(Image::new(image.view(), domain));
/// assert_eq!(free, Err(SfsError::NoKnownHeight));
/// # Ok::<(), SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum BoundaryCondition<T> {
    /// Nothing is known there but the domain's known heights.
    Free,
    /// The surface meets this height at the border of the mask (not where the frame cuts it off).
    Height(T),
}

/// Which of the two surfaces with the same shading: convex or concave, as seen from the known
/// heights.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{Domain, Eikonal, EikonalBranch, Image, Lighting, SurfaceReconstruction};
/// // n·s = 1/√2: slope 1 everywhere. The centre is known to be at 10.
/// let image = Array2::from_elem((15, 15), 0.5_f64.sqrt());
/// let known = Array2::from_shape_fn((15, 15), |at| if at == (7, 7) { 10.0 } else { f64::NAN });
/// let border = |branch| {
///     let method = Eikonal::new(Lighting::default()).with_branch(branch);
///     let surface = method.reconstruct(
///         Image::new(image.view(), Domain::default().with_known_heights(known.view()))
///     )?;
///     Ok::<_, tactile_sfs::SfsError>(surface.heights[[7, 12]])
/// };
/// assert!((border(EikonalBranch::Convex)? - 15.0).abs() < 0.1); // a funnel
/// assert!((border(EikonalBranch::Concave)? - 5.0).abs() < 0.1); // a cone
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum EikonalBranch {
    /// Convex if no height inside the mask is known. Else both are computed and the one whose
    /// shading is nearer to the image is returned (false folds give the wrong one away).
    Auto,
    /// Heights rise from the known ones, z = min (z_k + d): a bump on its boundary. Right if all
    /// minima and the boundary are known.
    Convex,
    /// Heights fall from the known ones, z = max (z_k − d): a hollow under its boundary, or a bump
    /// under its known top. Right if all maxima are known.
    Concave,
}

/// Shape from shading by the eikonal equation, for frontal and oblique light.
///
/// Known heights inside the mask hold at the pixel's centre. Those outside, next to the mask, are
/// the height the surface reaches at the mask's border. Pixels no known height reaches are flagged
/// `UNREACHED`.
///
/// Cost: a few sweeps over the bounding box, O(pixels). `report.iterations` counts them,
/// `report.residual` is the last change of height. Error on smooth surfaces: at least first order
/// in the pixel, under frontal light nearly second.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{BoundaryCondition, Domain, Eikonal, Image, Lighting, SurfaceReconstruction};
/// // A hemisphere of radius 20 px: R = z/20, vertical at its boundary.
/// let z = Array2::from_shape_fn((45, 45), |(r, c)| {
///     (400.0 - (r as f64 - 22.0).powi(2) - (c as f64 - 22.0).powi(2)).max(0.0).sqrt()
/// });
/// let (image, mask) = (z.mapv(|z| z / 20.0), z.mapv(|z| z > 0.0));
/// let method = Eikonal::new(Lighting::default()).with_boundary(BoundaryCondition::Height(0.0))?;
/// let surface = method.reconstruct(
///     Image::new(image.view(), Domain::default().with_mask(mask.view()))
/// )?;
/// assert!((surface.heights[[22, 22]] - 20.0).abs() < 0.3);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eikonal<T> {
    lighting: Lighting<T>,
    boundary: BoundaryCondition<T>,
    branch: EikonalBranch,
    fitted_profile: bool,
    max_slope: T,
    tolerance: T,
    max_sweeps: usize,
}

impl<T: PixelScalar> Eikonal<T> {
    /// The method with a free boundary, [`EikonalBranch::Auto`], slopes up to 100, a tolerance of
    /// 10⁻⁵ pixels and at most 400 sweeps.
    pub fn new(lighting: Lighting<T>) -> Self {
        Self {
            lighting,
            boundary: BoundaryCondition::Free,
            branch: EikonalBranch::Auto,
            fitted_profile: false,
            max_slope: T::of(100.0),
            tolerance: T::of(1e-5),
            max_sweeps: 400,
        }
    }

    /// The height at the border of the mask.
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] for a height that is not finite.
    pub fn with_boundary(self, boundary: BoundaryCondition<T>) -> Result<Self, SfsError> {
        if let BoundaryCondition::Height(height) = boundary {
            Requirement::Finite.check("boundary height", height.as_f64())?;
        }
        Ok(Self { boundary, ..self })
    }

    /// Which of the two surfaces with the same shading.
    pub fn with_branch(self, branch: EikonalBranch) -> Self {
        Self { branch, ..self }
    }

    /// Whether the shading of the two or three pixels next to the mask's border, blurred and partly
    /// covered in a real frame, is replaced by that of an elliptical profile fitted to the inside,
    /// R² = 1 − x²/a² − y²/b² (Hertz's contact of smooth bodies). The surface then starts on the
    /// sub-pixel contour of that profile. Where the profile explains less than 90 % of the variance
    /// of R², and under oblique light, nothing is replaced. O(pixels of the mask's box).
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_sfs::{
    ///     BoundaryCondition, Domain, Eikonal, Image, Lighting, SurfaceReconstruction,
    /// };
    /// // A hemisphere of radius 20 px in a frame that a lens blurs: each pixel is the mean of
    /// // those around it.
    /// let square = |r: usize, c: usize| (r as f64 - 25.3).powi(2) + (c as f64 - 24.6).powi(2);
    /// let light = |r: usize, c: usize| (400.0 - square(r, c)).max(0.0).sqrt() / 20.0;
    /// let sharp = Array2::from_shape_fn((52, 52), |(r, c)| light(r, c));
    /// let around = |r: usize, c: usize| sharp.slice(ndarray::s![r..r + 3, c..c + 3]);
    /// let image = Array2::from_shape_fn((50, 50), |(r, c)| around(r, c).sum() / 9.0);
    /// let mask = image.mapv(|light| light > 0.1);
    /// let domain = Domain::default().with_mask(mask.view());
    /// let rim = BoundaryCondition::Height(0.0);
    /// let plain = Eikonal::new(Lighting::default()).with_boundary(rim)?;
    /// let error = |method: Eikonal<f64>| {
    ///     let surface = method.reconstruct(Image::new(image.view(), domain))?;
    ///     Ok::<_, tactile_sfs::SfsError>((surface.heights[[24, 24]] - 20.0).abs())
    /// };
    /// let (fitted, plain) = (error(plain.with_fitted_profile(true))?, error(plain)?);
    /// assert!(fitted < 0.5 * plain, "{fitted} {plain}");
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    pub fn with_fitted_profile(self, fitted_profile: bool) -> Self {
        Self {
            fitted_profile,
            ..self
        }
    }

    /// Sweeping ends when no height changes by more than `tolerance` pixels (widths of a pixel).
    ///
    /// ```
    /// use ndarray::array;
    /// use tactile_sfs::{
    ///     Domain, Eikonal, EikonalBranch, Image, Lighting, PixelFlags, SurfaceReconstruction,
    /// };
    /// let known = array![[0.0, f64::NAN, f64::NAN, f64::NAN]];
    /// let method = Eikonal::new(Lighting::default())
    ///     .with_branch(EikonalBranch::Convex)
    ///     .with_tolerance(1e-6)?;
    /// let domain = Domain::default().with_known_heights(known.view());
    /// let surface = method.reconstruct(Image::new(array![[1.0, 1.0, 0.0, 1.0]].view(), domain))?;
    /// // Black would be infinitely steep.
    /// assert!(surface.flags[[0, 2]].contains(PixelFlags::DARK));
    /// assert!(surface.heights[[0, 3]].is_finite());
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] unless positive and finite.
    pub fn with_tolerance(self, tolerance: T) -> Result<Self, SfsError> {
        Requirement::Positive.check("tolerance", tolerance.as_f64())?;
        Ok(Self { tolerance, ..self })
    }
}

impl<T: PixelScalar> SurfaceReconstruction<T> for Eikonal<T> {
    fn reconstruct(&self, image: Image<'_, '_, T>) -> Result<Surface<T>, SfsError> {
        Surface::made_by(|workspace, surface| self.reconstruct_with(workspace, image, surface))
    }

    fn reconstruct_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        image: Image<'_, '_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        let Image { values, domain } = image;
        let Some(mask) = domain.mask.filter(|_| self.fitted_profile) else {
            return self.reconstruct_as_given(workspace, &values, &domain, None, surface);
        };
        let area = domain.bounding_box(values.dim())?;
        // Taken out, because the solve below borrows the whole workspace.
        let mut buffers = core::mem::take(&mut workspace.profile);
        let profile = if self.lighting.is_frontal() {
            buffers.fill(&values, mask, area, &self.lighting)
        } else {
            None
        };
        let result = if profile.is_some() {
            let frame = Frame::Real(buffers.image.view());
            let domain = Domain {
                mask: Some(buffers.mask.view()),
                ..domain
            };
            self.reconstruct_as_given(workspace, &frame, &domain, profile.as_ref(), surface)
        } else {
            self.reconstruct_as_given(workspace, &values, &domain, None, surface)
        };
        workspace.profile = buffers;
        result
    }
}

/// Nodes of the mask's box with a border of one pixel all around, in units of a pixel's width.
#[derive(Debug, Default)]
pub(crate) struct EikonalBuffers<T> {
    /// Nodes per row.
    width: usize,
    /// Height of a pixel over its width.
    aspect: T,
    node: Vec<Node>,
    /// Nodes whose value may still improve.
    active: Vec<bool>,
    /// Reflectance R = cos of the angle between normal and light, and the sine of that angle.
    cosine: Vec<T>,
    sine: Vec<T>,
    /// Given heights: inside the mask at the pixel's centre, outside it at the mask's border. NaN
    /// elsewhere.
    given: Vec<T>,
    /// Height of the convex branch, or minus that of the concave one. +∞ where not reached.
    value: Vec<T>,
    /// Values of the branch solved first.
    kept: Vec<T>,
    /// Boundary offset: height of a node above the boundary next to it, NaN away from the boundary.
    offset: Vec<T>,
    /// 1/(slope · step)² of the edge to the next node in x and in y.
    edges: Vec<[T; 2]>,
    /// cos²φ of the gradient, whether sweeps use it, and whether a fitted profile has given it
    /// before any solution.
    along_x: Vec<T>,
    corrected: bool,
    directed: bool,
    /// Nodes whose intensity is not finite.
    holes: Vec<usize>,
    /// Unknown nodes in the order in which the front is expected to reach them, after a level in
    /// the upper half of the number. Empty where nothing is expected.
    front: Vec<u64>,
}

/// The state of a node of the grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Node {
    /// Not in the mask.
    #[default]
    Outside,
    /// To be solved for.
    Unknown,
    /// In the mask, height given.
    Known,
}

/// How one branch was solved.
#[derive(Clone, Copy)]
struct Outcome<T> {
    convex: bool,
    stop: StopReason,
    sweeps: usize,
    /// Largest change of the last sweeps, in pixels.
    change: T,
}

impl<T: PixelScalar> Eikonal<T> {
    fn reconstruct_as_given(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        frame: &Frame<'_, T>,
        domain: &Domain<'_, T>,
        profile: Option<&Profile>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        surface.enter(frame.dim(), domain)?;
        let known_inside = workspace.eikonal.load(self, frame, domain, surface)?;
        // Where heights are known here and there lines of equal light need not be those of equal
        // height.
        if let Some(profile) = profile.filter(|_| domain.known_heights.is_none()) {
            workspace.eikonal.follow(profile, surface.bounding_box);
        }
        let outcome = self.choose(workspace, known_inside);
        let width = domain.pixel_size_m[0];
        surface.report.stop = outcome.stop;
        surface.report.iterations = outcome.sweeps;
        surface.report.residual = outcome.change * width;
        // The concave branch was solved for −z. The grid counts in widths of a pixel.
        let scale = if outcome.convex { width } else { -width };
        workspace.eikonal.store(scale, domain, surface);
        surface.finish(domain);
        Ok(())
    }

    /// Solves the branch asked for, or both and keeps the better.
    fn choose(&self, workspace: &mut SurfaceWorkspace<T>, known_inside: bool) -> Outcome<T> {
        let first = self.solve(workspace, self.branch != EikonalBranch::Concave);
        let both = self.branch == EikonalBranch::Auto && known_inside;
        if !both || first.stop == StopReason::Cancelled {
            return first;
        }
        let grid = &mut workspace.eikonal;
        // The convex branch is put aside while the concave one uses the same arrays.
        grid.kept.clone_from(&grid.value);
        let second = self.solve(workspace, false);
        let sweeps = first.sweeps + second.sweeps;
        let (grid, light) = (&mut workspace.eikonal, self.lighting.direction());
        let misfit = |value: &[T], sign: T| grid.misfit(value, sign, light);
        if misfit(&grid.kept, T::one()) <= misfit(&grid.value, -T::one()) {
            core::mem::swap(&mut grid.value, &mut grid.kept);
            return Outcome { sweeps, ..first };
        }
        Outcome { sweeps, ..second }
    }

    /// Solves one branch into the buffers' values. Under frontal light that takes two solves, the
    /// second with the directions of the first, unless a fitted profile has given those of a convex
    /// surface.
    fn solve(&self, workspace: &mut SurfaceWorkspace<T>, convex: bool) -> Outcome<T> {
        let grid = &mut workspace.eikonal;
        grid.corrected = convex && grid.directed;
        let corrected = grid.corrected;
        let first = self.sweep(workspace, convex, 0);
        // The second solve is for frontal light alone and needs the directions of a converged
        // surface.
        if corrected || !self.lighting.is_frontal() || first.stop != StopReason::Converged {
            return first;
        }
        workspace.eikonal.measure_directions();
        workspace.eikonal.corrected = true;
        self.sweep(workspace, convex, first.sweeps)
    }

    /// Sweeps until nothing changes, along the expected front first.
    fn sweep(&self, workspace: &mut SurfaceWorkspace<T>, convex: bool, done: usize) -> Outcome<T> {
        workspace.eikonal.start(convex);
        let light = (!self.lighting.is_frontal()).then(|| {
            // The concave branch is the convex one of −z, which the mirrored light shades alike.
            let [x, y, z] = self.lighting.direction();
            if convex { [x, y, z] } else { [-x, -y, z] }
        });
        let mut outcome = Outcome {
            convex,
            stop: StopReason::IterationLimit,
            sweeps: done,
            change: T::infinity(),
        };
        let marched = convex && !workspace.eikonal.front.is_empty();
        // Three passes along an expected front, then sweeps in four directions, which reach any
        // front.
        for _ in 0..if marched { self.max_sweeps.min(3) } else { 0 } {
            outcome.sweeps += 1;
            if !workspace.eikonal.march(self.tolerance) {
                outcome.change = T::zero();
                outcome.stop = StopReason::Converged;
                return outcome;
            }
        }
        let limit = done + self.max_sweeps;
        while outcome.sweeps < limit {
            outcome.change = T::zero();
            for order in 0..4 {
                let change = workspace.eikonal.sweep(light, order, self.tolerance);
                outcome.change = outcome.change.max(change);
            }
            outcome.sweeps += 4;
            if outcome.change <= self.tolerance {
                outcome.stop = StopReason::Converged;
                break;
            }
            if let Some(stop) = workspace.report(outcome.sweeps, limit, outcome.change) {
                outcome.stop = stop;
                break;
            }
        }
        outcome
    }
}

impl<T: PixelScalar> EikonalBuffers<T> {
    /// Sum of squared differences of reflectance over the nodes with four neighbours: the wrong
    /// branch has folds, and folds shade differently.
    fn misfit(&self, value: &[T], sign: T, [x, y, z]: [T; 3]) -> T {
        let (width, half) = (self.width, T::of(0.5) * sign);
        let mut sum = T::zero();
        for i in width..value.len() - width {
            let near = [i - 1, i + 1, i - width, i + width];
            if self.node[i] == Node::Outside || near.iter().any(|&j| self.node[j] == Node::Outside)
            {
                continue;
            }
            if near.iter().any(|&j| !value[j].is_finite()) {
                // Nothing to compare. Folds make 0.02 to 0.1 on average, right branches less than
                // 0.005. Under oblique light the right branch often ends at shadows.
                sum += T::of(0.01);
                continue;
            }
            let p = half * (value[i + 1] - value[i - 1]);
            let q = half * (value[i + width] - value[i - width]) / self.aspect;
            let shade = (z - x * p - y * q) / (T::one() + p * p + q * q).sqrt();
            let difference = shade.max(T::zero()) - self.cosine[i];
            // A slope whose square overflows has no shading. It counts as the largest misfit.
            sum += if difference.is_finite() {
                difference * difference
            } else {
                T::one()
            };
        }
        sum
    }
}
