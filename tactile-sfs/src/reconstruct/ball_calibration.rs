//! A depth table from one press of a ball of known radius.
//!
//! Inside the contact circle of radius a the depth is the spherical cap √(R² − r²) − √(R² − a²).
//! Each grey level of the signal gets the mean depth of its pixels, made monotone by pooling
//! (isotonic regression, weights = pixels).

use ndarray::Array2;

use super::depth_table::{DepthTable, Signal};
use crate::domain::parts;
use crate::{Domain, Frame, PixelScalar, SfsError};
use tactile_core::Requirement;

/// A depth table and how well the ball fits it. What [`DepthTable::from_ball`] returns.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{BallCalibration, DepthTable, Domain, Frame, Signal};
/// // A ball of 4 mm pressed to a contact of 2 mm; the image brightens by 100 a millimetre.
/// let depth = |r: usize, c: usize| {
///     let r2 = ((r as f64 - 30.0).powi(2) + (c as f64 - 30.0).powi(2)) * 1e-8;
///     (16e-6_f64 - r2).sqrt() - 12e-6_f64.sqrt()
/// };
/// let image = Array2::from_shape_fn((61, 61), |(r, c)| (1e5 * depth(r, c)).max(0.0));
/// let domain = Domain::new([1e-4, 1e-4])?;
/// let BallCalibration {
///     contact_radius_m,
///     indentation_m,
///     ..
/// } = DepthTable::from_ball(
///     Frame::Real(image.view()),
///     Signal::Intensity,
///     &domain,
///     4e-3,
///     1.0,
///     None,
/// )?;
/// assert!((contact_radius_m - 2e-3).abs() < 5e-5 && (indentation_m - 0.536e-3).abs() < 3e-5);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct BallCalibration<T> {
    /// The table, ready to use with the same signal.
    pub table: DepthTable<T>,
    /// Centre of the contact (x, y) in pixels.
    pub centre_px: [f64; 2],
    /// Contact radius in metres: that of the circle of equal area.
    pub contact_radius_m: f64,
    /// Depth of the cap at the centre in metres.
    pub indentation_m: f64,
    /// Mean absolute depth residual over the contact in metres, on the pixels calibrated with.
    pub mean_residual_m: f64,
    /// Pixels calibrated with.
    pub pixels: usize,
}

impl<T: PixelScalar> DepthTable<T> {
    /// Calibrates a table from one press of a ball.
    ///
    /// The contact is the largest connected patch of the domain where the signal exceeds
    /// `threshold`. The mask may leave out part of it (to test the table on the rest) if `circle`
    /// gives centre (px) and radius (m). The table counts depth from the contact's outline, where
    /// the signal is the threshold: [`zeroed`](DepthTable::zeroed) counts it from no signal.
    ///
    /// Lengths in metres, signals in grey levels. O(pixels log pixels).
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_sfs::{DepthTable, Domain, Frame, Signal};
    /// let square = |r: usize, c: usize| (r as f64 - 30.0).powi(2) + (c as f64 - 30.0).powi(2);
    /// let depth = |r, c| (1600.0 - square(r, c)).sqrt() - 1200.0_f64.sqrt();
    /// let image = Array2::from_shape_fn((61, 61), |(r, c)| 20.0 * depth(r, c).max(0.0));
    /// let (frame, circle) = (Frame::Real(image.view()), ([30.0, 30.0], 20.0));
    /// let found = DepthTable::from_ball(
    ///     frame,
    ///     Signal::Intensity,
    ///     &Domain::default(),
    ///     40.0,
    ///     1.0,
    ///     Some(circle),
    /// )?;
    /// assert!((found.table.depth(60.0).0 - 3.0).abs() < 0.05 && found.mean_residual_m < 0.05);
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// Those of a wrong domain. [`SfsError::InvalidOption`] for a radius or threshold that is not
    /// positive, or a contact wider than the ball. [`SfsError::TooFewPixels`] below 100 pixels of
    /// contact.
    pub fn from_ball(
        frame: Frame<'_, T>,
        signal: Signal<T>,
        domain: &Domain<'_, T>,
        ball_radius_m: T,
        threshold: T,
        circle: Option<([f64; 2], f64)>,
    ) -> Result<BallCalibration<T>, SfsError> {
        Requirement::Positive.check("ball radius", ball_radius_m.as_f64())?;
        Requirement::Positive.check("contact threshold", threshold.as_f64())?;
        let signals = signals(&frame, &signal, domain)?;
        let step = domain.pixel_size_m.map(T::as_f64);
        let found = || contact_circle(&signals, threshold.as_f64(), step);
        let (centre_px, radius) = circle.map_or_else(found, Ok)?;
        let ball = ball_radius_m.as_f64();
        // A contact circle as wide as the ball has no cap.
        if radius.is_nan() || radius >= ball {
            return Err(SfsError::ContactBeyondBall {
                found_m: radius,
                ball_radius_m: ball,
            });
        }
        let samples = cap_depths(&signals, step, centre_px, radius, ball)?;
        let entries = monotone_means(&samples)
            .into_iter()
            .map(|(s, d)| (T::of(s), T::of(d)));
        let table = DepthTable::new(&entries.collect::<Vec<_>>())?.with_signal(signal);
        let mean_residual_m = mean_residual(&table, &samples);
        Ok(BallCalibration {
            table,
            centre_px,
            contact_radius_m: radius,
            indentation_m: ball - (ball * ball - radius * radius).sqrt(),
            mean_residual_m,
            pixels: samples.len(),
        })
    }
}

/// Mean |depth of the table − depth of the ball|.
fn mean_residual<T: PixelScalar>(table: &DepthTable<T>, samples: &[(f64, f64)]) -> f64 {
    let residual =
        |&(signal, depth): &(f64, f64)| (table.depth(T::of(signal)).0.as_f64() - depth).abs();
    samples.iter().map(residual).sum::<f64>() / samples.len() as f64
}

/// The signal of each pixel, NaN outside the mask.
fn signals<T: PixelScalar>(
    frame: &Frame<'_, T>,
    signal: &Signal<T>,
    domain: &Domain<'_, T>,
) -> Result<Array2<f64>, SfsError> {
    domain.bounding_box(frame.dim())?;
    signal.check_reference(frame.dim())?;
    Ok(Array2::from_shape_fn(frame.dim(), |(row, column)| {
        let inside = domain.contains(row, column);
        if inside {
            signal.of_pixel(frame, row, column).as_f64()
        } else {
            f64::NAN
        }
    }))
}

/// Signal and depth √(R² − r²) − √(R² − a²) of the pixels inside the contact circle.
fn cap_depths(
    signals: &Array2<f64>,
    step: [f64; 2],
    centre: [f64; 2],
    radius: f64,
    ball: f64,
) -> Result<Vec<(f64, f64)>, SfsError> {
    let rim = (ball * ball - radius * radius).sqrt();
    let depth = |(row, column): (usize, usize)| {
        let r2 = ((column as f64 - centre[0]) * step[0]).powi(2)
            + ((row as f64 - centre[1]) * step[1]).powi(2);
        (r2 < radius * radius).then(|| (ball * ball - r2).sqrt() - rim)
    };
    let finite = signals
        .indexed_iter()
        .filter(|(_, signal)| signal.is_finite());
    let samples: Vec<_> = finite
        .filter_map(|(at, &signal)| Some((signal, depth(at)?)))
        .collect();
    if samples.len() < FEWEST {
        return Err(SfsError::TooFewPixels {
            needed: FEWEST,
            available: samples.len(),
        });
    }
    Ok(samples)
}

/// Mean depth of each signal level (steps of one unit), pooled until depths increase. Starts at
/// depth 0 for signal 0.
fn monotone_means(samples: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut sorted: Vec<(i64, f64, f64)> = samples
        .iter()
        .map(|&(s, d)| (s.round() as i64, s, d))
        .collect();
    // The whole tuple decides, so that sums do not depend on the order of equal levels.
    sorted.sort_by(|a, b| {
        a.0.cmp(&b.0)
            .then(a.1.total_cmp(&b.1))
            .then(a.2.total_cmp(&b.2))
    });
    // A block: weight, sum of signals, sum of depths.
    let mut blocks: Vec<(f64, f64, f64)> = Vec::new();
    for level in sorted.chunk_by(|a, b| a.0 == b.0) {
        let n = level.len() as f64;
        blocks.push((
            n,
            level.iter().map(|e| e.1).sum(),
            level.iter().map(|e| e.2).sum(),
        ));
        // Pooling adjacent violators: blocks whose means do not rise are merged until they do.
        while let [.., a, b] = blocks[..] {
            if b.2 / b.0 > a.2 / a.0 {
                break;
            }
            blocks.truncate(blocks.len() - 2);
            blocks.push((a.0 + b.0, a.1 + b.1, a.2 + b.2));
        }
    }
    let mut entries = vec![(0.0, 0.0)];
    entries.extend(
        blocks
            .iter()
            .map(|b| (b.1 / b.0, b.2 / b.0))
            // The entry (0, 0) stands for signals up to 0, and signals of a table must increase.
            .filter(|e| e.0 > 0.0),
    );
    entries
}

/// Fewest pixels of contact a calibration makes sense for.
const FEWEST: usize = 100;

/// Centroid (px) and radius of equal area (m) of the largest connected patch above the threshold:
/// other patches, such as uneven light at the frame's edge, are no contact. O(pixels).
///
/// Stray pixels are kept from counting by demanding that four of the eight neighbours are above the
/// threshold too.
fn contact_circle(
    signals: &Array2<f64>,
    threshold: f64,
    step: [f64; 2],
) -> Result<([f64; 2], f64), SfsError> {
    let above = |r: usize, c: usize| signals.get([r, c]).is_some_and(|&s| s > threshold);
    let counted = Array2::from_shape_fn(signals.dim(), |(r, c)| {
        let near = (0..9)
            .filter(|k| above((r + k / 3).wrapping_sub(1), (c + k % 3).wrapping_sub(1)))
            .count();
        above(r, c) && near > 4
    });
    // Of patches as large as each other the first.
    let patches = parts(counted.view(), true).into_iter().rev();
    let patch = patches.max_by_key(Vec::len).unwrap_or_default();
    if patch.len() < FEWEST {
        return Err(SfsError::TooFewPixels {
            needed: FEWEST,
            available: patch.len(),
        });
    }
    let n = patch.len() as f64;
    let mean = |axis: usize| patch.iter().map(|at| at[axis] as f64).sum::<f64>() / n;
    // By area, because single pixels at the rim move it far less than they move an outline.
    let radius = (n * step[0] * step[1] / core::f64::consts::PI).sqrt();
    Ok(([mean(1), mean(0)], radius))
}
