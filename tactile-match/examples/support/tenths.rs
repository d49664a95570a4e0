//! Confidences compared with the fraction of correct pairs.

/// Pairs, sum of confidences and correct pairs in every tenth of confidence.
#[derive(Default)]
pub(crate) struct Tenths([[f64; 3]; 10]);

impl Tenths {
    pub(crate) fn add(&mut self, confidence: f64, is_right: bool) {
        let tenth = &mut self.0[((10.0 * confidence) as usize).min(9)];
        tenth[0] += 1.0;
        tenth[1] += confidence;
        tenth[2] += f64::from(u8::from(is_right));
    }

    pub(crate) fn print(&self) {
        println!("pairs, mean confidence, share right");
        for [pairs, confidence, right] in self.0 {
            println!(
                "  {pairs:>6} {:.3} {:.3}",
                confidence / pairs,
                right / pairs
            );
        }
    }
}
