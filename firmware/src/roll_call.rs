//! The roll call: the watchdog is fed only while every task answers within its time.
//!
//! A watchdog that a timer feeds proves that the timer runs. Here each task answers for itself,
//! from its own priority and after its own work, and one that is missing for too long is named
//! in the last words before the reset. The chip's independent watchdog, which is fed from here,
//! stands behind all this: it bites when the caller itself is gone.

use core::sync::atomic::{AtomicU32, Ordering};

/// Who has answered since the last round. Answering is allowed from any priority.
#[derive(Debug, Default)]
pub struct Answers(AtomicU32);

impl Answers {
    /// Nobody yet.
    #[must_use]
    pub const fn new() -> Self {
        Self(AtomicU32::new(0))
    }

    /// The task of this number, below 32, answers.
    pub fn present(&self, task: u8) {
        self.0
            .fetch_or(1_u32.wrapping_shl(u32::from(task)), Ordering::Relaxed);
    }

    fn collect(&self) -> u32 {
        self.0.swap(0, Ordering::Relaxed)
    }
}

/// Calls the roll of `N` tasks.
#[derive(Debug)]
pub struct RollCall<const N: usize> {
    /// Rounds in which a task may be missing.
    patience: [u32; N],
    /// Rounds in which it has been.
    missing: [u32; N],
}

impl<const N: usize> RollCall<N> {
    /// Rounds in a row that each task, by its number, may be missing.
    #[must_use]
    pub const fn new(patience: [u32; N]) -> Self {
        const { assert!(N <= 32, "answers are bits of a word") };
        Self {
            patience,
            missing: [0; N],
        }
    }

    /// Ends a round.
    ///
    /// # Errors
    /// The task that has been missing for too long, the first if there are several: the
    /// watchdog is not to be fed.
    pub fn round(&mut self, answers: &Answers) -> Result<(), u8> {
        let answered = answers.collect();
        let mut late = Ok(());
        let tasks = self.missing.iter_mut().zip(self.patience);
        for (task, (missing, patience)) in (0_u8..).zip(tasks) {
            if answered & (1 << task) != 0 {
                *missing = 0;
                continue;
            }
            *missing = missing.saturating_add(1);
            if *missing > patience && late.is_ok() {
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
    fn names_the_first_that_is_missing_for_too_long() {
        let answers = Answers::new();
        let mut roll = RollCall::new([9, 2, 5]);
        for _ in 0..2 {
            answers.present(0);
            assert_eq!(roll.round(&answers), Ok(()));
        }
        assert_eq!(roll.round(&answers), Err(1));
        assert_eq!(roll.round(&answers), Err(1), "until something is done");
        answers.present(1);
        assert_eq!(roll.round(&answers), Ok(()));
        assert_eq!(roll.round(&answers), Err(2));
    }

    #[test]
    fn answers_within_patience_keep_it_going_for_ever() {
        let answers = Answers::new();
        let mut roll = RollCall::new([3, 0]);
        for round in 0..1000 {
            if round % 4 == 3 {
                answers.present(0);
            }
            answers.present(1);
            assert_eq!(roll.round(&answers), Ok(()), "{round}");
        }
    }

    #[test]
    fn one_answer_is_good_for_one_round() {
        let answers = Answers::new();
        let mut roll = RollCall::new([0]);
        answers.present(0);
        answers.present(0);
        assert_eq!(roll.round(&answers), Ok(()));
        assert_eq!(roll.round(&answers), Err(0));
    }
}
