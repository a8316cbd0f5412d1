//! Ctrl-C as a wish to come to an end.

use super::Failure;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What shells call a command that was ended by Ctrl-C.
const INTERRUPTED: i32 = 130;

/// Whether the user has pressed Ctrl-C.
#[derive(Clone, Debug)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// From now on Ctrl-C ends nothing by itself; pressed again, it does.
    ///
    /// # Errors
    /// [`Failure`] if the system does not let us.
    pub fn catch() -> Result<Self, Failure> {
        let pressed = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&pressed);
        let caught = ctrlc::set_handler(move || {
            if seen.swap(true, Ordering::Relaxed) {
                std::process::exit(INTERRUPTED);
            }
        });
        caught.map_err(|e| Failure::input(format!("Ctrl-C cannot be caught: {e}")))?;
        Ok(Self(pressed))
    }

    /// Whether it was pressed.
    #[must_use]
    pub fn is_pressed(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
