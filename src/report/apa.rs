//! Numbers as journals of the field print them: a real minus, no zero before
//! the point where a number cannot exceed 1, p down to "< .001".

/// So many decimals, with a minus that is one; very large and very small ones
/// as powers of ten.
pub(super) fn number(x: f64, decimals: usize) -> String {
    let size = x.abs();
    let shown = if size >= 1e12 || (size > 0.0 && size < 1e-5) {
        format!("{x:.2e}")
    } else {
        format!("{x:.decimals$}")
    };
    let zero = !shown.chars().any(|c| ('1'..='9').contains(&c));
    match shown.strip_prefix('-') {
        Some(rest) if zero => rest.to_owned(),
        _ => shown.replace('-', "−"),
    }
}

/// What lies between −1 and 1: no zero before the point.
pub(super) fn share(x: f64, decimals: usize) -> String {
    let shown = number(x, decimals);
    match (shown.strip_prefix("0."), shown.strip_prefix("−0.")) {
        (Some(rest), _) => format!(".{rest}"),
        (_, Some(rest)) => format!("−.{rest}"),
        _ => shown,
    }
}

/// `a, b and c`; of very many the first ones.
pub(super) fn listing(names: &[String]) -> String {
    if names.len() > MAX_LISTED {
        let more = names.len() - MAX_LISTED;
        return format!("{} and {more} more", names[..MAX_LISTED].join(", "));
    }
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

/// Names that a sentence can hold.
const MAX_LISTED: usize = 12;

/// A correlation.
pub(super) fn r(x: f64) -> String {
    share(x, 3)
}

/// `p = .023` without its letter.
pub(super) fn equals_p(x: f64) -> String {
    if x < 0.0005 {
        "< .001".to_owned()
    } else {
        format!("= {}", p(x))
    }
}

/// A probability alone.
pub(super) fn p(x: f64) -> String {
    if x < 0.0005 {
        "< .001".to_owned()
    } else if x >= 0.9995 {
        "1".to_owned()
    } else {
        share(x, 3)
    }
}

/// A p with its sign as text: `p = .023`, `exact p < .001`.
pub(super) fn named_p(kind: &str, p: f64) -> String {
    format!("{kind} {}", equals_p(p))
}

/// A share of all n! orders as what it is.
pub(super) fn of_orders(share: f64, n: f64) -> String {
    let all: f64 = (1..=n as u32).map(f64::from).product();
    format!("{}/{all}", (share * all).round())
}

/// A word for a small number, else its digits.
pub(super) fn count(n: usize) -> String {
    let words = ["two", "three", "four", "five", "six", "seven"];
    let word = n.checked_sub(2).and_then(|at| words.get(at));
    word.map_or_else(|| n.to_string(), |w| (*w).to_owned())
}

/// With a capital letter at its beginning.
pub(super) fn capital(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next();
    first.map_or_else(String::new, |c| {
        c.to_uppercase().to_string() + letters.as_str()
    })
}

/// A name of at most 60 characters, shortened in the middle.
pub(super) fn name(text: &str) -> String {
    super::svg::shortened(&study_base::text::Untrusted(text).to_string(), 60)
}

/// Decimals at which a standard error has two digits, at least so many.
pub(super) fn decimals(se: f64, least: usize) -> usize {
    let digits = 1.0 - se.abs().log10().floor();
    if digits.is_finite() {
        // Between 0 and 8, so the cast is exact.
        (digits.clamp(0.0, 8.0) as usize).max(least)
    } else {
        least
    }
}

/// `[low, high]`.
pub(super) fn interval(low: f64, high: f64, one: impl Fn(f64) -> String) -> String {
    format!("[{}, {}]", one(low), one(high))
}

/// A share in per cent, whole.
pub(super) fn percent(x: f64) -> String {
    format!("{} %", number(100.0 * x, 0))
}

/// Decimals, three to six, at which numbers that differ look different; three for
/// more numbers than anybody compares.
pub(super) fn telling(all: &[f64]) -> usize {
    let apart = |decimals: usize| {
        all.iter().enumerate().all(|(i, x)| {
            let shown = number(*x, decimals);
            all[..i]
                .iter()
                .all(|y| x == y || number(*y, decimals) != shown)
        })
    };
    if all.len() > 200 {
        return 3;
    }
    (3..6).find(|d| apart(*d)).unwrap_or(6)
}

/// As many digits as a reader of a table wants.
pub(super) fn plain(x: f64) -> String {
    if x.fract() == 0.0 && x.abs() < 1e7 {
        number(x, 0)
    } else if x.abs() < 0.1 {
        // Four digits that tell something, however small it is.
        number(x, decimals(x, 2) + 2)
    } else {
        let decimals = match x.abs() {
            a if a >= 1000.0 => 1,
            a if a >= 1.0 => 3,
            _ => 4,
        };
        number(x, decimals)
    }
}

/// `one` or so many `many`.
pub(super) fn counted(n: usize, one: &str, many: &str) -> String {
    if n == 1 {
        format!("1 {one}")
    } else {
        format!("{n} {many}")
    }
}

/// What is said of the memory by the correlation and the two p. Line and curve are two tests of one question: each is judged at half of .05.
pub(super) fn memory_verdict(r: f64, line: Option<f64>, curve: Option<f64>) -> &'static str {
    let shown = |p: Option<f64>| p.is_some_and(|p| p < if curve.is_some() { 0.025 } else { 0.05 });
    match (shown(line), shown(curve)) {
        (false, false) if line.is_none() && r.abs() > 1.0 - 1e-9 => {
            "The mean ratings lie on one line over the memory, so that no t test is defined"
        }
        (false, false) if line.is_none() => "No t test is defined",
        (true, _) if r > 0.0 => {
            "Over these realizations, those with a longer memory are rated higher"
        }
        (true, _) => "Over these realizations, those with a shorter memory are rated higher",
        (false, true) => "Over these realizations the rating follows the memory along a curve",
        (false, false) => "These realizations do not show that it does",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_listed_as_one_says_them() {
        let names = ["a", "b", "c"].map(str::to_owned);
        let said = [0, 1, 2, 3].map(|n| listing(&names[..n]));
        assert_eq!(said, ["", "a", "a and b", "a, b and c"]);
        let many = vec!["m".to_owned(); 20_000];
        assert!(listing(&many).ends_with("m, m and 19988 more"));
    }

    #[test]
    fn a_correlation_without_a_test_is_not_called_unshown() {
        let unshown = "These realizations do not show that it does";
        assert_eq!(memory_verdict(0.5, Some(0.2), None), unshown);
        assert!(memory_verdict(-1.0, None, None).contains("lie on one line"));
        assert!(memory_verdict(0.5, None, None).contains("No t test"));
    }

    #[test]
    fn numbers_read_as_in_print() {
        assert_eq!(r(0.97436), ".974");
        assert_eq!(r(-0.5), "−.500");
        assert_eq!(r(-0.0001), ".000");
        assert_eq!(r(1.0), "1.000");
        assert_eq!(equals_p(1.0 / 120.0), "= .008");
        assert_eq!(equals_p(0.0004), "< .001");
        assert_eq!(equals_p(1.0), "= 1");
        assert_eq!(number(-0.001, 2), "0.00");
        assert_eq!(number(-2.3456, 2), "−2.35");
        assert_eq!(number(1.5e300, 2), "1.50e300");
        assert_eq!(percent(0.565), "56 %");
        assert_eq!(number(1e9 + 4.5, 2), "1000000004.50");
        assert_eq!(
            [0.44, 0.015, 1.1e-5, 0.0].map(|se| decimals(se, 2)),
            [2, 3, 6, 2]
        );
        assert_eq!(telling(&[0.9, 0.9005, 0.9]), 4);
        assert_eq!(telling(&[0.9, 0.95]), 3);
        assert_eq!(plain(30.0), "30");
        assert_eq!(plain(0.12345), "0.1235");
        // A small p keeps digits that tell something.
        assert_eq!(
            [0.05, 0.00004312, 1.0 / 120.0, -0.0012346, 3.2e-9].map(plain),
            ["0.05000", "0.00004312", "0.008333", "−0.001235", "3.20e−9"]
        );
    }
}
