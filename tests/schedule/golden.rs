//! Orders that never change: a protocol and a row determine the order.
//!
//! Do not change these tests. A difference means that a running study would
//! continue with other orders than planned. `docs/schedule.py` makes the same
//! orders.

use crate::designs::{constrained, design};
use study_plan::protocol::Order::{Blocked, LatinSquare, Shuffled, Williams};
use study_plan::protocol::{Protocol, Seat};
use study_plan::schedule::plan;

/// The order of a seat as one text, a blank between blocks.
fn order(protocol: &Protocol, seat: Seat) -> String {
    let mut text = String::new();
    let mut block = 1;
    for trial in plan(protocol, None, seat).expect("the design is feasible") {
        if trial.block != block {
            text.push(' ');
            block = trial.block;
        }
        text.push_str(trial.model().expect("one realization").as_str());
    }
    text
}

fn orders(protocol: &Protocol) -> [String; 5] {
    [
        Seat::Row(1),
        Seat::Row(2),
        Seat::Row(1000),
        Seat::Pilot(1),
        Seat::Simulated(1),
    ]
    .map(|seat| order(protocol, seat))
}

#[test]
fn blocked_orders_never_change() {
    assert_eq!(
        orders(&design(5, 3, Blocked)),
        [
            "ABCED DEBCA DEABC",
            "EBACD DACBE CABED",
            "DECAB BEACD ECBAD",
            "EACBD BEDCA CEBDA",
            "BDACE EABCD EBCAD",
        ]
    );
}

#[test]
fn blocked_orders_under_max_run_never_change() {
    assert_eq!(
        orders(&constrained(5, 3, Blocked, Some(1), None)),
        [
            "ABCED CBDEA EDCBA",
            "EBACD BDAEC DCABE",
            "DECAB CEABD ADCBE",
            "EACBD BEDCA DCBEA",
            "BDACE CABDE ABDEC",
        ]
    );
}

#[test]
fn blocked_orders_under_min_distance_never_change() {
    assert_eq!(
        orders(&constrained(6, 2, Blocked, None, Some(4))),
        [
            "ABFCED FBCEDA",
            "EABDCF ADEFBC",
            "DECFBA CFBEDA",
            "EAFCBD EFCDBA",
            "BDACEF ABCDEF",
        ]
    );
}

#[test]
fn shuffled_orders_never_change() {
    assert_eq!(
        orders(&design(5, 3, Shuffled)),
        [
            "CADEDDBCBCABEEA",
            "DDDEEBEAACACCBB",
            "AAEBBECCBCDDAED",
            "EDDDCCBAEABBCAE",
            "BDCEAECBEDACBAD",
        ]
    );
}

#[test]
fn shuffled_orders_under_max_run_1_never_change() {
    assert_eq!(
        orders(&constrained(10, 5, Shuffled, Some(1), None)),
        [
            "EICBAIJCAEJDHIEGCJEGBCFHGDHDFAFCIAGBHJFJAEFDGBDIBH",
            "HEFAJCBFGCDIGEHIGFAJGBDBAICECEFIGIEACHBJAJDHDHBDFJ",
            "ABEACHCEHGBFGCHEFIHJCFGIDBFJIAFJIDBGCDEAEJADBHGIJD",
            "DFAGHFEJEIBJCGJBHCFICDIHGCBAEDBDIJEBGCAFIHAGJFEAHD",
            "BJCHGFBDGIJEJHDACDGFIEIHAGAFCBEACDCEJGBFJDIHEFHIAB",
        ]
    );
}

/// More than the states can count. Computed by inclusion and exclusion in Python 3.11 with
/// binomial convolutions; for smaller designs that script agrees with `docs/schedule.py`.
#[test]
fn large_shuffled_orders_under_max_run_never_change() {
    assert_eq!(
        order(&constrained(30, 10, Shuffled, Some(1), None), Seat::Row(1)),
        "JYTIOTHRPFaSZcMVGbJHaTDCEWEBVXNOKTXcVRTMLHAaIBQMPVZXDVOVaJWJNcQDNWUKIbCLRLE\
             PEBAFXAXWJLHYHADHXFBKCOJFXNdUbKWPBICRQYESHaOdCdYSBCZJQAJUEbMPdSaOZRSUCYIHGR\
             PZLTAbXIcCSDYKTXUGbURNOZDKPTPGcBNTSFRaMDAEZcCGVMcdZISaYINQKdSLRELOMaNUVQYdc\
             QRIScNbQOKYWcWLdFZFBDVdAMGMLAWQEZBPXdaPDKUQFKUJbELTDGVHNGAHUFJGWbBGbIFMWCOY"
    );
    assert_eq!(
        order(&constrained(20, 8, Shuffled, Some(3), None), Seat::Row(1)),
        "QCOOASKEAEQPFTJJIHLQNMPTBRNBQMNSPGRITKAQSPOBMGCGPKITDRGCAOQGLOHIIBRSJAFEHTD\
             FDRDQOHGFHDBJITPMFFQHSKMICJLJKSRCPOPDHSBDANKMSECTTLRJNEMDBCGICNJFLFERBLKONL\
             KAEGALHMEN"
    );
}

#[test]
fn shuffled_orders_under_max_run_2_never_change() {
    assert_eq!(
        orders(&constrained(4, 4, Shuffled, Some(2), None)),
        [
            "CBCDDCAADBCABADB",
            "DACDACDBCBBADBCA",
            "CABDABCDABCCBADD",
            "DBADCCABCBCADABD",
            "CCACDAADBBCDBBAD",
        ]
    );
}

#[test]
fn shuffled_orders_under_min_distance_never_change() {
    assert_eq!(
        orders(&constrained(6, 3, Shuffled, None, Some(3))),
        [
            "EBDACBFDCFAEDFECAB",
            "CFDEADCBFEBCAEBDAF",
            "CEDBEAFDEBDACFBAFC",
            "CEDCFBADCAEFDBFABE",
            "CEADEBFADBFDCEBCAF",
        ]
    );
}

#[test]
fn williams_orders_of_an_even_number_never_change() {
    assert_eq!(
        orders(&design(4, 3, Williams)),
        [
            "BACD ADBC DCAB",
            "CBDA BACD ADBC",
            "ADBC DCAB CBDA",
            "BACD ADBC DCAB",
            "BACD ADBC DCAB",
        ]
    );
}

#[test]
fn williams_orders_of_an_odd_number_never_change() {
    assert_eq!(
        orders(&design(5, 3, Williams)),
        [
            "BACED AEBDC EDACB",
            "DCEBA CBDAE DECAB",
            "BCADE ABECD EADBC",
            "BACED AEBDC EDACB",
            "BACED AEBDC EDACB",
        ]
    );
}

#[test]
fn latin_square_orders_never_change() {
    assert_eq!(
        orders(&design(5, 2, LatinSquare)),
        [
            "BAEDC AEDCB",
            "EDCBA DCBAE",
            "DCBAE CBAED",
            "BAEDC AEDCB",
            "BAEDC AEDCB",
        ]
    );
}

#[test]
fn the_largest_seed_never_changes() {
    let mut protocol = design(5, 1, Blocked);
    protocol.study.seed = u64::MAX;
    assert_eq!(order(&protocol, Seat::Row(u32::MAX)), "ADCEB");
}
