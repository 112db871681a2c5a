//! Identification: `identification/…`.

use crate::analyze::keys::{ConfusionName, LabelName};
use crate::analyze::record::{
    Interval, PairName, ParticipantName, RealizationName, Stat, Why, statistics,
};
use std::collections::{BTreeMap, BTreeSet};
use study_stats::identification::{
    Confusions, Pooled, above_guessing, biased_choice, information, pooled, sensitivity, transfer,
};
use study_stats::proportion::share;

statistics! {
    /// A share of correct answers.
    pub struct Recall {
        /// number of answers
        n: Stat,
        /// the share of them that is correct
        correct: Stat,
        /// Wilson's, with the number of answers that would be equally informative if participants were alike
        correct_ci95: Interval,
    }

    /// Whether participants do better than by guessing.
    pub struct AboveGuessing {
        /// mean over participants of the share of correct answers less that of guesses with their own preferences for labels
        mean: Stat,
        /// its standard error, which is at least half of that of guesses
        se: Stat,
        /// t interval of the mean
        ci95: Interval,
        /// t of the test against 0
        t: Stat,
        /// its degrees of freedom
        df: Stat,
        /// its p, two-sided
        p: Stat,
    }

    /// Information transfer, in bits.
    pub struct Transfer {
        /// by maximum likelihood, which is too high by chance
        transmitted: Stat,
        /// the same without its bias, after Miller (1955) for fixed numbers of presentations
        corrected: Stat,
        /// of the corrected one, by leaving out each participant in turn, on the logarithm of what it lacks of the stimulus information
        corrected_ci95: Interval,
        /// what answers without an error transmit: the entropy of the labels that were right
        stimulus: Stat,
        /// 2 to the power of the corrected one, at least 1: so many labels are told apart without an error with as much information
        items: Stat,
        /// of the number of labels
        items_ci95: Interval,
    }

    /// A label.
    pub struct LabelUse {
        /// its place among the answers, from 1
        place: Stat,
        /// how often it was right
        n: Stat,
        /// how often it was given
        given: Stat,
        /// its bias β in Luce's (1963) model; biases sum to 1
        bias: Stat,
    }

    /// Two labels.
    pub struct LabelPair {
        /// their similarity η in Luce's (1963) model: 1 if they are never told apart
        similarity: Stat,
        /// of the similarity, by leaving out each participant in turn, on its logarithm
        similarity_ci95: Interval,
        /// d′, from answers to the two that are one of the two
        d: Stat,
        /// of d′, by leaving out each participant in turn
        d_ci95: Interval,
    }

    /// A participant.
    pub struct OwnIdentification {
        /// number of answers
        n: Stat,
        /// the share of them that is correct
        correct: Stat,
        /// the share that guesses with the same preferences for labels would have
        by_guessing: Stat,
        /// the information that is transmitted, without its bias, bits
        information: Stat,
    }

    /// Labels that were given to realizations.
    pub struct Identified {
        /// of all realizations
        all: Recall as "",
        /// the share that guesses with the same preferences for labels would have
        by_guessing: Stat,
        /// whether they are told apart
        above_guessing: AboveGuessing,
        /// information transfer over all participants
        information: Transfer,
        /// how often a label was given where another one, or it, was right
        confusion: BTreeMap<ConfusionName, Stat>,
        /// by realization, hidden duplicates with their originals
        realizations: BTreeMap<RealizationName, Recall> as "realization",
        /// by label
        labels: BTreeMap<LabelName, LabelUse> as "label",
        /// by pair of labels
        pairs: BTreeMap<PairName, LabelPair> as "pair",
        /// by participant
        participants: BTreeMap<ParticipantName, OwnIdentification> as "participant",
    }
}

/// One answer.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelRow {
    /// Participant. Untrusted.
    pub participant: String,
    /// What was felt, if it has a name. Untrusted.
    pub realization: Option<String>,
    /// The place of the right label.
    pub right: usize,
    /// The place of the label that was given.
    pub given: usize,
}

/// The answers of each participant.
pub type OwnConfusions = Vec<(String, Confusions)>;

/// The statistics of answers among these labels, and the answers of each participant.
pub fn identification(rows: &[LabelRow], labels: &[String]) -> (Identified, OwnConfusions) {
    let mut own: BTreeMap<&str, Confusions> = BTreeMap::new();
    let mut felt: BTreeMap<&str, BTreeMap<&str, (f64, f64)>> = BTreeMap::new();
    for row in rows {
        let empty = || Confusions::new(labels.len());
        let mine = own.entry(&row.participant).or_insert_with(empty);
        mine.add(row.right, row.given);
        if let Some(realization) = &row.realization {
            let of_all = felt.entry(realization).or_default();
            let cell = of_all.entry(&row.participant).or_default();
            cell.0 += f64::from(u8::from(row.right == row.given));
            cell.1 += 1.0;
        }
    }
    let all: Vec<Confusions> = own.values().cloned().collect();
    let sum = Confusions::sum(all.iter()).unwrap_or_else(|| Confusions::new(labels.len()));
    let shares: Vec<(f64, f64)> = all.iter().map(|c| (c.correct(), c.trials())).collect();
    let of_realization = |(name, of_all): (&&str, &BTreeMap<&str, (f64, f64)>)| {
        let clusters: Vec<(f64, f64)> = of_all.values().copied().collect();
        (RealizationName::from(*name), recall(&clusters))
    };
    let of_participant =
        |(name, own): (&&str, &Confusions)| (ParticipantName::from(*name), of_participant(own));
    let (information, pairs) = over_all(&all, labels);
    let names = || labels.iter().enumerate();
    let confusion =
        names().flat_map(|(right, a)| names().map(move |(given, b)| (right, a, given, b)));
    let confusion = confusion
        .map(|(right, a, given, b)| (ConfusionName::of(a, b), Stat::of(sum.count(right, given))));
    let found = Identified {
        all: recall(&shares),
        by_guessing: Stat::or(sum.by_guessing(), NO_ANSWERS),
        above_guessing: tested(&all),
        information,
        confusion: confusion.collect(),
        realizations: felt.iter().map(of_realization).collect(),
        labels: uses(&sum, labels),
        pairs,
        participants: own.iter().map(of_participant).collect(),
    };
    let own = own.into_iter();
    let own = own.map(|(who, confusions)| (who.to_owned(), confusions));
    (found, own.collect())
}

const NO_ANSWERS: &str = "there are no answers";
const ONE_PARTICIPANT: &str = "there is one participant";
const NEVER_RIGHT: &str = "a label was never right";
const ALIKE: &str = "all participants are alike, which does not tell how much others would differ";

/// The share of correct answers of clusters, such as participants: correct answers and answers.
fn recall(clusters: &[(f64, f64)]) -> Recall {
    let found = share(clusters);
    let why = found.map_or(NO_ANSWERS, |_| ONE_PARTICIPANT);
    Recall {
        n: Stat::of(clusters.iter().map(|c| c.1).sum()),
        correct: Stat::or(found.map(|s| s.share), NO_ANSWERS),
        correct_ci95: Interval::or(found.and_then(|s| s.ci95), why),
    }
}

fn of_participant(own: &Confusions) -> OwnIdentification {
    let n = own.trials();
    OwnIdentification {
        n: Stat::of(n),
        correct: Stat::of(own.correct() / n),
        by_guessing: Stat::or(own.by_guessing(), NO_ANSWERS),
        information: Stat::or(information(own).map(|i| i.corrected), NO_ANSWERS),
    }
}

fn tested(all: &[Confusions]) -> AboveGuessing {
    let why = match all.len() {
        0 | 1 => "there are fewer than two participants",
        _ => "fewer than two participants gave two answers, or each always gave the same label",
    };
    let found = above_guessing(all);
    let stat = |x: Option<f64>| Stat::or(x, why);
    AboveGuessing {
        mean: stat(found.map(|f| f.mean)),
        se: stat(found.map(|f| f.se)),
        ci95: Interval::or(found.map(|f| f.ci95), why),
        t: stat(found.map(|f| f.t)),
        df: stat(found.map(|f| f.n as f64 - 1.0)),
        p: stat(found.map(|f| f.p)),
    }
}

fn uses(sum: &Confusions, labels: &[String]) -> BTreeMap<LabelName, LabelUse> {
    let model = biased_choice(sum);
    let of_label = |(place, label): (usize, &String)| {
        let bias = model.as_ref().map(|m| m.biases[place]);
        let own = LabelUse {
            place: Stat::count(place + 1),
            n: Stat::of(sum.right(place)),
            given: Stat::of(sum.given(place)),
            bias: Stat::or(bias, NEVER_RIGHT),
        };
        (LabelName::from(label.as_str()), own)
    };
    labels.iter().enumerate().map(of_label).collect()
}

/// What has an error by leaving out participants: information transfer, and pairs of labels.
fn over_all(all: &[Confusions], labels: &[String]) -> (Transfer, BTreeMap<PairName, LabelPair>) {
    let pairs: Vec<(usize, usize)> = (0..labels.len())
        .flat_map(|a| (a + 1..labels.len()).map(move |b| (a, b)))
        .collect();
    let of_pairs = |m: &Confusions| {
        let model = biased_choice(m);
        let similarity = |(a, b): &(usize, usize)| Some(model.as_ref()?.log_similarity(*a, *b));
        let mut of: Vec<Option<f64>> = pairs.iter().map(similarity).collect();
        of.extend(pairs.iter().map(|(a, b)| sensitivity(m, *a, *b)));
        of
    };
    let found = pooled(all, of_pairs);
    let at = |place: usize| found.get(place).copied().flatten();
    let few: Why = match all.len() {
        0 => NO_ANSWERS.into(),
        1 => ONE_PARTICIPANT.into(),
        _ => "without one of the participants there is no estimate".into(),
    };
    let ends = |of: Option<Pooled>, shown: fn(f64) -> f64, none: &'static str| {
        let ends = of.and_then(|of| of.ci95);
        let why = match of.map(|of| of.se) {
            None => Why::from(none),
            Some(None) => few.clone(),
            Some(Some(_)) => ALIKE.into(),
        };
        Interval::or(ends.map(|(low, high)| (shown(low), shown(high))), why)
    };
    let same = |x: f64| x;
    let of_pair = |(i, (a, b)): (usize, &(usize, usize))| {
        let (similarity, d) = (at(i), at(pairs.len() + i));
        let no_d = "no answer to one of the two was one of the two";
        let own = LabelPair {
            similarity: Stat::or(similarity.map(|s| libm::exp(s.estimate)), NEVER_RIGHT),
            similarity_ci95: ends(similarity, libm::exp, NEVER_RIGHT),
            d: Stat::or(d.map(|d| d.estimate), no_d),
            d_ci95: ends(d, same, no_d),
        };
        (PairName::of(&labels[*a], &labels[*b]), own)
    };
    let sum = Confusions::sum(all.iter());
    let bits = sum.as_ref().and_then(information);
    let corrected = transfer(all);
    let items = |bits: f64| libm::exp2(bits.max(0.0));
    let transfer = Transfer {
        transmitted: Stat::or(bits.map(|i| i.transmitted), NO_ANSWERS),
        corrected: Stat::or(bits.map(|i| i.corrected), NO_ANSWERS),
        corrected_ci95: ends(corrected, same, NO_ANSWERS),
        stimulus: Stat::or(bits.map(|i| i.stimulus), NO_ANSWERS),
        items: Stat::or(bits.map(|i| items(i.corrected)), NO_ANSWERS),
        items_ci95: ends(corrected, items, NO_ANSWERS),
    };
    let pairs = pairs.iter().enumerate().map(of_pair).collect();
    (transfer, pairs)
}

/// The labels of a table: those that are right or given, sorted.
pub(super) fn labels_of<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let all: BTreeSet<&str> = names.collect();
    all.into_iter().map(str::to_owned).collect()
}
