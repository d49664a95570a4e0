//! The inner loop of the pass: a strip of eight rows, tile by tile.
//!
//! All sums are linear, so they are taken over the frame alone; those of the reference are known beforehand and are
//! subtracted at the end. Only the extremes of the difference need both images. Everything is exact in integers:
//! x = 32 t + j runs from the strip's first column, k = −4..=3 over its rows.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod plain;

use super::tiles::TILE_ROWS;

/// Most tiles of a strip, so that 32-bit sums have room: 64²/2 tiles × 2040 × (31 + 30) < 2³¹.
pub(super) const STRIP_TILES: usize = 64;

/// Eight rows of equal length, a whole number of tiles.
pub(super) type Rows<'a> = [&'a [u8]; TILE_ROWS];

/// Sums over a strip of a frame f.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Strip {
    /// Σ f, Σ x f, Σ x² f.
    pub(super) sum: i64,
    pub(super) x: i64,
    pub(super) xx: i64,
    /// Σ k f, Σ x k f, Σ k² f.
    pub(super) k: i64,
    pub(super) xk: i64,
    pub(super) kk: i64,
    /// Greatest f − r and greatest r − f, zero if negative.
    pub(super) above: u8,
    pub(super) below: u8,
    /// First tile with |f − r| above the threshold, and one past the last; equal if there is none.
    pub(super) hits: [usize; 2],
}

impl Strip {
    fn hit(&mut self, tile: usize) {
        if self.hits[1] == 0 {
            self.hits[0] = tile;
        }
        self.hits[1] = tile + 1;
    }
}

/// Sums a strip with the widest instructions at hand; the result does not depend on them.
///
/// `tile_sums` receives Σ f of every tile.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kernel {
    Plain,
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
}

impl Kernel {
    pub(super) fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V3::try_new() {
            return Self::Avx2(simd);
        }
        Self::Plain
    }

    pub(super) fn run(
        self,
        frame: &Rows<'_>,
        reference: &Rows<'_>,
        threshold: u8,
        tile_sums: &mut [i32],
    ) -> Strip {
        match self {
            Self::Plain => plain::strip(frame, reference, threshold, tile_sums),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(simd) => avx2::strip(simd, frame, reference, threshold, tile_sums),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::TILE_COLUMNS;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_kernel_gives_the_same(
            tiles in 1..=STRIP_TILES, seed in any::<u64>(), threshold in any::<u8>(), full in any::<bool>()
        ) {
            let mut state = seed | 1;
            let mut byte = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                if full { 255 } else { (state >> 56) as u8 }
            };
            let mut image = || -> Vec<Vec<u8>> {
                (0..TILE_ROWS).map(|_| (0..tiles * TILE_COLUMNS).map(|_| byte()).collect()).collect()
            };
            let (frame, reference) = (image(), image());
            let frame: Rows<'_> = std::array::from_fn(|k| &frame[k][..]);
            let reference: Rows<'_> = std::array::from_fn(|k| &reference[k][..]);
            let (mut a, mut b) = (vec![0; tiles], vec![0; tiles]);
            let plain = Kernel::Plain.run(&frame, &reference, threshold, &mut a);
            prop_assert_eq!(plain, Kernel::best().run(&frame, &reference, threshold, &mut b));
            prop_assert_eq!(a, b);
        }
    }
}
