use super::*;

/// `rankings`: by participant, each the realizations in their order, `=` between those of one rank.
fn rows(rankings: &[&[&str]]) -> Vec<RankingRow> {
    let mut all = Vec::new();
    for (who, own) in rankings.iter().enumerate() {
        for (n, ranking) in own.iter().enumerate() {
            for (place, tied) in (1..).zip(ranking.split(' ')) {
                for realization in tied.split('=') {
                    all.push(RankingRow {
                        participant: format!("P{who}"),
                        ranking: n.to_string(),
                        realization: realization.to_owned(),
                        rank: f64::from(place),
                    });
                }
            }
        }
    }
    all
}

fn found(rankings: &[&[&str]]) -> Rankings {
    ranking(&rows(rankings), (1, "order"))
}

const SIX: &[&[&str]] = &[
    &["a b c", "a b c"],
    &["a b c", "b a c"],
    &["a c b", "a b c"],
    &["a b=c", "a c b"],
    &["b a c", "a b c"],
    &["a b c", "c a b"],
];

#[test]
fn the_best_one_is_above_each_other_one() {
    let found = found(SIX);
    assert_eq!(
        (found.n.number(), found.n_participants.number()),
        (Some(12.0), Some(6.0))
    );
    assert_eq!(by_worth(&found), ["a", "b", "c"]);
    let a = &found.items["a"];
    // Two rankings begin with b, and one with c.
    assert_eq!(a.first.number(), Some(9.0 / 12.0));
    let worths: f64 = found.items.values().filter_map(|i| i.worth.number()).sum();
    assert!((worths - 1.0).abs() < 1e-12);
    let pair = &found.pairs[&PairName::of("a", "b")];
    assert_eq!(
        (pair.above.number(), pair.tied.number()),
        (Some(10.0 / 12.0), Some(0.0))
    );
    let of_b = &found.pairs[&PairName::of("b", "c")];
    assert_eq!(of_b.tied.number(), Some(1.0 / 12.0));
    assert_eq!(found.ties.len(), 1);
    // The largest of the two p of the best one.
    let p = |pair: &str, other: &str| {
        let own = &found.pairs[&PairName::of(pair, other)].worths;
        own.p_holm.number().unwrap()
    };
    assert_eq!(found.best.p.number(), Some(p("a", "b").max(p("a", "c"))));
    let difference = pair.worths.difference.number();
    assert_eq!(found.best.difference.number(), difference);
    assert_eq!(found.best.ci95.ends(), pair.worths.ci95.ends());
}

/// Six participants put z first and a last, whatever they think of b and c: both ends have a bound and an exact p, and the
/// worths of b and c are those of two realizations.
#[test]
fn what_is_always_first_or_last_has_a_level_of_its_own() {
    let own: &[&[&str]] = &[
        &["z b c a", "z c b a"],
        &["z b c a"],
        &["z b c a"],
        &["z c b a"],
        &["z b c a", "z b c a"],
        &["z b c a"],
    ];
    let all = found(own);
    let level = |name: &str| all.items[name].level.number();
    assert_eq!(
        ["z", "b", "c", "a"].map(level),
        [1.0, 2.0, 2.0, 3.0].map(Some)
    );
    assert_eq!(levels(&all), [vec!["z"], vec!["b", "c"], vec!["a"]]);
    assert_eq!(by_worth(&all), ["z", "b", "c", "a"]);
    let worth = |name: &str| all.items[name].worth.number();
    assert_eq!(["z", "b", "a"].map(worth), [1.0, 0.0, 0.0].map(Some));
    assert_eq!(all.items["z"].log_worth.reason(), Some(ALONE));
    // Six of eight rankings have b above c: ln(6/2) of their difference.
    let pair = |a: &str, b: &str| &all.pairs[&PairName::of(a, b)].worths;
    let of_two = pair("b", "c").difference.number().unwrap();
    assert!((of_two - 3f64.ln()).abs() < 1e-9, "{of_two}");
    let log_worth = all.items["b"].log_worth.number().unwrap();
    assert!((log_worth - of_two / 2.0).abs() < 1e-9);
    // Participants count, not rankings: SciPy's binomtest(6, 6) as in study-stats/tests/reference/ranking_levels.py.
    let bound = 0.163_329_617_667;
    let (up, down) = (pair("b", "z"), pair("a", "c"));
    for end in [&up.ci95.hi, &down.ci95.hi] {
        assert!((end.number().unwrap() + bound).abs() < 1e-9);
    }
    for none in [&up.ci95.lo, &down.difference, &down.se, &down.preferred] {
        assert!(none.reason().unwrap().contains("in every ranking"));
    }
    assert_eq!(up.p.number(), Some(0.031_25));
    // Holm over six pairs, five of which have this p; that of b and c is larger.
    let corrected = up.p_holm.number().unwrap();
    assert!((corrected - 6.0 * 0.031_25).abs() < 1e-12);
    assert!(pair("b", "c").p.number().unwrap() > 0.031_25);
    assert_eq!(all.best.p.number(), Some(corrected));
    assert!((all.best.ci95.lo.number().unwrap() - bound).abs() < 1e-9);
    assert_eq!(
        (all.best.ci95.hi.number(), all.best.difference.number()),
        (None, None)
    );
    // One participant: each ranking counts.
    let one = found(&[&["a b", "a b", "a b"]]);
    assert_eq!(
        one.pairs[&PairName::of("a", "b")].worths.p.number(),
        Some(0.25)
    );
}

/// The pair of the best and the next has its difference the other way round.
#[test]
fn the_names_do_not_matter() {
    let renamed = |text: &str| text.replace('a', "z");
    let all: Vec<Vec<String>> = (SIX.iter())
        .map(|own| own.iter().map(|text| renamed(text)).collect())
        .collect();
    let all: Vec<Vec<&str>> = (all.iter())
        .map(|own| own.iter().map(String::as_str).collect())
        .collect();
    let all: Vec<&[&str]> = all.iter().map(Vec::as_slice).collect();
    let (one, other) = (found(SIX), found(&all));
    assert_eq!(by_worth(&other), ["z", "b", "c"]);
    let ends = |found: &Rankings| {
        let (low, high) = found.best.ci95.ends().unwrap();
        [low, high, found.best.difference.number().unwrap()]
    };
    for (a, b) in ends(&one).into_iter().zip(ends(&other)) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
}

/// Rankings of one participant count once: W is that of the mean ranks.
#[test]
fn agreement_is_that_of_participants() {
    let own = found(SIX).agreement;
    assert_eq!((own.n.number(), own.df.number()), (Some(6.0), Some(2.0)));
    let rows = [
        [1.0, 2.0, 3.0],
        [1.5, 1.5, 3.0],
        [1.0, 2.5, 2.5],
        [1.0, 2.75, 2.25],
        [1.5, 1.5, 3.0],
        [1.5, 2.5, 2.0],
    ];
    let expected = study_stats::friedman::friedman(&rows).unwrap();
    assert_eq!(own.w.number(), expected.kendall_w);
    assert_eq!(own.p.number(), expected.exact_p);
    assert!(own.exact.is_set() && own.smallest_p.number().unwrap() < 1e-3);
}

#[test]
fn what_is_undefined_has_a_reason() {
    let none = ranking(&[], (1, "order"));
    assert_eq!(
        none.agreement.w.reason(),
        Some("there are no rankings of all realizations")
    );
    assert_eq!(none.best.p.reason(), Some(NO_RANKINGS));
    let alone = found(&[&["a b c", "b a c", "c a b"]]);
    assert_eq!(alone.agreement.w.reason(), Some(ONE_PARTICIPANT));
    assert!(alone.participants["P0"].own_w.number().is_some());
    let others = alone.participants["P0"].with_others.reason();
    assert_eq!(others, Some("there are no other participants"));
    let tied = found(&[&["a=b=c"], &["a=b=c"]]);
    assert_eq!(tied.agreement.w.reason(), Some(ALL_TIED));
    assert_eq!(tied.best.p.reason(), Some("every comparison is a tie"));
    // Nothing says which of a and b is the higher one.
    let apart = found(&[&["a c"], &["b c"]]);
    let reason = apart.best.p.reason().unwrap();
    assert!(reason.contains("ever ranked above a,"), "{reason}");
    // One realization is no ranking.
    let one = found(&[&["a"], &["a"]]);
    assert_eq!(one.n.number(), Some(0.0));
}

/// What is described stays, and no test decides.
#[test]
fn what_cannot_be_told_has_no_p() {
    let mut found = found(SIX);
    found.cannot_be_told("one order");
    assert!(found.agreement.w.number().is_some() && found.best.difference.number().is_some());
    let pair = &found.pairs[&PairName::of("a", "b")].worths;
    for p in [&found.agreement.p, &found.best.p, &pair.p, &pair.p_holm] {
        assert_eq!(p.reason(), Some("one order"));
    }
    // A reason that there is already stays.
    let mut none = ranking(&[], (1, "order"));
    none.cannot_be_told("one order");
    assert_eq!(none.best.p.reason(), Some(NO_RANKINGS));
}

/// A declined rank leaves a realization out of one ranking; W does without such rankings.
#[test]
fn a_ranking_can_lack_a_realization() {
    let mut rows = rows(SIX);
    let at = rows.iter().position(|row| row.realization == "c").unwrap();
    rows.remove(at);
    let found = ranking(&rows, (1, "order"));
    assert_eq!(found.n_incomplete.number(), Some(1.0));
    assert_eq!(found.items["c"].n.number(), Some(11.0));
    assert_eq!(found.agreement.n.number(), Some(6.0));
    assert_eq!(found.pairs[&PairName::of("a", "c")].n.number(), Some(11.0));
}
