//! A depth table from one press of a ball of known radius.
//!
//! Inside the contact circle of radius a the depth is the spherical cap √(R² − r²) − √(R² − a²). Each grey level of the
//! signal gets the mean depth of its pixels, made monotone by pooling (isotonic regression, weights = pixels).

use ndarray::Array2;

use super::depth_table::{DepthTable, Signal};
use crate::error::positive;
use crate::{Domain, Frame, Scalar, SfsError};

/// Fewest pixels of contact a calibration makes sense for.
const FEWEST: usize = 100;

/// A depth table and how well the ball fits it.
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

impl<T: Scalar> DepthTable<T> {
    /// Calibrates a table from one press of a ball.
    ///
    /// The contact is where the signal exceeds `threshold`; the domain's mask should leave out whatever else does, and
    /// may leave out part of the contact (to test the table on the rest) if `circle` gives centre (px) and radius (m).
    ///
    /// # Errors
    /// Those of a wrong domain; [`SfsError::InvalidOption`] for a radius or threshold that is not positive, or a contact
    /// wider than the ball; [`SfsError::TooFewPixels`] below 100 pixels of contact.
    pub fn from_ball(
        frame: Frame<'_, T>,
        signal: Signal<T>,
        domain: &Domain<'_, T>,
        ball_radius_m: T,
        threshold: T,
        circle: Option<([f64; 2], f64)>,
    ) -> Result<BallCalibration<T>, SfsError> {
        positive("ball radius", ball_radius_m.as_f64())?;
        positive("contact threshold", threshold.as_f64())?;
        let (rows, columns) = frame.dim();
        domain.validate(rows, columns)?;
        // The table is replaced at the end; until then only its signal counts.
        let mut table =
            DepthTable::new(&[(T::zero(), T::zero()), (T::one(), T::zero())])?.with_signal(signal);
        table.check_reference((rows, columns))?;
        let signals = Array2::from_shape_fn((rows, columns), |(row, column)| {
            let inside = domain.contains(row, column);
            if inside { table.signal_at(&frame, row, column).as_f64() } else { f64::NAN }
        });
        let step = domain.pixel_size_m.map(Scalar::as_f64);
        let (centre, radius) = match circle {
            Some(circle) => circle,
            None => contact_circle(&signals, threshold.as_f64(), step)?,
        };
        let ball = ball_radius_m.as_f64();
        crate::error::in_range("contact radius", "less than the ball's radius", radius, radius < ball)?;
        let rim = (ball * ball - radius * radius).sqrt();
        let samples: Vec<(f64, f64)> = signals
            .indexed_iter()
            .filter_map(|((row, column), &signal)| {
                let (x, y) = ((column as f64 - centre[0]) * step[0], (row as f64 - centre[1]) * step[1]);
                let r2 = x * x + y * y;
                (signal.is_finite() && r2 < radius * radius)
                    .then(|| (signal, (ball * ball - r2).sqrt() - rim))
            })
            .collect();
        if samples.len() < FEWEST {
            return Err(SfsError::TooFewPixels { needed: FEWEST, available: samples.len() });
        }
        let entries: Vec<(T, T)> =
            monotone_means(&samples).iter().map(|&(s, d)| (T::of(s), T::of(d))).collect();
        table = DepthTable::new(&entries)?.with_signal(table.signal().clone());
        let residual = |&(signal, depth): &(f64, f64)| (table.depth(T::of(signal)).0.as_f64() - depth).abs();
        let mean_residual_m = samples.iter().map(residual).sum::<f64>() / samples.len() as f64;
        Ok(BallCalibration {
            table,
            centre_px: centre,
            contact_radius_m: radius,
            indentation_m: ball - rim,
            mean_residual_m,
            pixels: samples.len(),
        })
    }
}

/// Centroid (px) and radius of equal area (m) of the pixels above the threshold. Stray pixels are kept from counting by
/// demanding that four of the eight neighbours are above it too.
fn contact_circle(
    signals: &Array2<f64>,
    threshold: f64,
    step: [f64; 2],
) -> Result<([f64; 2], f64), SfsError> {
    let above = |r: usize, c: usize| signals.get([r, c]).is_some_and(|&s| s > threshold);
    let (mut x, mut y, mut count) = (0.0, 0.0, 0usize);
    for ((r, c), _) in signals.indexed_iter().filter(|(_, s)| **s > threshold) {
        let near = (0..9).filter(|k| above((r + k / 3).wrapping_sub(1), (c + k % 3).wrapping_sub(1))).count();
        if near > 4 {
            x += c as f64;
            y += r as f64;
            count += 1;
        }
    }
    if count < FEWEST {
        return Err(SfsError::TooFewPixels { needed: FEWEST, available: count });
    }
    let n = count as f64;
    Ok(([x / n, y / n], (n * step[0] * step[1] / core::f64::consts::PI).sqrt()))
}

/// Mean depth of each signal level (steps of one unit), pooled until depths increase; starts at depth 0 for signal 0.
fn monotone_means(samples: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut sorted: Vec<(i64, f64, f64)> = samples.iter().map(|&(s, d)| (s.round() as i64, s, d)).collect();
    sorted.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2)));
    // A block: weight, sum of signals, sum of depths.
    let mut blocks: Vec<(f64, f64, f64)> = Vec::new();
    for level in sorted.chunk_by(|a, b| a.0 == b.0) {
        let n = level.len() as f64;
        blocks.push((n, level.iter().map(|e| e.1).sum(), level.iter().map(|e| e.2).sum()));
        while let [.., a, b] = blocks[..] {
            if b.2 / b.0 > a.2 / a.0 {
                break;
            }
            blocks.truncate(blocks.len() - 2);
            blocks.push((a.0 + b.0, a.1 + b.1, a.2 + b.2));
        }
    }
    let mut entries = vec![(0.0, 0.0)];
    entries.extend(blocks.iter().map(|b| (b.1 / b.0, b.2 / b.0)).filter(|e| e.0 > 0.0));
    entries
}
