//! Ctrl-C as a wish to come to an end.

use super::Failure;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code of a command that was ended by Ctrl-C.
const INTERRUPTED: i32 = 130;

/// State of Ctrl-C.
#[derive(Clone, Debug)]
pub struct Interrupt {
    pressed: Arc<AtomicBool>,
    armed: Arc<AtomicBool>,
}

impl Interrupt {
    /// From now on Ctrl-C ends nothing by itself; pressed again, it does.
    ///
    /// # Errors
    /// [`Failure`] if the system does not let us.
    pub fn catch() -> Result<Self, Failure> {
        let interrupt = Self {
            pressed: Arc::new(AtomicBool::new(false)),
            armed: Arc::new(AtomicBool::new(true)),
        };
        let seen = interrupt.clone();
        let caught = ctrlc::set_handler(move || {
            let again = seen.pressed.swap(true, Ordering::Relaxed);
            if again || !seen.armed.load(Ordering::Relaxed) {
                std::process::exit(INTERRUPTED);
            }
        });
        caught.map_err(|e| Failure::input(format!("Ctrl-C cannot be caught: {e}")))?;
        Ok(interrupt)
    }

    /// `true` if it was pressed.
    #[must_use]
    pub fn is_pressed(&self) -> bool {
        self.pressed.load(Ordering::Relaxed)
    }

    /// While nothing is going on that could come to an end, Ctrl-C ends the program.
    pub fn arm(&self, armed: bool) {
        self.armed.store(armed, Ordering::Relaxed);
        self.pressed.store(false, Ordering::Relaxed);
    }
}
