//! From a track as it was read to its rules: levels, standard and defaults that depend on the family and the method.

use super::grids::Grids;
use super::looked::Looked;
use super::tracks::{RawRule, RawTrack};
use crate::procedure::{Constant, Ladder, QuestPlus, Rule, Staircase, Track};
use crate::protocol::relative::relative_ladder;
use crate::protocol::{Compared, FamilyRules, Method, Relative, TrackRules};
use study_base::diagnostic::Fault;
use study_base::rng::Stream;
use study_stats::psychometric::Spacing;

impl Looked<'_> {
    /// `families`: `None` if one of them has a fault of its own.
    pub(super) fn track(
        &self,
        raw: &RawTrack,
        families: Option<&[FamilyRules]>,
    ) -> Option<TrackRules> {
        let path = &raw.path;
        let (id, method) = (raw.id.clone()?, raw.method?);
        let compared = raw.compared.clone()?;
        let ladder = match &compared {
            Compared::Models { models } => {
                self.models(models, &format!("{path}.models"));
                Ladder::new(vec![1.0]).ok()?
            }
            Compared::Levels { family, standard } => {
                let family = self.family(family, families?, path)?;
                match raw.relative {
                    None => family.ladder.clone(),
                    Some(relative) => self.above(relative, *standard, family, path)?,
                }
            }
        };
        // Counted from the standard, that is 0 and below the ladder.
        let standard = match (&compared, raw.relative) {
            (Compared::Levels { standard, .. }, None) => Some(*standard),
            _ => None,
        };
        let rule = self.rule(raw.rule.clone()?, method, standard, &ladder);
        if let Rule::Staircase(Staircase {
            min_level: Some(standard),
            start,
            ..
        }) = &rule
            && start < standard
        {
            let what = format!("the staircase begins at {start}, below its standard {standard}");
            let hint = "a staircase goes down to the standard: levels below it are not easier to tell from it";
            self.fault(path, "standard", Fault::error(what).hint(hint));
            return None;
        }
        if let Err(why) = Track::new(&rule, &ladder, &mut Stream::new(0, &["check"])) {
            self.fault(path, "procedure", Fault::error(why.to_string()));
            return None;
        }
        if raw.fit.scale == Some(Spacing::Log) && ladder.first() <= 0.0 {
            let first = ladder.first();
            let what = format!("`{path}.fit`: the level {first} has no logarithm");
            let hint = "fit over scale = \"lin\", or begin the ladder above 0";
            self.fault(path, "fit", Fault::error(what).hint(hint));
            return None;
        }
        let catch = raw.catch.unwrap_or(match method {
            Method::YesNo => 0.2,
            Method::SameDifferent => 0.5,
            _ => 0.0,
        });
        Some(TrackRules {
            id,
            method,
            compared,
            relative: raw.relative,
            rule,
            feedback: raw.feedback,
            catch,
            easy: raw.easy,
            fit: raw.fit,
            measures: raw.measures.clone(),
        })
    }

    /// The levels of a family above a standard, as a track counts them.
    fn above(
        &self,
        relative: Relative,
        standard: f64,
        family: &FamilyRules,
        path: &str,
    ) -> Option<Ladder> {
        // that it has to be above 0 is said where it is read
        if relative == Relative::Fraction && standard <= 0.0 {
            return None;
        }
        let found = relative_ladder(relative, standard, &family.ladder);
        if found.is_none() {
            let (id, last) = (&family.id, family.ladder.last());
            let what = format!("no level of `{id}` is above the standard {standard}");
            let hint = format!("its highest is {last}: raise the range, or lower the standard");
            self.fault(path, "standard", Fault::error(what).hint(hint));
        }
        found
    }

    /// The rule with its defaults. `standard`: as the ladder counts, if the ladder may have
    /// levels below it.
    fn rule(&self, raw: RawRule, method: Method, standard: Option<f64>, ladder: &Ladder) -> Rule {
        match raw {
            RawRule::Staircase(rule) => {
                // Below the standard a smaller level is easier, not harder.
                let min_level = standard.filter(|s| *s > ladder.first());
                Rule::Staircase(Staircase { min_level, ..rule })
            }
            RawRule::Constant {
                levels,
                repetitions,
            } => Rule::Constant(Constant {
                levels: levels.unwrap_or_else(|| ladder.levels().to_vec()),
                repetitions,
            }),
            RawRule::QuestPlus {
                rule,
                threshold,
                slope,
                guess,
                lapse,
            } => {
                if !rule.parameters.is_empty() {
                    return Rule::QuestPlus(rule);
                }
                let grids = Grids {
                    threshold,
                    slope,
                    guess,
                    lapse,
                };
                let parameters = grids.parameters(&rule.function, method, ladder, standard);
                Rule::QuestPlus(QuestPlus { parameters, ..rule })
            }
        }
    }
}
