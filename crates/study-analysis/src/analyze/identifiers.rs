//! Identifiers of statistics: `group/name/statistic`.
//!
//! A name from the data may hold any text. In an identifier `%`, `/` and `|` of a name
//! are written `%25`, `%2F` and `%7C`, so that no two statistics share an identifier.

use std::borrow::Cow;

/// A name as part of an identifier.
pub(super) fn escaped(name: &str) -> Cow<'_, str> {
    if name.contains(['%', '/', '|']) {
        let name = name.replace('%', "%25");
        Cow::Owned(name.replace('/', "%2F").replace('|', "%7C"))
    } else {
        Cow::Borrowed(name)
    }
}

/// The common prefix of the statistics of something with a name, `desc/a`; or with two,
/// `reference/R/a`.
pub fn group_id(group: &str, names: &[&str]) -> String {
    let mut id = group.to_owned();
    for name in names {
        id.push('/');
        id.push_str(&escaped(name));
    }
    id
}

/// The common prefix of the statistics of a pair of realizations, `posthoc/a|b`. The
/// name that sorts first comes first.
pub fn pair_id(group: &str, a: &str, b: &str) -> String {
    let (first, second) = (a.min(b), a.max(b));
    format!("{group}/{}|{}", escaped(first), escaped(second))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_with_separators_never_share_an_identifier() {
        assert_eq!(group_id("desc", &["0.9995"]), "desc/0.9995");
        assert_eq!(
            group_id("desc", &["a/subject_mean"]),
            "desc/a%2Fsubject_mean"
        );
        assert_eq!(group_id("desc", &["a%2F"]), "desc/a%252F");
        let names = ["a", "a|b", "b|c", "c"];
        let mut ids = Vec::new();
        for (i, a) in names.iter().enumerate() {
            ids.extend(names[i + 1..].iter().map(|b| pair_id("posthoc", b, a)));
        }
        ids.sort();
        ids.dedup();
        assert_eq!(ids.len(), 6, "{ids:?}");
    }
}
