//! Jobs that each hold much memory: no more at a time than there are worker threads.
//!
//! A thread of rayon's pool that waits for a part of its job may begin another job meanwhile, and hold the memory of both. Here
//! every job has a thread of its own until it ends; what is parallel inside a job still runs in rayon's pool.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread::Builder;

/// `work(0)`, `work(1)`, ... `work(jobs - 1)`, in that order, as many at a time as rayon's pool has threads.
///
/// # Errors
/// That of the first job, in their order, that fails; jobs that were not begun by then are not.
pub fn in_order<T: Send, E: Send>(jobs: usize, work: impl Fn(usize) -> Result<T, E> + Sync) -> Result<Vec<T>, E> {
    let (next, failed) = (AtomicUsize::new(0), AtomicUsize::new(usize::MAX));
    let found: Mutex<Vec<Option<Result<T, E>>>> = Mutex::new((0..jobs).map(|_| None).collect());
    let worker = || {
        loop {
            let job = next.fetch_add(1, Ordering::Relaxed);
            // Jobs are begun in order, so that all before one that failed come to their end.
            if job >= jobs || job > failed.load(Ordering::Relaxed) {
                return;
            }
            let result = work(job);
            if result.is_err() {
                failed.fetch_min(job, Ordering::Relaxed);
            }
            found.lock().unwrap_or_else(PoisonError::into_inner)[job] = Some(result);
        }
    };
    std::thread::scope(|scope| {
        // Where no more threads can be started, those that were do the work; this one does it where none was.
        let wanted = rayon::current_num_threads().min(jobs);
        let started = (0..wanted).take_while(|_| Builder::new().spawn_scoped(scope, worker).is_ok()).count();
        if started == 0 {
            worker();
        }
    });
    found.into_inner().unwrap_or_else(PoisonError::into_inner).into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_stand_in_the_order_of_the_jobs() {
        let squares = in_order(100, |job| Ok::<_, ()>(job * job)).unwrap();
        assert_eq!(squares, (0..100).map(|job| job * job).collect::<Vec<_>>());
        assert_eq!(in_order(0, Err::<(), _>), Ok(Vec::new()));
    }

    #[test]
    fn the_first_error_counts_and_ends_the_work() {
        let begun = AtomicUsize::new(0);
        let found = in_order(1000, |job| {
            begun.fetch_add(1, Ordering::Relaxed);
            if job >= 7 { Err(job) } else { Ok(()) }
        });
        assert_eq!(found, Err(7));
        assert!(begun.into_inner() < 1000);
    }

    #[test]
    fn no_more_jobs_at_a_time_than_threads() {
        use rayon::prelude::*;
        let (now, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let job = |_| {
            most.fetch_max(now.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
            let sum: u64 = (0..10_000u64).into_par_iter().map(|k| k % 7).sum();
            now.fetch_sub(1, Ordering::SeqCst);
            Ok::<_, ()>(sum)
        };
        assert_eq!(in_order(200, job).unwrap().len(), 200);
        assert!(most.into_inner() <= rayon::current_num_threads());
    }
}
