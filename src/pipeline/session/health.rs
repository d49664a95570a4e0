//! The sensor's condition over a session.
use crate::force::{FrameCondition, HealthMonitor, HealthOptions, HealthReport, StuckPixels};
use ndarray::ArrayView2;

/// Frames from one look for stuck pixels to the next: a look reads the whole frame, so that it must be rare, and sixteen looks, the
/// fewest that tell, are 13 seconds at 80 frames a second.
const STUCK_INTERVAL: u64 = 64;

/// Charts of gain and noise, and the pixels that do not follow.
pub(super) struct SensorHealth {
    monitor: HealthMonitor,
    report: Option<HealthReport>,
    stuck: Option<StuckPixels>,
}

impl SensorHealth {
    pub(super) fn new(options: HealthOptions) -> Self {
        Self {
            monitor: HealthMonitor::new(options),
            report: None,
            stuck: None,
        }
    }

    pub(super) fn watch(
        &mut self,
        number: u64,
        frame: ArrayView2<'_, u8>,
        condition: Option<FrameCondition>,
    ) {
        let Some(condition) = condition else { return };
        self.report = Some(self.monitor.update(&condition));
        if !number.is_multiple_of(STUCK_INTERVAL) {
            return;
        }
        if self.stuck.is_none() {
            self.stuck = StuckPixels::new(frame.dim()).ok();
        }
        if let Some(stuck) = &mut self.stuck {
            // All frames of a session have the reference's size, or they were refused before.
            let _ = stuck.update(frame);
        }
    }

    pub(super) fn report(&self) -> Option<HealthReport> {
        self.report
    }

    pub(super) fn stuck_pixels(&self) -> Vec<(usize, usize)> {
        self.stuck
            .as_ref()
            .map_or_else(Vec::new, StuckPixels::pixels)
    }
}
