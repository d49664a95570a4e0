//! What a person at a bench wants to read of single frames, streams, and fits.
use super::contact::ContactReading;
use super::digits::estimate;
use super::report::{Skip, Stage, Work};
use super::session::{DriftWatch, Update};
use std::fmt::{self, Display, Formatter};

impl Display for ContactReading {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.force_n {
            Some(force) => write!(f, "force {} N", estimate(force, 1.0))?,
            None => f.write_str("force unknown")?,
        }
        write!(
            f,
            "   contact radius {} mm",
            estimate(self.contact_radius_m, 1e3)
        )?;
        if let Some(depth) = self.indentation_m {
            write!(f, "   indentation {} mm", estimate(depth, 1e3))?;
        }
        let [x, y] = self.centroid_px.map(|c| estimate(c, 1.0));
        write!(f, "   centroid ({x}, {y}) px")?;
        self.flags(0)
            .try_for_each(|flag| match flag.to_string().strip_prefix("frame 1: ") {
                Some(caution) => write!(f, "   [{caution}]"),
                None => write!(f, "   [{flag}]"),
            })
    }
}

impl Display for Update {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "frame {}: ", self.frame + 1)?;
        match &self.contact {
            Some(contact) => write!(f, "{contact}")?,
            None => f.write_str("no contact")?,
        }
        if let Some(shear) = &self.shear {
            let [x, y] = shear.force_n.map(|e| estimate(e, 1.0));
            write!(f, "   shear ({x}, {y}) N")?;
        }
        if self.repeated {
            f.write_str("   (equals the frame before)")
        } else {
            Ok(())
        }
    }
}

impl Display for DriftWatch {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self {
            frames,
            last_grey,
            greatest_grey,
            ..
        } = self;
        let s = if *frames == 1 { "" } else { "s" };
        write!(
            f,
            "light {last_grey:+.2} grey levels from the reference, {greatest_grey:+.2} at most, in "
        )?;
        write!(f, "{frames} frame{s} without contact")
    }
}

impl Display for Skip {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.stage)?;
        if let Some(frame) = self.frame {
            write!(f, " of frame {}", frame + 1)?;
        }
        let what = if self.stage == Stage::Match {
            "iterations"
        } else {
            "pixels"
        };
        write!(f, ": {} ({} {what} saved)", self.reason, self.saved)
    }
}

impl Display for Work {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let s = if self.runs == 1 { "" } else { "s" };
        write!(
            f,
            "{:.3} ms in {} run{s}",
            self.time.as_secs_f64() * 1e3,
            self.runs
        )
    }
}
