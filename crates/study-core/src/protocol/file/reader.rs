//! What every section of a protocol file is read with: text that is not too
//! long, numbers that are numbers, keys that have to be there.

use study_base::diagnostic::Fault;
use study_base::diagnostic::table::{Document, Table, Value};
use study_base::limits::Limit;
use study_base::text::{ModelId, QuestionId, Untrusted};

/// Longest text of one key, bytes.
pub(super) const MAX_FIELD_BYTES: usize = 64 * 1024;

/// The document, and whether its syntax is broken: then keys may have been lost,
/// and nothing is said of what is missing.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reader<'d, 't> {
    pub(super) document: &'d Document<'t>,
    pub(super) broken: bool,
}

impl<'d, 't> Reader<'d, 't> {
    /// A section that has to be there.
    pub(super) fn section(
        &self,
        root: &mut Table<'d, 't>,
        name: &str,
        hint: &str,
    ) -> Option<Table<'d, 't>> {
        let value = root.value(name);
        if value.is_none() && !self.broken {
            self.document
                .fault(Fault::error(format!("the file has no [{name}]")).hint(hint));
        }
        value?.table()
    }

    /// A key that has to be there.
    pub(super) fn need(
        &self,
        table: &mut Table<'d, 't>,
        key: &str,
        hint: &str,
    ) -> Option<Value<'d, 't>> {
        let value = table.value(key);
        if value.is_none() && !self.broken {
            let place = table.path();
            table.fault_at(
                key,
                Fault::error(format!("[{place}] has no `{key}`")).hint(hint),
            );
        }
        value
    }

    /// Text that may be absent, but not empty.
    pub(super) fn text(&self, table: &mut Table<'d, 't>, key: &str) -> Option<String> {
        prose(&table.value(key)?)
    }

    /// Text that has to be there.
    pub(super) fn need_text(
        &self,
        table: &mut Table<'d, 't>,
        key: &str,
        hint: &str,
    ) -> Option<String> {
        prose(&self.need(table, key, hint)?)
    }

    /// A whole number from 1 up.
    pub(super) fn count(&self, table: &mut Table<'d, 't>, key: &str) -> Option<u32> {
        count(&table.value(key)?)
    }

    /// A whole number from 1 up that has to be there.
    pub(super) fn need_count(
        &self,
        table: &mut Table<'d, 't>,
        key: &str,
        hint: &str,
    ) -> Option<u32> {
        count(&self.need(table, key, hint)?)
    }

    /// A finite number.
    pub(super) fn number(&self, table: &mut Table<'d, 't>, key: &str) -> Option<f64> {
        finite(&table.value(key)?)
    }

    /// A finite number from 0 up, such as a duration.
    pub(super) fn duration(&self, table: &mut Table<'d, 't>, key: &str) -> Option<f64> {
        duration(&table.value(key)?)
    }

    /// A limit that has to be there.
    pub(super) fn need_limit(
        &self,
        table: &mut Table<'d, 't>,
        key: &str,
        hint: &str,
    ) -> Option<Limit> {
        let value = self.need(table, key, hint)?;
        let limit = Limit::new(value.f64()?);
        if let Err(bad) = limit {
            value.fault(Fault::error(format!("`{}`: {bad}", value.path())));
        }
        limit.ok()
    }
}

/// Text, not empty and not longer than [`MAX_FIELD_BYTES`].
pub(super) fn prose(value: &Value<'_, '_>) -> Option<String> {
    let text = value.text()?;
    if text.len() > MAX_FIELD_BYTES {
        value.fault(Fault::error(format!(
            "`{}` is {} bytes long, more than {MAX_FIELD_BYTES}",
            value.path(),
            text.len()
        )));
        return None;
    }
    if text.trim().is_empty() {
        value.fault(
            Fault::error(format!("`{}` is empty", value.path()))
                .hint("say something or leave the key out"),
        );
        return None;
    }
    Some(text)
}

/// A whole number from 1 up.
pub(super) fn count(value: &Value<'_, '_>) -> Option<u32> {
    let number = value.u32()?;
    if number == 0 {
        value.fault(Fault::error(format!(
            "`{}` has to be at least 1",
            value.path()
        )));
        return None;
    }
    Some(number)
}

/// A number that is neither NaN nor infinite.
pub(super) fn finite(value: &Value<'_, '_>) -> Option<f64> {
    let number = value.f64()?;
    if !number.is_finite() {
        value.fault(Fault::error(format!(
            "`{}` has to be a finite number, not {number}",
            value.path()
        )));
        return None;
    }
    Some(number)
}

/// A finite number from 0 up.
pub(super) fn duration(value: &Value<'_, '_>) -> Option<f64> {
    let number = finite(value)?;
    if number < 0.0 {
        value.fault(Fault::error(format!(
            "`{}` cannot be below 0",
            value.path()
        )));
        return None;
    }
    Some(number)
}

/// The id of a realization.
pub(super) fn model_id(value: &Value<'_, '_>) -> Option<ModelId> {
    let id = ModelId::new(value.text()?);
    if let Err(bad) = &id {
        value.fault(Fault::error(bad.to_string()));
    }
    id.ok()
}

/// The id of a question.
pub(super) fn question_id(value: &Value<'_, '_>) -> Option<QuestionId> {
    let id = QuestionId::new(value.text()?);
    if let Err(bad) = &id {
        value.fault(Fault::error(bad.to_string()));
    }
    id.ok()
}

/// A path of a file beside or below the protocol, with `/` between folders. It
/// stays inside the protocol's folder, so that a study can be copied as a whole.
pub(super) fn inner_path(value: &Value<'_, '_>) -> Option<String> {
    let path = prose(value)?;
    let outside = path.split('/').any(|part| matches!(part, "" | "." | ".."));
    let foreign = path.contains(['\\', ':']) || path.contains(study_base::text::is_unsafe);
    if outside || foreign {
        value.fault(
            Fault::error(format!(
                "`{}` cannot be `{}`",
                value.path(),
                Untrusted(&path)
            ))
            .label("has to stay inside the protocol's folder")
            .hint("copy the file into the protocol's folder and write its path with `/`, such as `models/a.toml`"),
        );
        return None;
    }
    Some(path)
}
