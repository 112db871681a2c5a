//! The wording of findings about ratings.

use super::{USUAL, Wording, Words};
use crate::{apa, sentences};
use study_analysis::analyze::findings::Direction;
use study_analysis::analyze::results::Number as _;
use study_analysis::analyze::{Analysis, Finding, MAX_PAIRED, PreregisteredRule, Question};
use study_base::text::counted;
use study_session::outcome::Role;

/// Pairs that a sentence lists.
const MAX_LISTED: usize = 12;

/// A finding in words.
pub(crate) fn of_ratings<'a>(a: &'a Analysis, f: &'a Finding) -> Words<'a, Question> {
    Words {
        f,
        texts: texts(f),
        own: Box::new(|key| value(a, f, key)),
    }
}

/// What a finding is about and the test that decides it, for a preregistration. Which realization
/// is the best-rated one is not known before.
pub(crate) fn declared(a: &Analysis, f: &Finding) -> Option<String> {
    f.test.as_ref()?;
    let words = Words {
        own: Box::new(|key| match key {
            "first" => Some("the best-rated realization".to_owned()),
            key => value(a, f, key),
        }),
        ..of_ratings(a, f)
    };
    words.fill(&format!("{{about}}: {}.", words.texts.declared))
}

/// The texts of a question.
fn texts(f: &Finding) -> Wording {
    let (yes, curved) = (f.is_yes(), f.direction == Some(Direction::Curved));
    let either = |of_yes, of_no| if yes { of_yes } else { of_no };
    match &f.question {
        Question::Vaf => Wording {
            ask: "Does VAF predict {asked}?",
            about: "Whether VAF predicts {asked}",
            yes: "Realizations with a higher VAF were rated {way}",
            not_shown: "A relation with VAF was not shown",
            answer: either(
                "{verdict}: over these {n} realizations, those with a higher VAF are rated {way}: r = {r}{p-of-vaf} (two-sided).",
                "{verdict} over these {n} realizations: r = {r}{p-of-vaf} (two-sided).",
            ),
            paper: "{said}: over the {n} realizations the {mean} of {asked} correlated with VAF at r({df}) = {r}{p-of-vaf}{rho}.{raw-and-adjusted}{crossed}",
            ..USUAL
        },
        Question::Delivered => Wording {
            ask: "Does the VAF of what was delivered predict {asked}?",
            about: "Whether the delivered VAF predicts {asked}",
            yes: "Realizations of which more was delivered (a higher delivered VAF) were rated {way}",
            not_shown: "A relation with the delivered VAF was not shown",
            answer: "{verdict}: over these {n} realizations r = {r}, {result} ({corrected}).",
            paper: "{said}, r({df}) = {r}, {result} ({corrected}).",
            ..USUAL
        },
        Question::Memory => Wording {
            ask: "Does the forgetting factor matter?",
            about: "Whether the memory matters",
            yes: match curved {
                false => "Realizations with a {longer} memory were rated higher, r = {r}",
                true => "The rating was a curved function of the memory",
            },
            not_shown: "An effect of the memory was not shown, r = {r}",
            answer: match (yes, curved) {
                (true, false) => {
                    "{verdict}: over these realizations, those with a {longer} memory are rated higher{line}."
                }
                (true, true) => {
                    "{verdict}: over these realizations the rating is a curved function of the memory{line}."
                }
                (false, _) => "{verdict}{line}.",
            },
            undefined: "{verdict}: {why}{line}.",
            paper: "{said}, {p}.",
            declared: "t tests of a linear and a quadratic term, each level {level}",
            ..USUAL
        },
        Question::Best => Wording {
            ask: "Does the best-rated realization differ from the second best?",
            about: "Whether the best-rated realization differs from the second best",
            yes: "The best-rated realization, {first}, differed from the second best, {second}",
            not_shown: "The best-rated realization, {first}, was not shown to differ from the second best, {second}",
            answer: match f.test {
                Some(_) => "{verdict}: {both}, {result} ({corrected}{alone}).",
                None => "{verdict}: {names} share the {most} {mean}, {mean-of-first}.",
            },
            undefined: "{verdict}: {both}; {why}.",
            paper: match f.test {
                Some(_) => "{said}, by {size}, {result} ({corrected}).",
                None => "A best-rated realization was not shown: {names} share the {most} mean.",
            },
            ..USUAL
        },
        Question::Differ => Wording {
            ask: "Do the realizations differ?",
            about: "Whether the realizations differ",
            yes: "The realizations differed",
            not_shown: "A difference between the realizations was not shown",
            answer: "{verdict}, {result}{effect} ({test}, {people}).",
            paper: "{said}, {result}{effect}{w} ({corrected}, {people}){friedman}.",
            ..USUAL
        },
        Question::Pairs => Wording {
            ask: "Which pairs of realizations differ?",
            about: "Which pairs of realizations differ",
            yes: "These pairs of realizations differed",
            not_shown: "No pair of realizations was shown to differ",
            answer: either(
                "{verdict}: {different} of {pairs} ({corrected}).",
                "{verdict} for any of {pairs}, smallest {p} ({corrected}).",
            ),
            paper: either(
                "{said} ({corrected}): {listed}.",
                "{said}, smallest {p} ({corrected}).",
            ),
            ..USUAL
        },
        Question::Disagreement => Wording {
            ask: "Do participants disagree about the realizations?",
            about: "Whether participants disagree about the realizations",
            yes: "Participants disagreed about the realizations",
            not_shown: "A disagreement of participants about the realizations was not shown",
            answer: "{verdict}, {result} ({test}).",
            paper: "{said}, {result} ({corrected}).{caveats}",
            ..USUAL
        },
        Question::Order => Wording {
            ask: "Do order and learning matter?",
            about: "Whether ratings change over the session",
            yes: "Ratings changed over the session",
            not_shown: "A change of the ratings over the session was not shown",
            answer: "{verdict}: the change is {slope} points per trial, {result} ({test}).",
            paper: "{said}, b = {slope} per trial, {result}.",
            ..USUAL
        },
        Question::CarryOver => Wording {
            ask: "Does a rating depend on the one before it?",
            about: "Whether ratings depend on the ones before them",
            yes: "Ratings depended on the ones before them",
            not_shown: "A dependence of ratings on the ones before them was not shown",
            answer: "{verdict}: {size} points per point of the preceding rating, {result} (t test).",
            paper: "{said}, b = {size} points per point, {result}.",
            ..USUAL
        },
        Question::Reference(_) => Wording {
            about: "Whether {first} differs from {of}",
            yes: "{first} differed from the {role} {of}",
            not_shown: "{first} was not shown to differ from the {role} {of}",
            answer: either(
                "{first} minus {of} over participants: {size}; they differ, {result} ({corrected}).",
                "{first} minus {of} over participants: {size}; a difference is not shown, {result} ({corrected}).",
            ),
            undefined: "{first} minus {of} over participants: {size}; not tested: {why}.",
            paper: "{said}, by {size}, {result} ({corrected}).",
            ..USUAL
        },
        Question::Equivalence(_) => Wording {
            about: "Whether {first} is equivalent to {of}",
            yes: "{first} was equivalent to {of} within ± {margin} points",
            not_shown: "{first} was not shown to be equivalent to {of} within ± {margin} points",
            answer: either(
                "Within the margin of ± {margin}{later} they are equivalent ({test}, {p}).",
                "Within the margin of ± {margin}{later} they are not shown to be equivalent ({test}, {p}).",
            ),
            ..USUAL
        },
        Question::Repeat(_) => Wording {
            ask: "Are hidden duplicates rated differently from their originals?",
            about: "Whether {of} differs from its original",
            yes: "The hidden duplicate {of} differed from its original {second}",
            not_shown: "The hidden duplicate {of} was not shown to differ from its original {second}",
            answer: "{verdict}: {first} minus {second} over participants: {size}; {result} ({corrected}).",
            undefined: "{verdict}: {first} minus {second} over participants: {size}; not tested: {why}.",
            paper: "{said}, by {size}, {result} ({corrected}).",
            ..USUAL
        },
        Question::SiteRealizations => Wording {
            ask: "Do the differences between realizations depend on the site?",
            about: "Whether the differences between realizations depend on the site",
            yes: "The differences between realizations depended on the site",
            not_shown: "A dependence of the differences between realizations on the site was not shown",
            ..USUAL
        },
        Question::SiteVaf => Wording {
            ask: "Does the effect of VAF depend on the site?",
            about: "Whether the effect of VAF depends on the site",
            yes: "The effect of VAF depended on the site",
            not_shown: "A dependence of the effect of VAF on the site was not shown",
            paper: "{said}, {result} ({corrected} of the participants' slopes).",
            ..USUAL
        },
        Question::Effect(_) => {
            let (ask, about, yes, not_shown) = match f.names.len() {
                0 | 1 => (
                    "Does {factor} matter?",
                    "Whether {factor} matters",
                    "{factor} had an effect on {asked}{levels}",
                    "An effect of {factor} on {asked} was not shown{levels}",
                ),
                2 => (
                    "Does the effect of {factor} depend on {other-factor}?",
                    "Whether the effect of {factor} depends on {other-factor}",
                    "The effect of {factor} on {asked} depended on {other-factor}",
                    "A dependence of the effect of {factor} on {other-factor} was not shown",
                ),
                _ => (
                    "Do {factors} interact?",
                    "Whether {factors} interact",
                    "{factors} interacted in their effect on {asked}",
                    "An interaction of {factors} was not shown",
                ),
            };
            Wording {
                ask,
                about,
                yes,
                not_shown,
                answer: "{verdict}{levels}: {result}{effect-of} ({of-effects}, {people}).",
                paper: "{said}, {result}{effect-of} ({of-effects}).",
                declared: "{of-effects}, level {level}",
                ..USUAL
            }
        }
        Question::SiteLevel => Wording {
            ask: "Do the sites differ in their mean rating?",
            about: "Whether the sites differ in their mean rating",
            yes: "The sites differed in their mean rating",
            not_shown: "A difference of the sites in their mean rating was not shown",
            ..USUAL
        },
    }
}

/// A value in the texts of ratings.
fn value(a: &Analysis, f: &Finding, key: &str) -> Option<String> {
    let evidence = &a.results.evidence;
    let mean_of = |name: &str| {
        let ranked = a.ranked();
        let found = ranked.iter().find(|r| r.1 == name);
        found.map_or_else(String::new, |r| apa::two(r.0))
    };
    let test = f.test.as_ref();
    Some(match key {
        "of" => match &f.question {
            Question::Reference(of) | Question::Equivalence(of) | Question::Repeat(of) => {
                of.clone()
            }
            _ => return None,
        },
        "role" => {
            let Question::Reference(of) = &f.question else {
                return None;
            };
            role(a.realizations.iter().find(|m| m.id == *of)?.role).to_owned()
        }
        "asked" => sentences::asked(a),
        "mean" => sentences::mean(a).to_owned(),
        "most" => a.better.most().to_owned(),
        "mean-of-first" => mean_of(f.names.first()?),
        "both" => match &f.names[..] {
            [first, second] => format!(
                "{first} ({mean} {}) and {second} ({mean} {})",
                mean_of(first),
                mean_of(second),
                mean = sentences::mean(a)
            ),
            _ => String::new(),
        },
        "alone" if a.design.realizations == 2 => String::new(),
        "alone" => ", these two only, not corrected".to_owned(),
        "effect" => test.map_or_else(String::new, |t| sentences::anova_effect(a, t)),
        "w" => (f.effect.filter(|e| e.name == KENDALLS_W)).map_or_else(String::new, |w| {
            format!(", Kendall's W = {}", apa::share(w.value, 2))
        }),
        "friedman" => (f.effect.filter(|e| e.name != KENDALLS_W))
            .and_then(|_| sentences::friedman(a))
            .map_or_else(String::new, |s| format!("; {s}")),
        "p-of-vaf" => sentences::p_of_vaf(a),
        "rho" => {
            let rho = a.correlation().spearman.as_ref().map(|s| &s.rho).number();
            rho.map_or_else(String::new, |x| format!("; Spearman's ρ = {}", apa::r(x)))
        }
        "crossed" => crossed(a).unwrap_or_default(),
        "line" => line(a, f).unwrap_or_default(),
        "pairs" if a.design.realizations <= MAX_PAIRED => counted(a.pairs.len(), "pair", "pairs"),
        "pairs" => format!(
            "{} with the {} {}",
            counted(a.pairs.len(), "pair", "pairs"),
            a.better.most(),
            sentences::mean(a)
        ),
        "different" => a.different_pairs().len().to_string(),
        "listed" => {
            let all = a.different_pairs();
            let listed: Vec<String> = (all.iter().take(MAX_LISTED))
                .map(sentences::different_pair)
                .collect();
            let more = match all.len().saturating_sub(MAX_LISTED) {
                0 => String::new(),
                n => format!("; and {n} more"),
            };
            listed.join("; ") + &more
        }
        "slope" => {
            let decimals = apa::decimals(evidence.order.trial.se.number().unwrap_or(0.0), 3);
            (f.estimate).map_or_else(String::new, |e| apa::number(e.value, decimals))
        }
        "factor" => f.names.first()?.clone(),
        "other-factor" => f.names.get(1)?.clone(),
        "factors" => apa::listing(&f.names),
        "levels" => levels(a, f).unwrap_or_default(),
        "effect-of" => (f.effect.as_ref()).map_or_else(String::new, |e| {
            format!(", generalized η² = {}", apa::share(e.value, 2))
        }),
        "of-effects" => test.map_or_else(String::new, |t| {
            let name = sentences::test_name(t.kind);
            match t.comparisons {
                0 | 1 => name.to_owned(),
                n => format!("{name}, Holm's correction over {n} effects"),
            }
        }),
        "margin" => {
            let Question::Equivalence(of) = &f.question else {
                return None;
            };
            let contrast = a.against(of, f.names.first()?)?;
            contrast.equivalence.as_ref()?.margin.number()?.to_string()
        }
        "later" if a.changed(PreregisteredRule::Margin) => {
            " (changed after the study began)".to_owned()
        }
        "later" => String::new(),
        _ => return None,
    })
}

/// Of a factor with two levels how much higher the second was rated than the first: the level's
/// name and the difference.
fn levels(a: &Analysis, f: &Finding) -> Option<String> {
    let estimate = f.estimate.as_ref()?;
    let [first, second] = two_levels(a, f)?;
    let size = sentences::estimate(estimate, apa::two);
    Some(format!(" ({second} − {first}: {size})"))
}

/// The names of both levels, if a finding is about one factor that has two.
pub(crate) fn two_levels<'a>(a: &'a Analysis, f: &Finding) -> Option<[&'a str; 2]> {
    let crossing = a.crossing.as_ref()?;
    let [name] = &f.names[..] else {
        return None;
    };
    let factor = crossing.factors.iter().find(|x| x.id.as_str() == name)?;
    let [first, second] = &factor.levels[..] else {
        return None;
    };
    Some([first.as_str(), second.as_str()])
}

/// The effect size of Friedman's test.
const KENDALLS_W: &str = "Kendall's W";

/// What a reference or an anchor is called.
pub(crate) fn role(role: Role) -> &'static str {
    match role {
        Role::LowAnchor => "low anchor",
        Role::MidAnchor => "mid anchor",
        Role::Physical => "physical device",
        Role::HiddenReference | Role::Test | Role::Practice => "hidden reference",
    }
}

/// The slope on VAF of the crossed mixed model, where it has a test.
fn crossed(a: &Analysis) -> Option<String> {
    let crossed = &a.results.evidence.crossed.coefficients;
    crossed.slope_satterthwaite_p.number()?;
    let slope = sentences::slope_on_vaf(a, crossed)?;
    let singular = match a.no_variance_beside_vaf() {
        Some(true) => {
            " (singular fit: besides VAF no variance between realizations is left, and p is too small)"
        }
        Some(false) => " (singular fit in a variance other than that between realizations)",
        None => "",
    };
    Some(format!(" Crossed mixed model: {slope}{singular}."))
}

/// The line of the mean ratings over the logarithm of the memory.
fn line(a: &Analysis, f: &Finding) -> Option<String> {
    let memory = a.results.evidence.covariates.log10_memory.as_ref()?;
    let line = &memory.line;
    let r = apa::r(line.r.number()?);
    let test = line.t.number().zip(line.df.number()).zip(line.p.number());
    let test = test.map_or_else(String::new, |((t, df), p)| {
        let (df, t) = (apa::number(df, 0), apa::two(t));
        let level = f.test.as_ref().map_or(a.alpha, |t| t.level);
        format!(", t({df}) = {t}, p {}", apa::p_beside(p, level))
    });
    let unit = match memory.in_mm.is_set() {
        true => "mm",
        false => "samples",
    };
    Some(format!(
        "; mean rating against log10 of the memory in {unit}: r = {r}{test}"
    ))
}
