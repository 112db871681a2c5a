//! Counts the completions of a shuffled order under `max_run` by inclusion and
//! exclusion, for designs that have too many states for `completions`.
//!
//! A realization with m trials left is split into s ≥ 1 runs that count as one symbol
//! each, with a sign; all symbols are then arranged without any rule. Its polynomial is
//! Σ a(m, s) xˢ / s!, where a(m, s) is the coefficient of zᵐ in
//! (B / (1 + B))ˢ with B = z + z² + … + zᵏ. The number of orders is the product of the
//! polynomials of all realizations, with t! in place of xᵗ (Goulden & Jackson 1983,
//! Combinatorial Enumeration, 2.4). If the order may not begin with the realization,
//! (B / (1 + B))ˢ / (1 + B) takes the place of (B / (1 + B))ˢ.
//!
//! Polynomials are stored times m!, which makes them integer with a highest
//! coefficient of 1: a product can be divided by a factor exactly.

use super::constraints::Rule;
use num_bigint::{BigInt, BigUint};
use std::collections::HashMap;
use study_base::rng::Stream;

/// Most trials, and most trials of a realization, of a design that is counted.
const MAX_TRIALS: usize = 400;
const MAX_REPETITIONS: usize = 20;

/// Coefficients, those of lower powers first.
type Polynomial = Vec<BigInt>;

/// The polynomials of a design.
#[derive(Debug)]
pub(super) struct Inclusion {
    n: usize,
    repetitions: usize,
    longest: usize,
    /// `[m]`: m! times the polynomial of a realization with m trials left.
    any: Vec<Polynomial>,
    /// The same if the order may not begin with it.
    not_first: Vec<Polynomial>,
    total: BigUint,
}

/// Completions after a choice.
struct Choice {
    completions: BigUint,
    /// Product of the polynomials of the realizations that were not chosen.
    others: Polynomial,
}

impl Inclusion {
    /// Counts for `n` realizations with `repetitions` trials each; `None` if the rule is
    /// not one of runs or the design is too large.
    pub(super) fn count(n: usize, repetitions: usize, rule: Rule) -> Option<Self> {
        let longest = match rule {
            Rule::Run(k) => k as usize,
            Rule::Distance(2) => 1,
            Rule::Distance(_) | Rule::None => return None,
        };
        if n * repetitions > MAX_TRIALS || repetitions > MAX_REPETITIONS {
            return None;
        }
        let runs: Vec<BigInt> = (0..=repetitions)
            .map(|length| BigInt::from(u8::from((1..=longest).contains(&length))))
            .collect();
        let cut = |mut series: Polynomial| {
            series.truncate(repetitions + 1);
            series
        };
        // 1 / (1 + B), from (1 + B) · inverse = 1
        let mut inverse = vec![BigInt::from(1)];
        for i in 1..=repetitions {
            let sum: BigInt = (1..=i).map(|j| &runs[j] * &inverse[i - j]).sum();
            inverse.push(-sum);
        }
        let ratio = cut(product(&runs, &inverse));
        let mut any = vec![Polynomial::new(); repetitions + 1];
        let mut not_first = any.clone();
        let mut power = vec![BigInt::ZERO; repetitions + 1];
        power[0] = BigInt::from(1);
        for s in 0..=repetitions {
            let begun = cut(product(&power, &inverse));
            for m in s..=repetitions {
                // m! / s!
                let scale: BigInt = (s + 1..=m).map(BigInt::from).product();
                any[m].push(&power[m] * &scale);
                not_first[m].push(&begun[m] * scale);
            }
            power = cut(product(&power, &ratio));
        }
        let mut all = Self {
            n,
            repetitions,
            longest,
            any,
            not_first,
            total: BigUint::ZERO,
        };
        all.total = whole(arranged(&all.everything()), &all.scale());
        Some(all)
    }

    /// One of all valid orders, drawn uniformly.
    pub(super) fn draw(&self, stream: &mut Stream) -> Vec<usize> {
        self.at(stream.below_big(&self.total))
    }

    /// The order at a place, from 0, in the sorted list of all valid orders.
    fn at(&self, mut place: BigUint) -> Vec<usize> {
        let mut order = Vec::with_capacity(self.n * self.repetitions);
        let mut left = vec![self.repetitions; self.n];
        let mut last = None;
        let mut run = 0;
        let mut product_of_all = self.everything();
        let mut scale = self.scale();
        for _ in 0..self.n * self.repetitions {
            let mut counted: HashMap<(usize, usize), Choice> = HashMap::new();
            let length_of = |model| if last == Some(model) { run + 1 } else { 1 };
            let chosen = (0..self.n)
                .find(|&model| {
                    let choice = (left[model], length_of(model));
                    if choice.0 == 0 || choice.1 > self.longest {
                        return false;
                    }
                    let counted = counted
                        .entry(choice)
                        .or_insert_with(|| self.choose(choice, &product_of_all, &scale));
                    if place < counted.completions {
                        return true;
                    }
                    place -= &counted.completions;
                    false
                })
                .expect("the place is below the sum of the completions");
            let choice = (left[chosen], length_of(chosen));
            let others = &counted[&choice].others;
            product_of_all = product(others, &self.any[choice.0 - 1]);
            scale /= choice.0;
            left[chosen] -= 1;
            (last, run) = (Some(chosen), choice.1);
            order.push(chosen);
        }
        order
    }

    /// The completions after the choice of a realization with so many trials left, as
    /// the given one of a run.
    fn choose(&self, choice: (usize, usize), all: &[BigInt], scale: &BigUint) -> Choice {
        let (left, length) = choice;
        let others = quotient(all, &self.any[left]);
        let left = left - 1;
        // The run goes on for i more trials, and what follows does not begin with it.
        let mut rest = vec![BigInt::ZERO; left + 1];
        for i in 0..=left.min(self.longest - length) {
            // not_first[m] has the factor m!, the sum left!
            let factor: BigInt = (left - i + 1..=left).map(BigInt::from).product();
            for (sum, term) in rest.iter_mut().zip(&self.not_first[left - i]) {
                *sum += term * &factor;
            }
        }
        Choice {
            completions: whole(arranged(&product(&others, &rest)), &(scale / (left + 1))),
            others,
        }
    }

    /// The product of the polynomials of all realizations.
    fn everything(&self) -> Polynomial {
        let one = vec![BigInt::from(1)];
        (0..self.n).fold(one, |all, _| product(&all, &self.any[self.repetitions]))
    }

    /// The factor of that product.
    fn scale(&self) -> BigUint {
        let factorial: BigUint = (1..=self.repetitions).map(BigUint::from).product();
        factorial.pow(u32::try_from(self.n).unwrap_or(u32::MAX))
    }
}

/// The sum of the coefficients of xᵗ times t!.
fn arranged(polynomial: &[BigInt]) -> BigInt {
    let mut sum = BigInt::ZERO;
    for (power, coefficient) in polynomial.iter().enumerate().rev() {
        sum = sum * (power + 1) + coefficient;
    }
    sum
}

/// A count without the factor of its polynomials.
fn whole(count: BigInt, factor: &BigUint) -> BigUint {
    count.into_parts().1 / factor
}

fn product(a: &[BigInt], b: &[BigInt]) -> Polynomial {
    let mut out = vec![BigInt::ZERO; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            out[i + j] += x * y;
        }
    }
    out
}

/// `a / b` where `b` divides `a` and its highest coefficient is 1.
fn quotient(a: &[BigInt], b: &[BigInt]) -> Polynomial {
    let degree = b.len() - 1;
    let mut rest = a.to_vec();
    for top in (degree..a.len()).rev() {
        let (lower, upper) = rest.split_at_mut(top);
        for (j, y) in b[..degree].iter().enumerate() {
            lower[top - degree + j] -= &upper[0] * y;
        }
    }
    rest.split_off(degree)
}

#[cfg(test)]
mod tests {
    use super::super::completions::Completions;
    use super::*;

    /// Both count the same and have the same order at each place.
    #[test]
    fn inclusion_and_exclusion_agrees_with_the_states() {
        for (n, r, rule) in [
            (1, 1, Rule::Run(2)),
            (2, 3, Rule::Distance(2)),
            (3, 3, Rule::Distance(2)),
            (5, 2, Rule::Distance(2)),
            (2, 4, Rule::Run(2)),
            (3, 3, Rule::Run(2)),
            (2, 6, Rule::Run(4)),
            (3, 4, Rule::Run(3)),
        ] {
            let states = Completions::count(n, r, rule).unwrap();
            let terms = Inclusion::count(n, r, rule).unwrap();
            assert_eq!(terms.total, *states.total(), "{n} {r} {rule}");
            let places = u32::try_from(terms.total.clone()).unwrap();
            for place in (0..places).step_by(1 + places as usize / 200) {
                assert_eq!(
                    terms.at(place.into()),
                    states.at(place.into()),
                    "{n} {r} {rule}"
                );
            }
        }
    }

    #[test]
    fn designs_that_are_too_large_or_have_another_rule_are_not_counted() {
        assert!(Inclusion::count(40, 10, Rule::Run(2)).is_some());
        assert!(Inclusion::count(41, 10, Rule::Run(2)).is_none());
        assert!(Inclusion::count(2, 21, Rule::Run(2)).is_none());
        assert!(Inclusion::count(3, 3, Rule::Distance(3)).is_none());
        assert!(Inclusion::count(3, 3, Rule::None).is_none());
    }
}
