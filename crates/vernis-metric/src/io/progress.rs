//! How far a task has come, told to whoever wants to know; nothing here prints.

use std::sync::{Mutex, PoisonError};

/// How much of a stage is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Progress {
    /// How many units of work are done.
    pub done: usize,
    /// 0 where nobody knows.
    pub total: usize,
}

impl Progress {
    /// A stage begins whose length is not known.
    pub const BEGUN: Self = Self { done: 0, total: 0 };
}

/// Called with the name of a stage and how far it is, from any thread.
pub type Observer<'a> = &'a (dyn Fn(&str, Progress) + Sync);

/// An observer for those who do not want to know.
pub fn silent(_stage: &str, _progress: Progress) {}

/// Counts units of work that several threads finish. Each count is told before another thread can tell a higher one: who listens never hears
/// that less is done than before, and hears last that all is.
#[derive(Debug, Default)]
pub struct Count {
    done: Mutex<usize>,
    total: usize,
}

impl Count {
    /// Of `total` units, none of which is done.
    pub fn of(total: usize) -> Self {
        Self { done: Mutex::new(0), total }
    }

    /// One more unit is done, which `tell` is told.
    pub fn one(&self, tell: impl FnOnce(Progress)) {
        self.more(1, tell);
    }

    /// So many more units are done, which `tell` is told.
    pub fn more(&self, units: usize, tell: impl FnOnce(Progress)) {
        // A listener may end the work by a panic; what it was told stays true.
        let mut done = self.done.lock().unwrap_or_else(PoisonError::into_inner);
        *done += units;
        tell(Progress { done: *done, total: self.total });
    }

    /// How many units are done.
    pub fn done(&self) -> usize {
        *self.done.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// So many units are done, whatever was counted; nobody is told.
    pub fn set(&self, done: usize) {
        *self.done.lock().unwrap_or_else(PoisonError::into_inner) = done;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread::scope;

    #[test]
    fn counts_of_several_threads_are_told_in_order() {
        let (count, told) = (Count::of(400), Mutex::new(Vec::new()));
        scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| (0..100).for_each(|_| count.one(|progress| told.lock().unwrap().push(progress))));
            }
        });
        let expected: Vec<Progress> = (1..=400).map(|done| Progress { done, total: 400 }).collect();
        assert_eq!(told.into_inner().unwrap(), expected);
    }

    #[test]
    fn a_listener_that_panics_ends_nothing_else() {
        let count = Count::of(3);
        let panics = std::panic::AssertUnwindSafe(|| count.one(|_| std::panic::resume_unwind(Box::new("enough"))));
        assert!(std::panic::catch_unwind(panics).is_err());
        count.more(2, |progress| assert_eq!(progress, Progress { done: 3, total: 3 }));
        assert_eq!(count.done(), 3);
    }
}
