//! A session with what every frame has said so far.
use crate::console::Console;
use ndarray::ArrayView2;
use serde_json::{Value, json};
use tactile_imaging::elasticity::modulus::ModulusEstimate;
use tactile_imaging::pipeline::{PipelineError, Session, with_error};

/// Every so many frames of a series one is printed.
const PRINTED: usize = 16;

/// What one frame said, each number with its standard error.
#[derive(Clone, Copy)]
pub struct Row {
    pub time_s: f64,
    pub force_n: Option<[f64; 2]>,
    pub radius_m: Option<[f64; 2]>,
    /// The modulus from all frames so far.
    pub modulus_pa: Option<[f64; 2]>,
    pub strain_xx_zz: Option<[f64; 2]>,
}

impl Row {
    pub fn json(&self) -> Value {
        let value = |pair: Option<[f64; 2]>| pair.map(|[value, _]| value);
        json!({
            "time_s": self.time_s, "force_n": value(self.force_n), "contact_radius_m": value(self.radius_m),
            "youngs_modulus_pa": value(self.modulus_pa), "strain_xx_zz": self.strain_xx_zz,
        })
    }
}

pub struct Live {
    pub session: Session,
    pub rows: Vec<Row>,
    pub late: usize,
    /// Where the frames are simulated.
    pub truth_pa: Option<f64>,
    /// Strain is measured in frames of at least this force.
    strained_above_n: Option<f64>,
}

impl Live {
    pub fn new(session: Session, truth_pa: Option<f64>, strained_above_n: Option<f64>) -> Self {
        Self {
            session,
            rows: Vec::new(),
            late: 0,
            truth_pa,
            strained_above_n,
        }
    }

    /// Measures a frame.
    pub fn push(&mut self, time_s: f64, frame: ArrayView2<'_, u8>) -> Result<(), PipelineError> {
        let contact = self.session.push(frame)?.contact;
        let force = contact.and_then(|c| c.force_n);
        let strained =
            (self.strained_above_n).is_some_and(|least| force.is_some_and(|f| f.value > least));
        let modulus = self.session.modulus().ok();
        let strain_xx_zz = if strained { self.strain()? } else { None };
        self.rows.push(Row {
            time_s,
            force_n: force.map(|f| [f.value, f.standard_error]),
            radius_m: contact
                .map(|c| [c.contact_radius_m.value, c.contact_radius_m.standard_error]),
            modulus_pa: modulus.map(|m| [m.youngs_modulus_pa, m.standard_error_pa]),
            strain_xx_zz,
        });
        Ok(())
    }

    /// Mean strain along x and z; none of the frame that strain is counted from, and where the match has too few points to tell.
    fn strain(&mut self) -> Result<Option<[f64; 2]>, PipelineError> {
        match self.session.strain() {
            Ok(found) => Ok(found.map(|s| [(0, 0), (2, 2)].map(|at| s.strain.summary.mean[at]))),
            Err(PipelineError::TooFewMatches { .. } | PipelineError::Surface { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    pub fn late_percent(&self) -> f64 {
        100.0 * self.late as f64 / self.rows.len().max(1) as f64
    }

    /// How far a modulus is from the truth, in words; nothing where that is not known.
    pub fn beside_truth(&self, modulus_pa: f64) -> String {
        self.truth_pa.map_or(String::new(), |truth_pa| {
            let error = 100.0 * (modulus_pa / truth_pa - 1.0);
            format!(", true {:.2} kPa ({error:+.2} %)", truth_pa * 1e-3)
        })
    }

    pub fn print_heading(&self, console: &mut Console) {
        let strain = if self.strained_above_n.is_some() {
            "   strain xx, zz"
        } else {
            ""
        };
        console.line(format!(
            "time (s)   force (N)   radius (mm)   late (%)   modulus (kPa)     {strain}"
        ));
    }

    /// Prints one line out of some frames.
    pub fn print_last(&self, every_one: bool, console: &mut Console) {
        let Some(row) = self.rows.last() else {
            return;
        };
        if !every_one && !(self.rows.len() - 1).is_multiple_of(PRINTED) {
            return;
        }
        let number = |pair: Option<[f64; 2]>, scale: f64| {
            pair.map_or("-".to_owned(), |[value, _]| format!("{:.4}", value * scale))
        };
        let modulus = row.modulus_pa.map_or("-".to_owned(), |[value, error]| {
            with_error(value, error, 1e-3)
        });
        let strain = row
            .strain_xx_zz
            .map_or(String::new(), |[x, z]| format!("{x:+.3}, {z:+.3}"));
        let line = format!(
            "{:8.3} {:>11} {:>13} {:10.1}   {modulus:<18}{strain}",
            row.time_s,
            number(row.force_n, 1.0),
            number(row.radius_m, 1e3),
            self.late_percent(),
        );
        console.line(line.trim_end());
    }
}

pub fn in_kpa(modulus: &ModulusEstimate) -> String {
    let value = with_error(modulus.youngs_modulus_pa, modulus.standard_error_pa, 1e-3);
    format!("{value} kPa")
}
