//! Least squares at a given contact point.

use super::IndentationCurve;
use crate::golden_section::golden_section;
use crate::modulus::ContactLaw;

/// The best line at one contact point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Profile {
    pub(crate) contact_m: f64,
    /// E*.
    pub(crate) modulus: f64,
    pub(crate) offset: f64,
    pub(crate) squares: f64,
}

/// A curve, a law, and whether the force may be offset.
#[derive(Clone, Copy)]
pub(crate) struct Problem<'a> {
    pub(crate) curve: &'a IndentationCurve,
    pub(crate) law: &'a dyn ContactLaw,
    pub(crate) offset: bool,
}

const SCAN: usize = 300;
/// Golden sections down to rounding.
const SECTIONS: usize = 70;

impl Problem<'_> {
    /// f(z − z₀) of every point; None where the law does not reach so far.
    fn shape(&self, contact: f64) -> Option<Vec<f64>> {
        let of = |z: &f64| {
            let d = z - contact;
            if d > 0.0 {
                self.law.of_indentation(d, 0.0).map(|l| l.value.exp())
            } else {
                Some(0.0)
            }
        };
        self.curve.position_m().iter().map(of).collect()
    }

    /// Minimum over offset and modulus.
    pub(crate) fn at(&self, contact: f64) -> Option<Profile> {
        let g = self.shape(contact)?;
        let f = self.curve.force_n();
        let n = g.len() as f64;
        let (mg, mf) = if self.offset {
            (g.iter().sum::<f64>() / n, f.iter().sum::<f64>() / n)
        } else {
            (0.0, 0.0)
        };
        let scale = g.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let (mut sgg, mut sgf) = (0.0, 0.0);
        for (g, f) in g.iter().zip(f) {
            sgg += ((g - mg) / scale).powi(2);
            sgf += (g - mg) / scale * (f - mf);
        }
        let modulus = sgf / sgg / scale;
        self.finish(contact, &g, modulus)
            .filter(|p| p.modulus > 0.0 && p.squares.is_finite())
    }

    /// Minimum over the offset alone.
    pub(crate) fn at_modulus(&self, contact: f64, modulus: f64) -> Option<Profile> {
        self.finish(contact, &self.shape(contact)?, modulus)
    }

    fn finish(&self, contact_m: f64, g: &[f64], modulus: f64) -> Option<Profile> {
        let f = self.curve.force_n();
        let rest = || g.iter().zip(f).map(|(g, f)| f - modulus * g);
        let offset = if self.offset {
            rest().sum::<f64>() / f.len() as f64
        } else {
            0.0
        };
        Some(Profile {
            contact_m,
            modulus,
            offset,
            squares: rest().map(|r| (r - offset).powi(2)).sum(),
        })
    }

    /// The contact point that leaves the least, from one span before the first point up to the fifth last point.
    pub(crate) fn best(&self) -> Option<Profile> {
        let (first, last) = self.curve.span();
        let z = self.curve.position_m();
        let (from, to) = (first - (last - first), z[z.len() - 5]);
        let step = (to - from) / SCAN as f64;
        let scanned = (0..=SCAN).filter_map(|k| self.at(from + step * k as f64));
        let start = scanned.min_by(|a, b| a.squares.total_cmp(&b.squares))?;
        let (low, high) = (
            (start.contact_m - step).max(from),
            (start.contact_m + step).min(to),
        );
        let squares = |x| self.at(x).map_or(f64::INFINITY, |profile| profile.squares);
        let refined = self.at(golden_section(low, high, SECTIONS, squares))?;
        Some(if refined.squares <= start.squares {
            refined
        } else {
            start
        })
    }

    /// The least at a given modulus, the contact point sought around `near`.
    pub(crate) fn best_at_modulus(&self, near: f64, reach: f64, modulus: f64) -> Option<Profile> {
        let at = |x| self.at_modulus(x, modulus);
        let squares = |x| at(x).map_or(f64::INFINITY, |profile| profile.squares);
        at(golden_section(
            near - reach,
            near + reach,
            SECTIONS,
            squares,
        ))
    }
}
