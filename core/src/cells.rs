//! Entries by their numbers, without a way to panic.
//!
//! In a solver every number is below its dimension by construction. Where the optimiser cannot
//! see that, a check is left whose failure would end the program on the chip. Here a number that
//! is out of range reads zero and writes nothing instead, and builds with debug assertions, as
//! those of the tests, still stop there.

use core::ops::{Index, IndexMut};
use nalgebra::{Dim, Matrix, RawStorage, RawStorageMut, Scalar};

/// A collection of entries.
pub(crate) trait Collection {
    /// Type of the entries.
    type Entry;
}

/// Entries told apart by an `I`.
pub(crate) trait Entries<I>: Collection {
    /// One of them.
    fn entry(&self, at: I) -> Option<&Self::Entry>;
}

/// Entries that can be changed.
pub(crate) trait EntriesMut<I>: Entries<I> {
    /// One of them.
    fn entry_mut(&mut self, at: I) -> Option<&mut Self::Entry>;
}

impl<T, R: Dim, C: Dim, S: RawStorage<T, R, C>> Collection for Matrix<T, R, C, S> {
    type Entry = T;
}

macro_rules! matrix_entries {
    ($($index:ty),*) => {$(
        impl<T: Scalar, R: Dim, C: Dim, S: RawStorage<T, R, C>> Entries<$index> for Matrix<T, R, C, S> {
            #[inline]
            fn entry(&self, at: $index) -> Option<&T> {
                self.get(at)
            }
        }

        impl<T: Scalar, R: Dim, C: Dim, S: RawStorageMut<T, R, C>> EntriesMut<$index>
            for Matrix<T, R, C, S>
        {
            #[inline]
            fn entry_mut(&mut self, at: $index) -> Option<&mut T> {
                self.get_mut(at)
            }
        }
    )*};
}

matrix_entries!(usize, (usize, usize));

impl<T> Collection for [T] {
    type Entry = T;
}

impl<T> Entries<usize> for [T] {
    #[inline]
    fn entry(&self, at: usize) -> Option<&T> {
        self.get(at)
    }
}

impl<T> EntriesMut<usize> for [T] {
    #[inline]
    fn entry_mut(&mut self, at: usize) -> Option<&mut T> {
        self.get_mut(at)
    }
}

/// Entries that are read.
pub(crate) struct Seen<'m, M: Collection + ?Sized> {
    all: &'m M,
    /// The value of a place out of range.
    nothing: M::Entry,
}

/// Entries that are read and written.
pub(crate) struct Cells<'m, M: Collection + ?Sized> {
    all: &'m mut M,
    /// The value of a place out of range.
    nothing: M::Entry,
    /// Receives what is written to a place out of range.
    nowhere: M::Entry,
}

/// The entries of `all`, for reading.
#[inline]
pub(crate) fn seen<M: Collection<Entry: Default> + ?Sized>(all: &M) -> Seen<'_, M> {
    Seen {
        all,
        nothing: M::Entry::default(),
    }
}

/// The entries of `all`, for reading and writing.
#[inline]
pub(crate) fn cells<M: Collection<Entry: Default> + ?Sized>(all: &mut M) -> Cells<'_, M> {
    Cells {
        all,
        nothing: M::Entry::default(),
        nowhere: M::Entry::default(),
    }
}

impl<I, M: Entries<I> + ?Sized> Index<I> for Seen<'_, M> {
    type Output = M::Entry;

    #[inline]
    fn index(&self, at: I) -> &M::Entry {
        let entry = self.all.entry(at);
        debug_assert!(entry.is_some(), "a number out of range");
        entry.unwrap_or(&self.nothing)
    }
}

impl<I, M: Entries<I> + ?Sized> Index<I> for Cells<'_, M> {
    type Output = M::Entry;

    #[inline]
    fn index(&self, at: I) -> &M::Entry {
        let entry = self.all.entry(at);
        debug_assert!(entry.is_some(), "a number out of range");
        entry.unwrap_or(&self.nothing)
    }
}

impl<I, M: EntriesMut<I> + ?Sized> IndexMut<I> for Cells<'_, M> {
    #[inline]
    fn index_mut(&mut self, at: I) -> &mut M::Entry {
        let entry = self.all.entry_mut(at);
        debug_assert!(entry.is_some(), "a number out of range");
        entry.unwrap_or(&mut self.nowhere)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn entries_are_those_of_the_matrix() {
        let mut m = Matrix2::new(1.0, 2.0, 3.0, 4.0);
        let mut c = cells(&mut m);
        c[(1, 0)] += 10.0;
        assert_eq!(c[(1, 0)], 13.0);
        assert_eq!(m, Matrix2::new(1.0, 2.0, 13.0, 4.0));
        assert_eq!(seen(&Vector2::new(5.0, 6.0))[1], 6.0);
        assert_eq!(seen(&[7, 8][..])[0], 7);
    }

    #[test]
    #[cfg(debug_assertions)]
    #[should_panic(expected = "out of range")]
    fn a_mistake_shows_in_tests() {
        let m = Matrix2::<f64>::zeros();
        let _ = seen(&m)[(0, 2)];
    }

    #[test]
    #[cfg(not(debug_assertions))]
    fn a_mistake_on_the_chip_is_no_panic() {
        let mut m = Matrix2::new(1.0, 2.0, 3.0, 4.0);
        assert_eq!(seen(&m)[(0, 2)], 0.0);
        cells(&mut m)[(2, 0)] = 9.0;
        assert_eq!(m, Matrix2::new(1.0, 2.0, 3.0, 4.0));
    }
}
