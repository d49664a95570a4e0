//! Checks whether a frame comes from this sensor, by comparing its border with that of the
//! reference.
//!
//! The border is compared in blocks of pixels. A contact covers only some of them, which medians
//! tolerate. Exposure and white balance change the levels of a channel, but not the pattern of the
//! light. If the pattern differs, the frame is also compared with exchanged channels, rotated and
//! mirrored, and the variant that fits is reported.

use ndarray::{Array3, ArrayView2};
use tactile_core::statistics::{median, quantile};

use crate::gradients::Blurred;

/// Minimum side of the blocks in pixels.
const LEAST_BLOCK: usize = 4;
/// Number of blocks along the longer side of a frame.
const BLOCKS: usize = 32;
/// Range of exposures, relative to the reference, that a calibration covers: its polynomial is for
/// differences of several levels, and clipping begins outside the range.
const EXPOSURES: [f64; 2] = [0.8, 1.25];
/// Deviation of a channel's ratio from the median above which the white balance differs. A large
/// contact tints the border of real frames by up to 0.12.
const BALANCE: f64 = 0.13;
/// Relative difference of the border's untouched part from the reference above which the light
/// differs. For frames of one sensor under the deepest contacts it is at most 0.014, for those of
/// two units 0.06 or more (`--example exact_worlds`).
const PATTERN: f64 = 0.03;
/// Minimum fraction of the border that remains untouched by a wide contact.
const UNTOUCHED: f64 = 0.3;
/// A transformed frame is reported if its misfit is below this fraction of the original misfit.
const FITS_BETTER: f64 = 0.45;
/// A frame is black below this level, and white above 255 minus this level.
const DARK: f64 = 6.0;
/// A frame is noise if its pixels deviate from their neighbours by this multiple of those of the
/// reference.
const NOISY: f64 = 12.0;

/// Rotation or reflection of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum Turn {
    /// Rotated by 180°.
    Half,
    /// Left and right are exchanged.
    LeftRight,
    /// Top and bottom are exchanged.
    TopBottom,
    /// Rows and columns are exchanged, or the frame is rotated by 90°.
    Quarter,
}

/// Why a frame does not, or may not, come from this sensor as calibrated.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum FrameDoubt {
    /// Nearly all of the frame is black.
    Black,
    /// Nearly all of the frame is white.
    White,
    /// Neighbouring pixels are uncorrelated.
    Noise,
    /// The exposure differs from that of the reference by this factor.
    Exposure(f64),
    /// The brightness of the channels differs by these factors, relative to a common one.
    Balance([f64; 3]),
    /// Channels are exchanged: indices, 0 to 2, of the frame's channels that hold red, green and
    /// blue.
    ChannelsExchanged([usize; 3]),
    /// The frame is rotated or mirrored.
    Turned(Turn),
    /// The light has another pattern: it is another unit, or a lamp or the gel has changed. The
    /// value is the difference along the untouched border, relative to the level of the reference.
    AnotherPattern(f64),
    /// The slopes do not belong to a face that is pressed in.
    NoSurface,
    /// More of the frame is brighter than the reference than darker, on a gel that darkens.
    Brighter,
    /// A contact, counted from 0, is darker than the last entry of the table, whose depth is used.
    BeyondTable {
        /// The contact.
        contact: usize,
    },
}

impl FrameDoubt {
    /// Whether the frame cannot be used at all.
    pub fn refuses(&self) -> bool {
        !matches!(
            self,
            Self::Exposure(_)
                | Self::Balance(_)
                | Self::NoSurface
                | Self::Brighter
                | Self::BeyondTable { .. }
        )
    }

    /// A keyword for programs.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Black => "black_frame",
            Self::White => "white_frame",
            Self::Noise => "noise_frame",
            Self::Exposure(_) => "other_exposure",
            Self::Balance(_) => "other_white_balance",
            Self::ChannelsExchanged(_) => "channels_exchanged",
            Self::Turned(_) => "frame_turned",
            Self::AnotherPattern(_) => "another_unit",
            Self::NoSurface => "no_surface",
            Self::Brighter => "brighter_than_reference",
            Self::BeyondTable { .. } => "beyond_table",
        }
    }
}

impl core::fmt::Display for FrameDoubt {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Black => write!(f, "the frame is black"),
            Self::White => write!(f, "the frame is white: all of it is saturated"),
            Self::Noise => write!(
                f,
                "the frame is noise: neighbouring pixels are uncorrelated"
            ),
            Self::Exposure(factor) => write!(
                f,
                "the frame is {factor:.2} times as bright as the reference: set the exposure of the \
                 calibration, or calibrate again"
            ),
            Self::Balance([r, g, b]) => write!(
                f,
                "the white balance differs from that of the reference: red {r:.2}, green {g:.2} and \
                 blue {b:.2} times its level"
            ),
            Self::ChannelsExchanged([2, 1, 0]) => write!(
                f,
                "red and blue seem to be exchanged: OpenCV returns blue, green, red"
            ),
            Self::ChannelsExchanged(order) => {
                write!(
                    f,
                    "the channels seem to be exchanged: red, green, blue are {order:?}"
                )
            }
            Self::Turned(Turn::Half) => write!(f, "the frame seems to be rotated by 180°"),
            Self::Turned(Turn::LeftRight) => {
                write!(f, "the frame seems to be mirrored left to right")
            }
            Self::Turned(Turn::TopBottom) => {
                write!(f, "the frame seems to be mirrored top to bottom")
            }
            Self::Turned(Turn::Quarter) => write!(f, "the frame seems to be rotated by 90°"),
            Self::AnotherPattern(share) => write!(
                f,
                "the light pattern along the border differs from that of the reference by {:.0} %: \
                 another unit of the sensor, or changed lamps or gel",
                100.0 * share
            ),
            Self::NoSurface => write!(
                f,
                "the colours do not correspond to an indented surface: exchanged channels, a \
                 rotated or mirrored frame, or other lamps"
            ),
            Self::Brighter => write!(
                f,
                "the frame is brighter than the reference: are the two exchanged?"
            ),
            Self::BeyondTable { contact } => write!(
                f,
                "contact {} is darker than the last entry of the table: its depth is at least the \
                 stated one",
                contact + 1
            ),
        }
    }
}

/// Result for the border: factors of the channels, and doubts.
pub(crate) struct FrameLight {
    /// Exposure factor common to all channels.
    pub gain: f64,
    pub doubts: Vec<FrameDoubt>,
}

/// Block means of one image, and the median deviation of pixels from their neighbours in grey
/// levels.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Blocks {
    means: Array3<f32>,
    roughness: f64,
}

impl Blocks {
    pub(crate) fn of(image: &Blurred) -> Self {
        Self::of_lines(image.dim(), 3, |channel, row| image.line(channel, row))
    }

    /// Grey levels minus `step` count as three equal channels.
    pub(crate) fn of_grey(image: ArrayView2<'_, u8>, step: f64) -> Self {
        let levels = image.mapv(|level| (256.0 * (f64::from(level) - step)) as u16);
        Self::of_lines(levels.dim(), 1, |_, row| {
            levels.row(row).to_slice().unwrap_or_default()
        })
    }

    /// Blocks of an image whose lines, by channel and row, hold 1/256 grey level. If there is one
    /// channel, the others are equal to it.
    fn of_lines<'a>(
        (rows, columns): (usize, usize),
        channels: usize,
        line_of: impl Fn(usize, usize) -> &'a [u16],
    ) -> Self {
        let size = rows.max(columns).div_ceil(BLOCKS).max(LEAST_BLOCK);
        let size = size.min(rows).min(columns);
        let (high, wide) = (rows / size, columns / size);
        let mut means = Array3::zeros((high, wide, 3));
        // Number of deviations by their size in 1/16 grey level.
        let mut rough = vec![0_u32; 4096];
        for r in 0..high {
            for c in 0..wide {
                let (from, to) = (c * size, (c + 1) * size);
                for k in 0..channels {
                    // Every other pixel of every other row is enough for a mean.
                    let (mut sum, mut count) = (0_u64, 0_u64);
                    for row in (r * size..(r + 1) * size).step_by(2) {
                        let line = line_of(k, row);
                        for column in (from..to).step_by(2) {
                            sum += u64::from(line[column]);
                            count += 1;
                            // A slope of the levels has no second difference.
                            if column >= 3 && column + 3 < columns {
                                let beside = (line[column - 3] / 2) + (line[column + 3] / 2);
                                rough[usize::from(line[column].abs_diff(beside) >> 4)] += 1;
                            }
                        }
                    }
                    let mean = sum as f32 / (256.0 * count as f32);
                    (k..=k + 3 - channels).for_each(|k| means[[r, c, k]] = mean);
                }
            }
        }
        // The median, because the edges of a contact concern few pixels.
        let half = rough.iter().sum::<u32>() / 2;
        let mut below = 0;
        let median = rough.iter().position(|count| {
            below += count;
            below > half
        });
        Self {
            means,
            roughness: median.unwrap_or(0) as f64 / 16.0,
        }
    }

    /// Levels of the blocks along the border, with channels in this order, of the image transformed
    /// by `turn`.
    fn border(&self, order: [usize; 3], turn: Option<Turn>) -> Option<Vec<[f64; 3]>> {
        let (high, wide, _) = self.means.dim();
        if turn == Some(Turn::Quarter) && high != wide {
            return None;
        }
        let edge = |r: usize, c: usize| r == 0 || c == 0 || r + 1 == high || c + 1 == wide;
        let places = (0..high).flat_map(|r| (0..wide).map(move |c| (r, c)));
        let places = places.filter(|&(r, c)| edge(r, c));
        let level = places.map(|(r, c)| {
            let (r, c) = match turn {
                None => (r, c),
                Some(Turn::Half) => (high - 1 - r, wide - 1 - c),
                Some(Turn::LeftRight) => (r, wide - 1 - c),
                Some(Turn::TopBottom) => (high - 1 - r, c),
                Some(Turn::Quarter) => (c, high - 1 - r),
            };
            order.map(|k| f64::from(self.means[[r, c, k]]))
        });
        Some(level.collect())
    }

    fn mean(&self) -> f64 {
        self.means.iter().map(|v| f64::from(*v)).sum::<f64>() / self.means.len() as f64
    }
}

/// Ratios of the channels between two borders, as medians.
fn ratios(frame: &[[f64; 3]], reference: &[[f64; 3]]) -> [f64; 3] {
    [0, 1, 2].map(|k| {
        let pairs = frame.iter().zip(reference);
        let mut each: Vec<f64> = pairs.map(|(f, r)| f[k] / r[k].max(1.0)).collect();
        median(&mut each)
    })
}

/// Quantile of the border's misfit after multiplication by `gains`, relative to the level of the
/// reference.
fn misfit(frame: &[[f64; 3]], reference: &[[f64; 3]], gains: [f64; 3], share: f64) -> f64 {
    let pairs = frame.iter().zip(reference);
    let each = pairs.map(|(f, r)| {
        let away: f64 = (0..3).map(|k| (f[k] - gains[k] * r[k]).abs()).sum();
        away / (0..3).map(|k| gains[k] * r[k]).sum::<f64>().max(1.0)
    });
    quantile(&mut each.collect::<Vec<f64>>(), share)
}

const AS_THEY_CAME: [usize; 3] = [0, 1, 2];
const ORDERS: [[usize; 3]; 5] = [[2, 1, 0], [1, 0, 2], [0, 2, 1], [1, 2, 0], [2, 0, 1]];
const TURNS: [Turn; 4] = [Turn::Half, Turn::LeftRight, Turn::TopBottom, Turn::Quarter];

/// Compares a frame with the reference.
pub(crate) fn light(frame: &Blocks, reference: &Blocks) -> FrameLight {
    let same = |doubts| FrameLight { gain: 1.0, doubts };
    let mean = frame.mean();
    if mean < DARK {
        return same(vec![FrameDoubt::Black]);
    }
    if mean > 255.0 - DARK {
        return same(vec![FrameDoubt::White]);
    }
    if frame.roughness > NOISY * reference.roughness.max(0.5) {
        return same(vec![FrameDoubt::Noise]);
    }
    let border = |of: &Blocks, order, turn| of.border(order, turn);
    let (Some(own), Some(flat)) = (
        border(frame, AS_THEY_CAME, None),
        border(reference, AS_THEY_CAME, None),
    ) else {
        return same(Vec::new());
    };
    let channels = ratios(&own, &flat);
    let gain = median(&mut channels.to_vec());
    // A common factor is used, because separate factors would hide exchanged channels.
    let common = |frame: &[[f64; 3]]| {
        let gain = median(&mut ratios(frame, &flat).to_vec());
        misfit(frame, &flat, [gain; 3], 0.5)
    };
    let plain = common(&own);
    if plain > PATTERN {
        let exchanged = ORDERS.iter().filter_map(|order| {
            let found = common(&border(frame, *order, None)?);
            Some((found, FrameDoubt::ChannelsExchanged(*order)))
        });
        let turned = TURNS.iter().filter_map(|turn| {
            let found = common(&border(frame, AS_THEY_CAME, Some(*turn))?);
            Some((found, FrameDoubt::Turned(*turn)))
        });
        let best = exchanged.chain(turned).min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((found, doubt)) = best
            && found < FITS_BETTER * plain
            && found < 2.0 * PATTERN
        {
            return same(vec![doubt]);
        }
    }
    let mut doubts = Vec::new();
    let own_factors = misfit(&own, &flat, channels, UNTOUCHED);
    if own_factors > PATTERN {
        doubts.push(FrameDoubt::AnotherPattern(own_factors));
    }
    let balance = channels.map(|ratio| ratio / gain);
    if balance.iter().any(|b| (b - 1.0).abs() > BALANCE) {
        doubts.push(FrameDoubt::Balance(channels));
    } else if !(EXPOSURES[0]..=EXPOSURES[1]).contains(&gain) {
        doubts.push(FrameDoubt::Exposure(gain));
    }
    // If small changes of the channels disagree, they come from contacts at the border or from
    // lamps, not from the exposure.
    let agree = channels
        .iter()
        .all(|ratio| (ratio - gain).abs() < 0.5 * (gain - 1.0).abs());
    FrameLight {
        gain: if agree && gain > 0.0 { gain } else { 1.0 },
        doubts,
    }
}
