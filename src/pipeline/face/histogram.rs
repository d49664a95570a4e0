//! The signals of a contact's pixels, counted.

/// How many pixels have each of the 511 signals that two images of 8 bits may have.
pub(super) struct Histogram([usize; 511]);

impl Default for Histogram {
    fn default() -> Self {
        Self([0; 511])
    }
}

impl Histogram {
    pub(super) fn count(&mut self, signal: f32) {
        self.0[(signal as i32 + 255) as usize] += 1;
    }

    /// The signal that a quarter of the pixels is below; `None` without pixels.
    pub(super) fn lower_quartile(&self) -> Option<f32> {
        let quarter = self.0.iter().sum::<usize>() / 4;
        let mut below = 0;
        let level = self.0.iter().position(|pixels| {
            below += pixels;
            below > quarter
        })?;
        Some(level as f32 - 255.0)
    }
}
