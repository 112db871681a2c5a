//! Numbers as journals print them (APA style): a real minus sign, no zero before the
//! decimal point of a number that cannot exceed 1, p between "< .001" and "> .999".

/// A number with some decimals; powers of ten for very large and very small ones.
///
/// ```
/// # use study_base::apa::number;
/// assert_eq!(number(-1.25, 1), "−1.2");
/// assert_eq!(number(-0.001, 2), "0.00");
/// ```
pub fn number(x: f64, decimals: usize) -> String {
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

/// A number between −1 and 1, without a zero before the decimal point.
pub fn share(x: f64, decimals: usize) -> String {
    let shown = number(x, decimals);
    match (shown.strip_prefix("0."), shown.strip_prefix("−0.")) {
        (Some(rest), _) => format!(".{rest}"),
        (_, Some(rest)) => format!("−.{rest}"),
        _ => shown,
    }
}

/// A correlation, with three decimals; what rounding left of 0 is .000.
pub fn r(x: f64) -> String {
    share(if x.abs() < 5e-4 { 0.0 } else { x }, 3)
}

/// A p with its sign: `= .023`, `< .001`, `> .999`. [`p_beside`] the level .05.
///
/// ```
/// # use study_base::apa::p;
/// assert_eq!((p(0.0234), p(0.0004)), ("= .023".into(), "< .001".into()));
/// // The side of .05 shows.
/// assert_eq!(p(0.0496), "= .0496");
/// ```
pub fn p(x: f64) -> String {
    p_beside(x, 0.05)
}

/// A p beside a verdict at a level of significance.
///
/// Three decimals; what is below .001 or above .999 is printed as a bound, so that no p
/// reads as 0 or 1. It has more decimals where three would not show on which side of the
/// level it lies: .0496 at the level .05, not .050. A p that is the level is printed as the
/// level: .05.
pub fn p_beside(x: f64, level: f64) -> String {
    if x < 0.001 && (level >= 0.001 || x == 0.0) {
        return "< .001".to_owned();
    }
    if x > 0.999 {
        return "> .999".to_owned();
    }
    if x == level {
        return format!("= {}", share(x, level.to_string().len() - 2));
    }
    let on_its_side = |decimals: &usize| {
        let shown = format!("{x:.decimals$}").parse::<f64>();
        shown.is_ok_and(|shown| shown > 0.0 && shown != level && (shown < level) == (x < level))
    };
    let decimals = (3..=15).find(on_its_side).unwrap_or(15);
    format!("= {}", share(x, decimals))
}

/// A p for a table, without the equals sign: `.023`, `< .001`, `> .999`.
pub fn bare_p(x: f64) -> String {
    p(x).trim_start_matches("= ").to_owned()
}

/// A share in whole per cent.
pub fn percent(x: f64) -> String {
    format!("{} %", number(100.0 * x, 0))
}

/// `[low, high]`, each formatted by `format`.
pub fn interval((low, high): (f64, f64), format: impl Fn(f64) -> String) -> String {
    format!("[{}, {}]", format(low), format(high))
}

/// The number of decimals, at least `least`, that shows two digits of a standard error.
pub fn decimals(se: f64, least: usize) -> usize {
    let digits = 1.0 - se.abs().log10().floor();
    if digits.is_finite() {
        // Between 0 and 8, so the cast is exact.
        (digits.clamp(0.0, 8.0) as usize).max(least)
    } else {
        least
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_p_reads_as_0_or_1() {
        for (x, shown) in [
            (0.0, "< .001"),
            (1e-300, "< .001"),
            (0.0005, "< .001"),
            (0.000_999, "< .001"),
            (0.001, "= .001"),
            (0.001_49, "= .001"),
            (1.0 / 120.0, "= .008"),
            (0.0417, "= .042"),
            (0.05, "= .05"),
            (0.049_98, "= .04998"),
            (0.994_9, "= .995"),
            (0.995, "= .995"),
            (0.998_9, "= .999"),
            (0.999, "= .999"),
            (0.999_1, "> .999"),
            (0.999_6, "> .999"),
            (0.999_99, "> .999"),
            (1.0, "> .999"),
            (0.0496, "= .0496"),
            (0.049_999_6, "= .0499996"),
            (0.0504, "= .0504"),
        ] {
            assert_eq!(p(x), shown, "{x}");
            assert_eq!(bare_p(x), shown.trim_start_matches("= "), "{x}");
        }
    }

    #[test]
    fn a_p_lies_on_its_side_of_the_level() {
        assert_eq!(p_beside(0.0496, 0.01), "= .050");
        assert_eq!(p_beside(0.0098, 0.01), "= .0098");
        assert_eq!(p_beside(0.0004, 0.0005), "= .0004");
        assert_eq!(p_beside(0.0004, 0.001), "< .001");
        assert_eq!(p_beside(0.025, 0.025), "= .025");
        assert_eq!(p_beside(0.01, 0.01), "= .01");
    }

    #[test]
    fn numbers_read_as_in_print() {
        assert_eq!(r(0.97436), ".974");
        assert_eq!(r(-0.5), "−.500");
        assert_eq!([-0.0001, -1.5e-16].map(r), [".000", ".000"]);
        assert_eq!([1.0, -1.0].map(r), ["1.000", "−1.000"]);
        assert_eq!(number(-0.001, 2), "0.00");
        assert_eq!(number(-0.01, 2), "−0.01");
        assert_eq!(number(-2.3456, 2), "−2.35");
        assert_eq!(number(1.5e300, 2), "1.50e300");
        assert_eq!(number(1e9 + 4.5, 2), "1000000004.50");
        assert_eq!(percent(0.565), "56 %");
        assert_eq!(interval((-0.5, 1.0), r), "[−.500, 1.000]");
        assert_eq!(
            [0.44, 0.015, 1.1e-5, 0.0].map(|se| decimals(se, 2)),
            [2, 3, 6, 2]
        );
    }
}
