//! Record of the stages that ran and those that were skipped, with the reason.
use std::fmt;
use std::time::Duration;

/// A stage of the pipeline.
///
/// ```
/// use tactile_simulate::Trial;
/// let trial = Trial::coarser(8)?;
/// use tactile_imaging::pipeline::Stage;
/// // The modulus of a ball needs both contacts and no surface.
/// let pipeline = trial.pipeline()?;
/// let press = trial.press(&pipeline)?;
/// press.modulus()?;
/// let ran: Vec<_> =
///     Stage::ALL.into_iter().filter(|stage| press.report().work(*stage).runs > 0).collect();
/// assert_eq!(ran, [Stage::Contact, Stage::Modulus]);
/// assert_eq!(Stage::Contact.to_string(), "contact and force");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum Stage {
    /// From a frame to contact, force, centroid and radius.
    Contact,
    /// From an image to a surface.
    Surface,
    /// From a surface to control points.
    ControlPoints,
    /// From points to matches.
    Match,
    /// From matches to a warp and its strain.
    Strain,
    /// From loads to a modulus.
    Modulus,
}

impl Stage {
    /// All stages in order.
    pub const ALL: [Self; 6] = [
        Self::Contact,
        Self::Surface,
        Self::ControlPoints,
        Self::Match,
        Self::Strain,
        Self::Modulus,
    ];
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Contact => "contact and force",
            Self::Surface => "surface",
            Self::ControlPoints => "control points",
            Self::Match => "match",
            Self::Strain => "strain",
            Self::Modulus => "modulus",
        })
    }
}

/// Why a stage was skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum SkipReason {
    /// The result was not requested.
    NotAsked,
    /// The frame shows no contact.
    NoContact,
    /// Surface, points and spline of the load from which strain is counted were kept.
    KeptFromBefore,
    /// The match started from the last answer.
    NearLastAnswer,
}

impl fmt::Display for SkipReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotAsked => "not asked for",
            Self::NoContact => "no contact",
            Self::KeptFromBefore => "kept from an earlier load",
            Self::NearLastAnswer => "started from the last result",
        })
    }
}

/// Work of one kind that was skipped.
///
/// ```
/// use tactile_imaging::pipeline::{Object, Pipeline, SkipReason, Stage};
/// use tactile_imaging::force::CalibrationPair;
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
/// let empty = ndarray::Array2::from_elem((64, 64), 10_u8);
/// let mut press = pipeline.press(empty.view())?;
/// press.add_frame(empty.view());
/// assert!(press.contact(0)?.is_none());
/// let skip = press.report().skips[0];
/// assert_eq!((skip.stage, skip.reason, skip.frames), (Stage::Surface, SkipReason::NoContact, 1));
/// assert_eq!(skip.to_string(), "surface in 1 frame: no contact");
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Skip {
    /// The stage.
    pub stage: Stage,
    /// The reason.
    pub reason: SkipReason,
    /// Number of frames in which the stage was skipped.
    pub frames: usize,
}

impl fmt::Display for Skip {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            stage,
            reason,
            frames,
        } = self;
        let s = if *frames == 1 { "" } else { "s" };
        write!(f, "{stage} in {frames} frame{s}: {reason}")
    }
}

/// Number of runs of a stage, and their total time.
///
/// ```
/// use std::time::Duration;
/// use tactile_imaging::pipeline::Work;
/// let mut work = Work::default();
/// (work.runs, work.time) = (4, Duration::from_micros(1250));
/// assert_eq!(work.to_string(), "1.250 ms in 4 runs");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Work {
    /// Number of runs.
    pub runs: usize,
    /// Total time of the runs.
    pub time: Duration,
}

impl fmt::Display for Work {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = if self.runs == 1 { "" } else { "s" };
        write!(
            f,
            "{:.3} ms in {} run{s}",
            self.time.as_secs_f64() * 1e3,
            self.runs
        )
    }
}

/// Record of the stages that ran and those that were skipped, with the reason.
///
/// ```
/// use tactile_simulate::Trial;
/// let trial = Trial::coarser(8)?;
/// use tactile_imaging::pipeline::{Report, Stage};
/// let pipeline = trial.pipeline()?;
/// let press = trial.press(&pipeline)?;
/// press.surface(1)?;
/// let report: Report = press.report();
/// // The second surface uses the grid of the first, which needs both contacts.
/// assert_eq!((report.work(Stage::Contact).runs, report.work(Stage::Surface).runs), (2, 1));
/// assert!(report.to_string().contains("in 2 runs"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    work: [Work; 6],
    /// Skipped work.
    pub skips: Vec<Skip>,
}

impl Report {
    /// Number of runs of a stage, and their total time.
    pub fn work(&self, stage: Stage) -> Work {
        self.work[stage as usize]
    }

    pub(super) fn ran(&mut self, stage: Stage, time: Duration) {
        let work = &mut self.work[stage as usize];
        work.runs += 1;
        work.time += time;
    }

    pub(super) fn skipped(&mut self, stage: Stage, reason: SkipReason) {
        let same = |skip: &&mut Skip| (skip.stage, skip.reason) == (stage, reason);
        match self.skips.iter_mut().find(same) {
            Some(skip) => skip.frames += 1,
            None => self.skips.push(Skip {
                stage,
                reason,
                frames: 1,
            }),
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for stage in Stage::ALL {
            let Work { runs, time } = self.work(stage);
            let milliseconds = time.as_secs_f64() * 1e3;
            if runs > 0 {
                writeln!(
                    f,
                    "  {stage:<18} {milliseconds:9.3} ms in {runs} run{}",
                    if runs == 1 { "" } else { "s" }
                )?;
            }
        }
        let mut skips = self.skips.iter();
        skips.try_for_each(|skip| writeln!(f, "  skipped: {skip}"))
    }
}

#[cfg(feature = "serde")]
impl serde::Serialize for Report {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeStruct;
        #[derive(serde::Serialize)]
        struct Line {
            stage: Stage,
            runs: usize,
            milliseconds: f64,
        }
        let line = |stage: Stage| {
            let work = self.work(stage);
            Line {
                stage,
                runs: work.runs,
                milliseconds: work.time.as_secs_f64() * 1e3,
            }
        };
        let mut out = serializer.serialize_struct("Report", 2)?;
        out.serialize_field("stages", &Stage::ALL.map(line))?;
        out.serialize_field("skips", &self.skips)?;
        out.end()
    }
}
