//! Blocked and shuffled orders, Williams designs and Latin squares, as indices of
//! realizations.
//!
//! Williams, E. J. (1949). Experimental designs balanced for the estimation of
//! residual effects of treatments. Australian Journal of Scientific Research A
//! 2, 149–168.

use study_base::rng::Stream;
use study_base::text::PartId;

/// A new random permutation in each block; positions of the same realization differ
/// by at least `distance` (1: no constraint), also across blocks.
///
/// Choosing uniformly at each place among the realizations that may come is exactly
/// uniform over all such orders: at place q (from 0) of a later block,
/// max(0, `distance` − 1 − q) realizations of the block before are still too near, and
/// none of them has been used in this block. The number of choices, n − q minus that,
/// does not depend on earlier choices, so that every order has the same probability.
///
/// `distance` is at most `n`, or there is a single block.
pub(super) fn blocked(stream: &mut Stream, n: usize, blocks: usize, distance: usize) -> Vec<usize> {
    let mut order: Vec<usize> = Vec::with_capacity(n * blocks);
    // What may come, by ascending number.
    let mut free: Vec<usize> = Vec::with_capacity(n);
    for at in 0..n * blocks {
        let block = at - at % n;
        if at == block {
            let mut too_near = vec![false; n];
            for &model in &order[(at + 1).saturating_sub(distance).min(at)..] {
                too_near[model] = true;
            }
            free.clear();
            free.extend((0..n).filter(|&model| !too_near[model]));
        } else if let Some(back) = at.checked_sub(distance)
            && back < block
        {
            let model = order[back];
            free.insert(free.partition_point(|&m| m < model), model);
        }
        order.push(free.remove(below(stream, free.len())));
    }
    order
}

/// All trials in one random order, without a constraint.
pub(super) fn shuffled(stream: &mut Stream, n: usize, repetitions: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..n)
        .flat_map(|model| std::iter::repeat_n(model, repetitions))
        .collect();
    stream.shuffle(&mut order);
    order
}

/// The realization of each symbol of a Williams design or Latin square; the same for
/// all seats of a study.
pub(super) fn symbols(seed: u64, part: Option<&PartId>, n: usize) -> Vec<usize> {
    let mut symbols: Vec<usize> = (0..n).collect();
    let mut stream = match part {
        None => Stream::new(seed, &["schedule", "symbols"]),
        Some(part) => Stream::new(seed, &["schedule", "part", part.as_str(), "symbols"]),
    };
    stream.shuffle(&mut symbols);
    symbols
}

/// Number of lines of a Williams design: n for even n, 2 n for odd n.
pub fn williams_lines(n: usize) -> usize {
    if n.is_multiple_of(2) { n } else { 2 * n }
}

/// A line of the Williams design of `n` symbols; the number of the line is modulo the
/// number of lines.
///
/// Line i < n is 0, 1, n−1, 2, n−2, … with i added to each (mod n); for odd n,
/// line n + i is line i backwards. Over all lines, each symbol follows each
/// other equally often.
///
/// ```
/// # use study_plan::schedule::orders::williams_line;
/// assert_eq!(williams_line(4, 0), [0, 1, 3, 2]);
/// assert_eq!(williams_line(4, 1), [1, 2, 0, 3]);
/// ```
///
/// # Panics
/// If `n` is 0.
pub fn williams_line(n: usize, line: u64) -> Vec<usize> {
    let line = modulo(line, williams_lines(n));
    let shift = line % n;
    let mut symbols: Vec<usize> = (0..n)
        .map(|place| {
            let base = if place % 2 == 1 {
                place.div_ceil(2)
            } else {
                (n - place / 2) % n
            };
            (base + shift) % n
        })
        .collect();
    if line >= n {
        symbols.reverse();
    }
    symbols
}

/// A line of the cyclic Latin square of `n` symbols, modulo n: i, i+1, … (mod n).
///
/// ```
/// # use study_plan::schedule::orders::latin_line;
/// assert_eq!(latin_line(4, 1), [1, 2, 3, 0]);
/// ```
///
/// # Panics
/// If `n` is 0.
pub fn latin_line(n: usize, line: u64) -> Vec<usize> {
    let line = modulo(line, n);
    (0..n).map(|place| (line + place) % n).collect()
}

fn modulo(number: u64, n: usize) -> usize {
    usize::try_from(number % n as u64).expect("a remainder is below n, which is a usize")
}

fn below(stream: &mut Stream, n: usize) -> usize {
    usize::try_from(stream.below(n as u64)).expect("what is drawn is below n, which is a usize")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Williams (1949); for n = 4 and 5 as in every textbook: 0 1 3 2 and
    /// 0 1 4 2 3.
    #[test]
    fn the_first_lines_are_those_of_williams() {
        assert_eq!(williams_line(4, 0), [0, 1, 3, 2]);
        assert_eq!(williams_line(5, 0), [0, 1, 4, 2, 3]);
        assert_eq!(williams_line(5, 6), [4, 3, 0, 2, 1]);
        assert_eq!(williams_line(1, 1), [0]);
    }

    #[test]
    fn line_numbers_are_modulo_the_number_of_lines() {
        assert_eq!(williams_line(4, 4), williams_line(4, 0));
        assert_eq!(williams_line(5, 10), williams_line(5, 0));
        assert_eq!(latin_line(3, 5), [2, 0, 1]);
    }

    #[test]
    fn among_all_williams_lines_each_symbol_follows_each_other_equally_often() {
        for n in 2..=13 {
            let lines = williams_lines(n);
            let mut follows = vec![vec![0; n]; n];
            let mut at = vec![vec![0; n]; n];
            for line in 0..lines {
                let symbols = williams_line(n, line as u64);
                for pair in symbols.windows(2) {
                    follows[pair[0]][pair[1]] += 1;
                }
                for (place, &symbol) in symbols.iter().enumerate() {
                    at[symbol][place] += 1;
                }
            }
            for a in 0..n {
                for b in 0..n {
                    let expected = if a == b { 0 } else { lines / n };
                    assert_eq!(follows[a][b], expected, "{n} symbols, {b} after {a}");
                    assert_eq!(at[a][b], lines / n, "{n} symbols, {a} at {b}");
                }
            }
        }
    }

    #[test]
    fn no_symbol_ends_a_line_and_begins_the_next_with_four_symbols_or_more() {
        for n in 4..=13 {
            for line in 0..2 * n as u64 {
                let ends = *williams_line(n, line).last().unwrap();
                assert_ne!(
                    ends,
                    williams_line(n, line + 1)[0],
                    "{n} symbols, line {line}"
                );
            }
        }
    }
}
