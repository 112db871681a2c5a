//! Media of `[[models]]`, against the other sections.

use super::agree::at;
use super::models::PartialModel;
use super::{Content, Named};
use crate::protocol::{Entry, Medium, SessionRules};
use study_base::diagnostic::Fault;
use study_base::diagnostic::table::Document;
use study_base::text::ModelId;

/// The files of all media.
pub(super) fn files(models: &[PartialModel]) -> Vec<Named> {
    let named = |model: &PartialModel, medium: Medium| {
        Some(Named {
            place: format!("{}.{}", model.path, medium.as_str()),
            file: model.media.file(medium)?.file.clone(),
            content: Content::Media(medium),
        })
    };
    (models.iter())
        .flat_map(|model| Medium::ALL.into_iter().filter_map(move |m| named(model, m)))
        .collect()
}

/// Reports media that nobody could present, see or hear.
pub(super) fn agree(
    models: &[PartialModel],
    session: Option<&SessionRules>,
    document: &Document<'_>,
) {
    // A faulty path is reported once.
    let names = |model: &PartialModel| Medium::ALL.iter().any(|m| has(model, *m, document));
    let media = models.iter().filter(|model| !model.media.is_empty());
    for model in media.clone() {
        texts(model, document);
        duplicate(model, models, document);
    }
    for model in models.iter().filter(|model| !names(model)) {
        for (key, text) in [("alt", &model.media.alt), ("caption", &model.media.caption)] {
            if text.is_some() {
                no_effect(
                    &format!("{}.{key}", model.path),
                    "it has no media",
                    document,
                );
            }
        }
    }
    let Some(first) = media.clone().next() else {
        let place = "trial.media_within_ms";
        if document.span_of(place).is_some() && !models.iter().any(names) {
            no_effect(place, "no realization has media", document);
        }
        return;
    };
    if session.is_some_and(|session| session.entry == Entry::Experimenter) {
        let medium = first.media.files().next();
        let place = medium.map(|(medium, _)| at(document, &first.path, medium.as_str()));
        document.fault(
            Fault::error("only the participant's page shows and plays media, and in this study the experimenter types the answers")
                .at(place.flatten())
                .hint("leave `entry` out of [session], or the media out of [[models]]"),
        );
    }
}

/// Whether a realization has the key of a medium, faulty or not.
fn has(model: &PartialModel, medium: Medium, document: &Document<'_>) -> bool {
    let place = format!("{}.{}", model.path, medium.as_str());
    document.span_of(&place).is_some()
}

/// A screen reader has to know what is seen.
fn texts(model: &PartialModel, document: &Document<'_>) {
    let visible = [Medium::Picture, Medium::Video];
    let seen = (visible.into_iter()).find(|medium| model.media.file(*medium).is_some());
    match (seen, &model.media.alt) {
        (Some(medium), None) => document.fault(
            Fault::error(format!(
                "`{}` has a {} and no `alt`",
                model.path,
                medium.as_str()
            ))
            .at(at(document, &model.path, medium.as_str()))
            .hint("alt = \"what is seen on it\" is read to people who do not see it"),
        ),
        (None, Some(_)) if !visible.iter().any(|m| has(model, *m, document)) => {
            no_effect(&format!("{}.alt", model.path), "nothing is seen", document);
        }
        _ => {}
    }
}

/// A hidden duplicate that looks or sounds otherwise is none.
fn duplicate(model: &PartialModel, models: &[PartialModel], document: &Document<'_>) {
    let Some((of, original)) = original(model, models) else {
        return;
    };
    if original.media != model.media {
        let medium = model.media.files().next().map(|(medium, _)| medium);
        let place = medium.and_then(|medium| at(document, &model.path, medium.as_str()));
        document.fault(
            Fault::error(format!("a duplicate of `{of}` has to have the same media"))
                .at(place)
                .hint("leave its media and their texts out: it has those of the original"),
        );
    }
}

fn original<'m>(
    model: &'m PartialModel,
    models: &'m [PartialModel],
) -> Option<(&'m ModelId, &'m PartialModel)> {
    let of = model.duplicate_of.as_ref()?;
    let mut others = models.iter();
    Some((of, others.find(|other| other.id.as_ref() == Some(of))?))
}

/// Gives hidden duplicates the media of their originals.
pub(super) fn fill_duplicates(models: &mut [PartialModel]) {
    for i in 0..models.len() {
        let media = original(&models[i], models).map(|(_, original)| original.media.clone());
        if let Some(media) = media {
            models[i].media = media;
        }
    }
}

fn no_effect(place: &str, why: &str, document: &Document<'_>) {
    let what = format!("`{place}` has no effect: {why}");
    document.fault(Fault::error(what).at(document.span_of(place)));
}
