//! Raters who compare intervals, pairs and tracks, who estimate magnitudes, who rate
//! beside a reference, who say which label a realization has, who rate how different two are, and who rank several.
//!
//! Each interval is felt with normal noise of the rater's own, and the rater decides as an
//! observer without memory would: the largest, the odd one, the nearer one, a distance
//! beyond a criterion. Draws come from a stream of their own and their number never depends
//! on the realizations.

mod ranking;

use super::adjusting::equal;
use super::{Effect, Impression, MIDPOINT, Rater, Reference};
use ranking::ranked;
use std::collections::BTreeMap;
use study_base::perception::FORCE_JND_N;
use study_base::rng::Stream;
use study_base::text::{ModelId, PartId};
use study_haptics::model::Realization;
use study_plan::protocol::{
    Answer, Identification, Label, Method, Protocol, Question, Role, Similarity, Stimuli, Task,
    Trial,
};

/// Median standard deviation of the noise of an interval of a track, N: the just
/// noticeable difference of a force.
const NOISE_N: f64 = FORCE_JND_N;
/// Criterion of "different", in standard deviations of the noise of one interval.
const DIFFERENT: f64 = 1.8;
/// Criterion of "yes", in the same unit.
const YES: f64 = 1.0;
/// Difference of two opinions below which a pair is a tie, and two of a ranking have the same rank, in the same unit.
const TIE: f64 = 0.5;
/// Median exponent of magnitude estimates, and the standard deviation of its logarithm.
const EXPONENT: (f64, f64) = (0.8, 0.2);
/// Standard deviation of the logarithm of an estimate, for the median noise.
const ESTIMATE_NOISE: f64 = 0.2;
/// Distance from the reference that is not noticed, and that at which a rating of 100
/// has fallen to 37, N.
const CLOSE_N: (f64, f64) = (0.2, 1.5);

/// Difference of force at which the similarity of two realizations has fallen to 37 %, N: how
/// easily labels are confused. What is named from memory differs by several just noticeable differences.
const CONFUSED_N: f64 = 10.0 * FORCE_JND_N;

/// Standard deviation of a rating of difference, as a share of the scale, for the median noise.
const DIFFERENCE_NOISE: f64 = 0.1;

/// What raters feel of the realizations of a study.
#[derive(Debug, Default)]
pub struct Percepts {
    /// The realization that stands for the target; `None`: switch B.
    target: Option<ModelId>,
    impressions: BTreeMap<ModelId, Impression>,
    /// Of each realization of a track its distance from the track's standard, N, negative
    /// for lower levels.
    distances: BTreeMap<(PartId, ModelId), f64>,
    /// Of each realization of a part with a reference its distance from it, N.
    from_reference: BTreeMap<(PartId, ModelId), f64>,
    /// Of two realizations with labels, or of a part of similarity, the distance between them, N; the one
    /// that sorts first comes first.
    between: BTreeMap<(ModelId, ModelId), f64>,
    /// Of each part of adjustment the place in its ladder that feels equal to its standard.
    equal: BTreeMap<PartId, f64>,
}

impl Percepts {
    /// Computes them from all tables of a study.
    pub fn of(protocol: &Protocol, tables: &BTreeMap<ModelId, Realization>) -> Self {
        let target = target(protocol, tables);
        let reference = match &target {
            Some((_, best)) => Reference::of(best),
            None => Reference::switch_b(),
        };
        let mut percepts = Self {
            target: target.map(|(id, _)| id.clone()),
            impressions: (tables.iter())
                .map(|(id, table)| (id.clone(), Impression::of(table, &reference)))
                .collect(),
            distances: BTreeMap::new(),
            from_reference: BTreeMap::new(),
            between: between(protocol, tables, &reference),
            equal: BTreeMap::new(),
        };
        percepts.equal = equal(protocol, tables, &percepts.impressions, &reference);
        for part in &protocol.parts {
            let Task::Mushra(own) = &part.task else {
                continue;
            };
            let is_hidden = |id: &&ModelId| {
                let model = protocol.model(id);
                model.is_some_and(|m| m.role == Role::HiddenReference)
            };
            let models = own
                .presentations
                .models
                .iter()
                .chain(&own.presentations.practice);
            let hidden = own.presentations.models.iter().find(is_hidden);
            let named = own.reference.as_ref().or(hidden);
            let Some(beside) = named.and_then(|id| tables.get(id)) else {
                continue;
            };
            for model in models {
                if let Some(table) = tables.get(model) {
                    let distance = Impression::distance_n(table, beside, &reference);
                    let key = (part.id.clone(), model.clone());
                    percepts.from_reference.insert(key, distance);
                }
            }
        }
        for track in &protocol.tracks {
            let standard = track.standard();
            let steps = 0..protocol.ladder(track).levels().len();
            let models = steps.filter_map(|step| protocol.comparison(track, step));
            for model in models {
                let (Some(a), Some(b)) = (tables.get(&model), tables.get(&standard)) else {
                    continue;
                };
                let below = match (protocol.level_of(&model), track.standard_level()) {
                    (Some(level), Some(standard)) => level < standard,
                    _ => false,
                };
                let distance = Impression::distance_n(a, b, &reference);
                let signed = if below { -distance } else { distance };
                percepts.distances.insert((track.id.clone(), model), signed);
            }
        }
        percepts
    }

    /// The realization that raters compare with; `None`: the simulated switch B.
    pub fn target(&self) -> Option<&ModelId> {
        self.target.as_ref()
    }

    /// How far apart two realizations with labels, or of a part of similarity, are, N.
    fn between_n(&self, a: &ModelId, b: &ModelId) -> Option<f64> {
        if a == b {
            return Some(0.0);
        }
        self.between
            .get(&(a.min(b).clone(), a.max(b).clone()))
            .copied()
    }

    /// The distance of two realizations of a part of similarity, as a share of the largest one.
    fn share_of_most(&self, own: &Similarity, models: &[ModelId]) -> Option<f64> {
        let [a, b] = models else { return None };
        let all = own
            .different
            .iter()
            .filter_map(|[a, b]| self.between_n(a, b));
        let most_n = all.fold(0.0, f64::max);
        let distance_n = self.between_n(a, b)?;
        Some(if most_n > 0.0 {
            distance_n / most_n
        } else {
            0.0
        })
    }

    /// The place in the ladder of a part of adjustment, from 0, that feels equal to its standard.
    pub fn equal(&self, part: &PartId) -> Option<f64> {
        self.equal.get(part).copied()
    }

    /// The impression of a realization.
    pub fn impression(&self, model: &ModelId) -> Option<&Impression> {
        self.impressions.get(model)
    }
}

/// The distances of the realizations of each part of identification and of similarity.
fn between(
    protocol: &Protocol,
    tables: &BTreeMap<ModelId, Realization>,
    reference: &Reference,
) -> BTreeMap<(ModelId, ModelId), f64> {
    let mut between = BTreeMap::new();
    for part in &protocol.parts {
        let mut models: Vec<&ModelId> = match &part.task {
            Task::Identification(own) => own.labels.iter().flat_map(|l| &l.models).collect(),
            Task::Similarity(own) => own.models.iter().collect(),
            _ => continue,
        };
        models.sort_unstable();
        for (i, first) in models.iter().enumerate() {
            for second in &models[i + 1..] {
                if let (Some(a), Some(b)) = (tables.get(*first), tables.get(*second)) {
                    let distance = Impression::distance_n(a, b, reference);
                    between.insert(((*first).clone(), (*second).clone()), distance);
                }
            }
        }
    }
    between
}

/// Of a study whose realizations were not identified from switch B, the one with the highest
/// VAF, which is nearest to its target.
fn target<'t>(
    protocol: &'t Protocol,
    tables: &'t BTreeMap<ModelId, Realization>,
) -> Option<(&'t ModelId, &'t Realization)> {
    let of_b = |table: &Realization| {
        let note = table.provenance.note.as_deref();
        note.is_some_and(|note| note.contains("--plant b"))
    };
    if tables.values().any(of_b) {
        return None;
    }
    let by_vaf = protocol.models.iter().filter_map(|model| {
        let table = tables.get(&model.id)?;
        Some((model.vaf?, &model.id, table))
    });
    let best = by_vaf.max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some((best.1, best.2))
}

/// A rater's ability to compare.
#[derive(Debug)]
pub(super) struct Comparing {
    stream: Stream,
    /// Standard deviation of the noise, relative to the median rater's.
    noise: f64,
    lapse_rate: f64,
    /// Logarithm of the rater's number for level 1, and the exponent of their numbers.
    modulus: f64,
    exponent: f64,
    /// The ranks of the intervals of the trial that is ranked.
    ranks: Vec<i64>,
}

impl Comparing {
    pub(super) fn new(seed: u64, number: u32) -> Self {
        let mut stream = Stream::new(seed, &["rater", &number.to_string(), "comparing"]);
        let mut scale = Stream::new(seed, &["rater", &number.to_string(), "magnitude"]);
        Self {
            noise: libm::exp(0.25 * stream.normal()),
            lapse_rate: 0.04 * stream.unit(),
            stream,
            modulus: libm::log(10.0) + scale.normal(),
            exponent: EXPONENT.0 * libm::exp(EXPONENT.1 * scale.normal()),
            ranks: Vec::new(),
        }
    }

    /// A number for a level, with two digits; a level of 0 or less feels like a hundredth. `standard`: a level and its number,
    /// in place of the rater's own.
    fn estimate(&mut self, level: f64, standard: Option<(f64, f64)>) -> Answer {
        let noise = ESTIMATE_NOISE * self.noise * self.stream.normal();
        let felt = |level: f64| self.exponent * libm::log(level.max(0.01));
        let of_1 = match standard {
            Some((standard, modulus)) => libm::log(modulus) - felt(standard),
            None => self.modulus,
        };
        let logarithm = of_1 + felt(level) + noise;
        let estimate = libm::exp(logarithm);
        let digit = libm::pow(10.0, libm::floor(libm::log10(estimate)) - 1.0);
        Answer::Number((estimate / digit).round() * digit)
    }

    /// One of the labels: each as probable as its realizations are similar to the one that is felt
    /// (Shepard 1957, Luce 1963). `distance_n`: how far each of them is from it.
    fn name(&mut self, own: &Identification, distance_n: impl Fn(&ModelId) -> f64) -> Answer {
        let lapses = self.stream.unit() < self.lapse_rate;
        let falls_n = CONFUSED_N * self.noise;
        let weight = |label: &Label| -> f64 {
            let models = label.models.iter();
            let similar = |model| libm::exp(-distance_n(model) / falls_n);
            if lapses {
                1.0
            } else {
                models.map(similar).sum()
            }
        };
        let weights: Vec<f64> = own.labels.iter().map(weight).collect();
        let mut left = self.stream.unit() * weights.iter().sum::<f64>();
        let chosen = weights.iter().position(|weight| {
            left -= weight;
            left < 0.0
        });
        let label = chosen.map_or(own.labels.last(), |at| own.labels.get(at));
        Answer::Choice(label.map(|l| l.text.clone()).into_iter().collect())
    }

    /// A rating from 0 to 100 of a difference, for its share of the largest one.
    fn difference(&mut self, share: f64) -> Answer {
        let felt = share + DIFFERENCE_NOISE * self.noise * self.stream.normal();
        let lapses = self.stream.unit() < self.lapse_rate;
        let anywhere = self.stream.unit();
        let rating = if lapses { anywhere } else { felt };
        Answer::Number((100.0 * rating).clamp(0.0, 100.0).round())
    }

    /// A rating from 0 to 100 for a distance from the reference, N.
    fn beside_reference(&mut self, distance_n: f64) -> Answer {
        let felt = (distance_n + 0.5 * NOISE_N * self.noise * self.stream.normal()).abs();
        let lapses = self.stream.unit() < self.lapse_rate;
        let anywhere = self.stream.unit();
        let (unnoticed, falls) = CLOSE_N;
        let quality = libm::exp(-(felt - unnoticed).max(0.0) / falls);
        let rating = if lapses { anywhere } else { quality };
        Answer::Number((100.0 * rating).round())
    }
}

impl Rater {
    /// The answer of a part's own question, with which each of its trials begins; `None` if
    /// the question is another one.
    pub fn compare(
        &mut self,
        question: &Question,
        (trial, models): (&Trial, &[ModelId]),
        protocol: &Protocol,
        percepts: &Percepts,
    ) -> Option<Answer> {
        let part = trial.part.as_ref()?;
        if let Some((part, own)) = ranked(protocol, trial) {
            let asked = own.asked(&part.asks);
            let interval = asked.iter().position(|id| *id == question.id)?;
            return self.ranked(interval, (part, own), models, percepts);
        }
        if part.as_str() != question.id.as_str() {
            return None;
        }
        let known = self.effect == Effect::BuiltIn;
        match (protocol.part(part).map(|part| &part.task), trial.model()) {
            (Some(Task::Magnitude(own)), Some(model)) => {
                // The opinion of a realization stands for its level; 1 is the middle of the scale.
                let level = |model: &ModelId| {
                    let opinion = || Some(percepts.impression(model)?.opinion(part.as_str()));
                    let level = protocol.level_of(model);
                    let level = level.or_else(|| Some(opinion()?.max(0.5) / MIDPOINT));
                    level.filter(|_| known).unwrap_or(1.0)
                };
                let standard = own.standard.as_ref();
                let standard = standard.map(|own| (level(&own.model), own.modulus));
                return Some(self.comparing.estimate(level(model), standard));
            }
            (Some(Task::Mushra(_)), Some(model)) => {
                let key = (part.clone(), model.clone());
                let distance = percepts.from_reference.get(&key).filter(|_| known);
                return Some(
                    self.comparing
                        .beside_reference(distance.copied().unwrap_or(0.0)),
                );
            }
            (Some(Task::Identification(own)), Some(model)) => {
                let distance_n = |other: &ModelId| {
                    let distance = percepts.between_n(model, other).filter(|_| known);
                    distance.unwrap_or(0.0)
                };
                return Some(self.comparing.name(own, distance_n));
            }
            (Some(Task::Similarity(own)), None) => {
                let share = percepts.share_of_most(own, models).filter(|_| known);
                return Some(self.comparing.difference(share.unwrap_or(0.5)));
            }
            _ => {}
        }
        let method = match &trial.stimuli {
            Stimuli::One { .. }
            | Stimuli::Rated { .. }
            | Stimuli::Set { .. }
            | Stimuli::Adjusted { .. } => return None,
            Stimuli::Pair { .. } | Stimuli::Search { .. } => None,
            Stimuli::Track { track, .. } => Some(protocol.track(track)?.method),
        };
        let options = match (&trial.stimuli, method) {
            (_, Some(method)) => method.answers(),
            (Stimuli::Search { .. }, None) => &["first", "second"][..],
            (_, None) => &["first", "second", "tie"][..],
        };
        let effect = self.effect;
        let Comparing {
            stream,
            noise,
            lapse_rate,
            ..
        } = &mut self.comparing;
        // One unit is the median noise: of a force, or a point on the scale of opinions.
        let strength = |model: &ModelId| match (effect, trial.track()) {
            (Effect::None, _) => 0.0,
            (Effect::BuiltIn, Some(track)) => {
                let key = (track.clone(), model.clone());
                percepts.distances.get(&key).map_or(0.0, |d| d / NOISE_N)
            }
            (Effect::BuiltIn, None) => {
                let felt = percepts.impression(model);
                felt.map_or(0.0, |felt| felt.opinion(part.as_str()))
            }
        };
        let felt: Vec<f64> = (models.iter())
            .map(|model| strength(model) + *noise * stream.normal())
            .collect();
        let lapses = stream.unit() < *lapse_rate;
        let anywhere = usize::try_from(stream.below(2)).unwrap_or(0);
        let chosen = if lapses {
            anywhere
        } else {
            choose(method, &felt, *noise, options.len())
        };
        Some(Answer::Choice(vec![options.get(chosen)?.to_string()]))
    }
}

/// The index of the answer.
fn choose(method: Option<Method>, felt: &[f64], noise: f64, options: usize) -> usize {
    let largest = || {
        let order = |a: &usize, b: &usize| felt[*a].total_cmp(&felt[*b]);
        (0..felt.len()).max_by(order).unwrap_or(0)
    };
    // How far an interval is from the two others, which are near each other.
    let alone = |i: usize| {
        let others: Vec<f64> = (0..felt.len())
            .filter(|o| *o != i)
            .map(|o| felt[o])
            .collect();
        let within = others.iter().copied().fold(f64::NEG_INFINITY, f64::max)
            - others.iter().copied().fold(f64::INFINITY, f64::min);
        -within
    };
    match (method, felt) {
        (None, [a, b]) if options == 3 && (a - b).abs() < TIE * noise => 2,
        (Some(Method::SameDifferent), [a, b]) => usize::from((a - b).abs() > DIFFERENT * noise),
        (Some(Method::Abx), [a, b, x]) => usize::from((x - b).abs() < (x - a).abs()),
        (Some(Method::OddOneOut), [_, _, _]) => {
            let order = |a: &usize, b: &usize| alone(*a).total_cmp(&alone(*b));
            (0..3).max_by(order).unwrap_or(0)
        }
        (Some(Method::YesNo), [one]) => usize::from(*one <= YES * noise),
        _ => largest(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_farther_from_the_reference_is_rated_lower() {
        let mean = |distance_n: f64| -> f64 {
            let rating = |number| {
                Comparing::new(3, number)
                    .beside_reference(distance_n)
                    .number()
            };
            (1..=50).filter_map(rating).sum::<f64>() / 50.0
        };
        let means = [0.0, 1.0, 3.0].map(mean);
        assert!(
            means[0] > 80.0 && means.is_sorted_by(|a, b| a > b),
            "{means:?}"
        );
    }

    /// The closer a realization is to another, the more often it gets its label.
    #[test]
    fn labels_are_confused_as_their_realizations_are_similar() {
        use study_plan::protocol::{Feedback, Order, Presentations};
        let id = |name: &str| ModelId::new(name).unwrap();
        let label = |text: &str, models: &[&str]| Label {
            text: text.to_owned(),
            models: models.iter().map(|m| id(m)).collect(),
        };
        let own = Identification {
            labels: vec![label("near", &["a", "b"]), label("far", &["c"])],
            feedback: Feedback::Never,
            criterion: None,
            presentations: Presentations {
                models: Vec::new(),
                order: Order::Blocked,
                repetitions: 1,
                max_run: None,
                min_distance: None,
                practice: Vec::new(),
            },
        };
        let share = |far_n: f64| {
            let right = |number: &u32| {
                let distance_n = |m: &ModelId| if *m == id("c") { far_n } else { 0.0 };
                let answer = Comparing::new(3, *number).name(&own, distance_n);
                answer == Answer::Choice(vec!["near".to_owned()])
            };
            (1..=600).filter(right).count() as f64 / 600.0
        };
        // 2/(2 + e^−d), where d is the distance over that of confusion; one in fifty lapses.
        let expected = |far: f64| 0.98 * 2.0 / (2.0 + libm::exp(-far)) + 0.02 * 0.5;
        for far in [0.0, 1.0, 3.0] {
            let (found, expected) = (share(far * CONFUSED_N), expected(far));
            assert!((found - expected).abs() < 0.06, "{far}: {found} {expected}");
        }
    }

    #[test]
    fn differences_are_rated_as_they_are() {
        let mean = |share: f64| {
            let rated = (1..=400).map(|number| {
                let answer = Comparing::new(3, number).difference(share);
                answer.number().unwrap()
            });
            rated.sum::<f64>() / 400.0
        };
        // One in fifty lapses, and nobody rates below 0.
        let means = [0.0, 0.25, 0.5, 1.0].map(mean);
        assert!((0.5..9.0).contains(&means[0]), "{means:?}");
        assert!(
            (means[1] - 25.5).abs() < 3.0 && (means[2] - 50.0).abs() < 3.0,
            "{means:?}"
        );
        assert!((88.0..99.5).contains(&means[3]), "{means:?}");
    }

    #[test]
    fn without_noise_every_method_finds_the_comparison() {
        use study_plan::protocol::Interval;
        for method in [
            Method::TwoIntervals,
            Method::ThreeIntervals,
            Method::SameDifferent,
            Method::Abx,
            Method::OddOneOut,
            Method::YesNo,
        ] {
            for sequence in method.sequences().iter().chain(method.catch_sequences()) {
                let felt: Vec<f64> = (sequence.iter())
                    .map(|i| if *i == Interval::Comparison { 9.0 } else { 0.0 })
                    .collect();
                let chosen = choose(Some(method), &felt, 1e-9, method.answers().len());
                let correct = method.correct(sequence).unwrap();
                assert_eq!(method.answers()[chosen], correct, "{method:?} {sequence:?}");
            }
        }
    }

    #[test]
    fn a_pair_is_a_tie_only_where_ties_are_answers() {
        assert_eq!(choose(None, &[4.0, 4.1], 1.0, 3), 2);
        assert_eq!(choose(None, &[4.0, 4.1], 1.0, 2), 1);
        assert_eq!(choose(None, &[5.0, 4.1], 1.0, 3), 0);
    }
}
