//! One or several of a list of options.

use super::{Declared, Draws, Kind, accept_if};
use crate::protocol::answer::{Answer, Refusal};
use crate::protocol::control::{Control, Pick};
use crate::protocol::keys::{Key, Kind as Type, keys};
use crate::protocol::scale::Scale;
use crate::protocol::section::Section;
use serde::Serialize;
use serde_json::{Value, json};
use study_base::diagnostic::Fault;
use study_base::text::Untrusted;

/// One or several of a list.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Choice {
    /// The options, no two alike.
    pub options: Vec<String>,
    /// Whether several can be chosen.
    pub multiple: bool,
}

impl Kind for Choice {
    fn accepts(&self, answer: &Answer, required: bool) -> Result<(), Refusal> {
        let Answer::Choice(chosen) = answer else {
            return Err(Refusal::OtherKind);
        };
        let known = chosen.iter().all(|c| self.options.contains(c));
        accept_if(known, Refusal::NotListed(self.options.len()))?;
        let once = (1..chosen.len()).all(|i| !chosen[..i].contains(&chosen[i]));
        let count = self.multiple || chosen.len() <= 1;
        accept_if(once && count, Refusal::OtherKind)?;
        accept_if(!chosen.is_empty() || !required, Refusal::NoOption)
    }

    fn scale(&self) -> Scale<'_> {
        Scale::Names {
            options: &self.options,
            multiple: self.multiple,
        }
    }

    fn control(&self) -> Control<'_> {
        Control::List {
            options: &self.options,
            pick: match self.multiple {
                true => Pick::Many,
                false => Pick::One,
            },
        }
    }

    fn texts_mut(&mut self) -> Vec<&mut String> {
        self.options.iter_mut().collect()
    }

    fn stimulus(&self) -> Value {
        json!({ "choice": self.options, "multiple": self.multiple })
    }

    fn simulate(&self, draws: &mut dyn Draws) -> Answer {
        let first = draws.pick(self.options.len());
        let mut options = Vec::new();
        for (i, option) in self.options.iter().enumerate() {
            let also = self.multiple && draws.unit() < 0.2;
            if i == first || also {
                options.push(option.clone());
            }
        }
        Answer::Choice(options)
    }
}

impl Declared for Choice {
    const WORD: &'static str = "choice";
    const MEANING: &'static str = "One or several of a list of options.";
    const KEYS: &'static [Key] = keys! {
        /// The options, no two alike. With `multiple`, none contains a `;`, which
        /// separates them in the results.
        "options": Type::Texts(1), r#"["left", "right", "both"]"#, required;
        /// Whether several can be chosen.
        "multiple": Type::Flag, "true", default("false");
    };

    fn read(section: &mut Section<'_, '_>) -> Option<Self> {
        let multiple = section.flag("multiple")?;
        let mut options: Vec<String> = Vec::new();
        for (value, option) in section.texts("options") {
            if options.iter().any(|o| o.trim() == option.trim()) {
                value.fault(Fault::error(format!(
                    "`{}` is there twice",
                    Untrusted(&option)
                )));
            }
            if multiple && option.contains(';') {
                value.fault(
                    Fault::error("an option of a multiple choice cannot contain a `;`")
                        .hint("it separates the chosen options in the results"),
                );
            }
            options.push(option);
        }
        Some(Self { options, multiple })
    }

    fn examples() -> Vec<Self> {
        let options = ["left", "right", "both"].map(str::to_owned).to_vec();
        let choice = |multiple| Self {
            options: options.clone(),
            multiple,
        };
        vec![choice(false), choice(true)]
    }
}
