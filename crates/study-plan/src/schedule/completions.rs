//! Counts the completions of a shuffled order under a constraint, and draws one of
//! all valid orders uniformly.
//!
//! The number of completions of an order depends only on how many trials each
//! realization has left and which realizations may not come yet. This is a *state*:
//!
//! * **held**: realizations that cannot be chosen freely. Under a distance d: the
//!   trials left of the last d − 1 realizations, the newest first. Under a run of k:
//!   the trials left of the last realization, and how often it may still come at
//!   once.
//! * **free**: how many of the other realizations have 1, 2, … trials left.
//!
//! A forward pass lists the states of each position, each once; a backward pass sums
//! their completions. The order is then found at a random place in the list of all
//! valid orders, sorted lexicographically by the protocol's sequence of realizations.

use super::constraints::Rule;
use num_bigint::BigUint;
use std::collections::HashMap;
use std::ops::Range;
use study_base::rng::Stream;

/// Largest sum of the sizes of all states, about their number of bytes;
/// docs/schedule.md defines the size.
const MAX_SIZE: usize = 1 << 26;

/// The number of completions of every reachable state.
#[derive(Debug)]
pub(super) struct Completions {
    n: usize,
    repetitions: usize,
    rule: Rule,
    /// The initial state first, then position by position.
    nodes: Vec<Node>,
    edges: Vec<Edge>,
}

#[derive(Debug)]
struct Node {
    completions: BigUint,
    edges: Range<usize>,
}

/// The choice of a realization.
#[derive(Debug, Clone, Copy)]
struct Edge {
    /// Trials that the chosen one had left; [`Edge::GOES_ON`] if it continues a run.
    class: u16,
    /// How many realizations there are to choose from.
    times: u16,
    /// The node after the choice.
    next: usize,
}

impl Edge {
    const GOES_ON: u16 = 0;
}

/// A state: the held numbers, then pairs (trials left, number of realizations) of the
/// free ones, by ascending trials left, all above 0.
type Key = Vec<u16>;

impl Completions {
    /// Counts for `n` realizations with `repetitions` trials each; `None` if the states
    /// are larger than [`MAX_SIZE`].
    pub(super) fn count(n: usize, repetitions: usize, rule: Rule) -> Option<Self> {
        let trials = n * repetitions;
        // No count is above n^trials.
        let count_bytes = trials * (usize::BITS - n.leading_zeros()) as usize / 8;
        let held = held(rule);
        let mut start = vec![0; held];
        start.extend([small(repetitions), small(n)]);

        let mut size = 0;
        let mut nodes = Vec::new();
        let mut edges = Vec::new();
        let mut layer = vec![start];
        for _ in 0..trials {
            let first = nodes.len() + layer.len();
            let mut found: HashMap<Key, usize> = HashMap::new();
            for key in &layer {
                let begin = edges.len();
                each_successor(key, rule, |class, times, next| {
                    let known = found.len();
                    let next = *found.entry(next).or_insert_with_key(|key| {
                        size += 2 * key.len() + 128 + count_bytes;
                        first + known
                    });
                    edges.push(Edge { class, times, next });
                });
                nodes.push(Node {
                    completions: BigUint::ZERO,
                    edges: begin..edges.len(),
                });
                if size > MAX_SIZE {
                    return None;
                }
            }
            layer = vec![Key::new(); found.len()];
            for (key, at) in found {
                layer[at - first] = key;
            }
        }
        // No trial is left: a single, complete state.
        nodes.extend(layer.iter().map(|_| Node {
            completions: BigUint::from(1u32),
            edges: 0..0,
        }));
        for at in (0..nodes.len()).rev() {
            let sum: BigUint = edges[nodes[at].edges.clone()]
                .iter()
                .map(|edge| &nodes[edge.next].completions * edge.times)
                .sum();
            if !nodes[at].edges.is_empty() {
                nodes[at].completions = sum;
            }
        }
        Some(Self {
            n,
            repetitions,
            rule,
            nodes,
            edges,
        })
    }

    /// The number of valid orders.
    pub(super) fn total(&self) -> &BigUint {
        &self.nodes[0].completions
    }

    /// One of all valid orders, drawn uniformly.
    ///
    /// # Panics
    /// If there is none; `feasible` excludes such designs.
    pub(super) fn draw(&self, stream: &mut Stream) -> Vec<usize> {
        self.at(stream.below_big(self.total()))
    }

    /// The order at a place, from 0, in the sorted list of all valid orders.
    pub(super) fn at(&self, mut place: BigUint) -> Vec<usize> {
        let trials = self.n * self.repetitions;
        let mut order: Vec<usize> = Vec::with_capacity(trials);
        let mut left = vec![small(self.repetitions); self.n];
        let mut last: Vec<Option<usize>> = vec![None; self.n];
        let mut node = &self.nodes[0];
        for at in 0..trials {
            let edges = &self.edges[node.edges.clone()];
            let (model, next) = (0..self.n)
                .find_map(|model| {
                    let class = self.class(model, left[model], at, last[model])?;
                    let next = &self.nodes[edges.iter().find(|e| e.class == class)?.next];
                    if place < next.completions {
                        return Some((model, next));
                    }
                    place -= &next.completions;
                    None
                })
                .expect("the place is below the sum of the completions");
            left[model] -= 1;
            last[model] = Some(at);
            order.push(model);
            node = next;
        }
        order
    }

    /// The class of the edge that chooses a realization; `None` if it may not come.
    fn class(&self, model: usize, left: u16, at: usize, last: Option<usize>) -> Option<u16> {
        debug_assert!(model < self.n);
        let back = last.map(|last| at - last);
        match self.rule {
            _ if left == 0 => None,
            Rule::Distance(d) if back.is_some_and(|back| back < d as usize) => None,
            Rule::Run(_) if back == Some(1) => Some(Edge::GOES_ON),
            Rule::Distance(_) | Rule::Run(_) | Rule::None => Some(left),
        }
    }
}

/// Number of held numbers of a state.
fn held(rule: Rule) -> usize {
    match rule {
        Rule::None => 0,
        Rule::Run(_) => 2,
        Rule::Distance(d) => d as usize - 1,
    }
}

/// Calls `f` with the class, the number of realizations and the next state, for each
/// distinct choice.
fn each_successor(key: &Key, rule: Rule, mut f: impl FnMut(u16, u16, Key)) {
    let (held, free) = key.split_at(held(rule));
    if let (Rule::Run(_), &[left, goes_on]) = (rule, held)
        && goes_on > 0
    {
        let mut next = vec![left - 1, (goes_on - 1).min(left - 1)];
        next.extend(free);
        f(Edge::GOES_ON, 1, next);
    }
    for pair in free.chunks_exact(2) {
        let (class, times) = (pair[0], pair[1]);
        let left = class - 1;
        let mut next: Key = Vec::with_capacity(key.len() + 2);
        let freed = match rule {
            Rule::None => left,
            Rule::Run(k) => {
                // k is below the repetitions, which fit in 16 bits.
                let k = u16::try_from(k).unwrap_or(u16::MAX);
                next.extend([left, (k - 1).min(left)]);
                held[0]
            }
            Rule::Distance(_) => {
                next.push(left);
                next.extend(&held[..held.len() - 1]);
                held[held.len() - 1]
            }
        };
        moved(free, class, freed, &mut next);
        f(class, times, next);
    }
}

/// Appends `free` without one realization of `class` and with one of `freed`
/// (0: none).
fn moved(free: &[u16], class: u16, freed: u16, out: &mut Key) {
    let mut to_add = freed;
    for pair in free.chunks_exact(2) {
        let (c, mut times) = (pair[0], pair[1]);
        if to_add > 0 && to_add < c {
            out.extend([to_add, 1]);
            to_add = 0;
        }
        if c == class {
            times -= 1;
        }
        if c == to_add {
            times += 1;
            to_add = 0;
        }
        if times > 0 {
            out.extend([c, times]);
        }
    }
    if to_add > 0 {
        out.extend([to_add, 1]);
    }
}

fn small(number: usize) -> u16 {
    u16::try_from(number).expect("at most MAX_TRIALS realizations and repetitions")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All valid orders of n × r, sorted, by brute force.
    fn all(n: usize, r: usize, rule: Rule) -> Vec<Vec<usize>> {
        fn go(order: &mut Vec<usize>, left: &mut [usize], rule: Rule, out: &mut Vec<Vec<usize>>) {
            if left.iter().all(|l| *l == 0) {
                out.push(order.clone());
            }
            for model in 0..left.len() {
                let run = order.iter().rev().take_while(|m| **m == model).count();
                let back = order.iter().rev().position(|m| *m == model);
                let good = match rule {
                    Rule::None => true,
                    Rule::Run(k) => run < k as usize,
                    Rule::Distance(d) => back.is_none_or(|b| b + 1 >= d as usize),
                };
                if left[model] > 0 && good {
                    left[model] -= 1;
                    order.push(model);
                    go(order, left, rule, out);
                    order.pop();
                    left[model] += 1;
                }
            }
        }
        let mut out = Vec::new();
        go(&mut Vec::new(), &mut vec![r; n], rule, &mut out);
        out
    }

    #[test]
    fn every_valid_order_is_at_exactly_one_place() {
        for (n, r, rule) in [
            (3, 2, Rule::None),
            (2, 2, Rule::Distance(2)),
            (3, 3, Rule::Distance(2)),
            (3, 3, Rule::Distance(3)),
            (4, 2, Rule::Distance(2)),
            (4, 2, Rule::Distance(3)),
            (4, 2, Rule::Distance(4)),
            (4, 3, Rule::Distance(3)),
            (2, 4, Rule::Run(2)),
            (3, 3, Rule::Run(2)),
            (2, 5, Rule::Run(3)),
            (3, 4, Rule::Run(3)),
        ] {
            let slow = all(n, r, rule);
            let counted = Completions::count(n, r, rule).unwrap();
            assert_eq!(
                *counted.total(),
                BigUint::from(slow.len()),
                "{n} {r} {rule}"
            );
            for (place, order) in slow.iter().enumerate() {
                assert_eq!(counted.at(BigUint::from(place)), *order, "{n} {r} {rule}");
            }
        }
    }

    /// Without a constraint the count is the multinomial coefficient:
    /// 12! / (3!)⁴ = 369,600.
    #[test]
    fn without_a_constraint_the_count_is_multinomial() {
        let counted = Completions::count(4, 3, Rule::None).unwrap();
        assert_eq!(*counted.total(), BigUint::from(369_600u32));
    }

    /// Words of 2n letters, each twice, no two alike adjacent: OEIS A114938.
    #[test]
    fn counts_are_those_of_the_encyclopedia() {
        for (n, expected) in [
            (1, 0u64),
            (2, 2),
            (3, 30),
            (4, 864),
            (5, 39480),
            (6, 2631600),
        ] {
            let counted = Completions::count(n, 2, Rule::Distance(2)).unwrap();
            assert_eq!(*counted.total(), BigUint::from(expected), "{n}");
        }
    }

    #[test]
    fn designs_with_too_many_states_are_refused() {
        assert!(Completions::count(40, 20, Rule::Distance(4)).is_none());
    }
}
