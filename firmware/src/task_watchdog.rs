//! The task watchdog: the chip's watchdog is fed only while every task checks in within its time.
//!
//! A watchdog that a timer feeds proves that the timer runs. Here each task checks in for itself,
//! from its own priority and after its own work, and the first one that is late is named in the
//! record that outlives the reset. The chip's independent watchdog, which is fed from here, covers
//! the failure of the task watchdog itself.

use core::sync::atomic::{AtomicU32, Ordering};

/// Tasks that have checked in since the last round, by bits. Any priority may check in.
#[derive(Debug, Default)]
pub struct CheckIns(AtomicU32);

impl CheckIns {
    /// No task yet.
    #[must_use]
    pub const fn new() -> Self {
        Self(AtomicU32::new(0))
    }

    /// Checks the task of this number in, below 32.
    pub fn check_in(&self, task: u8) {
        self.0
            .fetch_or(1_u32.wrapping_shl(u32::from(task)), Ordering::Relaxed);
    }

    fn collect(&self) -> u32 {
        self.0.swap(0, Ordering::Relaxed)
    }
}

/// The watchdog of `N` tasks.
#[derive(Debug)]
pub struct TaskWatchdog<const N: usize> {
    /// Rounds in a row that each task may miss.
    limits: [u32; N],
    /// Rounds in a row that each task has missed.
    missed: [u32; N],
}

impl<const N: usize> TaskWatchdog<N> {
    /// A watchdog whose tasks, by their numbers, may miss so many rounds in a row.
    #[must_use]
    pub const fn new(limits: [u32; N]) -> Self {
        const { assert!(N <= 32, "check-ins are bits of a word") };
        Self {
            limits,
            missed: [0; N],
        }
    }

    /// Ends a round.
    ///
    /// # Errors
    /// The number of the first task that is late: the chip's watchdog must not be fed.
    pub fn round(&mut self, check_ins: &CheckIns) -> Result<(), u8> {
        let checked_in = check_ins.collect();
        let mut late = Ok(());
        let tasks = self.missed.iter_mut().zip(self.limits);
        for (task, (missed, limit)) in (0_u8..).zip(tasks) {
            if checked_in & (1 << task) != 0 {
                *missed = 0;
                continue;
            }
            *missed = missed.saturating_add(1);
            if *missed > limit && late.is_ok() {
                late = Err(task);
            }
        }
        late
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_task_that_is_late_is_named() {
        let tasks = CheckIns::new();
        let mut watchdog = TaskWatchdog::new([9, 2, 5]);
        for _ in 0..2 {
            tasks.check_in(0);
            assert_eq!(watchdog.round(&tasks), Ok(()));
        }
        assert_eq!(watchdog.round(&tasks), Err(1));
        assert_eq!(watchdog.round(&tasks), Err(1), "until the task checks in");
        tasks.check_in(1);
        assert_eq!(watchdog.round(&tasks), Ok(()));
        assert_eq!(watchdog.round(&tasks), Err(2));
    }

    #[test]
    fn tasks_within_their_limits_are_never_late() {
        let tasks = CheckIns::new();
        let mut watchdog = TaskWatchdog::new([3, 0]);
        for round in 0..1000 {
            if round % 4 == 3 {
                tasks.check_in(0);
            }
            tasks.check_in(1);
            assert_eq!(watchdog.round(&tasks), Ok(()), "{round}");
        }
    }

    #[test]
    fn checking_in_counts_for_one_round() {
        let tasks = CheckIns::new();
        let mut watchdog = TaskWatchdog::new([0]);
        tasks.check_in(0);
        tasks.check_in(0);
        assert_eq!(watchdog.round(&tasks), Ok(()));
        assert_eq!(watchdog.round(&tasks), Err(0));
    }
}
