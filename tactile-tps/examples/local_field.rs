//! What the errors of [`tactile_tps::LocalField`] are worth: fields with known gradients, smooth
//! and with a steep zone, in the plane and in space, with noise from none to 0.3 of the spacing and
//! wrong pairs.
//!
//! ```text
//! cargo run --release -p tactile-tps --example local_field -- [PAIRS SEED]
//! ```
//!
//! Prints the error of the gradients, how many of them lie within 1.96 standard errors, the noise
//! found over the true one, the wrong pairs that were kept and the right ones that were not, and
//! the time.
#![allow(clippy::print_stdout)]
use nalgebra::{Point, SMatrix, SVector};
use std::time::Instant;
use tactile_tps::{LocalField, TpsError};

/// SplitMix64.
struct Stream(u64);

impl Stream {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.next()).sum::<f64>() - 6.0
    }
}

/// Waves over the whole set, or a dimple of a tenth of its size.
fn field<const D: usize>(steep: bool, p: &Point<f64, D>) -> SVector<f64, D> {
    let x = p.coords;
    if steep {
        let r = x - SVector::repeat(0.5);
        let fall = (-r.norm_squared() / 0.02).exp();
        let mut u = SVector::zeros();
        u[0] = 0.2 * r[0] * fall;
        u[D - 1] += 0.03 * fall;
        return u;
    }
    SVector::from_fn(|d, _| {
        0.05 * (3.0 * x[(d + 1) % D] + d as f64).sin() * (2.0 * x[d] + 1.0).cos()
    })
}

/// Central differences, good to ten digits.
fn gradient<const D: usize>(steep: bool, p: &Point<f64, D>) -> SMatrix<f64, D, D> {
    let step = 1e-5;
    SMatrix::from_columns(&std::array::from_fn::<SVector<f64, D>, D, _>(|a| {
        let mut shift = SVector::zeros();
        shift[a] = step;
        (field(steep, &(p + shift)) - field(steep, &(p - shift))) / (2.0 * step)
    }))
}

fn study<const D: usize>(
    count: usize,
    seed: u64,
    steep: bool,
    noise: f64,
    wrong: f64,
) -> Result<(), TpsError> {
    let mut stream = Stream(seed);
    let mut place = |_| Point::from(SVector::<f64, D>::from_fn(|_, _| stream.next()));
    let sources: Vec<Point<f64, D>> = (0..count).map(&mut place).collect();
    let spacing = (count as f64).powf(-1.0 / D as f64);
    let mut is_wrong = vec![false; count];
    let mut targets = Vec::new();
    for (i, p) in sources.iter().enumerate() {
        is_wrong[i] = stream.next() < wrong;
        let size = if is_wrong[i] { 1.0 } else { noise };
        let offset = SVector::from_fn(|_, _| size * spacing * stream.normal());
        targets.push(p + field(steep, p) + offset);
    }
    let start = Instant::now();
    let found = LocalField::fit(&sources, &targets)?;
    let seconds = start.elapsed().as_secs_f64();
    let (mut within, mut squares, mut all, mut sigma) = (0, 0.0, 0, 0.0);
    for (p, value) in sources.iter().zip(&found.values) {
        // A steep zone is what is asked for there.
        if steep && (p - Point::from(SVector::repeat(0.5))).norm() > 0.3 {
            continue;
        }
        sigma += value.sigma;
        let off = value.gradient - gradient(steep, p);
        for a in 0..D {
            let error = value.gradient_covariance[(a, a)].sqrt();
            for d in 0..D {
                within += usize::from(off[(d, a)].abs() <= 1.96 * error);
                squares += off[(d, a)].powi(2);
                all += 1;
            }
        }
    }
    let count_of = |kept: bool, wrong: bool| {
        let rows = found.kept.iter().zip(&is_wrong);
        rows.filter(|&(&k, &w)| k == kept && w == wrong).count()
    };
    println!(
        "{D}-D {} noise {noise:<4} wrong {wrong:<4}: error {:.1e}, within 1.96: {:.1} %, noise \
         found {:.2}, wrong kept {} of {}, right lost {} of {}, {seconds:.2} s",
        if steep { "steep " } else { "smooth" },
        (squares / all as f64).sqrt(),
        100.0 * within as f64 / all as f64,
        sigma * (D * D) as f64 / all as f64 / (noise * spacing).max(1e-12),
        count_of(true, true),
        count_of(true, true) + count_of(false, true),
        count_of(false, false),
        count_of(true, false) + count_of(false, false),
    );
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let count = arguments.next().map_or(Ok(4000), |a| a.parse())?;
    let seed = arguments.next().map_or(Ok(1), |a| a.parse())?;
    for steep in [false, true] {
        for noise in [0.0, 0.03, 0.1, 0.3] {
            for wrong in [0.0, 0.05] {
                study::<2>(count, seed, steep, noise, wrong)?;
                study::<3>(count, seed, steep, noise, wrong)?;
            }
        }
    }
    Ok(())
}
