//! The trials of a part of tracks: which track is next, the order of its intervals, and
//! the places of its catch and easy trials. All of it is drawn before the session; only
//! the levels follow from the answers.

use super::{MAX_TRIALS, Planned, ScheduleError};
use crate::protocol::{Interval, Method, OrderVersion, Protocol, Seat, Stimuli};
use study_base::rng::Stream;
use study_base::text::PartId;

/// How often each sequence of intervals occurs in a block.
const OF_EACH: usize = 2;

/// Trials of a track over which its right answers are in balance, where they cannot be guessed.
const STRETCH: usize = 24;

/// How often more or less than its share an answer is right in a stretch, at most.
///
/// Somebody who is told the right answer after each trial and knows all of this is right in
/// 0.513 of the trials with two answers and in 0.349 of those with three. A smaller number would
/// exceed chance by 0.02.
const SLACK: usize = 4;

/// Makes the orders of a part of tracks.
#[derive(Debug)]
pub(super) struct TrackOrders {
    seed: u64,
    part: PartId,
    tracks: Vec<Planning>,
    version: OrderVersion,
}

/// What of a track is planned.
#[derive(Debug)]
struct Planning {
    id: PartId,
    method: Method,
    /// Most trials of its rule, and catch and easy trials among them.
    ruled: usize,
    catch: usize,
    easy: usize,
}

impl Planning {
    fn trials(&self) -> usize {
        self.ruled + self.catch + self.easy
    }
}

impl TrackOrders {
    pub(super) fn new(
        seed: u64,
        part: &PartId,
        protocol: &Protocol,
        tracks: &[PartId],
    ) -> Result<Self, ScheduleError> {
        let planning = |id: &PartId| {
            let track = protocol.track(id)?;
            let ruled = f64::from(track.rule.most_trials());
            // The shares are of all trials.
            let all = ruled / (1.0 - track.catch - track.easy);
            Some(Planning {
                id: id.clone(),
                method: track.method,
                ruled: ruled as usize,
                catch: (all * track.catch).round() as usize,
                easy: (all * track.easy).round() as usize,
            })
        };
        let tracks: Vec<Planning> = tracks.iter().filter_map(planning).collect();
        let trials: u64 = tracks.iter().map(|t| t.trials() as u64).sum();
        if trials > MAX_TRIALS {
            return Err(ScheduleError::LongTracks {
                part: part.clone(),
                trials,
            });
        }
        Ok(Self {
            seed,
            part: part.clone(),
            tracks,
            version: protocol.design.order_version,
        })
    }

    fn stream(&self, seat: Seat, of: &str) -> Stream {
        let number = seat.number().to_string();
        let part = self.part.as_str();
        let path = ["schedule", "part", part, seat.stream(), &number, of];
        Stream::new(self.seed, &path)
    }

    /// The trials of a seat: pass by pass, each track once, in a random order.
    pub(super) fn plan(&self, seat: Seat) -> Vec<Planned> {
        let mut tracks: Vec<_> = (self.tracks.iter())
            .map(|track| {
                let mut stream = self.stream(seat, track.id.as_str());
                let sequences = match self.version {
                    OrderVersion::Balanced => sequences(track, &mut stream),
                    OrderVersion::Unguessable => unguessable(track, &mut stream),
                };
                sequences.into_iter()
            })
            .collect();
        let most = tracks.iter().map(ExactSizeIterator::len).max().unwrap_or(0);
        let methods = self.tracks.iter().map(|t| t.method.sequences().len());
        let block = OF_EACH * methods.max().unwrap_or(1);
        let mut passes = self.stream(seat, ".passes");
        let mut planned = Vec::new();
        for pass in 0..most {
            let mut order: Vec<usize> = (0..tracks.len()).collect();
            passes.shuffle(&mut order);
            for at in order {
                let Some((intervals, easy)) = tracks[at].next() else {
                    continue;
                };
                planned.push(Planned {
                    block: whole(pass / block) + 1,
                    stimuli: Stimuli::Track {
                        track: self.tracks[at].id.clone(),
                        intervals,
                        easy,
                    },
                    repetition: whole(pass) + 1,
                });
            }
        }
        planned
    }
}

fn whole(n: usize) -> u32 {
    u32::try_from(n).unwrap_or(u32::MAX)
}

/// The intervals of each trial of a track, and whether it is an easy one.
fn sequences(track: &Planning, stream: &mut Stream) -> Vec<(Vec<Interval>, bool)> {
    let signal = track.method.sequences();
    let (catch, easy) = (track.catch, track.easy);
    let mut ruled = balanced(signal, track.ruled, stream).into_iter();
    let mut catches = balanced(track.method.catch_sequences(), catch, stream).into_iter();
    let mut easies = balanced(signal, easy, stream).into_iter();
    let mut kinds = spread(track.ruled + easy, easy, stream).into_iter();
    let is_catch = spread(track.trials(), catch, stream);
    let next = |is_catch: bool| {
        if is_catch {
            return Some((catches.next()?, false));
        }
        match kinds.next()? {
            true => Some((easies.next()?, true)),
            false => Some((ruled.next()?, false)),
        }
    };
    is_catch.into_iter().filter_map(next).collect()
}

/// The same, so that nobody can guess the right answer: see [`SLACK`].
fn unguessable(track: &Planning, stream: &mut Stream) -> Vec<(Vec<Interval>, bool)> {
    let signals = track.ruled + track.easy;
    let mut kinds = spread(signals, track.easy, stream).into_iter().peekable();
    let mut answers: Vec<Answer> = (track.method.answers().iter())
        .map(|answer| Answer::new(answer, track))
        .collect();
    let mut found = Vec::new();
    while kinds.peek().is_some() {
        for at in stretch(&answers, stream) {
            let Some(intervals) = answers[at].next(stream) else {
                continue;
            };
            if track.method.is_catch(&intervals) {
                found.push((intervals, false));
            } else if let Some(easy) = kinds.next() {
                found.push((intervals, easy));
            }
            if kinds.peek().is_none() {
                break;
            }
        }
    }
    found
}

/// A possible answer to the trials of a track.
struct Answer {
    /// How often it is the right one, compared with the others.
    weight: u64,
    /// The sequences of intervals to which it is the right answer.
    sequences: Vec<&'static [Interval]>,
    /// Those that come next.
    next: Vec<&'static [Interval]>,
}

impl Answer {
    fn new(answer: &str, track: &Planning) -> Self {
        let method = track.method;
        let all = method.sequences().iter().chain(method.catch_sequences());
        let right = all.filter(|sequence| method.correct(sequence) == Some(answer));
        let sequences: Vec<&[Interval]> = right.copied().collect();
        let is_catch = sequences.iter().any(|s| method.is_catch(s));
        Self {
            weight: match is_catch {
                true => track.catch as u64,
                false if method.catch_sequences().is_empty() => 1,
                false => (track.ruled + track.easy) as u64,
            },
            sequences,
            next: Vec::new(),
        }
    }

    /// Its next sequence: each twice, in random order, then again.
    fn next(&mut self, stream: &mut Stream) -> Option<Vec<Interval>> {
        if self.next.is_empty() {
            let each = std::iter::repeat_n(&self.sequences, OF_EACH);
            self.next = each.flatten().copied().collect();
            stream.shuffle(&mut self.next);
            self.next.reverse();
        }
        self.next.pop().map(<[Interval]>::to_vec)
    }
}

/// The right answers of a stretch, by place among `answers`: each drawn by its weight, and all of
/// them again until each occurs nearly as often as its share.
fn stretch(answers: &[Answer], stream: &mut Stream) -> Vec<usize> {
    let all: u64 = answers.iter().map(|answer| answer.weight).sum();
    loop {
        let mut counts = vec![0u64; answers.len()];
        let drawn = (0..STRETCH).map(|_| {
            let mut u = stream.below(all);
            let at = answers.iter().position(|answer| {
                let found = u < answer.weight;
                u = u.saturating_sub(answer.weight);
                found
            });
            let at = at.unwrap_or(0);
            counts[at] += 1;
            at
        });
        let drawn: Vec<usize> = drawn.collect();
        let in_balance = counts.iter().zip(answers).all(|(n, answer)| {
            (n * all).abs_diff(STRETCH as u64 * answer.weight) <= SLACK as u64 * all
        });
        if in_balance {
            return drawn;
        }
    }
}

/// `n` sequences: in each block every one equally often, in random order.
fn balanced(of: &[&[Interval]], n: usize, stream: &mut Stream) -> Vec<Vec<Interval>> {
    let mut all = Vec::with_capacity(n);
    while all.len() < n && !of.is_empty() {
        let mut block: Vec<Vec<Interval>> = (0..OF_EACH)
            .flat_map(|_| of.iter().map(|s| s.to_vec()))
            .collect();
        stream.shuffle(&mut block);
        all.extend(block);
    }
    all.truncate(n);
    all
}

/// `marked` places among `n`: one drawn in each of as many equal stretches.
fn spread(n: usize, marked: usize, stream: &mut Stream) -> Vec<bool> {
    let mut places = vec![false; n];
    for i in 0..marked {
        let (from, to) = (i * n / marked, (i + 1) * n / marked);
        let at = stream.below((to - from).max(1) as u64);
        places[from + usize::try_from(at).unwrap_or(0)] = true;
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use Interval::{Comparison as C, Standard as S};

    fn planning(method: Method, ruled: usize, catch: usize, easy: usize) -> Planning {
        Planning {
            id: PartId::new("t").unwrap(),
            method,
            ruled,
            catch,
            easy,
        }
    }

    fn stream() -> Stream {
        Stream::new(1, &["test"])
    }

    #[test]
    fn sequences_are_balanced_in_every_block() {
        let all = sequences(&planning(Method::Abx, 40, 0, 0), &mut stream());
        for block in all.chunks_exact(8) {
            for sequence in Method::Abx.sequences() {
                let n = block.iter().filter(|(s, _)| s == sequence).count();
                assert_eq!(n, 2, "{sequence:?}");
            }
        }
        assert_eq!(all.len(), 40);
    }

    #[test]
    fn catch_and_easy_trials_are_as_many_as_planned_and_spread() {
        let track = planning(Method::SameDifferent, 40, 48, 8);
        let all = sequences(&track, &mut stream());
        assert_eq!(all.len(), 96);
        let same = |half: &[(Vec<Interval>, bool)], of: Interval| {
            half.iter().filter(|(s, _)| *s == [of, of]).count()
        };
        assert_eq!((same(&all, S), same(&all, C)), (24, 24));
        assert_eq!(all.iter().filter(|(_, easy)| *easy).count(), 8);
        for half in all.chunks(48) {
            let catch = same(half, S) + same(half, C);
            assert!((22..=26).contains(&catch), "{catch}");
        }
    }

    #[test]
    fn places_are_spread_over_the_whole_length() {
        for (n, marked) in [(10, 0), (10, 10), (10, 3), (7, 2), (1, 1), (0, 0)] {
            let places = spread(n, marked, &mut stream());
            assert_eq!(places.len(), n);
            assert_eq!(
                places.iter().filter(|p| **p).count(),
                marked,
                "{n} {marked}"
            );
        }
    }
}
