//! How a question is answered: all that a channel has to know of it.

use super::answer::{Answer, Given, Refusal, digits, number, tidy};
use std::collections::BTreeMap;

/// What a person uses to answer a question. Terminal, lines and page draw these and
/// nothing else.
#[derive(Debug, Clone, PartialEq)]
pub enum Control<'a> {
    /// One box for each whole number. Where they do not fit, the number is typed.
    Boxes {
        /// Smallest number.
        from: i64,
        /// Largest number.
        to: i64,
        /// Labels of some of the numbers.
        labels: &'a BTreeMap<i64, String>,
    },
    /// A line with a marker that is not preset.
    Track {
        /// Left end.
        from: f64,
        /// Right end.
        to: f64,
        /// How far a key moves the marker.
        step: f64,
        /// Labels of some numbers.
        labels: Vec<(f64, &'a str)>,
    },
    /// A list of options.
    List {
        /// The options.
        options: &'a [String],
        /// How many are chosen.
        pick: Pick,
    },
    /// A number that is typed.
    Digits {
        /// Its unit.
        unit: Option<&'a str>,
        /// Smallest that is accepted.
        min: Option<f64>,
        /// Largest that is accepted.
        max: Option<f64>,
        /// Only larger numbers are accepted.
        above: Option<f64>,
    },
    /// A text that is typed.
    Text,
}

/// How many options of a list are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pick {
    /// One.
    One,
    /// Any number.
    Many,
}

impl Control<'_> {
    /// What is refused if nothing is entered where an answer is required.
    pub fn needed(&self) -> Refusal {
        match *self {
            Self::Boxes { from, to, .. } => Refusal::NoNumber(from as f64, to as f64),
            Self::Track { from, to, .. } => Refusal::NoMark(from, to),
            Self::List { .. } => Refusal::NoOption,
            Self::Digits { .. } => Refusal::NothingTyped,
            Self::Text => Refusal::NoText,
        }
    }

    /// The answer that is recorded if nothing is entered, so that the question is not asked
    /// again; `None` for numbers.
    pub fn empty(&self) -> Option<Answer> {
        match self {
            Self::List { .. } => Some(Answer::Choice(Vec::new())),
            Self::Text => Some(Answer::Text(String::new())),
            Self::Boxes { .. } | Self::Track { .. } | Self::Digits { .. } => None,
        }
    }

    /// What is entered, as an answer. Whether the question accepts it is not checked.
    ///
    /// # Errors
    /// [`Refusal`] if it cannot be read.
    pub(super) fn read(&self, given: &Given) -> Result<Answer, Refusal> {
        match (self, given) {
            (Self::Boxes { from, to, .. }, Given::Typed(typed)) => {
                let off_scale = Refusal::OffScale(*from as f64, *to as f64);
                let number = digits(typed).parse().map_err(|_| off_scale)?;
                Ok(Answer::Rating(number))
            }
            (Self::Track { .. } | Self::Digits { .. }, Given::Typed(typed)) => {
                Ok(Answer::Number(number(typed).ok_or(Refusal::NotANumber)?))
            }
            (Self::List { options, pick }, given) => {
                let unlisted = Refusal::NotListed(options.len());
                let mut chosen = match given {
                    Given::Typed(typed) => listed(typed).ok_or(unlisted)?,
                    Given::Chosen(chosen) => chosen.clone(),
                };
                pick.arrange(&mut chosen);
                let option = |at: usize| options.get(at).cloned().ok_or(unlisted);
                let chosen: Result<_, _> = chosen.into_iter().map(option).collect();
                Ok(Answer::Choice(chosen?))
            }
            (Self::Text, Given::Typed(typed)) => Ok(Answer::Text(tidy(typed))),
            (_, Given::Chosen(_)) => Err(Refusal::OtherKind),
        }
    }

    /// An answer as it would be entered; `None` if it is of another kind.
    pub fn given(&self, answer: &Answer) -> Option<Given> {
        match (self, answer) {
            (Self::List { options, .. }, Answer::Choice(chosen)) => {
                let at = |option| options.iter().position(|o| o == option);
                Some(Given::Chosen(chosen.iter().filter_map(at).collect()))
            }
            (Self::Boxes { .. }, Answer::Rating(n)) => Some(Given::Typed(n.to_string())),
            (Self::Track { .. } | Self::Digits { .. }, Answer::Number(n)) => {
                Some(Given::Typed(n.to_string()))
            }
            (Self::Text, Answer::Text(text)) => Some(Given::Typed(text.clone())),
            _ => None,
        }
    }
}

impl Pick {
    /// Puts chosen options in the order of the list, each once.
    fn arrange(self, chosen: &mut Vec<usize>) {
        match self {
            Self::One | Self::Many => {
                chosen.sort_unstable();
                chosen.dedup();
            }
        }
    }
}

/// The options with the typed numbers, which count from 1.
fn listed(typed: &str) -> Option<Vec<usize>> {
    digits(typed)
        .split(|c: char| c.is_whitespace() || ",;".contains(c))
        .filter(|number| !number.is_empty())
        .map(|number| number.parse::<usize>().ok()?.checked_sub(1))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(pick: Pick, given: Given) -> Result<Answer, Refusal> {
        let options = ["a", "b", "c"].map(str::to_owned);
        let options = &options;
        Control::List { options, pick }.read(&given)
    }

    fn choice(options: &[&str]) -> Result<Answer, Refusal> {
        Ok(Answer::Choice(
            options.iter().map(|o| (*o).to_owned()).collect(),
        ))
    }

    #[test]
    fn chosen_options_are_in_the_order_of_the_list_each_once() {
        for pick in [Pick::One, Pick::Many] {
            assert_eq!(read(pick, Given::Chosen(vec![2, 0])), choice(&["a", "c"]));
            for typed in ["3 1", "3,1,3", " 3 ; 1 ", "٣ ١"] {
                let given = Given::Typed(typed.to_owned());
                assert_eq!(read(pick, given), choice(&["a", "c"]), "{typed}");
            }
            assert_eq!(read(pick, Given::Typed("1 1".to_owned())), choice(&["a"]));
        }
    }

    #[test]
    fn what_is_not_in_the_list_is_refused() {
        let unlisted = Err(Refusal::NotListed(3));
        assert_eq!(read(Pick::Many, Given::Chosen(vec![0, 3])), unlisted);
        for typed in ["0", "4", "1 4", "a", "-1"] {
            assert_eq!(read(Pick::One, Given::Typed(typed.to_owned())), unlisted);
        }
    }

    #[test]
    fn numbers_are_typed_with_any_keyboard() {
        let labels = BTreeMap::new();
        let (from, to, labels) = (1, 7, &labels);
        let boxes = Control::Boxes { from, to, labels };
        let typed = |text: &str| boxes.read(&Given::Typed(text.to_owned()));
        assert_eq!(typed(" ５"), Ok(Answer::Rating(5)));
        assert_eq!(typed("5.5"), Err(Refusal::OffScale(1.0, 7.0)));
        let chosen = boxes.read(&Given::Chosen(vec![0]));
        assert_eq!(chosen, Err(Refusal::OtherKind));
    }
}
