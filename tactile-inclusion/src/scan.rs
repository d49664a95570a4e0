//! Several presses at stated positions of one block.

use crate::picture::CellPositions;
use crate::tissue_block::{PressureProfile, check};
use tactile_elasticity::{ElasticityError, Quantity};

/// Presses at stated positions of a block that is much wider than the guide.
///
/// ```
/// use tactile_inclusion::{PressureProfile, Scan, ScanPress};
///
/// let frame = PressureProfile {
///     approach_m: 1e-3,
///     force_n: None,
///     pressure_pa: vec![348.0; 2],
///     standard_error_pa: vec![0.3; 2],
/// };
/// let press = |axis_m| ScanPress {
///     axis_m,
///     positions_m: vec![[0.0, 0.0], [2e-3, 0.0]],
///     frames: vec![frame.clone()],
/// };
/// let presses = vec![press([0.0, 0.0]), press([20e-3, 0.0])];
/// let scan = Scan { presses, position_error_m: 0.1e-3 };
/// assert_eq!(scan.presses.len(), 2);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// Presses, all with the same approaches.
    pub presses: Vec<ScanPress>,
    /// Standard error of each press's position, in x and in y, for a robot or a hand.
    pub position_error_m: f64,
}

/// A press of a scan: the face of the guide at one position of a block, pressed to several
/// approaches.
///
/// ```
/// use tactile_inclusion::ScanPress;
///
/// let press = ScanPress { axis_m: [20e-3, 0.0], positions_m: vec![], frames: vec![] };
/// assert!(press.positions_m.is_empty(), "a scan with it is refused");
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct ScanPress {
    /// Position (x, y) of the guide's axis, in metres.
    pub axis_m: [f64; 2],
    /// Centres (x, y) of the face's cells relative to that axis, in metres.
    pub positions_m: Vec<[f64; 2]>,
    /// Pressures on these cells for each approach. Forces are not used.
    pub frames: Vec<PressureProfile>,
}

impl Scan {
    /// Distance of a position from the stated axis of the nearest press.
    pub(crate) fn nearest_press_m(&self, [x, y]: [f64; 2]) -> f64 {
        let axes_m = self.presses.iter().map(|press| press.axis_m);
        let distances = axes_m.map(|axis| (x - axis[0]).hypot(y - axis[1]));
        distances.fold(f64::INFINITY, f64::min)
    }

    /// The cells of all presses within a radius, and their frames side by side.
    ///
    /// # Errors
    /// An error if there is no press, the position error is negative or NaN, approaches do not
    /// increase or differ between presses, lengths differ, or values are not finite.
    pub(crate) fn joined(
        &self,
        radius_m: f64,
    ) -> Result<(CellPositions, Vec<PressureProfile>), ElasticityError> {
        let too_few = ElasticityError::TooFewLoads {
            expected: 1,
            found: 0,
        };
        Quantity::StandardError.not_negative(self.position_error_m)?;
        let first = self.presses.first().ok_or(too_few)?;
        let mut joined: Vec<PressureProfile> = (first.frames.iter())
            .map(|frame| PressureProfile {
                approach_m: frame.approach_m,
                force_n: None,
                pressure_pa: Vec::new(),
                standard_error_pa: Vec::new(),
            })
            .collect();
        let mut cells = CellPositions {
            positions_m: Vec::new(),
            presses: Vec::new(),
            axes_m: Vec::new(),
        };
        for (index, press) in self.presses.iter().enumerate() {
            for coordinate in press.positions_m.iter().flatten().chain(&press.axis_m) {
                Quantity::Distance.finite(*coordinate)?;
            }
            // A cell on the axis gets a positive radius.
            let radius = |[x, y]: &[f64; 2]| x.hypot(*y).max(f64::MIN_POSITIVE);
            let radii_m: Vec<f64> = press.positions_m.iter().map(radius).collect();
            check(&radii_m, &press.frames)?;
            Quantity::Distance.entries(press.frames.len(), joined.len())?;
            let used: Vec<usize> = (0..radii_m.len())
                .filter(|&k| radii_m[k] <= radius_m)
                .collect();
            cells
                .positions_m
                .extend(used.iter().map(|&k| press.positions_m[k]));
            cells.presses.resize(cells.positions_m.len(), index);
            cells.axes_m.push(press.axis_m);
            for (all, frame) in joined.iter_mut().zip(&press.frames) {
                if all.approach_m != frame.approach_m {
                    return Err(Quantity::Distance.beyond(frame.approach_m, all.approach_m));
                }
                let taken = |values: &[f64]| used.iter().map(|&k| values[k]).collect::<Vec<f64>>();
                all.pressure_pa.extend(taken(&frame.pressure_pa));
                all.standard_error_pa
                    .extend(taken(&frame.standard_error_pa));
            }
        }
        Ok((cells, joined))
    }
}
