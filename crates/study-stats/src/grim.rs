//! Consistency of a printed mean and standard deviation with whole-number ratings.
//!
//! Ratings are whole numbers, so their sum T and the sum of their squares Q are
//! whole too, and few pairs (T, Q) are rounded to a given mean and SD: the GRIM test of
//! the mean (Brown & Heathers 2017) and the GRIMMER test of the SD (Anaya 2016;
//! Allard 2018). The arithmetic is exact, in whole numbers.
//!
//! For n whole numbers from `low` to `high` with sum T, Q lies between its values for the
//! narrowest and the widest distribution, and has the parity of T, because x² and x
//! have the same parity. Not every such Q exists; a search decides each case.

/// A printed decimal number, to which the true number was rounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PrintedNumber {
    /// Its digits as a whole number: 4800 for 4.800.
    pub digits: i128,
    /// Digits after the point.
    pub decimals: u32,
}

/// Most digits of a printed number, so that squares do not overflow.
const MAX_DIGITS: usize = 12;

/// The text is not a plain decimal number of at most 12 digits, 9 of them decimals.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("not a plain decimal number, such as 4.80")]
pub struct NotADecimal;

impl std::str::FromStr for PrintedNumber {
    type Err = NotADecimal;

    fn from_str(text: &str) -> Result<Self, NotADecimal> {
        let (whole, decimals) = text.split_once('.').unwrap_or((text, ""));
        let unsigned = whole.strip_prefix('-').unwrap_or(whole);
        let plain = |t: &str| t.bytes().all(|b| b.is_ascii_digit());
        let many = decimals.len() > 9 || unsigned.len() + decimals.len() > MAX_DIGITS;
        if unsigned.is_empty() || !plain(unsigned) || !plain(decimals) || many {
            return Err(NotADecimal);
        }
        Ok(Self {
            digits: format!("{whole}{decimals}")
                .parse()
                .map_err(|_| NotADecimal)?,
            // At most 9.
            decimals: decimals.len() as u32,
        })
    }
}

impl PrintedNumber {
    /// 10 to the power of the number of decimals.
    fn unit(self) -> i128 {
        10i128.pow(self.decimals)
    }

    /// Whether a/b, b > 0, is rounded to it; a half may be rounded either way.
    fn rounds_from(self, a: i128, b: i128) -> bool {
        // |a/b − digits/unit| ≤ 1/(2 unit)
        (2 * (a * self.unit() - self.digits * b)).abs() <= b
    }

    /// Whether √(a/b), a ≥ 0, b > 0, is rounded to it.
    fn rounds_from_root(self, a: i128, b: i128) -> bool {
        let square = 4 * a * self.unit() * self.unit();
        let (low, high) = (2 * self.digits - 1, 2 * self.digits + 1);
        let above = low <= 0 || square >= low * low * b;
        high >= 0 && above && square <= high * high * b
    }
}

/// The numbers of which the standard deviation was computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SdOver {
    /// All ratings.
    Ratings,
    /// The means of the subjects.
    SubjectMeans {
        /// Number of ratings of each subject.
        each: u32,
    },
}

/// A definition of the standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SdDefinition {
    /// The numbers of which it was computed.
    pub over: SdOver,
    /// Whether the divisor is n − 1, not n.
    pub n_minus_1: bool,
}

/// A sum and a sum of squares that are rounded to the printed numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PossibleSums {
    /// Sum of the ratings.
    pub sum: i128,
    /// Sum of the squares of the ratings, or of the subjects' sums.
    pub squares: i128,
    /// n times the sum of squared deviations.
    pub deviations: i128,
}

/// Whether a definition of the SD is consistent with the printed numbers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SdCheck {
    /// The definition.
    pub definition: SdDefinition,
    /// Number of ratings, or of subjects.
    pub n: u32,
    /// Sums of possible ratings, at most [`MAX_SHOWN`].
    pub sums: Vec<PossibleSums>,
    /// Number of such sums; counted up to [`MAX_COUNTED`]. 0: not consistent.
    pub count: usize,
    /// Sums that would be rounded to the printed numbers but that no ratings on the
    /// scale have, at most [`MAX_SHOWN`].
    pub unattainable: Vec<PossibleSums>,
}

/// Most sums that are returned.
pub const MAX_SHOWN: usize = 5;

/// Most sums that are counted.
pub const MAX_COUNTED: usize = 100;

/// Most ratings that are supported.
pub const MAX_N: u32 = 1000;
/// Largest absolute value of a rating that is supported.
pub const MAX_SCALE: i128 = 10_000;

/// The published numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Published {
    /// The mean.
    pub mean: PrintedNumber,
    /// The standard deviation.
    pub sd: PrintedNumber,
    /// Number of ratings.
    pub n: u32,
    /// Number of ratings of each subject; if `None`, every divisor of n is tried.
    pub each: Option<u32>,
    /// Lowest and highest rating.
    pub scale: (i128, i128),
}

/// The sums of ratings whose mean is rounded to the printed one.
///
/// ```
/// # use study_stats::grim::{Published, possible_sums};
/// # fn main() -> Result<(), study_stats::grim::NotADecimal> {
/// // No 25 whole numbers have the mean 3.47.
/// let (mean, sd) = ("3.47".parse()?, "1.00".parse()?);
/// let printed = Published { mean, sd, n: 25, each: None, scale: (1, 7) };
/// assert!(possible_sums(&printed).is_empty());
/// assert_eq!(possible_sums(&Published { mean: "3.48".parse()?, ..printed }), [87]);
/// # Ok(())
/// # }
/// ```
pub fn possible_sums(q: &Published) -> Vec<i128> {
    let n = i128::from(q.n);
    let near = q.mean.digits * n / q.mean.unit();
    let slack = n / (2 * q.mean.unit()) + 2;
    (near - slack..=near + slack)
        .filter(|sum| (q.scale.0 * n..=q.scale.1 * n).contains(sum))
        .filter(|sum| q.mean.rounds_from(*sum, n))
        .collect()
}

/// Checks every definition of the SD. Subject means are considered if the number of
/// ratings of each divides n and there are at least two subjects. n has to be from 1 to
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

/// Checks one definition. For subject means the numbers are the subjects' sums, which are
/// whole, on a scale `each` times as wide; the SD is that of the sums divided by `each`.
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
        // At most the n of the ratings, which is a u32.
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
        let denominator = n * divisor * each * each;
        let deviations = |squares: i128| n * squares - sum * sum;
        // Q at both ends of the interval that is rounded to the SD, and a little beyond.
        let unit = 2 * q.sd.unit();
        let at = |digits: i128| {
            let digits = digits.max(0);
            (digits * digits * denominator / (unit * unit) + sum * sum) / n
        };
        for squares in at(2 * q.sd.digits - 1) - 2..=at(2 * q.sd.digits + 1) + 2 {
            if deviations(squares) < 0 || !q.sd.rounds_from_root(deviations(squares), denominator) {
                continue;
            }
            let sums = PossibleSums {
                sum,
                squares,
                deviations: deviations(squares),
            };
            if is_attainable(n, sum, squares, low, high) {
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

/// Smallest and largest sum of squares of n whole numbers from low to high with a given
/// sum: all as equal as possible, or as many as possible at the ends.
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

/// Whether n whole numbers from low to high exist with this sum and sum of squares. The
/// search tries values of the largest number in descending order, and recursively the
/// others. The first value nearly always succeeds, and the depth is n. A search that
/// would take too long counts as success.
fn is_attainable(n: i128, sum: i128, squares: i128, low: i128, high: i128) -> bool {
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
    // Both extremes are attained.
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
    fn only_the_sd_of_all_ratings_with_n_minus_1_gives_the_papers_numbers() {
        let q = question("4.800", "0.997", 30, Some(3));
        assert_eq!(possible_sums(&q), [144]);
        let found = check(&q);
        let counts: Vec<usize> = found.iter().map(|f| f.count).collect();
        assert_eq!(counts, [1, 0, 0, 0]);
        let s = found[0].sums[0];
        // Q = 720: 720 − 144²/30 = 28.8, here times n.
        assert_eq!((s.sum, s.squares, s.deviations), (144, 720, 864));
        // With the divisor n = 30, Q would have to be 721, which is odd.
        assert_eq!(found[1].unattainable[0].squares, 721);
    }

    #[test]
    fn a_mean_that_no_ratings_have_is_inconsistent() {
        // 3.45 · 28 = 96.6; 96/28 = 3.43, 97/28 = 3.46.
        let q = question("3.45", "1.00", 28, None);
        assert_eq!(possible_sums(&q), [] as [i128; 0]);
        assert!(check(&q).iter().all(|f| f.count == 0));
    }

    #[test]
    fn an_sd_too_large_for_the_scale_is_inconsistent() {
        // Ten ratings on 1…7 with mean 6.9 are nine 7 and one 6.
        let q = question("6.9", "1.5", 10, None);
        assert_eq!(possible_sums(&q), [69]);
        assert_eq!(check(&q)[0].count, 0);
    }

    /// The search agrees with the enumeration of four ratings on 1…4.
    #[test]
    fn sums_are_attainable_if_some_ratings_have_them() {
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
                let found = is_attainable(4, sum, squares, 1, 4);
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
