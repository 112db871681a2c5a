//! Other procedures for the tracks of a part, which `study power` compares.

use super::file::usual_grids;
use super::keys::words;
use super::{Compared, Part, Protocol, Task, TrackRules};
use crate::procedure::{
    Constant, Function, Ladder, ProcedureError, QuestPlus, Rule, Scale, Staircase, Stop, Track,
};
use study_base::rng::Stream;
use study_stats::psychometric::Spacing;

words! {
    /// A procedure that is compared with others.
    Procedure {
        /// That of the protocol.
        Own = "own",
        /// A staircase: the protocol's, or 1-up-3-down (1-up-1-down of yes–no) from three quarters of the
        /// ladder, with steps of an eighth and, after a reversal, a sixteenth of it.
        Staircase = "staircase",
        /// QUEST+: the protocol's, or a Weibull function with the usual grids.
        QuestPlus = "quest+",
        /// Constant stimuli: the protocol's, or eight levels evenly along the ladder.
        Constant = "constant",
    }
}

impl Procedure {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Own, Self::Staircase, Self::QuestPlus, Self::Constant];
}

/// Levels of constant stimuli, where the protocol has none.
const LEVELS: usize = 8;

impl Protocol {
    /// The protocol with this procedure in all tracks of a part that have levels, and with so many trials
    /// of each, which no reversal and no precision ends before. Without a number of trials the own procedure
    /// is as it was; others have the most trials of that.
    ///
    /// # Errors
    /// [`ProcedureError`] if a ladder is too coarse or too short for the procedure.
    pub fn with_procedure(
        &self,
        part: &Part,
        procedure: Procedure,
        trials: Option<u32>,
    ) -> Result<Self, ProcedureError> {
        let mut changed = self.clone();
        let Task::Discrimination { tracks } = &part.task else {
            return Ok(changed);
        };
        for track in &mut changed.tracks {
            if !tracks.contains(&track.id) || track.family().is_none() {
                continue;
            }
            let ladder = self.ladder(track);
            track.rule = self.rule(track, &ladder, procedure, trials);
            let mut stream = Stream::new(0, &["check"]);
            Track::new(&track.rule, &ladder, &mut stream)?;
        }
        Ok(changed)
    }

    fn rule(
        &self,
        track: &TrackRules,
        ladder: &Ladder,
        procedure: Procedure,
        trials: Option<u32>,
    ) -> Rule {
        let own = &track.rule;
        let stays = matches!(
            (procedure, own),
            (Procedure::Own, _)
                | (Procedure::Staircase, Rule::Staircase(_))
                | (Procedure::QuestPlus, Rule::QuestPlus(_))
                | (Procedure::Constant, Rule::Constant(_))
        );
        if stays {
            return match trials {
                Some(trials) => of_trials(own, trials),
                None => own.clone(),
            };
        }
        let trials = trials.unwrap_or_else(|| own.most_trials());
        let standard = match (&track.compared, track.relative) {
            (Compared::Levels { standard, .. }, None) => Some(*standard),
            _ => None,
        };
        match procedure {
            Procedure::QuestPlus => {
                let function = Function::Weibull;
                let parameters = usual_grids(&function, track.method, ladder, standard);
                Rule::QuestPlus(QuestPlus::new(function, parameters, trials))
            }
            Procedure::Constant => {
                let levels = above(ladder, standard);
                let count = LEVELS.min(levels.len());
                let place =
                    |i: usize| (i * (levels.len() - 1) + (count - 1) / 2) / (count - 1).max(1);
                let rule = Constant {
                    levels: (0..count).map(|i| levels[place(i)]).collect(),
                    repetitions: 1,
                };
                of_trials(&Rule::Constant(rule), trials)
            }
            Procedure::Staircase | Procedure::Own => {
                let family = track.family().and_then(|id| self.family(id));
                let ratios =
                    family.is_some_and(|f| f.spacing == Spacing::Log) && track.relative.is_none();
                let down = if track.method.guess_rate().is_some() {
                    3
                } else {
                    1
                };
                of_trials(&staircase(ladder, standard, ratios, down), trials)
            }
        }
    }
}

/// The levels above the standard, or all if there are none.
fn above(ladder: &Ladder, standard: Option<f64>) -> Vec<f64> {
    let levels = ladder.levels();
    let from = standard.map_or(0, |s| levels.partition_point(|level| *level <= s));
    levels
        .get(from..)
        .filter(|l| !l.is_empty())
        .unwrap_or(levels)
        .to_vec()
}

/// 1-up-`down`-down from three quarters of the ladder.
fn staircase(ladder: &Ladder, standard: Option<f64>, ratios: bool, down: u32) -> Rule {
    let levels = above(ladder, standard);
    let (low, high) = (levels[0], levels[levels.len() - 1]);
    let scale = if ratios && low > 0.0 {
        Scale::Log
    } else {
        Scale::Lin
    };
    let distance = |from: f64, to: f64| match scale {
        Scale::Log => libm::log10(to / from),
        Scale::Lin | Scale::Db => to - from,
    };
    let mut gaps: Vec<f64> = levels
        .windows(2)
        .map(|two| distance(two[0], two[1]))
        .collect();
    gaps.sort_by(f64::total_cmp);
    let gap = gaps.get(gaps.len() / 2).copied().unwrap_or(0.0);
    let span = distance(low, high);
    Rule::Staircase(Staircase {
        up: 1,
        down,
        start: levels[(levels.len() - 1) * 3 / 4],
        steps: [8.0, 16.0].map(|parts| (span / parts).max(gap)).to_vec(),
        scale,
        step_up_factor: 1.0,
        // Below the standard a smaller level is easier, not harder.
        min_level: standard.filter(|s| *s > ladder.first()),
        max_level: None,
        initial_one_up_one_down: true,
        stop: Stop {
            reversals: 1,
            min_trials: 0,
            max_trials: 1,
        },
        estimate_last: 6,
    })
}

/// The same rule with this number of trials; of constant stimuli with the nearest that gives each level
/// equally many.
fn of_trials(rule: &Rule, trials: u32) -> Rule {
    match rule {
        Rule::Staircase(own) => Rule::Staircase(Staircase {
            stop: Stop {
                // No track has more reversals than trials.
                reversals: trials.saturating_add(1),
                min_trials: trials,
                max_trials: trials,
            },
            ..own.clone()
        }),
        Rule::QuestPlus(own) => Rule::QuestPlus(QuestPlus {
            trials,
            min_trials: own.min_trials.min(trials),
            entropy_below: None,
            sd_below: None,
            ..own.clone()
        }),
        Rule::Constant(own) => {
            let levels = u32::try_from(own.levels.len()).unwrap_or(u32::MAX).max(1);
            Rule::Constant(Constant {
                repetitions: (trials.saturating_add(levels / 2) / levels).max(1),
                ..own.clone()
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A study with a track over this family, above this standard, and its own procedure.
    fn study(family: &str, track: &str) -> Protocol {
        let text = format!(
            r#"
format = "study-protocol/3"
study = {{ id = "example", title = "An example", seed = 1 }}
design = {{ participants = 10 }}
device = {{ kind = "simulated", limits = {{ force_n = 12.0, velocity_mm_s = 1000.0 }} }}
analysis = {{ primary = "more" }}

[[families]]
id = "friction"
from = "static.toml"
vary = "friction"
{family}

[[parts]]
id = "more"
kind = "discrimination"
text = "Two switches."
prompt = "Which one had more friction?"
tracks = ["only"]

[[tracks]]
id = "only"
family = "friction"
{track}
"#
        );
        let parsed = crate::protocol::file::parse("protocol.toml", &text);
        let shown = parsed.findings.render(false);
        parsed.protocol.unwrap_or_else(|| panic!("{shown}"))
    }

    const LOG: &str = "range = [0.02, 0.6]\nsteps = 30\nscale = \"log\"";
    const LIN: &str = "range = [0.02, 1.6]\nsteps = 80";
    const QUEST: &str = "method = \"2ifc\"\nstandard = 0.0\nprocedure = { rule = \"quest+\", trials = 40, sd_below = 0.01 }";
    const CONSTANT: &str = "method = \"2ifc\"\nstandard = 0.0\nprocedure = { rule = \"constant\", levels = [0.02, 0.6], repetitions = 10 }";
    const RELATIVE: &str = "method = \"2ifc\"\nstandard = 0.4\nrelative = \"increment\"\nprocedure = { rule = \"quest+\", trials = 40 }";
    const YES: &str =
        "method = \"yes-no\"\nstandard = 0.0\nprocedure = { rule = \"quest+\", trials = 40 }";

    fn rule(protocol: &Protocol, procedure: Procedure, trials: Option<u32>) -> Rule {
        let changed = protocol.with_procedure(&protocol.parts[0], procedure, trials);
        changed.unwrap().tracks[0].rule.clone()
    }

    #[test]
    fn the_own_procedure_stays_but_for_its_trials() {
        let own = study(LOG, QUEST);
        assert_eq!(rule(&own, Procedure::Own, None), own.tracks[0].rule);
        assert_eq!(rule(&own, Procedure::QuestPlus, None), own.tracks[0].rule);
        let Rule::QuestPlus(longer) = rule(&own, Procedure::Own, Some(150)) else {
            panic!("another rule")
        };
        // No precision ends it before.
        assert_eq!((longer.trials, longer.sd_below), (150, None));
        let constant = study(LOG, CONSTANT);
        let Rule::Constant(longer) = rule(&constant, Procedure::Own, Some(81)) else {
            panic!("another rule")
        };
        assert_eq!((longer.levels.len(), longer.repetitions), (2, 41));
    }

    #[test]
    fn quest_has_the_grids_of_a_protocol_that_gives_none() {
        let own = study(LOG, QUEST);
        let other = study(LOG, CONSTANT);
        let (Rule::QuestPlus(of_file), Rule::QuestPlus(made)) = (
            &own.tracks[0].rule,
            rule(&other, Procedure::QuestPlus, Some(40)),
        ) else {
            panic!("another rule")
        };
        assert_eq!(of_file.parameters, made.parameters);
        assert_eq!(rule(&other, Procedure::QuestPlus, None).most_trials(), 20);
    }

    #[test]
    fn a_staircase_has_steps_that_its_ladder_allows_and_stops_after_its_trials() {
        for (family, track, scale, down) in [
            (LOG, QUEST, Scale::Log, 3),
            (LIN, QUEST, Scale::Lin, 3),
            (LIN, RELATIVE, Scale::Lin, 3),
            (LOG, YES, Scale::Log, 1),
        ] {
            let protocol = study(family, track);
            let changed =
                protocol.with_procedure(&protocol.parts[0], Procedure::Staircase, Some(80));
            let changed = changed.unwrap();
            let coarse =
                crate::protocol::check::coarse(&changed, &std::collections::BTreeMap::new(), false);
            assert!(coarse.is_empty(), "{family}");
            let Rule::Staircase(made) = &changed.tracks[0].rule else {
                panic!("another rule")
            };
            assert_eq!((made.scale, made.down), (scale, down));
            // Answers that turn it in each trial do not end it.
            let ladder = changed.ladder(&changed.tracks[0]);
            let mut stream = Stream::new(0, &["test"]);
            let mut state = Track::new(&changed.tracks[0].rule, &ladder, &mut stream).unwrap();
            let mut trials = 0;
            while let Some(proposal) = state.next() {
                state.answer(&crate::procedure::Answer {
                    presented: ladder.level(proposal.step),
                    positive: trials % 2 == 0,
                    easy: false,
                });
                trials += 1;
            }
            assert_eq!(trials, 80);
        }
    }

    #[test]
    fn constant_stimuli_lie_evenly_above_the_standard() {
        let protocol = study(LOG, QUEST);
        let Rule::Constant(made) = rule(&protocol, Procedure::Constant, Some(80)) else {
            panic!("another rule")
        };
        let levels = protocol.families[0].ladder.levels();
        let expected = [0, 4, 8, 12, 17, 21, 25, 29].map(|i| levels[i]);
        assert_eq!((&made.levels[..], made.repetitions), (&expected[..], 10));
        let standard = QUEST.replace("standard = 0.0", "standard = 0.8");
        let protocol = study(LIN, &standard);
        let Rule::Constant(made) = rule(&protocol, Procedure::Constant, Some(40)) else {
            panic!("another rule")
        };
        assert!(
            made.levels.iter().all(|level| *level > 0.8),
            "{:?}",
            made.levels
        );
        assert_eq!(made.levels.len(), 8);
    }
}
