//! Control points on a surface: the trait and its implementations.

mod contact;
mod lattice;

use std::sync::Arc;

use nalgebra::Point3;
use ndarray::ArrayView2;
use tactile_core::Requirement;

pub use contact::ContactSampler;

use crate::{Domain, PixelScalar, SfsError, SurfaceWorkspace};
use lattice::{Lattice, Strips, Weights};

/// A way to choose control points on a surface.
///
/// Points are (x, y, z) in metres, x = column · width, y = row · height of a pixel. Between pixels the height is
/// interpolated. None lies outside the mask (for [`ContactSampler`]: outside the contour) or where the height is not finite,
/// no two coincide, and the same input gives the same points. Exactly `count` points are returned. Object safe. An
/// implementor writes [`sample`](Self::sample) alone.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{ControlPointSampler, Domain, EquallySpaced};
/// let flat = Array2::<f64>::zeros((60, 80));
/// let points = EquallySpaced.sample(flat.view(), &Domain::new([1e-4, 1e-4])?, 48)?;
/// assert_eq!(points.len(), 48);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
pub trait ControlPointSampler<T: PixelScalar> {
    /// Chooses `count` points on `heights` inside the mask of `domain`. Its known heights play no part.
    ///
    /// ```
    /// use ndarray::array;
    /// use tactile_sfs::{ControlPointSampler, Domain, EquallySpaced};
    /// let z = array![[5.0, 5.0], [5.0, f64::NAN]];
    /// let points = EquallySpaced.sample(z.view(), &Domain::new([1.0, 2.0])?, 3)?;
    /// assert!(points.iter().all(|point| point.z == 5.0 && (point.x, point.y) != (1.0, 2.0)));
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// Those of a wrong domain ([`Domain::bounding_box`]), and [`SfsError::TooManyPoints`] for more points than pixels.
    fn sample(
        &self,
        heights: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        count: usize,
    ) -> Result<Vec<Point3<T>>, SfsError>;

    /// The same into `points`, whose contents are replaced, with the buffers of `workspace`. The samplers of this crate
    /// allocate nothing once both have grown.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_sfs::{ControlPointSampler, Domain, Random, SurfaceWorkspace};
    /// let (z, mut workspace, mut points) = (Array2::<f64>::zeros((9, 9)), SurfaceWorkspace::default(), Vec::new());
    /// for count in [20, 5] {
    ///     Random { seed: 1 }.sample_with(&mut workspace, z.view(), &Domain::default(), count, &mut points)?;
    ///     assert_eq!(points.len(), count);
    /// }
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// As [`sample`](Self::sample). `points` is then empty.
    fn sample_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        heights: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        count: usize,
        points: &mut Vec<Point3<T>>,
    ) -> Result<(), SfsError> {
        let _ = workspace;
        points.clear();
        *points = self.sample(heights, domain, count)?;
        Ok(())
    }
}

/// A shared sampler is one, as trait objects need it.
impl<T: PixelScalar, S: ControlPointSampler<T> + ?Sized> ControlPointSampler<T> for Arc<S> {
    fn sample(
        &self,
        heights: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        count: usize,
    ) -> Result<Vec<Point3<T>>, SfsError> {
        (**self).sample(heights, domain, count)
    }

    fn sample_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        heights: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        count: usize,
        points: &mut Vec<Point3<T>>,
    ) -> Result<(), SfsError> {
        (**self).sample_with(workspace, heights, domain, count, points)
    }
}

/// The points that a method finds with a workspace of its own.
fn made_by<T: PixelScalar>(
    method: impl FnOnce(&mut SurfaceWorkspace<T>, &mut Vec<Point3<T>>) -> Result<(), SfsError>,
) -> Result<Vec<Point3<T>>, SfsError> {
    let mut points = Vec::new();
    method(&mut SurfaceWorkspace::default(), &mut points)?;
    Ok(points)
}

/// Buffers of the samplers, kept between calls.
#[derive(Debug, Default)]
pub(crate) struct SampleBuffers {
    /// Squared heights.
    squares: Vec<f64>,
    /// Weights of the lattice's nodes.
    weight: Vec<f64>,
    /// The key of each node that is drawn.
    keys: Vec<(f64, usize)>,
    /// Curvature at the nodes.
    curvatures: Vec<f64>,
    strips: Strips,
    pixels: Vec<[usize; 2]>,
}

/// Equally spaced control points: each stands for the same area of the surface (not of its projection). Ground steeper than
/// 2 (63°) counts as that steep: the area of a rim depends on the pixels it falls on.
///
/// The surface is cut into strips of rows and the strips into cells of equal area, with a point in the centroid of each.
/// Cuts and centroids are to a fraction of a pixel: the same surface, larger or shifted, gives the same points of it, so
/// that the points of two loads correspond. Areas are measured on 100 pixels a point or more, where there are as many.
/// Deterministic; O(count), and O(pixels) for the mask's box.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{ControlPointSampler, EquallySpaced};
/// // Level on the left, a roof of slope √3 on the right: twice the area, hence twice the points.
/// let z = Array2::from_shape_fn((60, 120), |(_, c)| 3.0_f64.sqrt() * (c as f64 - 60.0).max(0.0));
/// let points = EquallySpaced.sample(z.view(), None, [1.0, 1.0], 90)?;
/// let level = points.iter().filter(|point| point.x < 60.0).count();
/// assert!((27..=33).contains(&level));
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EquallySpaced;

impl<T: PixelScalar> ControlPointSampler<T> for EquallySpaced {
    fn sample(
        &self,
        heights: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        count: usize,
    ) -> Result<Vec<Point3<T>>, SfsError> {
        made_by(|workspace, points| self.sample_with(workspace, heights, domain, count, points))
    }

    fn sample_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        heights: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        count: usize,
        points: &mut Vec<Point3<T>>,
    ) -> Result<(), SfsError> {
        points.clear();
        let buffers = &mut workspace.points;
        let weight = core::mem::take(&mut buffers.weight);
        let lattice = Lattice::sparse(heights, domain, count, weight)?;
        spread(&lattice, count, buffers, points);
        buffers.weight = lattice.weight;
        Ok(())
    }
}

/// Adds `count` points, each standing for the same weight.
fn spread<T: PixelScalar>(
    lattice: &Lattice<'_, '_, T>,
    count: usize,
    buffers: &mut SampleBuffers,
    points: &mut Vec<Point3<T>>,
) {
    if count == 0 || lattice.has_room_for(count) && at_centroids(lattice, count, buffers, points) {
        return;
    }
    // Points nearly as dense as the nodes: nodes themselves, evenly in reading order.
    points.clear();
    let nodes = lattice.nodes().enumerate();
    let chosen = nodes.filter(|(k, _)| (k + 1) * count / lattice.count > k * count / lattice.count);
    points.extend(chosen.map(|(_, node)| lattice.point(lattice.pixel(node))));
}

/// Adds the centroids of the cells; false if two of them share a pixel.
fn at_centroids<T: PixelScalar>(
    lattice: &Lattice<'_, '_, T>,
    count: usize,
    buffers: &mut SampleBuffers,
    points: &mut Vec<Point3<T>>,
) -> bool {
    let SampleBuffers { strips, pixels, .. } = buffers;
    let grid = Weights {
        weight: &lattice.weight,
        columns: lattice.columns,
        rows: lattice.rows,
        count: lattice.count as f64,
        aspect: lattice.aspect(),
    };
    strips.find(&grid, count);
    pixels.clear();
    for &place in &strips.places {
        let (pixel, point) = lattice.point_near(place);
        pixels.push(pixel);
        points.push(point);
    }
    pixels.sort_unstable();
    pixels.windows(2).all(|pair| pair[0] != pair[1])
}

/// Control points whose density grows with curvature: density ∝ 1 + emphasis · √(κ/κ̄), κ the root of the sum of squares
/// of the second derivatives and κ̄ its mean (the root because a linear interpolant's error goes as κ · spacing²).
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{ControlPointSampler, CurvatureAdaptive, Domain};
/// // Flat on the left, wavy on the right.
/// let z = Array2::from_shape_fn((60, 80), |(_, c)| if c < 40 { 0.0 } else { (c as f64 * 0.5).sin() });
/// let points = CurvatureAdaptive::new(4.0)?.sample(z.view(), &Domain::default(), 60)?;
/// let right = points.iter().filter(|p| p.x >= 40.0).count();
/// assert!(right > 40);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvatureAdaptive {
    emphasis: f64,
}

impl CurvatureAdaptive {
    /// The sampler; emphasis 0 is equal spacing.
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] unless finite and not negative.
    pub fn new(emphasis: f64) -> Result<Self, SfsError> {
        Requirement::NonNegative.check("emphasis", emphasis)?;
        Ok(Self { emphasis })
    }
}

impl<T: PixelScalar> ControlPointSampler<T> for CurvatureAdaptive {
    fn sample(
        &self,
        heights: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        count: usize,
    ) -> Result<Vec<Point3<T>>, SfsError> {
        made_by(|workspace, points| self.sample_with(workspace, heights, domain, count, points))
    }

    fn sample_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        heights: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        count: usize,
        points: &mut Vec<Point3<T>>,
    ) -> Result<(), SfsError> {
        points.clear();
        let buffers = &mut workspace.points;
        let weight = core::mem::take(&mut buffers.weight);
        let mut lattice = Lattice::sparse(heights, domain, count, weight)?;
        let step = domain.pixel_size_m.map(T::as_f64);
        let curvatures = &mut buffers.curvatures;
        curvatures.clear();
        curvatures.extend(
            lattice
                .nodes()
                .map(|node| curvature(heights, lattice.pixel(node), step)),
        );
        let mean = curvatures.iter().sum::<f64>() / curvatures.len() as f64;
        if mean > 0.0 {
            let nodes = lattice.weight.iter_mut().filter(|weight| **weight > 0.0);
            for (weight, curvature) in nodes.zip(curvatures) {
                *weight *= 1.0 + self.emphasis * (*curvature / mean).sqrt();
            }
        }
        spread(&lattice, count, buffers, points);
        buffers.weight = lattice.weight;
        Ok(())
    }
}

/// Root of the sum of squares of the second derivatives that can be formed.
fn curvature<T: PixelScalar>(
    z: ArrayView2<'_, T>,
    [row, column]: [usize; 2],
    [hx, hy]: [f64; 2],
) -> f64 {
    let here = z[[row, column]].as_f64();
    let second = |a: [usize; 2], b: [usize; 2], h: f64| -> f64 {
        match (z.get(a), z.get(b)) {
            (Some(a), Some(b)) if a.is_finite() && b.is_finite() => {
                (a.as_f64() - 2.0 * here + b.as_f64()) / (h * h)
            }
            _ => 0.0,
        }
    };
    let (left, above) = (column.wrapping_sub(1), row.wrapping_sub(1));
    second([row, left], [row, column + 1], hx).hypot(second([above, column], [row + 1, column], hy))
}

/// Random control points: every pixel is drawn with a probability proportional to the surface area over it, without
/// repetition. The same seed gives the same points on every platform and in every version of the library: the generator
/// (SplitMix64) is part of this crate for that reason. O(pixels + count log count).
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{ControlPointSampler, Domain, Random};
/// let flat = Array2::<f32>::zeros((20, 20));
/// let a = Random { seed: 7 }.sample(flat.view(), &Domain::default(), 50)?;
/// assert_eq!(a, Random { seed: 7 }.sample(flat.view(), &Domain::default(), 50)?);
/// assert_ne!(a, Random { seed: 8 }.sample(flat.view(), &Domain::default(), 50)?);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Random {
    /// The seed.
    pub seed: u64,
}

impl<T: PixelScalar> ControlPointSampler<T> for Random {
    fn sample(
        &self,
        heights: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        count: usize,
    ) -> Result<Vec<Point3<T>>, SfsError> {
        made_by(|workspace, points| self.sample_with(workspace, heights, domain, count, points))
    }

    fn sample_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        heights: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        count: usize,
        points: &mut Vec<Point3<T>>,
    ) -> Result<(), SfsError> {
        points.clear();
        let buffers = &mut workspace.points;
        let weight = core::mem::take(&mut buffers.weight);
        let lattice = Lattice::dense(heights, domain, count, weight)?;
        // The `count` least of exponential variates with rates = areas are a draw without repetition (Efraimidis &
        // Spirakis 2006).
        let mut state = self.seed;
        let mut key = |node: usize| -(1.0 - unit(&mut state)).ln() / lattice.weight[node];
        let keys = &mut buffers.keys;
        keys.clear();
        keys.extend(lattice.nodes().map(|node| (key(node), node)));
        let order = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if count < keys.len() {
            keys.select_nth_unstable_by(count, order);
            keys.truncate(count);
        }
        keys.sort_unstable_by(order);
        points.extend(
            keys.iter()
                .map(|&(_, node)| lattice.point(lattice.pixel(node))),
        );
        buffers.weight = lattice.weight;
        Ok(())
    }
}

/// Uniform in [0, 1): SplitMix64 (Steele, Lea & Flood 2014), the upper 53 bits.
fn unit(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}
