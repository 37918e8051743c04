//! Memory that is used again: the system hands fresh memory out page by page, which took as long as what was computed into it.

use super::lanes::{LANES, Lanes};
use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};

/// Smaller memory comes from the allocator, which keeps it.
const SMALLEST: usize = (64 << 10) / size_of::<Lanes>();
/// What may lie about unused.
const MOST: usize = (64 << 20) / size_of::<Lanes>();

/// The shortest first.
static UNUSED: Mutex<Vec<Vec<Lanes>>> = Mutex::new(Vec::new());

/// Numbers, eight at a time, in memory that goes to the next buffer when this one is dropped.
#[derive(Debug)]
pub(super) struct Buffer(Vec<Lanes>);

impl Buffer {
    /// `len` entries of what was in the memory before: for those who write all of them.
    pub fn unspecified(len: usize) -> Self {
        let mut memory = if len < SMALLEST { Vec::new() } else { taken(len) };
        memory.resize(len, [0.0; LANES]);
        Self(memory)
    }

    /// `len` entries of zero.
    pub fn zeros(len: usize) -> Self {
        let mut memory = if len < SMALLEST { Vec::new() } else { taken(len) };
        memory.clear();
        memory.resize(len, [0.0; LANES]);
        Self(memory)
    }

    /// Adds entries at the end.
    pub fn extend(&mut self, lanes: impl Iterator<Item = Lanes>) {
        self.0.extend(lanes);
    }
}

/// The shortest unused memory that is long enough, if there is any.
fn taken(len: usize) -> Vec<Lanes> {
    let mut unused = UNUSED.lock().unwrap_or_else(PoisonError::into_inner);
    let place = unused.partition_point(|memory| memory.capacity() < len);
    if place < unused.len() { unused.remove(place) } else { Vec::new() }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        let memory = std::mem::take(&mut self.0);
        if memory.capacity() < SMALLEST {
            return;
        }
        let mut unused = UNUSED.lock().unwrap_or_else(PoisonError::into_inner);
        let lying: usize = unused.iter().map(Vec::capacity).sum();
        if lying + memory.capacity() <= MOST {
            let place = unused.partition_point(|other| other.capacity() < memory.capacity());
            unused.insert(place, memory);
        }
    }
}

impl Clone for Buffer {
    fn clone(&self) -> Self {
        let mut copy = Self::unspecified(self.len());
        copy.copy_from_slice(self);
        copy
    }
}

impl Deref for Buffer {
    type Target = [Lanes];

    fn deref(&self) -> &[Lanes] {
        &self.0
    }
}

impl DerefMut for Buffer {
    fn deref_mut(&mut self) -> &mut [Lanes] {
        &mut self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_are_zero_in_used_memory() {
        for len in [10, 2 * SMALLEST, 3 * SMALLEST, SMALLEST] {
            let mut buffer = Buffer::zeros(len);
            assert!(buffer.len() == len && buffer.iter().all(|lanes| *lanes == [0.0; LANES]));
            buffer.fill([1.0; LANES]);
            assert_eq!(*buffer.clone(), *buffer);
        }
        assert_eq!(Buffer::unspecified(2 * SMALLEST).len(), 2 * SMALLEST);
    }

    #[test]
    fn no_more_lies_about_than_allowed() {
        let buffers: Vec<Buffer> = (0..40).map(|_| Buffer::unspecified(MOST / 16)).collect();
        drop(buffers);
        let lying: usize = UNUSED.lock().unwrap().iter().map(Vec::capacity).sum();
        assert!(lying <= MOST, "{lying}");
    }
}
