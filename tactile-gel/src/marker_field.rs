//! Markers followed from the reference through frames: sideways motion of the face, the resulting
//! shear force and torque, and slip.

use nalgebra::{Matrix2, Point2, Rotation2, Vector2};
use tactile_core::Estimate;
use tactile_core::statistics::median;
use tactile_match::{AnnealedSoftassign, Doubt, LatticeStep, MatchError, PointMatcher};
use tactile_tps::{LocalField, LocalValue, nearest_rows};

use crate::markers::Marker;

/// Minimum number of tracks. Fewer do not reveal their own noise.
const LEAST_TRACKS: usize = 4;
/// A marker is accepted within this number of standard errors of the field's prediction, and within
/// a third of the spacing: further away, a chance coincidence is equally likely.
const PREDICTED: f64 = 4.0;
/// A marker slips if it deviates from the rigid motion by this number of standard errors and this
/// number of pixels. The second limit is needed because the gel below the edge of a contact deforms
/// slightly.
const SLIP_ERRORS: f64 = 4.0;
const LEAST_SLIP_PX: f64 = 0.3;
/// Number of visible markers around a hidden one that assess the field in the gap.
const BESIDE: usize = 4;
/// Maximum number of markers whose pairs are tried for a rigid motion.
const TRIED: usize = 60;

/// Motion of a marker of the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MarkerTrack {
    /// Row of the marker in the reference.
    pub row: usize,
    /// Row of the marker in the frame. `None` if it is hidden: it then moves like the markers
    /// around it.
    pub seen_row: Option<usize>,
    /// Centre in the reference, in pixels.
    pub position_px: Point2<f64>,
    /// Displacement in pixels.
    pub displacement_px: Vector2<f64>,
    /// Standard errors of a coordinate of the position and of the displacement.
    pub standard_errors_px: [f64; 2],
}

impl MarkerTrack {
    fn start_px(&self) -> Point2<f64> {
        self.position_px
    }

    /// Position in the frame, in pixels.
    pub fn place_px(&self) -> Point2<f64> {
        self.position_px + self.displacement_px
    }
}

/// Markers followed from the reference to a frame.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_gel::{Marker, MarkerField};
/// // A grid moves by 1.5 steps along x, which only the intermediate frames reveal.
/// let frame = |k: u32| -> Vec<_> {
///     let place = |i: u32| Point2::new(f64::from(10 * (i % 7) + k), f64::from(10 * (i / 7)));
///     (0..42).map(|i| Marker::new(place(i), 0.05, 60.0)).collect()
/// };
/// let mut field = MarkerField::at_rest(&frame(0));
/// for k in 1..=15 {
///     field = field.followed(&frame(k))?;
/// }
/// assert!(field.doubt.is_none());
/// assert!((field.largest_px().expect("42 markers").value - 15.0).abs() < 1e-9);
/// # Ok::<(), tactile_gel::GelError>(())
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MarkerField {
    /// One track per marker of the reference.
    pub tracks: Vec<MarkerTrack>,
    /// The matcher's doubt about the pairs. `None` if it has none.
    pub doubt: Option<Doubt>,
    /// The lattice step by which the pairs of the last two frames can be shifted: the smallest
    /// motion is assumed.
    pub period: Option<LatticeStep>,
    /// Positions in the last frame without a doubt.
    known: Vec<Point2<f64>>,
    matcher: AnnealedSoftassign,
}

/// Shear force and torque, with standard errors from those of the markers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct MarkerShear {
    /// F_x and F_y in newtons.
    pub force_n: [Estimate; 2],
    /// M_z about the mean of the reference's markers, in newton metres.
    pub torque_nm: Estimate,
    /// Column and row of the reference point of the torque, the mean of the reference's markers.
    pub about_px: [f64; 2],
}

/// Number of markers of a contact that deviate from its rigid motion.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct MarkerSlip {
    /// Number of markers inside the contact in both frames.
    pub markers: usize,
    /// Fraction of these markers that slip.
    pub share: f64,
    /// Rigid motion of the sticking markers: translation of their centre along x and y, in pixels.
    pub motion_px: [f64; 2],
    /// Rotation of the rigid motion in radians.
    pub turn_rad: f64,
}

/// Follows markers from the reference to a frame. No order or grid is assumed, and markers may be
/// missing in either.
///
/// [`AnnealedSoftassign`] pairs the markers. If markers on a lattice have moved by more than a
/// sixth of its step, there is a [`doubt`](MarkerField::doubt), because a shift by another step
/// would fit as well. Following them from frame to frame ([`MarkerField::followed`]) avoids the
/// doubt, and so does a [largest motion](MarkerField::with_largest_motion_px).
///
/// ```
/// use nalgebra::Point2;
/// use tactile_gel::{Marker, track_markers};
/// let place = |k: usize| {
///     Point2::new(
///         10.0 * (k % 7) as f64,
///         11.0 * (k / 7) as f64 + (k % 3) as f64,
///     )
/// };
/// let reference: Vec<_> = (0..42).map(|k| Marker::new(place(k), 0.05, 60.0)).collect();
/// // Sheared by 10 %, with the last markers hidden.
/// let sheared = |p: Point2<f64>| Point2::new(p.x + 0.1 * p.y, p.y);
/// let frame: Vec<_> = (0..38).map(|k| Marker::new(sheared(place(k)), 0.05, 60.0)).collect();
/// let field = track_markers(&reference, &frame)?;
/// assert_eq!(field.seen().count(), 38);
/// assert!(field.seen().all(|track| track.seen_row == Some(track.row)));
/// // The hidden markers follow the others.
/// assert!((field.tracks[41].displacement_px.x - 0.1 * place(41).y).abs() < 0.05);
/// # Ok::<(), tactile_gel::GelError>(())
/// ```
///
/// # Errors
/// Those of the matcher, such as too few markers.
pub fn track_markers(reference: &[Marker], frame: &[Marker]) -> Result<MarkerField, MatchError> {
    MarkerField::at_rest(reference).followed(frame)
}

impl MarkerField {
    /// The markers of a reference, all without motion.
    pub fn at_rest(reference: &[Marker]) -> Self {
        let track = |(row, marker): (usize, &Marker)| MarkerTrack {
            row,
            seen_row: Some(row),
            position_px: marker.position_px,
            displacement_px: Vector2::zeros(),
            standard_errors_px: [marker.standard_error_px; 2],
        };
        Self {
            tracks: reference.iter().enumerate().map(track).collect(),
            doubt: None,
            period: None,
            known: reference.iter().map(|marker| marker.position_px).collect(),
            matcher: AnnealedSoftassign::default(),
        }
    }

    /// Sets the largest motion of a marker from one frame to the next, in pixels.
    ///
    /// # Errors
    /// [`MatchError`] for a motion that is not positive.
    pub fn with_largest_motion_px(mut self, motion: f64) -> Result<Self, MatchError> {
        self.matcher = self.matcher.with_largest_motion(motion)?;
        Ok(self)
    }

    /// Follows the markers to the next frame. The matcher starts from their last positions without
    /// a doubt.
    ///
    /// # Errors
    /// Those of the matcher, such as too few markers.
    pub fn followed(&self, frame: &[Marker]) -> Result<Self, MatchError> {
        let there: Vec<_> = frame.iter().map(|marker| marker.position_px).collect();
        let mut matching = self.matcher.match_points(&self.known, &there)?;
        if matching.report.doubt().is_some() {
            // Separate still frames start at rest.
            let rest: Vec<_> = self.tracks.iter().map(|track| track.position_px).collect();
            let other = self.matcher.match_points(&rest, &there)?;
            if other.report.doubt().is_none() {
                matching = other;
            }
        }
        let (doubt, period) = (matching.report.doubt(), matching.report.period);
        let tracks = self.tracks_to(matching.assignment, frame);
        Ok(Self {
            known: match doubt {
                None => tracks.iter().map(MarkerTrack::place_px).collect(),
                Some(_) => self.known.clone(),
            },
            tracks,
            doubt,
            period,
            matcher: self.matcher,
        })
    }

    /// The tracks of all markers. If a marker has no partner, the field through the others rejects
    /// contradicting pairs, finds markers at predicted positions, and moves the rest.
    fn tracks_to(&self, mut partners: Vec<Option<usize>>, frame: &[Marker]) -> Vec<MarkerTrack> {
        let tracks = |partners: &[Option<usize>], values: &[LocalValue<2>]| -> Vec<MarkerTrack> {
            let pairs = self.tracks.iter().zip(partners);
            pairs
                .map(|(track, partner)| match partner {
                    Some(j) => track.seen(*j, &frame[*j]),
                    None => track.hidden(values.get(track.row)),
                })
                .collect()
        };
        if partners.iter().all(Option::is_some) {
            return tracks(&partners, &[]);
        }
        let Some((field, kept)) = field_through(&tracks(&partners, &[])) else {
            return tracks(&partners, &[]);
        };
        for (row, kept) in kept {
            partners[row] = partners[row].filter(|_| kept);
        }
        let places: Vec<_> = self.tracks.iter().map(|track| track.position_px).collect();
        let values = field.at(&places);
        let mut taken = vec![false; frame.len()];
        partners.iter().flatten().for_each(|&j| taken[j] = true);
        let mut meetings = Vec::new();
        for (i, value) in values
            .iter()
            .enumerate()
            .filter(|(i, _)| partners[*i].is_none())
        {
            let error = (value.displacement_variance + value.sigma.powi(2)).sqrt();
            let farthest = value.spacing / 3.0;
            let reach = (PREDICTED * error).max(0.1 * farthest);
            for (j, marker) in frame.iter().enumerate().filter(|(j, _)| !taken[*j]) {
                let miss = (marker.position_px - places[i] - value.displacement).norm();
                if reach <= farthest && miss <= reach {
                    meetings.push((miss, i, j));
                }
            }
        }
        meetings.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, i, j) in meetings {
            if !taken[j] && partners[i].is_none() {
                (taken[j], partners[i]) = (true, Some(j));
            }
        }
        let mut tracks = tracks(&partners, &values);
        let wider = gap_error(&tracks);
        for track in tracks.iter_mut().filter(|track| track.seen_row.is_none()) {
            track.standard_errors_px[1] *= wider;
        }
        tracks
    }

    /// The tracks of the visible markers.
    pub fn seen(&self) -> impl Iterator<Item = &MarkerTrack> {
        self.tracks.iter().filter(|track| track.seen_row.is_some())
    }

    /// The largest displacement of a visible marker, in pixels. `None` if no marker is visible.
    pub fn largest_px(&self) -> Option<Estimate> {
        let lengths = self
            .seen()
            .map(|track| Estimate::new(track.displacement_px.norm(), track.standard_errors_px[1]));
        lengths.max_by(|a, b| a.value.total_cmp(&b.value))
    }

    /// Mean Green–Lagrange strain of the face, E_xx, E_yy and E_xy. `None` for fewer than four
    /// visible markers, and if they lie on a line.
    ///
    /// The strain is E = (H + Hᵀ + HᵀH)/2 for the mean gradient H of the field through the markers.
    /// Its error follows from the covariance of H to first order.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_gel::{Marker, track_markers};
    /// let place = |k: u32| Point2::new(f64::from(10 * (k % 6)), f64::from(10 * (k / 6)));
    /// let frame = |stretch: f64| -> Vec<_> {
    ///     let place = |k| Point2::new(stretch * place(k).x, place(k).y);
    ///     (0..36).map(|k| Marker::new(place(k), 0.05, 60.0)).collect()
    /// };
    /// let strain = track_markers(&frame(1.0), &frame(1.02))?.strain().expect("36 markers");
    /// assert!((strain[0].value - (1.02_f64.powi(2) - 1.0) / 2.0).abs() < 1e-6);
    /// # Ok::<(), tactile_gel::GelError>(())
    /// ```
    pub fn strain(&self) -> Option<[Estimate; 3]> {
        let (field, _) = field_through(&self.tracks)?;
        let count = field.values.len() as f64;
        let mean = field.values.iter().map(|value| value.gradient);
        let h = mean.sum::<Matrix2<f64>>() / count;
        let f = h + Matrix2::identity();
        let (strain, c) = (
            0.5 * (h + h.transpose() + h.transpose() * h),
            field.mean_gradient_covariance,
        );
        // dE = (dHᵀ F + Fᵀ dH)/2, and the rows of H are independent.
        let variance = |a: usize, b: usize| -> f64 {
            let row = |i: usize| {
                let [x, y] = [f[(i, b)], f[(i, a)]];
                x * x * c[(a, a)] + y * y * c[(b, b)] + 2.0 * x * y * c[(a, b)]
            };
            0.25 * (row(0) + row(1))
        };
        let part = |(a, b)| {
            let estimate = Estimate::from_variance(strain[(a, b)], variance(a, b));
            estimate.with_degrees_of_freedom(field.degrees_of_freedom as f64)
        };
        let parts = [(0, 0), (1, 1), (0, 1)].map(part);
        parts
            .iter()
            .all(|part| part.standard_error.is_finite())
            .then_some(parts)
    }

    /// Shear force and torque of a gel whose surface resists displacement by k Pa per metre: F = k
    /// A Σ u and M = k A Σ (r × u). The sums are over the cells of all markers of the reference,
    /// with the area A of a cell. Hidden markers move like those around them, with a corresponding
    /// error.
    ///
    /// A layer of shear modulus G and thickness h bonded to a rigid plate has k = G/h. For the
    /// whole face this holds for contacts of any width, because only the longest wave carries a net
    /// force. Errors include those of the markers, but not of k. `None` without three markers that
    /// are not on a line.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_gel::{Marker, track_markers};
    /// let place = |k: usize| Point2::new(10.0 * (k % 6) as f64, 10.0 * (k / 6) as f64);
    /// let all = |dx: f64, seen: usize| -> Vec<_> {
    ///     (0..seen)
    ///         .map(|k| Marker::new(place(k) + nalgebra::Vector2::new(dx, 0.0), 0.05, 60.0))
    ///         .collect()
    /// };
    /// // 36 cells of 1 mm² move by 0.1 mm on a layer of 1e8 Pa/m. A third of them are hidden.
    /// let field = track_markers(&all(0.0, 36), &all(1.0, 24))?;
    /// let shear = field.shear(1e8, 1e-4).expect("a grid");
    /// assert!((shear.force_n[0].value - 0.36).abs() < 1e-3 && shear.torque_nm.value.abs() < 1e-6);
    /// # Ok::<(), tactile_gel::GelError>(())
    /// ```
    pub fn shear(&self, stiffness_pa_per_m: f64, pixel_size_m: f64) -> Option<MarkerShear> {
        let places: Vec<_> = self.tracks.iter().map(|track| track.position_px).collect();
        let scale = stiffness_pa_per_m * cell_area(&places)? * pixel_size_m.powi(3);
        let mean = places.iter().map(|p| p.coords).sum::<Vector2<f64>>() / places.len() as f64;
        let (mut force, mut torque) = (Vector2::zeros(), 0.0);
        // Variances of visible markers, and standard errors of hidden ones, whose errors are
        // common.
        let (mut seen, mut hidden) = ([0.0; 2], [0.0; 2]);
        for track in &self.tracks {
            let (r, u) = (track.position_px.coords - mean, track.displacement_px);
            force += u;
            torque += r.x * u.y - r.y * u.x;
            let error = track.standard_errors_px[1];
            for (k, arm) in [1.0, r.norm()].into_iter().enumerate() {
                match track.seen_row {
                    Some(_) => seen[k] += (arm * error).powi(2),
                    None => hidden[k] += arm * error,
                }
            }
        }
        let estimate = |value: f64, k: usize, scale: f64| {
            Estimate::new(scale * value, scale * seen[k].sqrt().hypot(hidden[k]))
        };
        Some(MarkerShear {
            force_n: [force.x, force.y].map(|sum| estimate(sum, 0, scale)),
            torque_nm: estimate(torque, 1, scale * pixel_size_m),
            about_px: mean.into(),
        })
    }

    /// Number of markers under a contact that have left its rigid motion since an earlier frame.
    /// `covers` is true for positions (in pixels) inside the contact.
    ///
    /// Markers that stick to a rigid body move rigidly. The majority determines the motion: if more
    /// than half of the markers slip, it is theirs, and a contact that slips as a whole shows no
    /// slip. A marker slips if it deviates by four standard errors and a third of a pixel. `None`
    /// for fewer than four visible markers inside the contact in both frames.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_gel::{Marker, track_markers};
    /// let place = |k: u32| Point2::new(f64::from(10 * (k % 6)), f64::from(10 * (k / 6)));
    /// let frame = |moved: &dyn Fn(u32) -> f64| -> Vec<_> {
    ///     let there = |k| Point2::new(place(k).x + moved(k), place(k).y);
    ///     (0..36).map(|k| Marker::new(there(k), 0.05, 60.0)).collect()
    /// };
    /// let rest = frame(&|_| 0.0);
    /// let start = track_markers(&rest, &frame(&|_| 0.2))?;
    /// // The last six of them stay behind.
    /// let field = track_markers(&rest, &frame(&|k| if k < 30 { 3.0 } else { 1.5 }))?;
    /// let slip = field.slip_since(&start, |_| true).expect("36 markers");
    /// assert!((slip.share - 1.0 / 6.0).abs() < 1e-9 && (slip.motion_px[0] - 2.8).abs() < 0.01);
    /// # Ok::<(), tactile_gel::GelError>(())
    /// ```
    pub fn slip_since(
        &self,
        before: &Self,
        covers: impl Fn(Point2<f64>) -> bool,
    ) -> Option<MarkerSlip> {
        let both = before.tracks.iter().zip(&self.tracks);
        let inside = both.filter(|(old, new)| {
            let seen = old.seen_row.is_some() && new.seen_row.is_some();
            seen && covers(old.place_px()) && covers(new.place_px())
        });
        let moves: Vec<Step> = inside.map(|(old, new)| Step::of(old, new)).collect();
        if moves.len() < LEAST_TRACKS {
            return None;
        }
        let mut motion = RigidMotion::of_most(&moves)?;
        for _ in 0..2 {
            let stuck: Vec<Step> = moves
                .iter()
                .filter(|m| !motion.leaves(m))
                .copied()
                .collect();
            motion = RigidMotion::of_all(&stuck).unwrap_or(motion);
        }
        let slipped = moves.iter().filter(|step| motion.leaves(step)).count();
        let middle = moves.iter().map(|m| m.from.coords).sum::<Vector2<f64>>() / moves.len() as f64;
        Some(MarkerSlip {
            markers: moves.len(),
            share: slipped as f64 / moves.len() as f64,
            motion_px: (motion.image(middle.into()).coords - middle).into(),
            turn_rad: motion.turn.angle(),
        })
    }
}

impl MarkerTrack {
    fn seen(&self, row: usize, marker: &Marker) -> Self {
        let [own, _] = self.standard_errors_px;
        Self {
            seen_row: Some(row),
            displacement_px: marker.position_px - self.position_px,
            standard_errors_px: [own, own.hypot(marker.standard_error_px)],
            ..*self
        }
    }

    /// Moves the marker with the local field. Without a field its motion is unknown.
    fn hidden(&self, value: Option<&LocalValue<2>>) -> Self {
        let moved = value.map(|value| (value.displacement, value.displacement_variance.sqrt()));
        let (displacement_px, error) = moved.unwrap_or((Vector2::zeros(), f64::INFINITY));
        Self {
            seen_row: None,
            displacement_px,
            standard_errors_px: [self.standard_errors_px[0], error],
            ..*self
        }
    }
}

/// The field through the visible tracks, and whether each row agrees with it. `None` for few
/// tracks.
fn field_through(tracks: &[MarkerTrack]) -> Option<(LocalField<2>, Vec<(usize, bool)>)> {
    let seen: Vec<_> = tracks
        .iter()
        .filter(|track| track.seen_row.is_some())
        .collect();
    if seen.len() < LEAST_TRACKS {
        return None;
    }
    let [from, to] = [MarkerTrack::start_px, MarkerTrack::place_px]
        .map(|place| seen.iter().map(|track| place(track)).collect::<Vec<_>>());
    let field = LocalField::fit(&from, &to).ok()?;
    let rows = seen.iter().map(|track| track.row);
    let kept = rows.zip(field.kept.iter().copied()).collect();
    Some((field, kept))
}

/// Error of the field in gaps, in its standard errors but at least 1. It is the root mean square
/// deviation from the visible markers next to hidden ones, if these visible markers are left out.
/// The field may behave differently in a gap.
fn gap_error(tracks: &[MarkerTrack]) -> f64 {
    let [hidden, seen] = [false, true].map(|seen| -> Vec<&MarkerTrack> {
        tracks
            .iter()
            .filter(|track| track.seen_row.is_some() == seen)
            .collect()
    });
    let [gap, places] = [&hidden, &seen].map(|tracks| {
        tracks
            .iter()
            .map(|track| track.position_px)
            .collect::<Vec<_>>()
    });
    let mut beside = vec![false; seen.len()];
    nearest_rows(&places, &gap, BESIDE)
        .iter()
        .flatten()
        .for_each(|&k| beside[k] = true);
    let [rim, rest] = [true, false].map(|on_rim| -> Vec<MarkerTrack> {
        let tracks = seen
            .iter()
            .zip(&beside)
            .filter(|(_, beside)| **beside == on_rim);
        tracks.map(|(track, _)| **track).collect()
    });
    // If gaps are spread over the whole face, they are as wide as the spacing, and the field is
    // known there.
    if hidden.is_empty() || rim.len() > rest.len() {
        return 1.0;
    }
    let Some((field, _)) = field_through(&rest) else {
        return 1.0;
    };
    let places: Vec<_> = rim.iter().map(|track| track.position_px).collect();
    let values = field.at(&places).into_iter().zip(&rim);
    let square = values.map(|(value, track)| {
        let miss = (value.displacement - track.displacement_px).norm_squared();
        0.5 * miss / (value.displacement_variance + track.standard_errors_px[1].powi(2))
    });
    (square.sum::<f64>() / rim.len() as f64).sqrt().max(1.0)
}

/// Area of a marker's cell in square pixels. `None` if all markers lie on a line.
///
/// By Pick's theorem, a convex polygon of a lattice with B points on its outline and n points in
/// total covers n − B/2 − 1 cells of any lattice. For scattered markers this is approximately true.
fn cell_area(points: &[Point2<f64>]) -> Option<f64> {
    let spacing = nearest_rows(points, points, 2).into_iter().zip(points);
    let spacing = spacing.filter_map(|(near, p)| Some((points[*near.get(1)?] - p).norm()));
    let spacing = median(&mut spacing.collect::<Vec<f64>>());
    let hull = convex_hull(points);
    let edges = || hull.iter().zip(hull.iter().cycle().skip(1));
    let area = 0.5
        * edges()
            .map(|(a, b)| a.coords.perp(&b.coords))
            .sum::<f64>()
            .abs();
    // Markers up to a quarter of the spacing inside count as on the outline, because of their
    // scatter.
    let on_outline = |p: &&Point2<f64>| {
        edges().any(|(a, b)| {
            let along = b - a;
            along.norm() > 0.0 && along.perp(&(*p - a)).abs() < 0.25 * spacing * along.norm()
        })
    };
    let outline = points.iter().filter(on_outline).count() as f64;
    let cells = points.len() as f64 - 0.5 * outline - 1.0;
    (area > 0.0 && cells > 0.0).then(|| area / cells)
}

/// Corners of the convex hull in order (Andrew, Inf. Process. Lett. 9, 216–219, 1979).
fn convex_hull(points: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let half = |points: &mut dyn Iterator<Item = Point2<f64>>| {
        let mut line: Vec<Point2<f64>> = Vec::new();
        for p in points {
            while let [.., a, b] = line[..]
                && (b - a).perp(&(p - b)) <= 0.0
            {
                line.pop();
            }
            line.push(p);
        }
        line.pop();
        line
    };
    let mut hull = half(&mut sorted.iter().copied());
    hull.extend(half(&mut sorted.iter().rev().copied()));
    hull
}

/// Displacement of a marker between two frames, with the standard error of a coordinate.
#[derive(Clone, Copy)]
struct Step {
    from: Point2<f64>,
    to: Point2<f64>,
    error: f64,
}

impl Step {
    fn of(old: &MarkerTrack, new: &MarkerTrack) -> Self {
        Self {
            from: old.place_px(),
            to: new.place_px(),
            error: old.standard_errors_px[1].hypot(new.standard_errors_px[1]),
        }
    }
}

/// A rotation about the origin, then a translation.
#[derive(Clone, Copy)]
struct RigidMotion {
    turn: Rotation2<f64>,
    shift: Vector2<f64>,
}

impl RigidMotion {
    fn image(&self, p: Point2<f64>) -> Point2<f64> {
        self.turn * p + self.shift
    }

    fn leaves(&self, step: &Step) -> bool {
        (self.image(step.from) - step.to).norm() > (SLIP_ERRORS * step.error).max(LEAST_SLIP_PX)
    }

    /// The least-squares motion. `None` without steps.
    fn of_all(steps: &[Step]) -> Option<Self> {
        let n = steps.len() as f64;
        let mean = |place: fn(&Step) -> Point2<f64>| {
            steps
                .iter()
                .map(|step| place(step).coords)
                .sum::<Vector2<f64>>()
                / n
        };
        let (from, to) = (mean(|step| step.from), mean(|step| step.to));
        let arms = steps
            .iter()
            .map(|s| (s.from.coords - from, s.to.coords - to));
        let (sine, cosine) =
            arms.fold((0.0, 0.0), |(s, c), (a, b)| (s + a.perp(&b), c + a.dot(&b)));
        let turn = Rotation2::new(sine.atan2(cosine));
        (n > 0.0).then(|| Self {
            turn,
            shift: to - turn * from,
        })
    }

    /// The motion through two steps with the smallest median deviation of all steps (Rousseeuw, J.
    /// Am. Stat. Assoc. 79, 871–880, 1984).
    fn of_most(steps: &[Step]) -> Option<Self> {
        let some: Vec<&Step> = steps.iter().step_by(steps.len().div_ceil(TRIED)).collect();
        let pairs = (0..some.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
        let tried = pairs.filter_map(|(a, b)| Self::of_all(&[*some[a], *some[b]]));
        let miss = |motion: &Self| {
            let misses = steps
                .iter()
                .map(|step| (motion.image(step.from) - step.to).norm());
            median(&mut misses.collect::<Vec<f64>>())
        };
        tried
            .map(|motion| (miss(&motion), motion))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|best| best.1)
    }
}
