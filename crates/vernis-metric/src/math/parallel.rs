//! Loops on all workers, whose results do not depend on their number.
//!
//! They are rayon's, behind functions that are compiled once: each loop hands over its body as `&dyn Fn`. A parallel iterator is compiled
//! anew for every loop, several times over; such iterators were a tenth of what the compiler had to optimise. Beyond a plain loop, each
//! part of the work costs a call through a pointer and a lock that nobody else wants.

use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Most parts into which [`map`] divides its items. A part is what one worker does at a time.
const PARTS: usize = 512;

/// Calls `work(i)` for every i in `0..count`, in any order.
pub fn for_each(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(work);
}

/// The values `value(i)` for i in `0..count`, in this order.
pub fn map<T: Send>(count: usize, value: impl Fn(usize) -> T + Sync) -> Vec<T> {
    concatenated(count, &|part| part.map(&value).collect())
}

/// What `values` gives for ranges that make up `0..count`, one after the other.
fn concatenated<T: Send>(count: usize, values: &(dyn Fn(Range<usize>) -> Vec<T> + Sync)) -> Vec<T> {
    let size = count.div_ceil(PARTS).max(1);
    let mut parts: Vec<Vec<T>> = (0..count.div_ceil(size)).map(|_| Vec::new()).collect();
    chunk_by_chunk(&mut parts, 1, &|part, found| found[0] = values(part * size..count.min((part + 1) * size)));
    let mut all = Vec::with_capacity(count);
    parts.iter_mut().for_each(|found| all.append(found));
    all
}

/// The values of `value` for each of `items`, in their order.
pub fn map_items<I: Sync, T: Send>(items: &[I], value: impl Fn(&I) -> T + Sync) -> Vec<T> {
    map(items.len(), |i| value(&items[i]))
}

/// As [`map`], for values that can fail.
///
/// # Errors
/// That of the smallest i that fails. What follows it may be left out.
pub fn try_map<T: Send, E: Send>(count: usize, value: impl Fn(usize) -> Result<T, E> + Sync) -> Result<Vec<T>, E> {
    let failed = AtomicUsize::new(usize::MAX);
    let found = map(count, |i| {
        if failed.load(Ordering::Relaxed) < i {
            return None;
        }
        let found = value(i);
        if found.is_err() {
            failed.fetch_min(i, Ordering::Relaxed);
        }
        Some(found)
    });
    // All that were left out come after one that failed.
    found.into_iter().flatten().collect()
}

/// Whether `holds(i)` for every i in `0..count`. Those after one that does not hold may be left out.
pub fn all(count: usize, holds: impl Fn(usize) -> bool + Sync) -> bool {
    try_map(count, |i| if holds(i) { Ok(()) } else { Err(()) }).is_ok()
}

/// Calls `work(k, chunk)` for chunk k of `size` values each; the last one may be shorter.
///
/// # Panics
/// If `size` is 0.
pub fn for_each_chunk<T: Send>(values: &mut [T], size: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    chunk_by_chunk(values, size, &work);
}

fn chunk_by_chunk<T: Send>(values: &mut [T], size: usize, work: &(dyn Fn(usize, &mut [T]) + Sync)) {
    let chunks: Vec<Mutex<&mut [T]>> = values.chunks_mut(size).map(Mutex::new).collect();
    for_each(chunks.len(), &|k| work(k, &mut chunks[k].lock().unwrap_or_else(PoisonError::into_inner)));
}

/// As [`for_each_chunk`], over two slices side by side, as far as the shorter one goes.
///
/// # Panics
/// If `size` is 0.
pub fn for_each_chunk_of_two<A: Send, B: Send>(
    a: &mut [A],
    b: &mut [B],
    size: usize,
    work: impl Fn(usize, &mut [A], &mut [B]) + Sync,
) {
    let chunks: Vec<Mutex<(&mut [A], &mut [B])>> = a.chunks_mut(size).zip(b.chunks_mut(size)).map(Mutex::new).collect();
    for_each(chunks.len(), &|k| {
        let mut chunk = chunks[k].lock().unwrap_or_else(PoisonError::into_inner);
        let (a, b) = &mut *chunk;
        work(k, a, b);
    });
}

/// The values of `a` and of `b`, at the same time if a worker is free.
pub fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    let (mut a, mut b) = (Once::new(a), Once::new(b));
    rayon::join(dynamic(&mut || a.run()), dynamic(&mut || b.run()));
    (a.value(), b.value())
}

/// One type for all of them, so that [`rayon::join`] is compiled once.
fn dynamic(run: &mut (dyn FnMut() + Send)) -> &mut (dyn FnMut() + Send) {
    run
}

/// A function to be called once, then its value.
enum Once<F, T> {
    Waiting(F),
    Running,
    Done(T),
}

impl<T, F: FnOnce() -> T> Once<F, T> {
    fn new(function: F) -> Self {
        Self::Waiting(function)
    }

    fn run(&mut self) {
        if let Self::Waiting(function) = std::mem::replace(self, Self::Running) {
            *self = Self::Done(function());
        }
    }

    fn value(self) -> T {
        match self {
            Self::Done(value) => value,
            // A panic of a function goes on in whoever waits for it.
            Self::Waiting(_) | Self::Running => unreachable!("both functions have ended"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Around the number of parts, where their sizes change.
    #[test]
    fn values_come_in_their_order() {
        for count in [0, 1, 2, PARTS - 1, PARTS, PARTS + 1, 2 * PARTS, 10_007] {
            assert_eq!(map(count, |i| 3 * i), (0..count).map(|i| 3 * i).collect::<Vec<_>>(), "{count}");
        }
    }

    #[test]
    fn every_index_is_called_once() {
        let seen = Mutex::new(BTreeSet::new());
        for_each(1000, &|i| assert!(seen.lock().unwrap().insert(i)));
        assert_eq!(seen.into_inner().unwrap().len(), 1000);
    }

    #[test]
    fn the_error_is_that_of_the_smallest_index() {
        for _ in 0..50 {
            let found = try_map(5000, |i| if i % 1000 == 777 { Err(i) } else { Ok(i) });
            assert_eq!(found, Err(777));
        }
        assert_eq!(try_map(3, Ok::<_, ()>), Ok(vec![0, 1, 2]));
        assert!(all(100, |i| i < 100) && !all(100, |i| i != 99) && all(0, |_| false));
    }

    #[test]
    fn chunks_cover_a_slice() {
        let mut values = vec![0; 103];
        for_each_chunk(&mut values, 10, |k, chunk| chunk.iter_mut().enumerate().for_each(|(j, v)| *v = 10 * k + j));
        assert_eq!(values, (0..103).collect::<Vec<_>>());
        let mut signs = vec![false; 103];
        for_each_chunk_of_two(&mut values, &mut signs, 7, |_, values, signs| {
            values.iter_mut().zip(signs).for_each(|(v, sign)| (*v, *sign) = (*v + 1, *v % 2 == 0));
        });
        assert!(values.iter().enumerate().all(|(i, v)| *v == i + 1));
        assert!(signs.iter().enumerate().all(|(i, sign)| *sign == (i % 2 == 0)));
    }

    #[test]
    fn joined_values_are_those_of_their_functions() {
        let text = String::from("moved");
        assert_eq!(join(move || text.len(), || join(|| 'a', || 2.5)), (5, ('a', 2.5)));
    }

    #[test]
    #[should_panic(expected = "of the second")]
    fn a_panic_goes_on() {
        join(|| (), || panic!("of the second"));
    }
}
