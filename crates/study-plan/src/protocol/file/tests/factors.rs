//! `[[factors]]`, the levels of realizations and the formula of `[analysis]`.

use super::super::parse;
use crate::protocol::Protocol;

const HEAD: &str = r#"
format = "study-protocol/3"
study = { id = "x", title = "X", seed = 1 }
device = { kind = "manual", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
design = { participants = 4, repetitions = 1, order = "blocked" }
questions = [{ id = "rough", kind = "rating", prompt = "How rough?", from = 1, to = 7 }]
"#;
const FACTORS: &str = r#"
analysis = { primary = "rough" }
factors = [{ id = "friction", levels = ["low", "high"] }, { id = "detent", levels = ["soft", "crisp"] }]
"#;

fn model(id: &str, rest: &str) -> String {
    format!("[[models]]\nid = \"{id}\"\n{rest}\n")
}

fn levels(friction: &str, detent: &str) -> String {
    format!("levels = {{ friction = \"{friction}\", detent = \"{detent}\" }}")
}

fn crossed() -> String {
    [
        ("low", "soft"),
        ("low", "crisp"),
        ("high", "soft"),
        ("high", "crisp"),
    ]
    .iter()
    .map(|(f, d)| model(&format!("{f}-{d}"), &levels(f, d)))
    .collect()
}

fn protocol(text: &str) -> Protocol {
    let parsed = parse("p.toml", text);
    parsed
        .protocol
        .unwrap_or_else(|| panic!("{}", parsed.findings.render(false)))
}

fn faults(text: &str) -> String {
    let parsed = parse("p.toml", text);
    assert!(parsed.protocol.is_none(), "{text}");
    parsed.findings.render(false)
}

#[test]
fn a_crossing_has_the_levels_of_each_realization() {
    let found = protocol(&format!("{HEAD}{FACTORS}{}", crossed()))
        .crossing()
        .unwrap();
    assert_eq!(found.sizes(), [2, 2]);
    assert_eq!(found.levels_of["high-soft"], [1, 0]);
    assert_eq!(found.effects, [vec![0], vec![1], vec![0, 1]]);
    assert!(found.groups.is_empty());
    assert_eq!(found.effect_name(&[0, 1]), "friction:detent");
}

#[test]
fn a_formula_restricts_the_tests() {
    let with = FACTORS.replace("\"rough\" }", "\"rough\", model = \"rough ~ detent\" }");
    let found = protocol(&format!("{HEAD}{with}{}", crossed()))
        .crossing()
        .unwrap();
    assert_eq!(found.effects, [vec![1]]);
    for (formula, told) in [
        ("rough ~ detnt", "there is no factor `detnt`"),
        ("smooth ~ detent", "primary question `rough`, not `smooth`"),
        ("rough ~ friction * group", "there is no factor `group`"),
    ] {
        let with = FACTORS.replace(
            "\"rough\" }",
            &format!("\"rough\", model = \"{formula}\" }}"),
        );
        let told_of = faults(&format!("{HEAD}{with}{}", crossed()));
        assert!(told_of.contains(told), "{told_of}");
    }
}

#[test]
fn groups_that_rate_everything_are_a_factor_between_participants() {
    let parts =
        "[[parts]]\nid = \"rating\"\nkind = \"rating\"\nrepetitions = 1\norder = \"blocked\"\n";
    let head = HEAD.replace(", repetitions = 1, order = \"blocked\"", "");
    let with = |groups: &str| {
        protocol(&format!(
            "{head}{FACTORS}{}{parts}[groups]\n{groups}",
            crossed()
        ))
        .crossing()
        .unwrap()
    };
    let found = with("list = [{ id = \"novices\" }, { id = \"experts\" }]");
    assert_eq!(found.groups, ["novices", "experts"]);
    assert_eq!(found.effects.len(), 7);
    assert_eq!(found.effect_name(&[0, 2]), "friction:group");
    // A group that rates half of them is none.
    let half = "list = [{ id = \"n\", models = [\"low-soft\", \"low-crisp\"] }, { id = \"e\" }]";
    let found = with(half);
    assert!(found.groups.is_empty());
    assert_eq!(found.effects.len(), 3);
    // Then its effects cannot be asked for, and the formula is not ignored in silence.
    let stated = FACTORS.replace(
        "\"rough\" }",
        "\"rough\", model = \"rough ~ friction * group\" }",
    );
    let text = |groups: &str| format!("{head}{stated}{}{parts}[groups]\n{groups}", crossed());
    assert!(faults(&text(half)).contains("there is no factor `group`"));
    let whole = "list = [{ id = \"n\" }, { id = \"e\" }]";
    assert_eq!(protocol(&text(whole)).crossing().unwrap().effects.len(), 3);
}

#[test]
fn each_fault_is_named_where_it_is() {
    let all = crossed();
    let low_soft = model("low-soft", &levels("low", "soft"));
    let with = |rest: &str| format!("{HEAD}{FACTORS}{}{rest}", all.replace(&low_soft, ""));
    for (text, told) in [
        (
            with(&model("low-soft", "")),
            "`models[3]` has no level of the factor `friction`",
        ),
        (
            with(&model("low-soft", &levels("lo", "soft"))),
            "there is no level of `friction` `lo`",
        ),
        (
            with(""),
            "no realization under study has friction = low, detent = soft",
        ),
        (
            with(&model(
                "low-soft",
                "levels = { friction = \"low\", detnt = \"soft\" }",
            )),
            "did you mean `detent`?",
        ),
        (
            with(
                &(low_soft.clone()
                    + &model(
                        "spring",
                        &("role = \"low-anchor\"\n".to_owned() + &levels("low", "soft")),
                    )),
            ),
            "`models[4]` has levels, and does not take part in the tests",
        ),
        (
            format!("{HEAD}{FACTORS}{all}")
                .replace("\"low\", \"high\"", "\"low\", \"low\", \"high\""),
            "the level `low` is there twice",
        ),
        (
            format!("{HEAD}{FACTORS}{all}").replace("[\"low\", \"high\"]", "[\"low\"]"),
            "too few entries: 1 of at least 2",
        ),
        (
            format!("{HEAD}{FACTORS}{all}").replace("friction", "block"),
            "is a column of ratings.csv already",
        ),
        (
            format!("{HEAD}{FACTORS}{all}").replace("friction", "rough"),
            "`rough` is a question and a factor",
        ),
        (
            format!("{HEAD}{FACTORS}{all}").replace("friction", "group"),
            "the factor between participants",
        ),
        (
            format!(
                "{HEAD}{FACTORS}{}",
                all.replace(
                    "id = \"low-soft\"",
                    "id = \"low-soft\"\ncovariates = { friction = 1 }"
                )
            ),
            "`friction` is a covariate and a factor",
        ),
        (
            format!(
                "{HEAD}{}{all}",
                FACTORS.lines().take(2).collect::<Vec<_>>().join("\n") + "\n"
            ),
            "has levels, and there are no [[factors]]",
        ),
        (
            format!("{HEAD}{FACTORS}{all}").replace("study-protocol/3", "study-protocol/1"),
            "`factors` needs the format `study-protocol/3`",
        ),
    ] {
        let found = faults(&text);
        assert!(found.contains(told), "{told}\n{found}");
    }
}

/// A second realization of a combination is one more of it, and a practice realization none.
#[test]
fn a_combination_may_have_several_realizations() {
    let more =
        model("low-soft-2", &levels("low", "soft")) + &model("spring", "role = \"practice\"");
    let found = protocol(&format!("{HEAD}{FACTORS}{}{more}", crossed()))
        .crossing()
        .unwrap();
    assert_eq!(found.levels_of.len(), 5);
    assert_eq!(found.levels_of["low-soft-2"], [0, 0]);
}
