//! NIST's certified analyses of variance (StRD, public domain), computed by the whole
//! analysis.
//!
//! A number such as 1000000000000.4 is off by up to 6·10⁻⁵ as a double, 0.06 % of the
//! steps of 0.1 between the ratings. No program that reads doubles can avoid this
//! error: the required numbers of digits are what doubles permit.
#![allow(clippy::unwrap_used)]

use study_analysis::analyze::{Rules, analyze};
use study_session::outcome::ratings::Ratings;

/// Values certified by NIST.
struct Certified {
    /// Mean square between treatments.
    ms_between: f64,
    f: f64,
    residual_sd: f64,
}

/// Analyses treatments as realizations and replicates as repetitions of one subject,
/// and requires this many correct digits.
fn compare(name: &str, treatments: &[Vec<String>], certified: &Certified, digits: f64) {
    let mut csv = String::from("subject,model,repetition,rating,vaf\n");
    for (t, responses) in treatments.iter().enumerate() {
        for (i, y) in responses.iter().enumerate() {
            csv += &format!("S,t{t},{},{y},\n", i + 1);
        }
    }
    let ratings = Ratings::read_csv(name, csv.as_bytes(), None).unwrap();
    let v = analyze(&ratings, &Rules::default()).values;
    for (id, wanted) in [
        ("icc_repetitions/ms_targets", certified.ms_between),
        ("icc_repetitions/F_1", certified.f),
        ("desc_all/within_cell_sd", certified.residual_sd),
    ] {
        let found = v.number(id).unwrap();
        let error = (found - wanted).abs() / wanted;
        let reached = -error.log10();
        assert!(
            reached >= digits,
            "{name} {id}: {found:e}, not {wanted:e}: {reached:.1} digits of {digits}"
        );
    }
}

/// Simon & Lesage's data: nine treatments of `n` replicates at levels of 1.4, 1.3, 1.5,
/// 1.3 …, alternating a tenth below and above their level, plus `offset`.
fn simon_lesage(offset: u64, n: usize) -> Vec<Vec<String>> {
    let tenths = [4, 3, 5, 3, 5, 3, 5, 3, 5];
    let one = |level: i32| {
        let each = (0..n).map(|i| match i {
            0 => level,
            i if i % 2 == 1 => level - 1,
            _ => level + 1,
        });
        each.map(|t| format!("{offset}.{t}")).collect()
    };
    tenths.into_iter().map(one).collect()
}

#[test]
fn simon_and_lesages_sets_agree_with_nist() {
    for (first, offset, digits) in [
        (1, 1, 14.0),
        (4, 1_000_000, 9.9),
        (7, 1_000_000_000_000, 3.9),
    ] {
        for (i, n) in [21usize, 201, 2001].into_iter().enumerate() {
            let certified = Certified {
                ms_between: n as f64 / 100.0,
                f: n as f64,
                residual_sd: 0.1,
            };
            let name = format!("SmLs0{}", first + i);
            compare(&name, &simon_lesage(offset, n), &certified, digits);
        }
    }
}

fn split(columns: &[&str]) -> Vec<Vec<String>> {
    let words = |c: &&str| c.split_whitespace().map(str::to_owned).collect();
    columns.iter().map(words).collect()
}

/// Five instruments.
#[test]
fn silicon_resistivity_agrees_with_nist() {
    let data = split(&[
        "196.3052 196.1240 196.1890 196.2569 196.3403",
        "196.3042 196.3825 196.1669 196.3257 196.0422",
        "196.1303 196.2005 196.2889 196.0343 196.1811",
        "196.2795 196.1748 196.1494 196.1485 195.9885",
        "196.2119 196.1051 196.1850 196.0052 196.2090",
    ]);
    let certified = Certified {
        ms_between: 1.278_656_54e-2,
        f: 1.180_462_374_402_55,
        residual_sd: 1.040_760_683_346_56e-1,
    };
    compare("SiRstv", &data, &certified, 12.9);
}

/// Two instruments, with differences in the eighth digit.
#[test]
fn the_atomic_weight_of_silver_agrees_with_nist() {
    let data = split(&[
        "107.8681568 107.8681465 107.8681572 107.8681785 107.8681446 107.8681903 107.8681526 107.8681494 \
         107.8681616 107.8681587 107.8681519 107.8681486 107.8681419 107.8681569 107.8681508 107.8681672 \
         107.8681385 107.8681518 107.8681662 107.8681424 107.8681360 107.8681333 107.8681610 107.8681477",
        "107.8681079 107.8681344 107.8681513 107.8681197 107.8681604 107.8681385 107.8681642 107.8681365 \
         107.8681151 107.8681082 107.8681517 107.8681448 107.8681198 107.8681482 107.8681334 107.8681609 \
         107.8681101 107.8681512 107.8681469 107.8681360 107.8681254 107.8681261 107.8681450 107.8681368",
    ]);
    let certified = Certified {
        ms_between: 3.638_341_875e-9,
        f: 15.946_733_567_793,
        residual_sd: 1.510_483_144_464_1e-5,
    };
    compare("AtmWtAg", &data, &certified, 10.0);
}
