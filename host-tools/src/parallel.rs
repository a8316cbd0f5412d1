//! Independent jobs on several threads, with results in the order of the jobs.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// Least time between two words about the share of a job, each of which wakes a thread.
const BETWEEN: Duration = Duration::from_millis(50);

/// A word from a thread about a job.
enum Word<T> {
    /// Share of it that is done, 0 to 1.
    Share(f64),
    /// Its result, and the time that it took.
    Done(T, Duration),
}

/// A job by its number, which may tell the share of it that is done, 0 to 1, and take an idle thread.
type Job<'a, T, E> = &'a (dyn Fn(usize, &mut dyn FnMut(f64), &Idle) -> Result<T, E> + Sync);

/// Number of threads that have nothing to do, so that a job may start as many of its own.
pub(crate) struct Idle(AtomicUsize);

impl Idle {
    /// No thread, as where a job is the only one.
    pub(crate) const fn none() -> Self {
        Self::new(0)
    }

    /// So many threads.
    pub(crate) const fn new(count: usize) -> Self {
        Self(AtomicUsize::new(count))
    }

    /// One of them, which is idle again once this is dropped; `None` if there is none.
    pub(crate) fn take(&self) -> Option<Taken<'_>> {
        let less = |count: usize| count.checked_sub(1);
        let taken = (self.0).fetch_update(Ordering::Relaxed, Ordering::Relaxed, less);
        taken.ok().map(|_| Taken(self))
    }

    /// One more.
    pub(crate) fn add(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

/// A thread that was idle.
pub(crate) struct Taken<'a>(&'a Idle);

impl Drop for Taken<'_> {
    fn drop(&mut self) {
        self.0.add();
    }
}

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
    let mut done = 0;
    let job = |number: usize, _: &mut dyn FnMut(f64), _: &Idle| job(number);
    run(count, threads, BETWEEN, &job, &mut |number, _| {
        done += 1;
        progress(done, number);
    })
}

/// Does jobs 0 to `count` as [`each`] does. `progress` hears which job is the latest that told of itself, and
/// the sum of the shares of all jobs that are done.
///
/// # Errors
/// The error of the first job that fails.
pub(crate) fn each_with_shares<T: Send, E: Send>(
    count: usize,
    threads: Option<usize>,
    job: Job<'_, T, E>,
    progress: &mut dyn FnMut(usize, f64),
) -> Result<Vec<T>, E> {
    with_shares(count, threads, BETWEEN, job, progress)
}

/// The same, with so much time between two words about the share of a job at least.
fn with_shares<T: Send, E: Send>(
    count: usize,
    threads: Option<usize>,
    between: Duration,
    job: Job<'_, T, E>,
    progress: &mut dyn FnMut(usize, f64),
) -> Result<Vec<T>, E> {
    let mut shares = vec![0.0; count];
    let told = run(count, threads, between, job, &mut |number, share: f64| {
        if let Some(slot) = shares.get_mut(number) {
            *slot = share.clamp(0.0, 1.0);
        }
        progress(number, shares.iter().sum());
    });
    told.map(|(results, _)| results)
}

/// Does two pieces of work, beside each other where there are `threads` threads for them, as many as there are
/// processors if `None`.
pub(crate) fn both<A: Send, B>(
    threads: Option<usize>,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B,
) -> (A, B) {
    if threads.unwrap_or_else(processors) < 2 {
        return (a(), b());
    }
    std::thread::scope(|scope| {
        let a = scope.spawn(a);
        let b = b();
        let a = a.join();
        (
            a.unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
            b,
        )
    })
}

/// Processors that this program may use, at least one.
pub(crate) fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Does the jobs; `told` hears the number of a job and the share of it that is done, 1 at its end.
fn run<T: Send, E: Send>(
    count: usize,
    threads: Option<usize>,
    between: Duration,
    job: Job<'_, T, E>,
    told: &mut dyn FnMut(usize, f64),
) -> Result<(Vec<T>, Duration), E> {
    let wanted = threads.unwrap_or_else(processors).max(1);
    let threads = wanted.min(count.max(1));
    let idle = &Idle::new(wanted - threads);
    let mut results: Vec<Option<T>> = (0..count).map(|_| None).collect();
    let mut work = Duration::ZERO;
    if threads == 1 {
        for (number, slot) in results.iter_mut().enumerate() {
            let began = Instant::now();
            *slot = Some(job(
                number,
                &mut seldom(between, |share| told(number, share)),
                idle,
            )?);
            work += began.elapsed();
            told(number, 1.0);
        }
        return Ok((results.into_iter().flatten().collect(), work));
    }
    let next = AtomicUsize::new(0);
    let (sender, receiver) = mpsc::channel();
    std::thread::scope(|scope| {
        for _ in 0..threads {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= count {
                        idle.add();
                        return;
                    }
                    let began = Instant::now();
                    // Nobody listens any more after a failure elsewhere.
                    let mut share = seldom(between, |share| {
                        drop(sender.send((number, Word::Share(share))))
                    });
                    let done = job(number, &mut share, idle);
                    if sender
                        .send((number, Word::Done(done, began.elapsed())))
                        .is_err()
                    {
                        return;
                    }
                }
            });
        }
        drop(sender);
        for (number, word) in receiver {
            match word {
                Word::Share(share) => told(number, share),
                Word::Done(result, took) => {
                    results[number] = Some(result?);
                    work += took;
                    told(number, 1.0);
                }
            }
        }
        Ok::<(), E>(())
    })?;
    Ok((results.into_iter().flatten().collect(), work))
}

/// Hands shares on, but not those that follow another one too soon.
fn seldom(between: Duration, mut told: impl FnMut(f64)) -> impl FnMut(f64) {
    let mut last: Option<Instant> = None;
    move |share| {
        if last.is_none_or(|last| last.elapsed() >= between) {
            last = Some(Instant::now());
            told(share);
        }
    }
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
    fn two_pieces_of_work_give_what_each_gives() {
        for threads in [None, Some(1), Some(2)] {
            assert_eq!(both(threads, || 3, || "b"), (3, "b"));
        }
    }

    #[test]
    fn threads_without_a_job_are_idle_and_no_others() {
        let at_once = |count: usize, threads: usize| {
            let most = Idle::new(0);
            let job = |_: usize, _: &mut dyn FnMut(f64), idle: &Idle| {
                // Kept until the job's end, as a job that started threads of its own would.
                let taken: Vec<Taken<'_>> = std::iter::from_fn(|| idle.take()).collect();
                (most.0).fetch_max(taken.len(), Ordering::Relaxed);
                Ok::<_, ()>(())
            };
            let done = with_shares(count, Some(threads), BETWEEN, &job, &mut |_, _| ());
            assert!(done.is_ok());
            most.0.into_inner()
        };
        assert_eq!(at_once(4, 1), 0);
        assert_eq!(at_once(1, 4), 3);
        for _ in 0..100 {
            // Three threads beyond the jobs, and at most that which ended first.
            let most = at_once(2, 5);
            assert!((2..=4).contains(&most), "{most}");
        }
        let idle = Idle::new(1);
        let taken = idle.take();
        assert!(taken.is_some() && idle.take().is_none());
        drop(taken);
        assert!(idle.take().is_some());
    }

    #[test]
    fn a_failure_ends_it() {
        let fails = |n: usize| if n == 7 { Err(n) } else { Ok(n) };
        assert_eq!(
            each(20, Some(2), &fails, &mut |_, _| ()).map(|_| ()),
            Err(7)
        );
    }

    #[test]
    fn shares_add_up_to_the_number_of_jobs() {
        let job = |n: usize, share: &mut dyn FnMut(f64), _: &Idle| {
            share(0.25);
            share(0.5);
            Ok::<_, ()>(n)
        };
        // All shares are told, or the first one of each job.
        for (between, words) in [(Duration::ZERO, 15), (Duration::MAX, 10)] {
            for threads in [1, 3] {
                let mut last = 0.0;
                let mut heard = 0;
                let done = with_shares(5, Some(threads), between, &job, &mut |_, sum| {
                    assert!(sum > last, "{sum} after {last}");
                    (last, heard) = (sum, heard + 1);
                });
                assert_eq!((done, last, heard), (Ok(vec![0, 1, 2, 3, 4]), 5.0, words));
            }
        }
    }
}
