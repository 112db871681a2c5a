//! The participant's copy of the consent document.

#![allow(clippy::unwrap_used)]

use crate::world::{Kept, at, protocol, real, started};
use std::fs;
use study_session::store::StudyFolder;

#[test]
fn a_copy_is_replaced_known_to_verify_and_on_the_disk_before_its_event() {
    let results = tempfile::tempdir().unwrap();
    let study = StudyFolder::open_or_create(results.path(), &Kept::new().frozen(), at(0)).unwrap();
    let mut claimed = study.claim(&real("P01")).unwrap();
    let mut journal = claimed.folder.journal().unwrap();
    journal
        .append(at(1), &started("P01", claimed.session, claimed.seat))
        .unwrap();
    for copy in ["of before a crash", "signed"] {
        claimed.folder.keep_consent(copy).unwrap();
        let path = claimed.folder.path().join("consent.txt");
        assert_eq!(fs::read_to_string(path).unwrap(), copy);
    }
    drop((journal, claimed));
    let found = study.verify(Some(&protocol())).unwrap();
    let about = found.iter().find(|f| f.place.contains("consent"));
    assert!(about.is_none(), "{found:?}");
}
