//! The part of the frame in which a contact is suspected.

use super::ContactDetector;
use super::threshold::quantile;
use crate::drift::IlluminationDrift;
use crate::frame::{FrameStatistics, PassWorkspace, ReferenceFrame, Tiles};
use tactile_core::BoundingBox;

impl ContactDetector {
    /// Box around every tile whose sum exceeds its noise, and every pixel that exceeds its own.
    pub(super) fn suspect(
        &self,
        pass: &PassWorkspace,
        reference: &ReferenceFrame,
        statistics: &FrameStatistics,
        drift: &IlluminationDrift,
        sd: f64,
        pixel_limit: f64,
    ) -> Option<BoundingBox> {
        let size = (statistics.rows, statistics.columns);
        let bright = self.bright_tiles(&pass.tiles, reference, size, drift, sd);
        // Pixels were compared with their limit before the drift was known; that holds while the drift is well below the limit.
        let pixels = statistics
            .bounding_box
            .filter(|_| drift.greatest_grey(size, reference.mean_grey()) < 0.3 * pixel_limit);
        bright.into_iter().chain(pixels).reduce(BoundingBox::union)
    }

    /// Box around every tile whose sum exceeds its noise.
    fn bright_tiles(
        &self,
        tiles: &Tiles,
        reference: &ReferenceFrame,
        size: (usize, usize),
        drift: &IlluminationDrift,
        sd: f64,
    ) -> Option<BoundingBox> {
        let z = quantile(0.5 * self.options.false_alarm_rate, tiles.sums.len()) * sd;
        let sign = self.options.polarity.sign();
        let stands_out = |k: usize| {
            let tile = reference.tile_sum(tiles, k);
            f64::from(sign) * drift.residual(&tile) > z * tile.pixels.sqrt()
        };
        // The last tile of a band is its smallest: a band whose sums stay below that tile's noise has no bright tile.
        let below_noise = |band: usize| {
            drift.is_zero() && {
                let last = reference.tile_sum(tiles, (band + 1) * tiles.columns - 1);
                f64::from(tiles.greatest(band, sign)) <= z * last.pixels.sqrt()
            }
        };
        (0..tiles.rows)
            .filter(|&band| !below_noise(band))
            .flat_map(|band| {
                (band * tiles.columns..(band + 1) * tiles.columns).filter(|&k| stands_out(k))
            })
            .map(|k| tiles.pixels(k, size))
            .reduce(BoundingBox::union)
    }
}
