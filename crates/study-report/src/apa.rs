//! Formats of numbers and names in sentences and tables.

pub(super) use study_base::apa::{
    bare_p, decimals, interval, number, p, p_beside, percent, r, share,
};
use study_base::text::{Untrusted, cut_middle};

/// Names that a list in a sentence shows in full.
const MAX_LISTED: usize = 12;

/// `a, b and c`; of a long list the first ones.
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

/// Without decimals.
pub(super) fn whole(x: f64) -> String {
    number(x, 0)
}

/// With one decimal.
pub(super) fn one(x: f64) -> String {
    number(x, 1)
}

/// With three decimals.
pub(super) fn three(x: f64) -> String {
    number(x, 3)
}

/// With two decimals.
pub(super) fn two(x: f64) -> String {
    number(x, 2)
}

/// A number or, if it is missing, a dash.
pub(super) fn or_dash(x: Option<f64>, format: impl Fn(f64) -> String) -> String {
    x.map_or_else(|| "–".to_owned(), format)
}

/// An interval or, if it is missing, a dash.
pub(super) fn interval_or_dash(
    bounds: Option<(f64, f64)>,
    format: impl Fn(f64) -> String,
) -> String {
    bounds.map_or_else(|| "–".to_owned(), |b| interval(b, format))
}

/// A share of all n! orders as a fraction.
pub(super) fn of_orders(share: f64, n: f64) -> String {
    let all: f64 = (1..=n as u32).map(f64::from).product();
    format!("{}/{all}", (share * all).round())
}

/// A word for a small number, else digits.
pub(super) fn count(n: usize) -> String {
    let words = ["two", "three", "four", "five", "six", "seven"];
    let word = n.checked_sub(2).and_then(|at| words.get(at));
    word.map_or_else(|| n.to_string(), |w| (*w).to_owned())
}

/// A name from the data, escaped and of at most 60 columns.
pub(super) fn name(text: &str) -> String {
    cut_middle(&Untrusted(text).to_string(), 60)
}

/// The number of decimals, three to six, at which different numbers look different;
/// three for long lists.
pub(super) fn distinguishing_decimals(all: &[f64]) -> usize {
    let distinct = |decimals: usize| {
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
    (3..6).find(|d| distinct(*d)).unwrap_or(6)
}

/// A number of any size, with about four significant digits.
pub(super) fn plain(x: f64) -> String {
    if x.fract() == 0.0 && x.abs() < 1e7 {
        number(x, 0)
    } else if x.abs() < 0.1 {
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

/// All digits of a number; an exponent instead of many zeros.
pub(super) fn digits(x: f64) -> String {
    if x == 0.0 || (1e-5..1e16).contains(&x.abs()) {
        x.to_string()
    } else {
        format!("{x:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_listed_with_commas_and_an_and() {
        let names = ["a", "b", "c"].map(str::to_owned);
        let lists = [0, 1, 2, 3].map(|n| listing(&names[..n]));
        assert_eq!(lists, ["", "a", "a and b", "a, b and c"]);
        let many = vec!["m".to_owned(); 20_000];
        assert!(listing(&many).ends_with("m, m and 19988 more"));
    }

    #[test]
    fn numbers_have_as_many_digits_as_they_need() {
        assert_eq!(of_orders(2.0 / 120.0, 5.0), "2/120");
        assert_eq!(distinguishing_decimals(&[0.9, 0.9005, 0.9]), 4);
        assert_eq!(distinguishing_decimals(&[0.9, 0.95]), 3);
        assert_eq!(plain(30.0), "30");
        assert_eq!(plain(0.12345), "0.1235");
        // A small p keeps its significant digits.
        assert_eq!(
            [0.05, 0.00004312, 1.0 / 120.0, -0.0012346, 3.2e-9].map(plain),
            ["0.05000", "0.00004312", "0.008333", "−0.001235", "3.20e−9"]
        );
    }

    #[test]
    fn digits_read_back_as_the_same_number() {
        for (x, shown) in [
            (0.0, "0"),
            (-4.25, "-4.25"),
            (1e15, "1000000000000000"),
            (0.00001, "0.00001"),
            (1.5e308, "1.5e308"),
            (5e-324, "5e-324"),
            (-1.2e-6, "-1.2e-6"),
        ] {
            assert_eq!(digits(x), shown);
            assert_eq!(digits(x).parse(), Ok(x));
        }
    }
}
