//! Points followed through the frames of a deformation, with the strain of each step.
use crate::strain_between::{StrainBetween, StrainBetweenError, StrainBetweenOptions};
use nalgebra::Point;

/// Follows points through frames: pairs from each frame to the next, chained to tracks, and the
/// strain of each step and since the first frame.
///
/// The matcher starts from the positions predicted by the last step, or from the current positions
/// if this fails. Points may appear and disappear: a new point starts a track, and an interrupted
/// track of the first frame continues if the total deformation maps it to a new point. Strain since
/// the first frame comes from the tracks that reach back to it, so it is available for deformations
/// that no matcher could handle directly. A frame costs as much time as two calls of
/// [`strain_between`](crate::strain_between). The first frame, the last frame and the rows of all
/// tracks are kept in memory.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_imaging::{StrainBetweenOptions, StrainSeries};
/// // A sheet of 8 × 8 points is stretched to twice its length, and seen through a window.
/// let sheet: Vec<_> = (0..64)
///     .map(|k| Point2::new(f64::from(k % 8) + 0.2 * f64::from(k % 3) - 3.7, f64::from(k / 8)))
///     .collect();
/// let frame = |stretch: f64| -> Vec<_> {
///     let seen = sheet.iter().map(|p| Point2::new(stretch * p.x, p.y));
///     seen.filter(|p| p.x.abs() < 4.0).collect()
/// };
/// let mut series = StrainSeries::new(&frame(1.0), StrainBetweenOptions::default());
/// for k in 1..10 {
///     let found = series.push(&frame(1.0 + 0.1 * f64::from(k)))?;
///     assert!(found.step.rows.len() > 25);
/// }
/// let found = series.push(&frame(2.0))?;
/// // Green–Lagrange since the first frame: (2² − 1)/2.
/// assert!((found.total?.summary.mean[(0, 0)] - 1.5).abs() < 1e-6);
/// let whole = series.tracks().iter().filter(|track| track.len() == 11).count();
/// assert_eq!(whole, frame(2.0).len());
/// # Ok::<(), tactile_imaging::StrainBetweenError>(())
/// ```
#[derive(Clone)]
pub struct StrainSeries<const D: usize> {
    options: StrainBetweenOptions<D>,
    first: Vec<Point<f64, D>>,
    last: Vec<Point<f64, D>>,
    /// Predicted positions of the last frame's points in the next frame.
    predicted: Vec<Point<f64, D>>,
    frames: usize,
    tracks: Vec<Vec<(usize, usize)>>,
    /// The track of each row of the last frame.
    track_of: Vec<usize>,
}

/// Strain of a frame of a [`StrainSeries`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SeriesStrain<const D: usize> {
    /// Strain since the last frame.
    pub step: StrainBetween<D>,
    /// Strain since the first frame. An error if too few tracks reach back to it.
    pub total: Result<StrainBetween<D>, StrainBetweenError>,
}

impl<const D: usize> StrainSeries<D> {
    /// A series that starts with these points.
    #[must_use]
    pub fn new(first: &[Point<f64, D>], options: StrainBetweenOptions<D>) -> Self {
        Self {
            options,
            first: first.to_vec(),
            last: first.to_vec(),
            predicted: first.to_vec(),
            frames: 1,
            tracks: (0..first.len()).map(|row| vec![(0, row)]).collect(),
            track_of: (0..first.len()).collect(),
        }
    }

    /// The tracks in the order of their first frames: frame and row of each point, both from 0.
    /// Rejected frames are not counted.
    #[must_use]
    pub fn tracks(&self) -> &[Vec<(usize, usize)>] {
        &self.tracks
    }

    /// Adds the next frame.
    ///
    /// # Errors
    /// Those of [`strain_between`](crate::strain_between) for the step from the last frame. The
    /// series is then unchanged, and another frame may follow.
    pub fn push(&mut self, next: &[Point<f64, D>]) -> Result<SeriesStrain<D>, StrainBetweenError> {
        let step = match self.step_from(&self.predicted, next) {
            Err(_) if self.predicted != self.last => self.step_from(&self.last, next)?,
            found => found?,
        };
        let mut origin = vec![None; next.len()];
        self.predicted = next.to_vec();
        for (k, &(i, j)) in step.rows.iter().enumerate() {
            if step.is_kept(k) {
                origin[j] = Some(self.track_of[i]);
                self.predicted[j] += step.displacements[k];
            }
        }
        let back = |j: usize| Some((self.tracks[origin[j]?].first().copied()?, j));
        let since_first = (0..next.len()).filter_map(back);
        let pairs: Vec<_> = since_first
            .filter(|&((frame, _), _)| frame == 0)
            .map(|((_, row), j)| (row, j))
            .collect();
        let total = self.options.total(&self.first, next, &pairs);
        let mut seen = vec![false; self.tracks.len()];
        origin
            .iter()
            .flatten()
            .for_each(|&track| seen[track] = true);
        if let Ok(found) = &total {
            for (k, &(i, j)) in found.rows.iter().enumerate() {
                // Tracks of the first frame are in the order of its rows.
                if origin[j].is_none() && !seen[i] && found.is_kept(k) {
                    origin[j] = Some(i);
                }
            }
        }
        let new: Vec<usize> = (0..next.len()).filter(|&j| origin[j].is_none()).collect();
        let places: Vec<_> = new.iter().map(|&j| next[j]).collect();
        for (&j, image) in new.iter().zip(step.images(&places)) {
            self.predicted[j] = image;
        }
        self.track_of.clear();
        for (j, origin) in origin.into_iter().enumerate() {
            let track = origin.unwrap_or(self.tracks.len());
            if track == self.tracks.len() {
                self.tracks.push(Vec::new());
            }
            self.tracks[track].push((self.frames, j));
            self.track_of.push(track);
        }
        self.frames += 1;
        self.last = next.to_vec();
        Ok(SeriesStrain { step, total })
    }

    /// The step from the last frame. Matching starts from the positions `start`.
    fn step_from(
        &self,
        start: &[Point<f64, D>],
        next: &[Point<f64, D>],
    ) -> Result<StrainBetween<D>, StrainBetweenError> {
        let matching = self.options.matched(start, next)?;
        StrainBetween::of_matching(&self.last, next, &matching, &self.options)
    }
}
