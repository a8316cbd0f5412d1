//! What takes seconds: it leaves the instrument, is run elsewhere, and comes back.

use core::marker::PhantomData;

/// Work that a request has left to be done. It owns all it needs, so that a task of low
/// priority can run it while the instrument goes on.
#[derive(Debug)]
pub struct Job<'m> {
    memory: PhantomData<&'m mut ()>,
}

impl Job<'_> {
    /// Does the work. It takes seconds on the chip, and up to 32 KiB of stack.
    pub fn run(&mut self) {
        let _ = self.memory;
    }
}
