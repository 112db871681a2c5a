use super::*;

/// The declarations of every table.
fn tables() -> [Vec<Column>; 6] {
    [
        IntervalColumn::ALL.iter().map(|c| c.column()).collect(),
        RatingColumn::ALL.iter().map(|c| c.column()).collect(),
        AttemptColumn::ALL.iter().map(|c| c.column()).collect(),
        ParticipantColumn::ALL.iter().map(|c| c.column()).collect(),
        SampleColumn::ALL.iter().map(|c| c.column()).collect(),
        UsedColumn::ALL.iter().map(|c| c.column()).collect(),
    ]
}

#[test]
fn every_column_has_a_name_of_its_own_and_a_meaning() {
    for columns in tables() {
        for (i, column) in columns.iter().enumerate() {
            let name = column.name;
            assert!(!column.meaning.is_empty(), "{name}");
            assert!(column.empty.is_none_or(|when| !when.is_empty()), "{name}");
            assert!(columns[..i].iter().all(|c| c.name != name), "{name}");
            if let Kind::Level(levels) = column.kind {
                assert!(levels.len() > 1, "{name}");
                assert!(
                    levels.iter().all(|(l, m)| !l.is_empty() && !m.is_empty()),
                    "{name}"
                );
            }
        }
    }
}

#[test]
fn a_name_ends_in_its_unit() {
    let units = [
        ("_mm", "mm"),
        ("_ms", "ms"),
        ("_mm_s", "mm/s"),
        ("_per_s", "1/s"),
        ("_s", "s"),
        ("_h", "h"),
        ("_j", "J"),
        ("_n", "N"),
    ];
    for column in tables().concat() {
        let of_name = units.iter().find(|(end, _)| {
            let longer = |other: &str| other.len() > end.len() && column.name.ends_with(other);
            column.name.ends_with(end) && !units.iter().any(|(other, _)| longer(other))
        });
        assert_eq!(
            column.unit,
            of_name.map(|(_, unit)| *unit),
            "{}",
            column.name
        );
    }
}

#[test]
fn names_of_fixed_columns_are_reserved_in_any_case() {
    assert!(is_ratings_column("Status") && is_ratings_column("vaf"));
    assert!(is_participants_column("reason") && !is_participants_column_of_parts("vaf"));
    // Questions of earlier protocols may have these names.
    assert!(is_participants_column_of_parts("Group") && !is_participants_column("group"));
    assert!(is_parts_column("Level") && !is_ratings_column("level"));
    assert!(!is_ratings_column("realism") && !is_ratings_column("one for each question"));
}
