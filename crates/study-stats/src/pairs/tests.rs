use super::*;

fn pair(first: usize, second: usize, counts: [f64; 3]) -> Comparison {
    Comparison {
        first,
        second,
        first_preferred: counts[0],
        second_preferred: counts[1],
        tied: counts[2],
        cluster: 0,
    }
}

const PLAIN: Model = Model {
    link: Link::BradleyTerry,
    order: false,
};

/// Citations between Biometrika, Communications in Statistics, JASA and JRSS-B (Stigler
/// 1994; Agresti 2002, p. 448), fitted with R's glm.
#[test]
fn citations_agree_with_r() {
    let counts = [
        (0, 1, 730.0, 33.0),
        (0, 2, 498.0, 320.0),
        (0, 3, 221.0, 284.0),
        (1, 2, 68.0, 813.0),
        (1, 3, 17.0, 276.0),
        (2, 3, 142.0, 325.0),
    ];
    let data = counts.map(|(a, b, x, y)| pair(a, b, [x, y, 0.0]));
    let fit = abilities(4, &data, PLAIN).unwrap();
    for (b, difference, se) in [
        (1, 2.949_072_5, 0.102_545_34),
        (2, 0.479_569_77, 0.060_588_73),
        (3, -0.268_954_06, 0.070_829_97),
    ] {
        let found = fit.difference(0, b);
        assert!((found.effect.estimate - difference).abs() < 1e-7);
        assert!((found.effect.se - se).abs() < 1e-7);
        assert_eq!(found.clustered, None);
    }
    assert!((fit.deviance - 4.293_384).abs() < 1e-6);
    assert_eq!((fit.df, fit.ranks()), (3, vec![2, 4, 3, 1]));
    assert!(fit.abilities.iter().sum::<f64>().abs() < 1e-12);
    assert!((fit.ses[0] - 0.043_330_47).abs() < 1e-7);
    // Thurstone's units are those of a standard deviation.
    let probit = abilities(
        4,
        &data,
        Model {
            link: Link::Thurstone,
            ..PLAIN
        },
    );
    let ratio = 2.949_072_5 / probit.unwrap().difference(0, 1).effect.estimate;
    assert!(ratio > 1.6 && ratio < 1.8, "{ratio}");
}

/// Two items, both orders, with R: glm(cbind(k, n - k) ~ x + 1, binomial), where x is 1
/// or −1 and the intercept the order effect; deviance 0 on 0 degrees of freedom.
#[test]
fn the_order_effect_is_that_of_the_first_interval() {
    let data = [pair(0, 1, [15.0, 5.0, 0.0]), pair(1, 0, [9.0, 11.0, 0.0])];
    let model = Model {
        order: true,
        ..PLAIN
    };
    let fit = abilities(2, &data, model).unwrap();
    let (a, b) = (3f64.ln(), (9.0f64 / 11.0).ln());
    let order = fit.order.unwrap();
    assert!((order.estimate - (a + b) / 2.0).abs() < 1e-9);
    assert!((fit.difference(0, 1).effect.estimate - (a - b) / 2.0).abs() < 1e-9);
    let variance = (1.0 / 15.0 + 1.0 / 5.0 + 1.0 / 9.0 + 1.0 / 11.0) / 4.0;
    assert!((order.se - f64::sqrt(variance)).abs() < 1e-9);
    assert!(fit.deviance.abs() < 1e-9 && fit.df == 0);
}

/// One pair with ties: ln ν = ln(tied/√(wins · losses)), and a − b = ln(wins/losses).
#[test]
fn ties_have_davidsons_probability() {
    let model = Model {
        link: Link::Davidson,
        order: false,
    };
    let fit = abilities(2, &[pair(0, 1, [12.0, 3.0, 9.0])], model).unwrap();
    assert!((fit.tie.unwrap().estimate - (9.0 / 6.0f64).ln()).abs() < 1e-9);
    assert!((fit.difference(0, 1).effect.estimate - 4f64.ln()).abs() < 1e-9);
    // Without a tie there is no tie parameter; ties alone join two items.
    let no_tie = abilities(2, &[pair(0, 1, [12.0, 3.0, 0.0])], model).unwrap();
    assert_eq!(no_tie.tie, None);
    let data = [pair(0, 1, [3.0, 0.0, 2.0]), pair(1, 2, [1.0, 2.0, 1.0])];
    assert!(abilities(3, &data, model).is_ok());
    assert!(matches!(abilities(3, &data, PLAIN), Err(NoAbilities::Unbounded(top)) if top == [0]));
}

#[test]
fn without_a_maximum_the_items_are_named() {
    let fit = |items, data: &[Comparison]| abilities(items, data, PLAIN).unwrap_err();
    let apart = [pair(0, 1, [3.0, 2.0, 0.0]), pair(2, 3, [1.0, 4.0, 0.0])];
    assert_eq!(
        fit(4, &apart),
        NoAbilities::Disconnected(vec![vec![0, 1], vec![2, 3]])
    );
    // two groups, all preferences between them one way
    let oneway = [
        pair(0, 1, [3.0, 2.0, 0.0]),
        pair(2, 3, [1.0, 4.0, 0.0]),
        pair(1, 2, [0.0, 4.0, 0.0]),
    ];
    assert_eq!(fit(4, &oneway), NoAbilities::Unbounded(vec![2, 3]));
    let same = [pair(0, 0, [1.0, 1.0, 0.0])];
    assert_eq!(fit(2, &same), NoAbilities::NoPairs);
    let order = Model {
        order: true,
        ..PLAIN
    };
    let one_order = [pair(0, 1, [3.0, 2.0, 0.0])];
    assert_eq!(
        abilities(2, &one_order, order).unwrap_err(),
        NoAbilities::OneOrder
    );
    // everybody always prefers the first
    let first = [pair(0, 1, [3.0, 0.0, 0.0]), pair(1, 0, [2.0, 0.0, 0.0])];
    assert_eq!(
        abilities(2, &first, order).unwrap_err(),
        NoAbilities::NotFound
    );
}

/// Participants who agree with themselves: the sandwich is wider than the naive error,
/// and equal to it on average if all answers are independent.
#[test]
fn clusters_widen_the_standard_error() {
    let cluster = |cluster: usize, counts| Comparison {
        cluster,
        ..pair(0, 1, counts)
    };
    let loyal: Vec<Comparison> = (0..12)
        .map(|c| {
            cluster(
                c,
                if c < 8 {
                    [6.0, 0.0, 0.0]
                } else {
                    [0.0, 6.0, 0.0]
                },
            )
        })
        .collect();
    let fit = abilities(2, &loyal, PLAIN).unwrap().difference(0, 1);
    let (naive, clustered) = (fit.effect.se, fit.clustered.unwrap().se);
    assert!((clustered / naive - 6f64.sqrt()).abs() < 1e-9);
}

/// Kendall & Babington Smith (1940): 0 for a ranking, T(T² − 1)/24 at most for odd T.
#[test]
fn circular_triads_are_counted() {
    let ranking: Vec<(usize, usize)> = (0..5)
        .flat_map(|a| (a + 1..5).map(move |b| (a, b)))
        .collect();
    let found = circular_triads(5, &ranking).unwrap();
    assert_eq!((found.circular, found.consistency), (0.0, 1.0));
    let cyclic: Vec<(usize, usize)> = (0..5)
        .flat_map(|a| [(a, (a + 1) % 5), (a, (a + 2) % 5)])
        .collect();
    let found = circular_triads(5, &cyclic).unwrap();
    assert_eq!((found.circular, found.consistency), (5.0, 0.0));
    assert_eq!(circular_triads(5, &ranking[1..]), None);
    assert_eq!(circular_triads(3, &[(0, 1), (1, 0), (1, 2)]), None);
    assert_eq!(circular_triads(3, &[(0, 1), (1, 2), (0, 7)]), None);
}

/// Nothing but ties: the weight of a tie has no maximum, and says why.
#[test]
fn ties_alone_have_no_abilities() {
    let model = Model {
        link: Link::Davidson,
        order: false,
    };
    let tied = [pair(0, 1, [0.0, 0.0, 4.0]), pair(1, 2, [0.0, 0.0, 3.0])];
    assert!(matches!(
        abilities(3, &tied, model),
        Err(NoAbilities::AllTied)
    ));
    let once = [tied[0], tied[1], pair(2, 0, [1.0, 1.0, 2.0])];
    // Nine ties of eleven: ν/(ν + 2) = 9/11.
    let tie = abilities(3, &once, model).unwrap().tie.unwrap();
    assert!((tie.estimate - 9f64.ln()).abs() < 1e-6, "{tie:?}");
}
