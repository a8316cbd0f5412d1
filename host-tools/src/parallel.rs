//! Independent jobs on several threads, with results in the order of the jobs.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// Does jobs 0 to `count` on `threads` threads, as many as there are processors if `None`.
/// Gives the results in order and the time that the threads worked. `progress` hears how many
/// are done and which one is the latest.
///
/// # Errors
/// The error of the first job that fails.
pub(crate) fn each<T: Send, E: Send>(
    count: usize,
    threads: Option<usize>,
    job: &(dyn Fn(usize) -> Result<T, E> + Sync),
    progress: &mut dyn FnMut(usize, usize),
) -> Result<(Vec<T>, Duration), E> {
    let processors = || std::thread::available_parallelism().map_or(1, usize::from);
    let threads = threads.unwrap_or_else(processors).clamp(1, count.max(1));
    let next = AtomicUsize::new(0);
    let (sender, receiver) = mpsc::channel();
    let mut results: Vec<Option<T>> = (0..count).map(|_| None).collect();
    let mut work = Duration::ZERO;
    std::thread::scope(|scope| {
        for _ in 0..threads {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= count {
                        return;
                    }
                    let began = Instant::now();
                    let done = job(number);
                    // Nobody listens any more after a failure elsewhere.
                    if sender.send((number, done, began.elapsed())).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        for (done, (number, result, took)) in receiver.iter().enumerate() {
            results[number] = Some(result?);
            work += took;
            progress(done + 1, number);
        }
        Ok::<(), E>(())
    })?;
    Ok((results.into_iter().flatten().collect(), work))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_order_whatever_the_threads() {
        let square = |n: usize| Ok::<_, ()>(n * n);
        for threads in [None, Some(1), Some(3), Some(100)] {
            let mut heard = 0;
            let done = each(20, threads, &square, &mut |_, _| heard += 1);
            let expected: Vec<usize> = (0..20).map(|n| n * n).collect();
            assert_eq!(done.map(|(results, _)| results), Ok(expected));
            assert_eq!(heard, 20);
        }
    }

    #[test]
    fn a_failure_ends_it() {
        let fails = |n: usize| if n == 7 { Err(n) } else { Ok(n) };
        assert_eq!(
            each(20, Some(2), &fails, &mut |_, _| ()).map(|_| ()),
            Err(7)
        );
    }
}
