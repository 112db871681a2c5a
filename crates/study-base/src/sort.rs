//! Sorting that is compiled once.
//!
//! A sort of the standard library is compiled anew for each type and each closure, 4 to 5 kB every time. Most of what
//! this program sorts are short lists of a report or of a folder: here only their places are sorted, by one
//! function for all of them. What has thousands of numbers is better sorted by the standard library.

use std::cmp::Ordering;

/// Stable sorting of lists, as by the methods of slices without `small_`: the same order, less code.
pub trait SmallSort<T> {
    /// Sorts by what `compare` says of two items.
    fn small_sort_by(&mut self, compare: impl FnMut(&T, &T) -> Ordering);

    /// Sorts by a key, which is made anew for each comparison.
    fn small_sort_by_key<K: Ord>(&mut self, mut key: impl FnMut(&T) -> K) {
        self.small_sort_by(|a, b| key(a).cmp(&key(b)));
    }

    /// Sorts in ascending order.
    fn small_sort(&mut self)
    where
        T: Ord,
    {
        self.small_sort_by(T::cmp);
    }
}

impl<T> SmallSort<T> for [T] {
    fn small_sort_by(&mut self, mut compare: impl FnMut(&T, &T) -> Ordering) {
        let mut sources = sorted_places(self.len(), &mut |a, b| compare(&self[a], &self[b]));
        // Each cycle of the permutation is walked once; a place that is done is its own source.
        for start in 0..sources.len() {
            let mut place = start;
            loop {
                let source = std::mem::replace(&mut sources[place], place);
                if source == start {
                    break;
                }
                self.swap(place, source);
                place = source;
            }
        }
    }
}

/// For each place of the sorted list, where its item is now.
fn sorted_places(len: usize, compare: &mut dyn FnMut(usize, usize) -> Ordering) -> Vec<usize> {
    let mut places: Vec<usize> = (0..len).collect();
    places.sort_by(|a, b| compare(*a, *b));
    places
}

#[cfg(test)]
mod tests {
    use super::SmallSort;
    use std::cmp::Reverse;

    /// All lists of up to six items of three kinds: as the standard library sorts them, equal items in their order.
    #[test]
    fn sorts_as_the_standard_library() {
        for len in 0..=6u32 {
            for code in 0..3usize.pow(len) {
                let items: Vec<(usize, u32)> =
                    (0..len).map(|i| (code / 3usize.pow(i) % 3, i)).collect();
                let (mut theirs, mut ours) = (items.clone(), items.clone());
                theirs.sort_by_key(|item| item.0);
                ours.small_sort_by(|a, b| a.0.cmp(&b.0));
                assert_eq!(ours, theirs);
                let (mut theirs, mut ours) = (items.clone(), items.clone());
                theirs.sort_by_key(|item| Reverse(item.0));
                ours.small_sort_by_key(|item| Reverse(item.0));
                assert_eq!(ours, theirs);
                let (mut theirs, mut ours) = (items.clone(), items);
                theirs.sort();
                ours.small_sort();
                assert_eq!(ours, theirs);
            }
        }
    }
}
