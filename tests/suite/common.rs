//! Code shared by many tests: a simulated press, a press of given frames, and the errors of many
//! moduli.
#![allow(clippy::print_stdout)]
use ndarray::{Array2, ArrayView2};
use tactile_imaging::Pipeline;
use tactile_imaging::elasticity::modulus::ModulusEstimate;
use tactile_imaging::pipeline::Press;
use tactile_simulate::{CalibrationRun, Camera, PressLoad, PressOptions, Trial};

/// A press of the default ball at these forces, and a calibration.
pub(crate) fn trial(camera: Camera, forces_n: &[f64], seed: u64) -> Trial {
    let options = PressOptions {
        camera,
        loads: forces_n.iter().map(|&f| PressLoad::normal(f)).collect(),
        seed,
        ..PressOptions::default()
    };
    Trial::new(options, &CalibrationRun::default()).expect("a trial")
}

/// A press that owns these frames.
pub(crate) fn press_of(
    pipeline: &Pipeline,
    reference: ArrayView2<'_, u8>,
    frames: impl IntoIterator<Item = Array2<u8>>,
) -> Press<'static> {
    let mut press = pipeline.press(reference).expect("a reference");
    for frame in frames {
        press.add_frame(frame);
    }
    press
}

/// Relative errors of many moduli, and the fraction of intervals that contain the true value.
#[derive(Debug, Default)]
pub(crate) struct Study {
    pub(crate) errors: Vec<f64>,
    /// Standard errors, relative to the true value.
    stated: Vec<f64>,
    held: usize,
}

impl Study {
    pub(crate) fn add(&mut self, found: &ModulusEstimate, truth_pa: f64) {
        self.errors.push(found.youngs_modulus_pa / truth_pa - 1.0);
        self.stated.push(found.standard_error_pa / truth_pa);
        self.held += usize::from(found.interval_95.contains(truth_pa));
    }

    /// The median and the largest magnitude of an error, or NaN without errors.
    pub(crate) fn median_and_worst(&self) -> [f64; 2] {
        let mut sizes: Vec<f64> = self.errors.iter().map(|e| e.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let of = |size: Option<&f64>| size.copied().unwrap_or(f64::NAN);
        [of(sizes.get(sizes.len() / 2)), of(sizes.last())]
    }

    pub(crate) fn held(&self) -> f64 {
        self.held as f64 / self.errors.len() as f64
    }

    pub(crate) fn print(&self, name: &str) {
        let (n, [median, worst]) = (self.errors.len() as f64, self.median_and_worst());
        let mean = |values: &[f64]| 100.0 * values.iter().sum::<f64>() / n;
        println!(
            "{name}: {n} moduli, errors: median {:.3} %, worst {:.3} %, mean {:+.3} %, stated {:.3} \
             %; {:.1} % held",
            100.0 * median,
            100.0 * worst,
            mean(&self.errors),
            mean(&self.stated),
            100.0 * self.held()
        );
    }

    /// 92 to 98 %, extended by two binomial standard deviations for this number of moduli.
    pub(crate) fn check_coverage(&self) {
        let slack = 2.0 * (0.05 * 0.95 / self.errors.len() as f64).sqrt();
        let range = 0.92 - slack..=0.98 + slack;
        assert!(range.contains(&self.held()), "{self:?}");
    }
}
