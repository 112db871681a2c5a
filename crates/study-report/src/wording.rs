//! The wording of findings: one row of texts for each question, of ratings and of parts. Terminal
//! page, report, its paragraphs and a preregistration fill them in.

mod parts;
mod ratings;

pub(crate) use parts::{declared_of_part, of_part, upwards};
pub(crate) use ratings::{declared, of_ratings, role, two_levels};

use crate::{apa, sentences};
use study_analysis::analyze::findings::Direction;
use study_analysis::analyze::{Finding, Test};
use study_base::text::counted;

/// The texts of a question. `{key}` stands for a value of its finding or its analysis.
#[derive(Debug, Clone, Copy)]
struct Wording {
    /// The question.
    ask: &'static str,
    /// What it is about, as the subject of a sentence.
    about: &'static str,
    /// What a yes says, in a paper; `{said}` in the other texts.
    yes: &'static str,
    /// What is said in its place if nothing is shown.
    not_shown: &'static str,
    /// What the deciding test says, where several texts have it: `{shown}`.
    shown: &'static str,
    /// The answer.
    answer: &'static str,
    /// The answer that cannot be determined.
    undefined: &'static str,
    /// The sentence of a paper.
    paper: &'static str,
    /// The deciding test, in a preregistration.
    declared: &'static str,
}

/// What most questions share.
const USUAL: Wording = Wording {
    ask: "",
    about: "",
    yes: "",
    not_shown: "",
    shown: "",
    answer: "{verdict}, {result} ({test}, {people}).",
    undefined: "{verdict}: {why}.",
    paper: "{said}, {result} ({corrected}).",
    declared: "{corrected}, level {level}",
};

/// The value of a key, if it is known.
type Values<'a> = dyn Fn(&str) -> Option<String> + 'a;

/// A finding and the texts of its question.
pub(crate) struct Words<'a, Q> {
    f: &'a Finding<Q>,
    texts: Wording,
    /// The values that only some questions have.
    own: Box<Values<'a>>,
}

impl<Q> Words<'_, Q> {
    /// The question.
    pub(crate) fn ask(&self) -> String {
        self.fill(self.texts.ask).unwrap_or_default()
    }

    /// The answer, or why there is none; `None` if something that it names is missing.
    pub(crate) fn answer(&self) -> Option<String> {
        self.fill(match self.f.reason() {
            Some(_) => self.texts.undefined,
            None => self.texts.answer,
        })
    }

    /// The sentence of a paper; `None` as for the answer.
    pub(crate) fn paper(&self) -> Option<String> {
        self.fill(match self.f.reason() {
            Some(_) => "{about} cannot be determined: {why}.",
            None => self.texts.paper,
        })
    }

    /// A text with its values. They are not searched for keys: names of the data have braces.
    fn fill(&self, text: &str) -> Option<String> {
        let (mut out, mut rest) = (String::new(), text);
        while let Some((before, after)) = rest.split_once('{') {
            let (key, after) = after.split_once('}')?;
            out.push_str(before);
            out.push_str(&(self.own)(key).or_else(|| self.value(key))?);
            rest = after;
        }
        Some(out + rest)
    }

    /// A value that all findings have.
    fn value(&self, key: &str) -> Option<String> {
        let (f, texts) = (self.f, &self.texts);
        let of_test = |text: fn(&Test) -> String| f.test.as_ref().map_or_else(String::new, text);
        let estimate = |format: fn(f64) -> String| {
            let estimate = f.estimate.as_ref();
            estimate.map_or_else(String::new, |e| sentences::estimate(e, format))
        };
        Some(match key {
            "ask" => self.ask(),
            "about" => self.fill(texts.about)?,
            "said" => self.fill(if f.is_yes() {
                texts.yes
            } else {
                texts.not_shown
            })?,
            "shown" => self.fill(texts.shown)?,
            "verdict" => sentences::verdict(&f.verdict).to_owned(),
            "why" => f.reason()?.to_owned(),
            "result" => sentences::result(f).unwrap_or_default(),
            "p" => of_test(sentences::p),
            "test" => of_test(|t| sentences::test_name(t.kind).to_owned()),
            "corrected" => of_test(sentences::corrected),
            "level" => of_test(|t| sentences::level(t.level)),
            "size" => estimate(apa::two),
            "r" => estimate(apa::r),
            "way" if f.direction == Some(Direction::Up) => "higher".to_owned(),
            "way" => "lower".to_owned(),
            "longer" if f.direction == Some(Direction::Up) => "longer".to_owned(),
            "longer" => "shorter".to_owned(),
            "first" => f.names.first()?.clone(),
            "second" => f.names.get(1)?.clone(),
            "names" => apa::listing(&f.names),
            "people" => sentences::participants(f.participants),
            "n" => f.realizations.to_string(),
            "df" => f.realizations.saturating_sub(2).to_string(),
            "realizations" => counted(f.realizations, "realization", "realizations"),
            "caveats" => caveats(f, |_| true),
            "raw-and-adjusted" => caveats(f, |code| code == "raw-and-adjusted"),
            _ => return None,
        })
    }
}

/// Caveats, each after a space.
fn caveats<Q>(f: &Finding<Q>, which: impl Fn(&str) -> bool) -> String {
    let told = f.caveats.iter().filter(|c| which(c.code));
    told.map(|c| format!(" {}", sentences::caveat(c))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_analysis::analyze::psychophysics::PartQuestion;
    use study_analysis::analyze::{Analysis, Include, Question, Rules, Verdict, analyze};
    use study_analysis::preregister::{complete_parts, complete_study};
    use study_plan::protocol::{Role, example, file};

    const PAIRS: &str = r#"
format = "study-protocol/2"
study = { id = "example", title = "An example", seed = 2007 }
design = { participants = 4 }
device = { kind = "simulated", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
models = [{ id = "A", file = "a.toml" }, { id = "B", file = "b.toml" }]
parts = [{ id = "better", kind = "pairs", text = "Feel two.", prompt = "Which?", pairs = "all", repetitions = 2, order = "blocked", tie = false, interval_order = "balanced" }]
analysis = { primary = "better" }
"#;

    fn analysis() -> Analysis {
        let mut protocol = example::protocol(6, 2);
        protocol.analysis.equivalence_margin = Some(1.0);
        protocol.models[0].role = Role::HiddenReference;
        let rules = Rules::of(&protocol, "realism", Include::default());
        let question = protocol.analysis.primary.clone();
        analyze(&complete_study(&protocol, &question, 8), &rules)
    }

    /// What is said of a finding with any verdict and direction, each text once. A key that nothing
    /// knows would make its sentence vanish.
    fn told<Q: Clone + std::fmt::Debug>(
        f: &Finding<Q>,
        words: impl Fn(&Finding<Q>) -> Vec<Option<String>>,
    ) -> String {
        let mut told = vec![format!("{:?}", f.question)];
        for verdict in [
            Verdict::Yes,
            Verdict::NotShown,
            Verdict::Undefined("{why}".to_owned()),
        ] {
            for direction in [None, Some(Direction::Up), Some(Direction::Curved)] {
                let found = Finding {
                    verdict: verdict.clone(),
                    direction,
                    ..f.clone()
                };
                for text in words(&found) {
                    let text = text.unwrap_or_else(|| panic!("{found:?}"));
                    if !told.contains(&text) {
                        told.push(text);
                    }
                }
            }
        }
        told.join("\n  ") + "\n"
    }

    fn all<Q>(words: &Words<'_, Q>) -> Vec<Option<String>> {
        let declared = format!("{{about}}: {}.", words.texts.declared);
        vec![
            words.fill(words.texts.ask),
            words.answer(),
            words.paper(),
            words.fill(&declared),
        ]
    }

    #[test]
    fn every_question_is_answered_in_these_words() {
        let a = analysis();
        let mut told_of_all = String::new();
        let usual = a.finding(&Question::Differ).expect("a finding");
        let reference = a
            .findings
            .iter()
            .find(|f| matches!(f.question, Question::Reference(_)));
        let reference = reference.expect("a reference");
        let names = vec![reference.names[0].clone(), "{said}".to_owned()];
        let of = || "A".to_owned();
        for question in [
            Question::Vaf,
            Question::Delivered,
            Question::Memory,
            Question::Best,
            Question::Differ,
            Question::Pairs,
            Question::Disagreement,
            Question::Order,
            Question::CarryOver,
            Question::Reference(of()),
            Question::Equivalence(of()),
            Question::Repeat(of()),
            Question::SiteRealizations,
            Question::SiteVaf,
            Question::SiteLevel,
            Question::Effect(of()),
        ] {
            let mut f = Finding {
                question,
                names: names.clone(),
                estimate: reference.estimate,
                ..usual.clone()
            };
            told_of_all += &told(&f, |f| all(&of_ratings(&a, f)));
            // One factor, and an interaction of three.
            if matches!(f.question, Question::Effect(_)) {
                let all = f.names.clone();
                for names in [
                    all[..1].to_vec(),
                    [all.clone(), vec!["C".to_owned()]].concat(),
                ] {
                    f.names = names;
                    told_of_all += &told(&f, |f| self::all(&of_ratings(&a, f)));
                }
            }
            // two that share the best mean
            if f.question == Question::Best {
                f.test = None;
                told_of_all += &told(&f, |f| all(&of_ratings(&a, f)));
            }
        }
        let protocol = file::parse("pairs", PAIRS).protocol.expect("a protocol");
        let part = complete_parts(&protocol, 4).remove(0);
        for question in [
            PartQuestion::Preferred,
            PartQuestion::PreferenceVaf,
            PartQuestion::IntervalOrder,
            PartQuestion::ToldApart("{of}".to_owned()),
            PartQuestion::Thresholds,
            PartQuestion::Magnitudes,
            PartQuestion::MagnitudeVaf,
            PartQuestion::Identified,
            PartQuestion::Structure,
            PartQuestion::Dimensions,
            PartQuestion::MapFollows("VAF".to_owned()),
            PartQuestion::RankedAlike,
            PartQuestion::RankedFirst,
            PartQuestion::Adjusted,
            PartQuestion::Starts,
            PartQuestion::Groups,
            PartQuestion::GroupsConditions,
            PartQuestion::Sessions,
            PartQuestion::GroupsSessions,
        ] {
            let f = Finding {
                question,
                verdict: Verdict::Yes,
                direction: None,
                names: names.clone(),
                test: usual.test.clone(),
                participants: 8,
                realizations: 5,
                estimate: reference.estimate,
                effect: None,
                caveats: Vec::new(),
            };
            told_of_all += &told(&f, |f| all(&of_part(&part, f)));
        }
        insta::assert_snapshot!(told_of_all);
    }

    #[test]
    fn names_with_braces_stay_as_they_are() {
        let a = analysis();
        let mut f = a.finding(&Question::Best).expect("a finding").clone();
        f.names = vec!["{verdict}".to_owned(), "}{".to_owned()];
        let paper = of_ratings(&a, &f).paper().expect("a sentence");
        assert!(
            paper.contains("{verdict}") && paper.contains("}{"),
            "{paper}"
        );
    }
}
