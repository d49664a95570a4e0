//! A bar on the terminal for what takes longer than a second.
use crate::interrupt::Interrupt;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// How long a job may take before it shows how far it is.
const PATIENCE: Duration = Duration::from_secs(1);

/// How often a job that runs by itself is looked at.
const GLANCE: Duration = Duration::from_millis(100);

/// Shows how far a job is and how long it will take; nothing where standard error is no terminal.
pub struct Progress {
    bar: ProgressBar,
    started: Instant,
    shown: bool,
    /// Dropped at the end, which a clock's thread hears.
    end: Option<mpsc::Sender<()>>,
}

impl Progress {
    /// Of a job of `total` steps.
    pub fn of(total: usize, job: impl Into<String>) -> Self {
        let bar = ProgressBar::with_draw_target(Some(total as u64), ProgressDrawTarget::hidden());
        let style = ProgressStyle::with_template("{msg} [{bar:32}] {percent} %, {eta} left");
        Self::new(bar, style.ok(), job)
    }

    /// Of a job whose length is not known; the clock runs by itself.
    pub fn without_end(job: impl Into<String>) -> Self {
        let progress = Self::new(ProgressBar::hidden(), None, job);
        let style = ProgressStyle::with_template("{spinner} {msg}, {elapsed}");
        if let Ok(style) = style {
            progress.bar.set_style(style);
        }
        progress
    }

    /// Of a job that does not tell how far it is: after a second on the clock of its own.
    pub fn with_clock(job: impl Into<String>) -> Self {
        let mut progress = Self::without_end(job);
        let bar = progress.bar.clone();
        let (end, ended) = mpsc::channel::<()>();
        progress.end = Some(end);
        std::thread::spawn(move || {
            let still_runs = Err(mpsc::RecvTimeoutError::Timeout);
            if ended.recv_timeout(PATIENCE) == still_runs {
                bar.set_draw_target(ProgressDrawTarget::stderr());
                bar.enable_steady_tick(2 * GLANCE);
            }
        });
        progress
    }

    fn new(bar: ProgressBar, style: Option<ProgressStyle>, job: impl Into<String>) -> Self {
        if let Some(style) = style {
            bar.set_style(style);
        }
        bar.set_message(job.into());
        Self {
            bar,
            started: Instant::now(),
            shown: false,
            end: None,
        }
    }

    /// Tells that so many steps are done.
    pub fn done(&mut self, steps: usize) {
        self.bar.set_position(steps as u64);
        self.show();
    }

    /// Tells that the job still runs.
    fn tick(&mut self) {
        self.bar.tick();
        self.show();
    }

    fn show(&mut self) {
        if !self.shown && self.started.elapsed() > PATIENCE {
            self.shown = true;
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.end = None;
        self.bar.finish_and_clear();
    }
}

/// Runs a job that can neither stop nor tell how far it is, with the time it has taken so far on the terminal; None after Ctrl-C, which
/// leaves the job to end with the program.
pub fn waiting_or_interrupted<R: Send + 'static>(
    job: impl Into<String>,
    interrupt: &Interrupt,
    work: impl FnOnce() -> R + Send + 'static,
) -> Option<R> {
    let mut progress = Progress::without_end(job);
    let (answer, answered) = mpsc::channel();
    interrupt.hear(true);
    let worker = std::thread::spawn(move || {
        // Nobody waits for the answer any more after Ctrl-C.
        let _ = answer.send(work());
    });
    let result = loop {
        match answered.recv_timeout(GLANCE) {
            Ok(result) => break Some(result),
            Err(mpsc::RecvTimeoutError::Timeout) if interrupt.requested() => break None,
            Err(mpsc::RecvTimeoutError::Timeout) => progress.tick(),
            Err(mpsc::RecvTimeoutError::Disconnected) => match worker.join() {
                Err(panic) => std::panic::resume_unwind(panic),
                Ok(()) => break None,
            },
        }
    };
    interrupt.hear(false);
    result
}

/// Runs a job that cannot tell how far it is, with the time it has taken so far on the terminal.
pub fn waiting<R>(job: impl Into<String>, work: impl FnOnce() -> R) -> R {
    let _clock = Progress::with_clock(job);
    work()
}
