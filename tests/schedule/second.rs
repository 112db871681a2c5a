//! A second implementation of the orders, written from docs/schedule.md alone. It uses
//! nothing of the program: no stream, no counting, no constraints.

use std::collections::HashMap;

/// The design of a protocol as the document names its parts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Design {
    pub(crate) seed: u64,
    pub(crate) n: usize,
    pub(crate) repetitions: usize,
    pub(crate) order: &'static str,
    pub(crate) max_run: Option<usize>,
    pub(crate) min_distance: Option<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rule {
    None,
    Distance(usize),
    Run(usize),
}

impl Design {
    fn rule(&self) -> Rule {
        match (self.max_run, self.min_distance) {
            _ if self.repetitions == 1 => Rule::None,
            (_, Some(d)) if d >= 2 => Rule::Distance(d),
            (Some(1), _) => Rule::Distance(2),
            (Some(k), _) if k < self.repetitions => Rule::Run(k),
            _ => Rule::None,
        }
    }

    /// The order of a seat as numbers of realizations.
    pub(crate) fn order(&self, kind: &str, number: u32) -> Vec<usize> {
        let (n, repetitions) = (self.n, self.repetitions);
        let mut stream = Stream::new(self.seed, &["schedule", kind, &number.to_string()]);
        let lines = |lines: usize, line: fn(usize, usize) -> Vec<usize>| {
            let mut symbols: Vec<usize> = (0..n).collect();
            Stream::new(self.seed, &["schedule", "symbols"]).shuffle(&mut symbols);
            let first = repetitions * (number as usize - 1);
            let blocks = (0..repetitions).flat_map(|r| line(n, (first + r) % lines));
            blocks.map(|s| symbols[s]).collect()
        };
        match (self.order, self.rule()) {
            ("blocked", rule) => self.blocked(&mut stream, rule),
            ("shuffled", Rule::None) => {
                let mut order: Vec<usize> = (0..n * repetitions).map(|i| i / repetitions).collect();
                stream.shuffle(&mut order);
                order
            }
            ("shuffled", rule) => self.shuffled(&mut stream, rule),
            ("williams", _) => lines(if n % 2 == 0 { n } else { 2 * n }, williams),
            ("latin-square", _) => lines(n, |n, i| (0..n).map(|s| (s + i) % n).collect()),
            ("fixed", _) => (0..n * repetitions).map(|i| i % n).collect(),
            (other, _) => panic!("{other} is no order"),
        }
    }

    fn blocked(&self, stream: &mut Stream, rule: Rule) -> Vec<usize> {
        let d = if let Rule::Distance(d) = rule { d } else { 1 };
        let mut order: Vec<usize> = Vec::new();
        for p in 0..self.n * self.repetitions {
            let block = p - p % self.n;
            let may_come: Vec<usize> = (0..self.n)
                .filter(|m| match order.iter().rposition(|o| o == m) {
                    Some(last) => last < block && last + d <= p,
                    None => true,
                })
                .collect();
            order.push(may_come[stream.below(may_come.len() as u128) as usize]);
        }
        order
    }

    /// The order at a random place of the sorted list of all valid orders. Counts are
    /// remembered by what is left of each realization and when it was last felt.
    fn shuffled(&self, stream: &mut Stream, rule: Rule) -> Vec<usize> {
        let mut counts = HashMap::new();
        let mut order = Vec::new();
        let mut u = stream.below(self.completions(&mut order, rule, &mut counts));
        while order.len() < self.n * self.repetitions {
            for m in 0..self.n {
                if !self.may_come(&order, m, rule) {
                    continue;
                }
                order.push(m);
                let count = self.completions(&mut order, rule, &mut counts);
                if u < count {
                    break;
                }
                u -= count;
                order.pop();
            }
        }
        order
    }

    fn left(&self, order: &[usize], m: usize) -> usize {
        self.repetitions - order.iter().filter(|o| **o == m).count()
    }

    fn may_come(&self, order: &[usize], m: usize, rule: Rule) -> bool {
        let back = order.iter().rev().position(|o| *o == m);
        let run = order.iter().rev().take_while(|o| **o == m).count();
        self.left(order, m) > 0
            && match rule {
                Rule::None => true,
                Rule::Distance(d) => back.is_none_or(|between| between + 1 >= d),
                Rule::Run(k) => run < k,
            }
    }

    fn completions(
        &self,
        order: &mut Vec<usize>,
        rule: Rule,
        counts: &mut HashMap<Vec<(usize, usize)>, u128>,
    ) -> u128 {
        if order.len() == self.n * self.repetitions {
            return 1;
        }
        // Realizations with the same trials left and the same past are alike.
        let mut state: Vec<(usize, usize)> = (0..self.n)
            .map(|m| {
                let back = order.iter().rev().position(|o| *o == m);
                let run = order.iter().rev().take_while(|o| **o == m).count();
                let past = match rule {
                    Rule::None => 0,
                    Rule::Distance(d) => back.map_or(0, |b| (d - 1).saturating_sub(b)),
                    Rule::Run(_) => run,
                };
                let left = self.left(order, m);
                (left, if left == 0 { 0 } else { past })
            })
            .collect();
        state.sort_unstable();
        if let Some(count) = counts.get(&state) {
            return *count;
        }
        let mut sum = 0;
        for m in 0..self.n {
            if self.may_come(order, m, rule) {
                order.push(m);
                sum += self.completions(order, rule, counts);
                order.pop();
            }
        }
        counts.insert(state, sum);
        sum
    }

    /// Whether the sizes of the states are at most 2²⁶, or the design is an exception.
    pub(crate) fn is_accepted(&self) -> bool {
        let (n, trials) = (self.n, self.n * self.repetitions);
        let (held, excepted) = match self.rule() {
            Rule::None => return true,
            Rule::Distance(d) => (d - 1, d == 2),
            Rule::Run(_) => (2, true),
        };
        if self.order != "shuffled" || excepted && trials <= 400 && self.repetitions <= 20 {
            return true;
        }
        // A state: the held numbers, and how many others have 0, 1, … R trials left.
        let mut others = vec![0; self.repetitions + 1];
        others[self.repetitions] = n;
        let mut layer = std::collections::HashSet::from([(vec![0; held], others)]);
        let bits = usize::BITS - n.leading_zeros();
        let mut size = 0;
        for _ in 0..trials {
            let mut next = std::collections::HashSet::new();
            for (held, others) in &layer {
                if let (Rule::Run(_), &[left, again]) = (self.rule(), held.as_slice())
                    && again > 0
                {
                    let again = (again - 1).min(left - 1);
                    next.insert((vec![left - 1, again], others.clone()));
                }
                for left in (1..=self.repetitions).filter(|left| others[*left] > 0) {
                    let mut others = others.clone();
                    others[left] -= 1;
                    let (freed, held) = match self.rule() {
                        Rule::Run(k) => (held[0], vec![left - 1, (k - 1).min(left - 1)]),
                        _ => {
                            let newest = std::iter::once(left - 1);
                            let older = held[..held.len() - 1].iter().copied();
                            (held[held.len() - 1], newest.chain(older).collect())
                        }
                    };
                    // 0 stands for a realization that is used up, or for none.
                    if freed > 0 {
                        others[freed] += 1;
                    }
                    next.insert((held, others));
                }
            }
            for (held, others) in &next {
                let s = held.len() + 2 * others[1..].iter().filter(|times| **times > 0).count();
                size += 128 + 2 * s + trials * bits as usize / 8;
            }
            if size > 1 << 26 {
                return false;
            }
            layer = next;
        }
        true
    }

    /// Where a failed realization is inserted among the next `places` trials to come, and
    /// whether that is flagged. `presented` and `to_come` leave practice out; the first
    /// to come is left out of the order if it goes on.
    pub(crate) fn place(
        &self,
        presented: &[usize],
        to_come: &[usize],
        failed: usize,
        places: usize,
        goes_on: impl Fn(usize) -> bool,
    ) -> (usize, bool) {
        let violations = |place: usize| {
            let mut order = presented.to_vec();
            let mut rest = to_come.to_vec();
            rest.insert(place, failed);
            order.extend(&rest[usize::from(goes_on(place))..]);
            (presented.len()..order.len())
                .filter(|&p| {
                    let last = order[..p].iter().rposition(|m| *m == order[p]);
                    let near = |d| last.is_some_and(|last| p - last < d);
                    let run = |k: usize| p >= k && (p - k..p).all(|i| order[i] == order[p]);
                    self.max_run.is_some_and(run) || self.min_distance.is_some_and(near)
                })
                .count()
        };
        let fewest = (0..=places)
            .map(violations)
            .min()
            .expect("right away is a place");
        let latest = (0..=places).rev().find(|p| violations(*p) == fewest);
        (latest.expect("there is a least"), fewest > 0)
    }
}

fn williams(n: usize, line: usize) -> Vec<usize> {
    let mut symbols = vec![0];
    for i in 1..n {
        symbols.extend([i, n - i]);
    }
    symbols.truncate(n);
    let mut symbols: Vec<usize> = symbols.iter().map(|s| (s + line) % n).collect();
    if line >= n {
        symbols.reverse();
    }
    symbols
}

struct Stream {
    key: [u32; 8],
    counter: u32,
    drawn: Vec<u64>,
}

impl Stream {
    fn new(seed: u64, path: &[&str]) -> Self {
        let mut text = b"study-rng/1\0".to_vec();
        text.extend(seed.to_le_bytes());
        for name in path {
            text.extend((name.len() as u32).to_le_bytes());
            text.extend(name.as_bytes());
        }
        // SHA-256 gives words whose bytes are big-endian; ChaCha20 reads little-endian.
        Self {
            key: sha256(&text).map(u32::swap_bytes),
            counter: 0,
            drawn: Vec::new(),
        }
    }

    fn draw(&mut self) -> u64 {
        if self.drawn.is_empty() {
            let block = chacha20(self.key, self.counter);
            let word = |pair: &[u32]| u64::from(pair[0]) | u64::from(pair[1]) << 32;
            self.drawn = block.chunks(2).map(word).rev().collect();
            self.counter += 1;
        }
        self.drawn.pop().expect("a block has eight draws")
    }

    fn below(&mut self, m: u128) -> u128 {
        let b = u128::BITS - (m - 1).leading_zeros();
        if b == 0 {
            return 0;
        }
        loop {
            let words = (0..b.div_ceil(64)).map(|word| u128::from(self.draw()) << (64 * word));
            let number = words.fold(0, |sum, word| sum | word) & (u128::MAX >> (128 - b));
            if number < m {
                return number;
            }
        }
    }

    fn shuffle(&mut self, items: &mut [usize]) {
        for i in (1..items.len()).rev() {
            let j = self.below(i as u128 + 1) as usize;
            items.swap(i, j);
        }
    }
}

/// RFC 8439, section 2.3, with a nonce of zeros.
fn chacha20(key: [u32; 8], counter: u32) -> [u32; 16] {
    let mut start = [0; 16];
    start[..4].copy_from_slice(&[0x6170_7865, 0x3320_646e, 0x7962_2d32, 0x6b20_6574]);
    start[4..12].copy_from_slice(&key);
    start[12] = counter;
    let mut s = start;
    let mut quarter = |a: usize, b: usize, c: usize, d: usize| {
        for (x, y, z, turn) in [(a, b, d, 16), (c, d, b, 12), (a, b, d, 8), (c, d, b, 7)] {
            s[x] = s[x].wrapping_add(s[y]);
            s[z] = (s[z] ^ s[x]).rotate_left(turn);
        }
    };
    for _ in 0..10 {
        for i in 0..4 {
            quarter(i, i + 4, i + 8, i + 12);
        }
        for i in 0..4 {
            quarter(i, (i + 1) % 4 + 4, (i + 2) % 4 + 8, (i + 3) % 4 + 12);
        }
    }
    std::array::from_fn(|i| s[i].wrapping_add(start[i]))
}

/// FIPS 180-4.
fn sha256(text: &[u8]) -> [u32; 8] {
    // The first 32 bits of the fractional parts of roots of the first primes.
    let primes: Vec<f64> = (2..312u32)
        .filter(|p| (2..*p).all(|q| p % q != 0))
        .map(f64::from)
        .collect();
    let bits = |root: f64| (root.fract() * 2f64.powi(32)) as u32;
    let mut hash: [u32; 8] = std::array::from_fn(|i| bits(primes[i].sqrt()));
    let mut padded = text.to_vec();
    padded.push(0x80);
    while padded.len() % 64 != 56 {
        padded.push(0);
    }
    padded.extend((text.len() as u64 * 8).to_be_bytes());
    for block in padded.chunks(64) {
        let word = |b: &[u8]| u32::from_be_bytes([b[0], b[1], b[2], b[3]]);
        let mut w: Vec<u32> = block.chunks(4).map(word).collect();
        for t in 16..64 {
            let (x, y) = (w[t - 15], w[t - 2]);
            let s0 = x.rotate_right(7) ^ x.rotate_right(18) ^ (x >> 3);
            let s1 = y.rotate_right(17) ^ y.rotate_right(19) ^ (y >> 10);
            let sum = w[t - 16].wrapping_add(s0).wrapping_add(w[t - 7]);
            w.push(sum.wrapping_add(s1));
        }
        let [mut a, mut b, mut c, mut d, mut e, mut f, mut g, mut h] = hash;
        for t in 0..64 {
            let s1 = e.rotate_right(6) ^ e.rotate_right(11) ^ e.rotate_right(25);
            let choice = (e & f) ^ (!e & g);
            let t1 = [s1, choice, bits(primes[t].cbrt()), w[t]]
                .iter()
                .fold(h, |sum, x| sum.wrapping_add(*x));
            let s0 = a.rotate_right(2) ^ a.rotate_right(13) ^ a.rotate_right(22);
            let majority = (a & b) ^ (a & c) ^ (b & c);
            (h, g, f, e) = (g, f, e, d.wrapping_add(t1));
            (d, c, b, a) = (c, b, a, t1.wrapping_add(s0).wrapping_add(majority));
        }
        for (sum, x) in hash.iter_mut().zip([a, b, c, d, e, f, g, h]) {
            *sum = sum.wrapping_add(x);
        }
    }
    hash
}

/// FIPS 180-4, "abc"; RFC 8439, appendix A.1, test vector 1.
#[test]
fn hash_and_cipher_are_the_standard_ones() {
    assert_eq!(sha256(b"abc")[..2], [0xba78_16bf, 0x8f01_cfea]);
    assert_eq!(sha256(b"abc")[7], 0xf200_15ad);
    assert_eq!(chacha20([0; 8], 0)[..2], [0xade0_b876, 0x903d_f1a0]);
}
