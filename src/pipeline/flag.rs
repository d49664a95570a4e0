//! Typed cautions: the result holds with a reservation.
use super::contact::ContactReading;
use super::error::PipelineError;
use crate::elasticity::modulus::Warning;
use crate::force::{Estimate, LineDoubt};

/// A caution about a result. Frames are counted from 0, as in the calls. It also implements
/// [`Error`](std::error::Error), for callers that reject results with a caution.
///
/// ```
/// use tactile_imaging::force::{CalibrationPair, Estimate};
/// use tactile_imaging::pipeline::{Flag, Object, Pipeline};
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let hertz = |peak: f64| {
///     ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
///         let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
///         10 + (peak * (1.0 - d * d).sqrt()).round() as u8
///     })
/// };
/// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
/// let (reference, frame) = (hertz(0.0), hertz(120.0));
/// // The camera sees the right half of the contact, and a gauge reads 1 N.
/// let [reference, half] = [&reference, &frame].map(|image| image.slice(ndarray::s![.., 32..]));
/// let mut press = pipeline.press(reference)?;
/// press.add_gauged_frame(half, Some(Estimate::new(1.0, 0.0)));
/// let flags = press.measure().flags;
/// assert!(flags.contains(&Flag::TouchesEdge { frame: 0 }));
/// assert!(
///     flags.iter().any(
///         |flag| matches!(flag, Flag::GaugeDisagrees { measured_n, .. } if *measured_n < 0.6)
///     )
/// );
/// assert_eq!(flags[0].to_string(), "frame 0: the contact reaches the frame's edge");
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(tag = "kind", rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum Flag {
    /// Some of the contact's pixels are saturated, so force and radius are too low.
    #[error("frame {frame}: {:.2} % of the contact is saturated", 100.0 * share)]
    Saturated {
        /// The frame.
        frame: usize,
        /// Fraction of the contact's pixels.
        share: f64,
    },
    /// The signal is outside the range of the calibration.
    #[error("frame {frame}: outside the range of the calibration")]
    OutOfCalibration {
        /// The frame.
        frame: usize,
    },
    /// The contact reaches the edge of the frame.
    #[error("frame {frame}: the contact reaches the frame's edge")]
    TouchesEdge {
        /// The frame.
        frame: usize,
    },
    /// The contact is wider than the frame: most of it is outside the view, or the light has
    /// changed everywhere.
    #[error(
        "frame {frame}: the contact, {:.3} mm in radius, is wider than the frame: its size is \
         undetermined",
        1e3 * radius_m
    )]
    WiderThanFrame {
        /// The frame.
        frame: usize,
        /// Contact radius in metres.
        radius_m: f64,
    },
    /// The standard error of a number is larger than the number.
    #[error(
        "frame {frame}: the {quantity} is undetermined: its error ({}) is larger than its value \
         ({})",
        in_unit(quantity, *standard_error), in_unit(quantity, *value)
    )]
    CannotBeTold {
        /// The frame.
        frame: usize,
        /// Name of the number.
        quantity: &'static str,
        /// The value in SI units.
        value: f64,
        /// Standard error of the value.
        standard_error: f64,
    },
    /// There is no contact, but the signal has the wrong sign for one.
    #[error("{}", PipelineError::OppositeSignal { frame: *frame, grey: *grey })]
    OppositeSignal {
        /// The frame.
        frame: usize,
        /// Largest difference of frame minus reference, in grey levels.
        grey: f64,
    },
    /// The frame has lost its light: the camera dropped it, or the lamps were off. It is left out.
    #[error("frame {frame}: black, left out: a dropped frame, or the lamps were off")]
    BlackFrame {
        /// The frame.
        frame: usize,
    },
    /// The frame shows more than one contact. The largest is measured, and the theory assumes a
    /// single contact.
    #[error("frame {frame}: {} besides the one measured", other_contacts(*others))]
    SeveralContacts {
        /// The frame.
        frame: usize,
        /// Number of contacts besides the largest.
        others: usize,
    },
    /// The light has changed since the reference was taken.
    #[error("the light has drifted by {grey:+.2} grey levels since the reference was taken")]
    LightDrifted {
        /// Mean of frame minus reference without contact, in grey levels.
        grey: f64,
    },
    /// The light of the reference is not that of the calibration. Forces are divided by the factor of
    /// the lamps, whose error is included.
    #[error("{}", light_changed(*change, *change_error, *stray_grey, *uneven))]
    LightChanged {
        /// The factor of the lamps minus one.
        change: f64,
        /// Its standard error.
        change_error: f64,
        /// Light added to that of the lamps, in grey levels. NaN if the background is too dark now.
        stray_grey: f64,
        /// Deviation from a common change, relative.
        uneven: f64,
    },
    /// The fit of the contact's profile did not converge.
    #[error("frame {frame}: the profile's fit did not converge")]
    ProfileNotConverged {
        /// The frame.
        frame: usize,
    },
    /// The pressure profile is not that of a ball: the contact radius belongs to the best-fitting
    /// ball.
    #[error(
        "frame {frame}: the pressure deviates from that of a ball by {:.1} % of its peak",
        100.0 * misfit
    )]
    NotABall {
        /// The frame.
        frame: usize,
        /// Misfit as a fraction of the peak.
        misfit: f64,
    },
    /// The object is a punch, which touches with its whole face, but the contact has another
    /// radius.
    #[error(
        "frame {frame}: the contact's radius is {:.3} mm, that of the punch {:.3} mm",
        1e3 * radius_m, 1e3 * punch_m
    )]
    NotThePunch {
        /// The frame.
        frame: usize,
        /// Contact radius in metres.
        radius_m: f64,
        /// Radius of the punch.
        punch_m: f64,
    },
    /// No gel can withstand the mean stress, or none would show it. The unit of the forces, the
    /// light or the pixel size is probably wrong.
    #[error(
        "frame {frame}: a mean stress of {mean_stress_pa:.1e} Pa is {}: are the forces in newtons \
         and the pixel sizes in the stated unit?",
        if *mean_stress_pa > 1.0e3 { "more than any gel withstands" } else { "less than any gel shows" }
    )]
    UnlikelyStress {
        /// The frame.
        frame: usize,
        /// Mean stress in pascals.
        mean_stress_pa: f64,
    },
    /// The outline of the contact is not round: the pixel sizes are misstated, the lens distorts,
    /// or the object is not a ball.
    #[error("frame {frame}: the contact is {:.1} % longer than wide", 100.0 * elongation)]
    NotRound {
        /// The frame.
        frame: usize,
        /// Longer over shorter half axis, minus one.
        elongation: f64,
    },
    /// The calibration pairs are not on a line: light is not proportional to pressure, so profile
    /// and radius of the light differ from those of the pressure. A sensor calibrated from frames
    /// has the local curve and avoids this.
    #[error(
        "frame {frame}: the calibration's pairs deviate from a line by {:.1} % of the full scale: \
         light is not proportional to pressure",
        100.0 * departure
    )]
    LightNotProportional {
        /// The frame.
        frame: usize,
        /// Deviation of the pairs from a line at half scale, as a fraction of the full scale.
        departure: f64,
    },
    /// The calibration's pairs have a force without light. Every force has this standard error.
    #[error(
        "the calibration's pairs have a force of {offset_n:.4} N without light: was the gauge not \
         zeroed, or do the sums contain other light?"
    )]
    GaugeNotZeroed {
        /// The force without light, in newtons.
        offset_n: f64,
    },
    /// The force has fallen, but the calibration has rising forces alone, so that its hysteresis is
    /// unknown. The force has a standard error that covers a loop of ± 5 %.
    #[error(
        "frame {frame}: the force has fallen, but the calibration has rising forces alone: its \
         hysteresis is unknown"
    )]
    UnknownHysteresis {
        /// The frame.
        frame: usize,
    },
    /// One pair of the calibration is far from the line through the others.
    #[error(
        "a pair of the calibration has {force_n:.4} N, but the other pairs give {expected_n:.4} N: \
         is it mistyped?"
    )]
    PairDeparts {
        /// The pair, counted from 0.
        pair: usize,
        /// Its force in newtons.
        force_n: f64,
        /// The force of the line through the other pairs.
        expected_n: f64,
    },
    /// The calibration and the gauge disagree by more than three standard errors and two per cent.
    #[error("frame {frame}: {measured_n:.4} N measured, but the gauge read {gauge_n:.4} N")]
    GaugeDisagrees {
        /// The frame.
        frame: usize,
        /// Force by the calibration, in newtons.
        measured_n: f64,
        /// Force by the gauge, in newtons.
        gauge_n: f64,
    },
    /// The pressure rises towards the outline of a flat face, as it does if the face sticks. The
    /// face then does not spread freely, and its strain is not that of its material.
    #[error(
        "frame {frame}: the pressure rises towards the outline (to {edge_ratio:.2} times that \
         further inside): the face sticks, and its strain is not that of its material"
    )]
    FaceSticks {
        /// The frame.
        frame: usize,
        /// Light just inside the outline, relative to the light further inside.
        edge_ratio: f64,
    },
    /// The compression is so large that the modulus depends on the stress–strain law.
    #[error(
        "at a strain of {:.1} % the modulus depends on the law of the material: for a rubber-like \
         sample it is {:.0} % off (strain = \"hencky\" is closest)",
        100.0 * strain, 100.0 * excess
    )]
    MaterialLaw {
        /// The largest strain e_zz, in the measure of the pipeline.
        strain: f64,
        /// Relative excess of stress over strain over the modulus of a neo-Hookean sample.
        excess: f64,
    },
    /// No stress is conjugate to the strain measure, so the law of the sample at large strain could
    /// not be assessed.
    #[error(
        "strain {strain:.3}: no stress is conjugate to the strain measure, the material's law at \
         this strain was not assessed"
    )]
    MaterialLawNotJudged {
        /// The largest strain e_zz, in the measure of the pipeline.
        strain: f64,
    },
    /// The sample relaxes: the modulus is a mean over the times of the frames.
    #[error(
        "the sample relaxes from {:.1} to {:.1} kPa with a time constant of \
         {time_constant_s:.2} s: the modulus is a mean over the time of the frames",
        1e-3 * instantaneous_pa, 1e-3 * equilibrium_pa
    )]
    SampleRelaxes {
        /// Modulus for a load too fast to relax, in pascals.
        instantaneous_pa: f64,
        /// Modulus for a load held indefinitely.
        equilibrium_pa: f64,
        /// Time constant under a held approach, in seconds.
        time_constant_s: f64,
    },
    /// The sensor's gain changes with time.
    #[error("the sensor's gain changes by {:+.1} % over the frames", 100.0 * change)]
    SensorDrifts {
        /// Relative change over the frames.
        change: f64,
    },
    /// The modulus changes with time, either because the sample relaxes or because the sensor
    /// drifts.
    #[error(
        "the modulus changes by {:+.1} % over the frames: the sample relaxes or the sensor drifts, \
         which these frames cannot distinguish",
        100.0 * change
    )]
    ChangesWithTime {
        /// Relative change over the frames.
        change: f64,
    },
    /// The matcher stopped before it converged.
    #[error("the match did not converge")]
    MatchNotConverged,
    /// Some control points have no partner.
    #[error(
        "{points} control {} no partner", if *points == 1 { "point has" } else { "points have" }
    )]
    Unmatched {
        /// Number of points.
        points: usize,
    },
    /// The first contact is so small, in pixels, that the errors of its surface and of the strain
    /// counted from it may be underestimated.
    #[error(
        "the contact has a radius of {radius_px:.1} pixels: too few for a reliable error of the \
         strain"
    )]
    CoarseStrain {
        /// Radius of the smaller contact in pixels.
        radius_px: f64,
    },
    /// The warp folds at some control points, which are excluded from the strain.
    #[error("the warp folds at {points} control point{}", if *points == 1 { "" } else { "s" })]
    Folded {
        /// Number of points.
        points: usize,
    },
    /// An assumption of the estimator is violated.
    #[error("{warning}")]
    Assumption {
        /// The estimator's warning.
        #[cfg_attr(
            feature = "serde",
            serde(serialize_with = "super::text::outcome::text")
        )]
        warning: Warning,
    },
}

impl Flag {
    /// The frame that the caution is about. `None` if it is about several, or about the result.
    fn frame(&mut self) -> Option<&mut usize> {
        match self {
            Self::Saturated { frame, .. }
            | Self::OutOfCalibration { frame }
            | Self::TouchesEdge { frame }
            | Self::WiderThanFrame { frame, .. }
            | Self::CannotBeTold { frame, .. }
            | Self::OppositeSignal { frame, .. }
            | Self::BlackFrame { frame }
            | Self::UnknownHysteresis { frame }
            | Self::SeveralContacts { frame, .. }
            | Self::ProfileNotConverged { frame }
            | Self::NotABall { frame, .. }
            | Self::NotThePunch { frame, .. }
            | Self::UnlikelyStress { frame, .. }
            | Self::NotRound { frame, .. }
            | Self::LightNotProportional { frame, .. }
            | Self::GaugeDisagrees { frame, .. }
            | Self::FaceSticks { frame, .. } => Some(frame),
            _ => None,
        }
    }

    /// This caution with its frame or load counted from `first` instead of 0, for messages.
    ///
    /// ```
    /// use tactile_imaging::pipeline::Flag;
    /// let caution = Flag::TouchesEdge { frame: 2 }.numbered_from(1);
    /// assert_eq!(caution.to_string(), "frame 3: the contact reaches the frame's edge");
    /// assert_eq!(caution.without_frame(), "the contact reaches the frame's edge");
    /// ```
    #[must_use]
    pub fn numbered_from(mut self, first: usize) -> Self {
        if let Some(frame) = self.frame() {
            *frame += first;
        }
        match self {
            Self::Assumption { warning } => Self::Assumption {
                warning: warning.numbered_from(first),
            },
            caution => caution,
        }
    }

    /// The message without its frame, for a place that names the frame.
    #[must_use]
    pub fn without_frame(&self) -> String {
        let message = self.to_string();
        let frame = self.clone().frame().map(|frame| format!("frame {frame}: "));
        let words = frame.and_then(|frame| message.strip_prefix(&frame).map(str::to_owned));
        words.unwrap_or(message)
    }

    /// The caution about pairs of a calibration, for the first frame. `None` for a doubt without
    /// one.
    #[must_use]
    pub fn of_pairs(doubt: &LineDoubt) -> Option<Self> {
        match *doubt {
            LineDoubt::Offset { offset_n } => Some(Self::GaugeNotZeroed {
                offset_n: offset_n.value,
            }),
            LineDoubt::Outlier {
                pair,
                force_n,
                expected_n,
            } => Some(Self::PairDeparts {
                pair,
                force_n,
                expected_n,
            }),
            LineDoubt::Bend { departure } => Some(Self::LightNotProportional {
                frame: 0,
                departure,
            }),
            _ => None,
        }
    }
}

/// Plausible mean stresses of contacts: silicone rubbers tear at several megapascals, and one grey
/// level of a sensor with the softest gel is several tens of pascals.
const GEL_STRESS_PA: [f64; 2] = [20.0, 2e6];

impl ContactReading {
    /// The cautions about this reading, with `frame` (from 0) as the frame number.
    pub fn flags(&self, frame: usize) -> impl Iterator<Item = Flag> {
        let (share, others) = (self.saturated_share, self.other_contacts);
        let numbers = [
            ("force", self.force_n.map(|force| force.total())),
            ("contact radius", Some(self.contact_radius_m.total())),
            ("indentation", self.indentation_m),
        ];
        let unknown = numbers.into_iter().filter_map(move |(quantity, number)| {
            let Estimate {
                value,
                standard_error,
                ..
            } = number?;
            (standard_error > value.abs()).then_some(Flag::CannotBeTold {
                frame,
                quantity,
                value,
                standard_error,
            })
        });
        let stress = self.mean_stress_pa().map(|stress| stress.value);
        let [least, most] = GEL_STRESS_PA;
        let unlikely = stress.filter(|stress| !(least..=most).contains(&stress.abs()));
        let with = |holds: bool, flag: Flag| holds.then_some(flag);
        let is_load = self.no_force_n().is_none();
        let flags = [
            with(share > 0.0, Flag::Saturated { frame, share }),
            with(self.out_of_calibration, Flag::OutOfCalibration { frame }),
            with(self.touches_edge, Flag::TouchesEdge { frame }),
            with(self.unknown_hysteresis, Flag::UnknownHysteresis { frame }),
            with(others > 0, Flag::SeveralContacts { frame, others }),
            with(!self.converged, Flag::ProfileNotConverged { frame }),
            self.profile_misfit
                .map(|misfit| Flag::NotABall { frame, misfit }),
            self.elongation
                .map(|elongation| Flag::NotRound { frame, elongation }),
            self.calibration_bend
                .map(|departure| Flag::LightNotProportional { frame, departure }),
            unlikely.map(|mean_stress_pa| Flag::UnlikelyStress {
                frame,
                mean_stress_pa,
            }),
        ];
        flags
            .into_iter()
            .flatten()
            .filter(move |_| is_load)
            .chain(unknown)
    }
}

/// Formats a force in newtons or a length in millimetres.
fn in_unit(quantity: &str, value: f64) -> String {
    match quantity {
        "force" => format!("{value:.1e} N"),
        _ => format!("{:.1e} mm", 1e3 * value),
    }
}

/// Describes a change of the light.
fn light_changed(change: f64, error: f64, stray_grey: f64, uneven: f64) -> String {
    let [change, error, uneven] = [change, error, uneven].map(|share| 100.0 * share);
    match stray_grey.is_nan() {
        true => "the light of the calibration's reference is missing in this one: another black \
                 level, or lamps that are off"
            .to_owned(),
        false => format!(
            "the light has changed since the calibration's reference: lamps {change:+.1} ± \
             {error:.1} %, by which forces are divided, other light {stray_grey:+.1} grey levels, \
             unevenly by {uneven:.1} %"
        ),
    }
}

/// Describes the contacts besides the largest.
fn other_contacts(others: usize) -> String {
    match others {
        1 => "another contact".to_owned(),
        _ => format!("{others} other contacts"),
    }
}
