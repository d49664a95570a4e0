//! Sensor health: brightness, noise and dead pixels against what they were when the sensor was calibrated.

mod condition;
mod cusum;
mod monitor;
mod stuck;

pub use condition::FrameCondition;
pub use monitor::{ChartState, HealthMonitor, HealthOptions, HealthReport};
pub use stuck::StuckPixels;
