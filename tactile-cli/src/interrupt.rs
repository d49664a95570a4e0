//! Ctrl-C: work that looks at it stops with what there is; work that cannot ends at once. A second one always ends.
use crate::failure::Exit;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

#[derive(Clone, Default)]
pub struct Interrupt {
    requested: Arc<AtomicBool>,
    /// Whether somebody looks at `requested` from time to time.
    heard: Arc<AtomicBool>,
}

impl Interrupt {
    /// Listens for Ctrl-C. Where the system allows no handler it ends the program, as without one.
    pub fn install() -> Self {
        let interrupt = Self::default();
        let copy = interrupt.clone();
        let _ = ctrlc::set_handler(move || {
            let again = copy.requested.swap(true, Ordering::SeqCst);
            // Files are written whole or not at all, so that ending here leaves nothing half done.
            if again || !copy.heard.load(Ordering::SeqCst) {
                std::process::exit(Exit::Interrupted.code().into());
            }
        });
        interrupt
    }

    pub fn requested(&self) -> bool {
        self.requested.load(Ordering::SeqCst)
    }

    /// Announces that the work from here on looks at [`requested`](Self::requested), or no longer does.
    pub fn hear(&self, heard: bool) {
        self.heard.store(heard, Ordering::SeqCst);
    }
}
