//! Free text.

use super::{Declared, Draws, Kind, accept_if};
use crate::protocol::answer::{Answer, MAX_TEXT_BYTES, Refusal};
use crate::protocol::control::Control;
use crate::protocol::keys::Key;
use crate::protocol::scale::Scale;
use crate::protocol::section::Section;
use serde::Serialize;
use serde_json::{Value, json};

/// Free text.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Text;

impl Kind for Text {
    fn accepts(&self, answer: &Answer, required: bool) -> Result<(), Refusal> {
        let Answer::Text(text) = answer else {
            return Err(Refusal::OtherKind);
        };
        accept_if(!text.trim().is_empty() || !required, Refusal::NoText)?;
        accept_if(text.len() <= MAX_TEXT_BYTES, Refusal::TooLong)
    }

    fn scale(&self) -> Scale<'_> {
        Scale::Free
    }

    fn control(&self) -> Control<'_> {
        Control::Text
    }

    fn texts_mut(&mut self) -> Vec<&mut String> {
        Vec::new()
    }

    fn stimulus(&self) -> Value {
        json!("text")
    }

    fn simulate(&self, draws: &mut dyn Draws) -> Answer {
        Answer::Text(draws.comment())
    }
}

impl Declared for Text {
    const WORD: &'static str = "text";
    const MEANING: &'static str = "Free text.";
    const KEYS: &'static [Key] = &[];

    fn read(_section: &mut Section<'_, '_>) -> Option<Self> {
        Some(Self)
    }

    fn examples() -> Vec<Self> {
        vec![Self]
    }
}
