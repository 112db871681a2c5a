//! Who made a study, and under which terms its data are given: `[study]` in the forms of
//! the formats.

use study_plan::protocol::Study;

/// Name and ORCID of an author: `A. Researcher (0000-0002-1825-0097)`.
pub(super) fn author(text: &str) -> (&str, Option<&str>) {
    let is_orcid = |id: &str| {
        let groups: Vec<&str> = id.split('-').collect();
        let digit = |(i, c): (usize, char)| c.is_ascii_digit() || (i == 3 && c == 'X');
        groups.len() == 4
            && groups
                .iter()
                .all(|g| g.len() == 4 && g.chars().enumerate().all(digit))
    };
    let found = text.trim_end().strip_suffix(')').and_then(|rest| {
        let (name, id) = rest.rsplit_once('(')?;
        is_orcid(id).then_some((name.trim_end(), id))
    });
    found.map_or((text, None), |(name, id)| (name, Some(id)))
}

/// The address of an ORCID.
pub(super) fn orcid(id: &str) -> String {
    format!("https://orcid.org/{id}")
}

/// The license as an SPDX identifier, if it can be one.
pub(super) fn spdx(study: &Study) -> Option<&str> {
    study.license.as_deref().and_then(study_base::license::spdx)
}

/// The DOI without a prefix, such as `10.1000/182`.
pub(super) fn doi(study: &Study) -> Option<&str> {
    let given = study.doi.as_deref()?.trim();
    let prefixes = ["https://doi.org/", "http://doi.org/", "doi:"];
    let bare = prefixes.iter().find_map(|p| given.strip_prefix(p));
    let bare = bare.unwrap_or(given).trim();
    let (registrant, suffix) = bare.strip_prefix("10.")?.split_once('/')?;
    let good = registrant.chars().all(|c| c.is_ascii_digit() || c == '.')
        && !registrant.is_empty()
        && !suffix.is_empty()
        && suffix.chars().all(|c| c.is_ascii_graphic());
    good.then_some(bare)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_author_may_end_with_an_orcid() {
        let id = "0000-0002-1825-0097";
        assert_eq!(author("A. B. (0000-0002-1825-0097)"), ("A. B.", Some(id)));
        for other in [
            "A. B.",
            "A. B. (lab)",
            "A (0000-0002-1825-00970)",
            ")",
            "(-)",
        ] {
            assert_eq!(author(other), (other, None));
        }
    }

    #[test]
    fn a_doi_is_written_without_its_prefix() {
        let mut study = Study {
            id: "a".to_owned(),
            title: "A".to_owned(),
            seed: 1,
            authors: Vec::new(),
            license: None,
            ethics: None,
            contact: None,
            funding: None,
            doi: None,
        };
        for given in [
            "10.1000/182",
            "doi:10.1000/182",
            "https://doi.org/10.1000/182",
        ] {
            study.doi = Some(given.to_owned());
            assert_eq!(doi(&study), Some("10.1000/182"), "{given}");
        }
        for bad in ["", "10.", "10./x", "see the paper", "10.1000/a b", "10.x/1"] {
            study.doi = Some(bad.to_owned());
            assert_eq!(doi(&study), None, "{bad}");
        }
        study.license = Some("CC-BY-4.0".to_owned());
        assert_eq!(spdx(&study), Some("CC-BY-4.0"));
        study.license = Some("ask us".to_owned());
        assert_eq!(spdx(&study), None);
    }
}
