//! Which data can give a printed mean and standard deviation.
//!
//! Ratings are whole numbers, so their sum T and the sum of their squares Q are
//! whole too, and few pairs (T, Q) print as a given mean and SD: the GRIM test of
//! the mean (Brown & Heathers 2017), the GRIMMER test of the SD (Anaya 2016;
//! Allard 2018). The arithmetic is exact, in whole numbers: no printed digit is
//! ever turned into a binary fraction.
//!
//! For n whole numbers from `low` to `high` with sum T, Q lies between that of the
//! most even spread and that of the widest, and has T's parity, since x² and x
//! have the same. Not every such Q exists; a search settles each.

/// A printed number: all it says is that the true one rounds to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PrintedNumber {
    /// Its digits as a whole number, 4.800 as 4800.
    pub digits: i128,
    /// Digits after the point.
    pub decimals: u32,
}

/// Most digits of a printed number: squares of them fit a whole number here.
const MAX_DIGITS: usize = 12;

/// Why a text is no printed number.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("not a plain decimal number, such as 4.80")]
pub struct NotADecimal;

impl std::str::FromStr for PrintedNumber {
    type Err = NotADecimal;

    fn from_str(text: &str) -> Result<Self, NotADecimal> {
        let wrong = || NotADecimal;
        let (whole, decimals) = text.split_once('.').unwrap_or((text, ""));
        let unsigned = whole.strip_prefix('-').unwrap_or(whole);
        let plain = |t: &str| t.bytes().all(|b| b.is_ascii_digit());
        let many = decimals.len() > 9 || unsigned.len() + decimals.len() > MAX_DIGITS;
        if unsigned.is_empty() || !plain(unsigned) || !plain(decimals) || many {
            return Err(wrong());
        }
        Ok(Self {
            digits: format!("{whole}{decimals}").parse().map_err(|_| wrong())?,
            // At most 9.
            decimals: decimals.len() as u32,
        })
    }
}

impl PrintedNumber {
    /// The scale: 10 to the decimals.
    fn unit(self) -> i128 {
        10i128.pow(self.decimals)
    }

    /// Whether a/b, b > 0, rounds to it; halves may have gone either way.
    fn rounds_from(self, a: i128, b: i128) -> bool {
        // |a/b − digits/unit| ≤ 1/(2 unit)
        (2 * (a * self.unit() - self.digits * b)).abs() <= b
    }

    /// Whether √(a/b), a ≥ 0, b > 0, rounds to it.
    fn rounds_from_root(self, a: i128, b: i128) -> bool {
        let square = 4 * a * self.unit() * self.unit();
        let (low, high) = (2 * self.digits - 1, 2 * self.digits + 1);
        let above = low <= 0 || square >= low * low * b;
        high >= 0 && above && square <= high * high * b
    }
}

/// What the standard deviation may have been taken over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SdOver {
    /// All ratings.
    Ratings,
    /// The means of the subjects, each of so many ratings.
    SubjectMeans {
        /// Ratings of each.
        each: u32,
    },
}

/// A definition of the standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SdDefinition {
    /// Over what.
    pub over: SdOver,
    /// Whether the divisor is one less than their number.
    pub n_minus_1: bool,
}

/// A pair of sums that prints as asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PossibleSums {
    /// Of the ratings.
    pub sum: i128,
    /// Of the squares: of the ratings, or of the subjects' sums.
    pub squares: i128,
    /// Numerator of the sum of squared deviations, over n.
    pub deviations: i128,
}

/// What a definition can give.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SdCheck {
    /// Which definition.
    pub definition: SdDefinition,
    /// How many numbers it goes over: ratings, or subjects.
    pub n: u32,
    /// Sums that print as asked, up to [`MAX_SHOWN`].
    pub sums: Vec<PossibleSums>,
    /// How many there are; at [`MAX_COUNTED`] the count stops.
    pub count: usize,
    /// Sums that would print as asked, but that no ratings have, up to
    /// [`MAX_SHOWN`].
    pub unattainable: Vec<PossibleSums>,
}

/// Most sums that are kept for showing.
pub const MAX_SHOWN: usize = 5;

/// Most sums that are counted.
pub const MAX_COUNTED: usize = 100;

/// Most ratings that are examined, and the furthest end of a scale.
pub const MAX_N: u32 = 1000;
/// See [`MAX_N`].
pub const MAX_SCALE: i128 = 10_000;

/// What was printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Published {
    /// The mean.
    pub mean: PrintedNumber,
    /// The standard deviation.
    pub sd: PrintedNumber,
    /// Ratings.
    pub n: u32,
    /// Ratings of each subject; not known: every divisor of n is tried.
    pub each: Option<u32>,
    /// Lowest and highest whole rating.
    pub scale: (i128, i128),
}

/// Sums whose mean rounds to what was printed.
pub fn possible_sums(q: &Published) -> Vec<i128> {
    let n = i128::from(q.n);
    let near = q.mean.digits * n / q.mean.unit();
    let slack = n / (2 * q.mean.unit()) + 2;
    (near - slack..=near + slack)
        .filter(|sum| (q.scale.0 * n..=q.scale.1 * n).contains(sum))
        .filter(|sum| q.mean.rounds_from(*sum, n))
        .collect()
}

/// Every definition with what it can give. Subject means come in where the
/// ratings of each divide n and leave two subjects or more. n has to be from 1 to
/// [`MAX_N`], the scale within ±[`MAX_SCALE`].
pub fn check(q: &Published) -> Vec<SdCheck> {
    let sums = possible_sums(q);
    let mut overs = vec![SdOver::Ratings];
    for each in 2..=q.n / 2 {
        if q.n.is_multiple_of(each) && q.each.is_none_or(|known| known == each) {
            overs.push(SdOver::SubjectMeans { each });
        }
    }
    let mut all = Vec::new();
    for over in overs {
        for n_minus_1 in [true, false] {
            all.push(find(q, &sums, SdDefinition { over, n_minus_1 }));
        }
    }
    all
}

/// Over subject means the numbers are the subjects' sums, whole again, on a scale
/// `each` times as wide; the SD is that of the sums over `each`.
fn find(q: &Published, sums: &[i128], definition: SdDefinition) -> SdCheck {
    let each = match definition.over {
        SdOver::Ratings => 1,
        SdOver::SubjectMeans { each } => i128::from(each),
    };
    let n = i128::from(q.n) / each;
    let (low, high) = (q.scale.0 * each, q.scale.1 * each);
    let divisor = if definition.n_minus_1 { n - 1 } else { n };
    let mut found = SdCheck {
        definition,
        // n was a u32 and became no larger.
        n: n as u32,
        sums: Vec::new(),
        count: 0,
        unattainable: Vec::new(),
    };
    if divisor < 1 {
        return found;
    }
    for &sum in sums {
        // variance = (nQ − T²)/(n · divisor · each²)
        let below = n * divisor * each * each;
        let wide = |squares: i128| n * squares - sum * sum;
        // Q at both ends of what rounds to the SD, and a little beyond.
        let unit = 2 * q.sd.unit();
        let at = |digits: i128| {
            let digits = digits.max(0);
            (digits * digits * below / (unit * unit) + sum * sum) / n
        };
        for squares in at(2 * q.sd.digits - 1) - 2..=at(2 * q.sd.digits + 1) + 2 {
            if wide(squares) < 0 || !q.sd.rounds_from_root(wide(squares), below) {
                continue;
            }
            let sums = PossibleSums {
                sum,
                squares,
                deviations: wide(squares),
            };
            if reachable(n, sum, squares, low, high) {
                found.count += 1;
                if found.sums.len() < MAX_SHOWN {
                    found.sums.push(sums);
                }
                if found.count == MAX_COUNTED {
                    return found;
                }
            } else if found.unattainable.len() < MAX_SHOWN {
                found.unattainable.push(sums);
            }
        }
    }
    found
}

/// Smallest and largest sum of squares of n whole numbers from low to high with a
/// sum: as even as can be, and as many at the ends as can be.
fn extremes(n: i128, sum: i128, low: i128, high: i128) -> (i128, i128) {
    let (even, rest) = (sum.div_euclid(n), sum.rem_euclid(n));
    let least = (n - rest) * even * even + rest * (even + 1) * (even + 1);
    if high == low {
        return (least, n * low * low);
    }
    let above = sum - n * low;
    let (at_high, rest) = (above / (high - low), above % (high - low));
    let middle = low + rest;
    let one = i128::from(at_high < n);
    let most =
        at_high * high * high + one * middle * middle + (n - at_high - one).max(0) * low * low;
    (least, most)
}

/// Whether n whole numbers from low to high have this sum and sum of squares: the
/// largest of them is tried downwards, each with what is left for the others.
/// What is left is nearly always within its extremes and of the right parity, so
/// the first try leads through; the depth is n. A search that would take too long
/// excludes nothing.
fn reachable(n: i128, sum: i128, squares: i128, low: i128, high: i128) -> bool {
    let mut budget = 20_000u32;
    search(n, sum, squares, low, high, &mut budget)
}

fn search(n: i128, sum: i128, squares: i128, low: i128, high: i128, budget: &mut u32) -> bool {
    if n == 0 {
        return sum == 0 && squares == 0;
    }
    if sum < n * low || sum > n * high || (squares - sum).rem_euclid(2) != 0 {
        return false;
    }
    let (least, most) = extremes(n, sum, low, high);
    if squares < least || squares > most {
        return false;
    }
    // Both extremes are made of whole numbers.
    if squares == least || squares == most {
        return true;
    }
    let mut top = high;
    while top >= low {
        if *budget == 0 {
            return true;
        }
        *budget -= 1;
        if search(n - 1, sum - top, squares - top * top, low, top, budget) {
            return true;
        }
        top -= 1;
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    fn question(mean: &str, sd: &str, n: u32, each: Option<u32>) -> Published {
        Published {
            mean: mean.parse().unwrap(),
            sd: sd.parse().unwrap(),
            n,
            each,
            scale: (1, 7),
        }
    }

    /// Colton & Hollerbach (2007): mean 4.800, SD 0.997, ten subjects three times.
    #[test]
    fn only_the_sd_over_all_ratings_with_n_less_one_gives_the_papers_numbers() {
        let q = question("4.800", "0.997", 30, Some(3));
        assert_eq!(possible_sums(&q), [144]);
        let found = check(&q);
        let counts: Vec<usize> = found.iter().map(|f| f.count).collect();
        assert_eq!(counts, [1, 0, 0, 0]);
        let s = found[0].sums[0];
        // Q = 720: 720 − 144²/30 = 28.8, here times n.
        assert_eq!((s.sum, s.squares, s.deviations), (144, 720, 864));
        // With n = 30 in the denominator it would have to be 721, which is odd.
        assert_eq!(found[1].unattainable[0].squares, 721);
    }

    #[test]
    fn a_mean_that_no_whole_ratings_have_is_impossible() {
        // 3.45 · 28 = 96.6; 96/28 = 3.43, 97/28 = 3.46.
        let q = question("3.45", "1.00", 28, None);
        assert_eq!(possible_sums(&q), [] as [i128; 0]);
        assert!(check(&q).iter().all(|f| f.count == 0));
    }

    #[test]
    fn an_sd_beyond_the_ends_of_the_scale_is_impossible() {
        // Mean 6.9 of ten on 1…7: the widest is nine 7 and one 6.
        let q = question("6.9", "1.5", 10, None);
        assert_eq!(possible_sums(&q), [69]);
        assert_eq!(check(&q)[0].count, 0);
    }

    /// Every multiset of four ratings on 1…4 against the search.
    #[test]
    fn reachable_sums_are_those_of_some_ratings_and_no_others() {
        let mut real = std::collections::BTreeSet::new();
        for code in 0..256i128 {
            let x: Vec<i128> = (0..4).map(|i| 1 + code / 4i128.pow(i) % 4).collect();
            real.insert((
                x.iter().sum::<i128>(),
                x.iter().map(|v| v * v).sum::<i128>(),
            ));
        }
        for sum in 0..20 {
            for squares in 0..80 {
                let found = reachable(4, sum, squares, 1, 4);
                assert_eq!(found, real.contains(&(sum, squares)), "{sum} {squares}");
            }
        }
    }

    #[test]
    fn halves_may_have_been_rounded_either_way() {
        let printed: PrintedNumber = "0.13".parse().unwrap();
        assert!(printed.rounds_from(1, 8));
        let printed: PrintedNumber = "0.12".parse().unwrap();
        assert!(printed.rounds_from(1, 8));
        assert!("4,8".parse::<PrintedNumber>().is_err() && "nan".parse::<PrintedNumber>().is_err());
        assert!("-".parse::<PrintedNumber>().is_err() && "1e3".parse::<PrintedNumber>().is_err());
    }
}
