//! Typed cautions: the result stands, but not unconditionally.
use super::contact::ContactReading;
use super::error::PipelineError;
use crate::elasticity::modulus::Warning;
use crate::force::Estimate;

/// A caution about a result. Frames are counted from 0 in the fields and from 1 in the sentences.
/// It is an [`Error`](std::error::Error) too, for those who take no result with a caution.
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
/// assert_eq!(flags[0].to_string(), "frame 1: the contact reaches the frame's edge");
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
    /// Some of the contact's pixels are saturated: force and radius are low.
    #[error("frame {}: {:.2} % of the contact is saturated", frame + 1, 100.0 * share)]
    Saturated {
        /// The frame.
        frame: usize,
        /// Share of the contact's pixels.
        share: f64,
    },
    /// The signal lies outside the range of the calibration.
    #[error("frame {}: outside the range of the calibration", frame + 1)]
    OutOfCalibration {
        /// The frame.
        frame: usize,
    },
    /// The contact reaches the edge of the frame.
    #[error("frame {}: the contact reaches the frame's edge", frame + 1)]
    TouchesEdge {
        /// The frame.
        frame: usize,
    },
    /// The contact is wider than the frame: most of it is not seen, or the light has changed
    /// everywhere.
    #[error(
        "frame {}: the contact, {:.3} mm in radius, is wider than the frame: its size cannot be \
         told",
        frame + 1, 1e3 * radius_m
    )]
    WiderThanFrame {
        /// The frame.
        frame: usize,
        /// Contact radius in metres.
        radius_m: f64,
    },
    /// A number whose error is larger than the number.
    #[error(
        "frame {}: the {quantity} cannot be told, its error ({}) is larger than its value ({})",
        frame + 1, in_unit(quantity, *standard_error), in_unit(quantity, *value)
    )]
    CannotBeTold {
        /// The frame.
        frame: usize,
        /// Which number.
        quantity: &'static str,
        /// In SI units.
        value: f64,
        /// Its standard error.
        standard_error: f64,
    },
    /// No contact, though the frame differs from the reference the other way than a contact does.
    #[error("{}", PipelineError::OppositeSignal { frame: *frame, grey: *grey })]
    OppositeSignal {
        /// The frame.
        frame: usize,
        /// Frame minus reference where they differ most, in grey levels.
        grey: f64,
    },
    /// The frame shows more than one contact. The largest is measured, and theory knows of one.
    #[error("frame {}: {} beside the one measured", frame + 1, other_contacts(*others))]
    SeveralContacts {
        /// The frame.
        frame: usize,
        /// How many beside the largest.
        others: usize,
    },
    /// The light has changed since the reference was taken.
    #[error("the light has drifted by {grey:+.2} grey levels since the reference was taken")]
    LightDrifted {
        /// Mean of frame minus reference without contact, in grey levels.
        grey: f64,
    },
    /// The reference is brighter or darker than that of the calibration: forces are divided by the
    /// factor, with its error.
    #[error(
        "the reference is {:+.1} % brighter than the calibration's, unevenly by {:.1} %: forces \
         are divided by that factor",
        100.0 * change, 100.0 * uneven
    )]
    LightChanged {
        /// The common factor less one.
        change: f64,
        /// What is no common factor, relative.
        uneven: f64,
    },
    /// The fit of the contact's profile did not converge.
    #[error("frame {}: the profile's fit did not converge", frame + 1)]
    ProfileNotConverged {
        /// The frame.
        frame: usize,
    },
    /// The profile of the contact's pressure is not that of a ball: the contact radius is that of
    /// the best ball.
    #[error(
        "frame {}: the pressure is not that of a ball, by {:.1} % of its peak",
        frame + 1, 100.0 * misfit
    )]
    NotABall {
        /// The frame.
        frame: usize,
        /// Misfit as a share of the peak.
        misfit: f64,
    },
    /// The object is said to be a punch, which touches with its whole face, but the contact has
    /// another radius.
    #[error(
        "frame {}: the contact's radius is {:.3} mm, that of the punch {:.3} mm",
        frame + 1, 1e3 * radius_m, 1e3 * punch_m
    )]
    NotThePunch {
        /// The frame.
        frame: usize,
        /// Contact radius in metres.
        radius_m: f64,
        /// That of the punch.
        punch_m: f64,
    },
    /// The mean stress is one that no gel bears, or that no gel shows: a slip of a unit in the
    /// forces, the light or the size of a pixel.
    #[error(
        "frame {}: a mean stress of {mean_stress_pa:.1e} Pa is one that no gel {}: are the forces \
         in newtons, the pixels in the unit asked for?",
        frame + 1, if *mean_stress_pa > 1.0e3 { "bears" } else { "shows" }
    )]
    UnlikelyStress {
        /// The frame.
        frame: usize,
        /// Mean stress in pascals.
        mean_stress_pa: f64,
    },
    /// The contact's outline is not round: the pixels are not as stated, the lens distorts, or the
    /// object is no ball.
    #[error("frame {}: the contact is longer than wide by {:.1} %", frame + 1, 100.0 * elongation)]
    NotRound {
        /// The frame.
        frame: usize,
        /// Longer over shorter half axis, less one.
        elongation: f64,
    },
    /// The pairs of the calibration do not lie on a line: light is not proportional to pressure, so
    /// that the light's profile and its radius are not those of the pressure. A sensor calibrated
    /// from frames has the local curve.
    #[error(
        "frame {}: the calibration's pairs depart from a line by {:.1} % of the full scale: light \
         is not proportional to pressure",
        frame + 1, 100.0 * departure
    )]
    LightNotProportional {
        /// The frame.
        frame: usize,
        /// Departure of the pairs from a line at half scale, as a share of the full scale.
        departure: f64,
    },
    /// The calibration and the gauge disagree by more than three standard errors and two per cent.
    #[error(
        "frame {}: {measured_n:.4} N measured, but the gauge read {gauge_n:.4} N", frame + 1
    )]
    GaugeDisagrees {
        /// The frame.
        frame: usize,
        /// What the calibration says, in newtons.
        measured_n: f64,
        /// What the gauge said, in newtons.
        gauge_n: f64,
    },
    /// The pressure rises to the outline of a flat face, as where it sticks: it does not spread
    /// freely, and its strain is not that of its material.
    #[error(
        "frame {}: the pressure rises towards the outline ({edge_ratio:.2} of that further \
         inside): the face sticks, its strain is not that of its material",
        frame + 1
    )]
    FaceSticks {
        /// The frame.
        frame: usize,
        /// Light just inside the outline over that further inside.
        edge_ratio: f64,
    },
    /// A face is squeezed so far that the modulus depends on the law between stress and strain.
    #[error(
        "at a strain of {:.1} % the modulus depends on the law of the material: of a rubber-like \
         sample it is {:.0} % off (strain = \"hencky\" is closest)",
        100.0 * strain, 100.0 * excess
    )]
    MaterialLaw {
        /// The largest strain e_zz, of the pipeline's measure.
        strain: f64,
        /// By how much stress over strain there exceeds the modulus of a neo-Hookean sample.
        excess: f64,
    },
    /// No stress is conjugate to the strain measure, so that the sample's law at large strain was
    /// not judged.
    #[error(
        "strain {strain:.3}: no stress is conjugate to the strain measure, the material's law at \
         this strain was not judged"
    )]
    MaterialLawNotJudged {
        /// The largest strain e_zz, of the pipeline's measure.
        strain: f64,
    },
    /// The sample relaxes: the modulus is a mean over the time of the frames.
    #[error(
        "the sample relaxes from {:.1} to {:.1} kPa with {time_constant_s:.2} s: the modulus is a \
         mean over the time of the frames",
        1e-3 * instantaneous_pa, 1e-3 * equilibrium_pa
    )]
    SampleRelaxes {
        /// Modulus of a load too fast to relax, in pascals.
        instantaneous_pa: f64,
        /// Modulus of a load held for ever.
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
    /// The modulus changes with time, and it cannot be told whether it is the sample or the sensor.
    #[error(
        "the modulus changes by {:+.1} % over the frames: a relaxing sample or a drifting sensor, \
         which the frames do not tell apart",
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
        /// How many.
        points: usize,
    },
    /// The first contact is so small, in pixels, that its surface and the strain counted from it
    /// may be off by more than their errors say.
    #[error(
        "the contact has a radius of {radius_px:.1} pixels: too few for the strain's error to be \
         sure"
    )]
    CoarseStrain {
        /// Radius of the smaller contact in pixels.
        radius_px: f64,
    },
    /// The warp folds over at some control points. They are left out of the strain.
    #[error("the warp folds over at {points} control point{}", if *points == 1 { "" } else { "s" })]
    Folded {
        /// How many.
        points: usize,
    },
    /// An assumption of the estimator is broken.
    #[error("{warning}")]
    Assumption {
        /// Which.
        #[cfg_attr(
            feature = "serde",
            serde(serialize_with = "super::text::outcome::text")
        )]
        warning: Warning,
    },
}

/// Mean stresses of contacts that can be: silicone rubbers tear at some megapascals, and one grey
/// level of a sensor of the softest gel is some ten pascals.
const GEL_STRESS_PA: [f64; 2] = [20.0, 2e6];

impl ContactReading {
    /// The cautions about this reading, as one of frame number `frame` (from 0).
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
        let flags = [
            with(share > 0.0, Flag::Saturated { frame, share }),
            with(self.out_of_calibration, Flag::OutOfCalibration { frame }),
            with(self.touches_edge, Flag::TouchesEdge { frame }),
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
        flags.into_iter().flatten().chain(unknown)
    }
}

/// A force in newtons, a length in millimetres.
fn in_unit(quantity: &str, value: f64) -> String {
    match quantity {
        "force" => format!("{value:.1e} N"),
        _ => format!("{:.1e} mm", 1e3 * value),
    }
}

/// The contacts beside the largest.
fn other_contacts(others: usize) -> String {
    match others {
        1 => "another contact".to_owned(),
        _ => format!("{others} other contacts"),
    }
}
