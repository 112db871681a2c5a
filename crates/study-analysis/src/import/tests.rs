use super::*;

fn grid(name: &str, text: &str) -> Grid {
    Grid::read(name, text.as_bytes()).unwrap()
}

fn mapping(kind: &str, columns: &[(&str, &str)]) -> Mapping {
    let mut mapping = Mapping::new(kind);
    for (field, column) in columns {
        mapping.set(field, column).unwrap();
    }
    mapping
}

fn imported(text: &str, mapping: Mapping) -> Imported {
    import(&[grid("t.csv", text)], mapping).unwrap()
}

fn refused(text: &str, mapping: Mapping) -> String {
    let grid = Grid::read("t.csv", text.as_bytes());
    let imported = grid.and_then(|grid| import(&[grid], mapping));
    imported.unwrap_err().to_string()
}

#[test]
fn columns_are_found_by_the_names_that_programs_give_them() {
    let psychopy = "texture,trials.thisRepN,slider.response,slider.rt,participant,date,expName,\n\
                    ,,,,7,2024-05-17,rating,\nsoft,0,3.0,1.2,7,2024-05-17,rating,\ncrisp,0,,,7,2024-05-17,rating,\n";
    let found = imported(psychopy, mapping("ratings", &[("model", "texture")]));
    assert_eq!(
        found.table,
        "subject,model,rating,trial_index\n7,soft,3.0,1\n7,crisp,,2\n"
    );
    let taken = &found.files[0];
    assert_eq!(taken.program, Some(Program::PsychoPy));
    assert_eq!(
        (taken.rows, taken.taken, taken.unrated, taken.others),
        (3, 2, 1, 1)
    );

    let opensesame = "\"subject_nr\",\"level\",\"correct\",\"response\"\n\"3\",\"0.5\",\"1\",\"left\"\n\"3\",\"0.5\",\"undefined\",\"None\"\n";
    let found = imported(opensesame, mapping("2ifc", &[]));
    assert_eq!(found.table, "participant,level,correct\n3,0.5,1\n");

    let jspsych = r#"[{"trial_type":"x","trial_index":0,"time_elapsed":4,"subject":"A"},
        {"trial_type":"s","trial_index":1,"time_elapsed":9,"subject":"A","m":"none","response":{"Q0":4}}]"#;
    let found = imported(
        jspsych,
        mapping("ratings", &[("model", "m"), ("rating", "response.Q0")]),
    );
    assert_eq!(
        found.table,
        "subject,model,rating,trial_index\nA,none,4,1\n"
    );
}

#[test]
fn rows_and_words_are_those_that_were_stated() {
    let table = "participant,task,first,second,key\nP1,a,x,y,f\nP1,b,x,y,f\nP1,a,y,x,j\n";
    let mut wanted = mapping("pairs", &[("answer", "key")]);
    wanted.rows.insert("task".to_owned(), vec!["a".to_owned()]);
    let words = [("f", "first"), ("j", "second")];
    let words = words.map(|(theirs, ours)| (theirs.to_owned(), ours.to_owned()));
    wanted.words.insert("answer".to_owned(), words.into());
    let found = imported(table, wanted.clone());
    assert_eq!(
        found.table,
        "participant,first,second,answer\nP1,x,y,first\nP1,y,x,second\n"
    );
    assert_eq!(found.files[0].filtered, 1);
    // What a key means was not said: the line is that of the file.
    wanted.words.clear();
    let error = refused(table, wanted);
    assert!(
        error.contains("t.csv:2: answer is `f`, expected first, second, tie"),
        "{error}"
    );
    assert!(error.ends_with("(from the column `key`)"), "{error}");
}

#[test]
fn a_wide_table_has_a_row_for_each_rating() {
    let mut wanted = mapping("ratings", &[]);
    wanted.wide = vec!["soft".to_owned(), "crisp".to_owned()];
    let found = imported("Participant;age;soft;crisp\n1;30;2,5;6\n2;31;;7\n", wanted);
    assert_eq!(
        found.table,
        "subject,model,rating\n1,soft,2.5\n1,crisp,6\n2,crisp,7\n"
    );
    assert_eq!((found.participants, found.files[0].others), (2, 1));

    let mut wanted = mapping("ratings", &[("subject", "id")]);
    wanted.wide = vec!["r_{model}_{repetition}".to_owned()];
    let found = imported(
        "id\tr_very_soft_1\tr_very_soft_2\tr_note\n1\t3\t4\tx\n",
        wanted.clone(),
    );
    assert_eq!(
        found.table,
        "subject,model,rating,repetition\n1,very_soft,3,1\n1,very_soft,4,2\n"
    );
    wanted.wide = vec!["q_{model}".to_owned()];
    assert!(refused("id,r_soft\n1,2\n", wanted).contains("no column is named like `q_{model}`"));
}

#[test]
fn factors_are_kept_and_name_the_realization() {
    let mut wanted = mapping("ratings", &[]);
    wanted.keep = vec!["friction".to_owned(), "detent".to_owned()];
    let found = imported(
        "subject,friction,detent,rating\nP1,low,crisp,4\nP1,high,crisp,5\n",
        wanted,
    );
    assert_eq!(
        found.table,
        "subject,model,rating,friction,detent\nP1,\"low, crisp\",4,low,crisp\nP1,\"high, crisp\",5,high,crisp\n"
    );
}

#[test]
fn several_files_are_one_experiment() {
    let files = ["p1.csv", "p2.csv"].map(|name| grid(name, "texture,rating\nsoft,3\ncrisp,5\n"));
    let by_file = mapping(
        "ratings",
        &[
            ("model", "texture"),
            ("subject", "@file"),
            ("trial_index", "@order"),
        ],
    );
    let found = import(&files, by_file).unwrap();
    assert_eq!(
        found.table,
        "subject,model,rating,trial_index\np1,soft,3,1\np1,crisp,5,2\np2,soft,3,1\np2,crisp,5,2\n"
    );
    assert!(found.shared.is_empty());
    let files = ["a.csv", "b.csv"].map(|name| grid(name, "participant,texture,rating\n1,soft,3\n"));
    let found = import(&files, mapping("ratings", &[("model", "texture")])).unwrap();
    let shared = ("1".to_owned(), "a.csv".to_owned(), "b.csv".to_owned());
    assert_eq!(found.shared, [shared]);
}

#[test]
fn what_is_wrong_says_where_and_which_columns_there_are() {
    let model = || mapping("ratings", &[("model", "texture")]);
    for (text, wanted, said) in [
        (
            "participant,texture,grade\n1,soft,3\n",
            model(),
            "which column has the rating? No column is named as usual; the columns are participant, texture, grade",
        ),
        (
            "texture,rating\nsoft,3\n",
            model(),
            "which column has the participant?",
        ),
        (
            "subject,textures,rating\n1,soft,3\n",
            model(),
            "there is no column `texture` (did you mean `textures`?); the columns are subject, textures, rating",
        ),
        (
            "subject,texture,rating\n1,soft,3\n2,soft,good\n",
            model(),
            "t.csv, line 3: `good` in column `rating` is not a finite number (from the column `rating`)",
        ),
        (
            "subject,texture,rating\n1,soft,3,4\n",
            model(),
            "line 2: 4 cells, but the header has 3",
        ),
        (
            "subject,texture,rating,rating\n1,soft,3,4\n",
            model(),
            "two columns are named `rating`",
        ),
        ("subject,texture,rating\n", model(), "there are no rows"),
        (
            "[{\"a\": 1}, 2]",
            model(),
            "it begins like JSON, but is no list of trials",
        ),
        (
            "subject,texture,rating\n1,,3\n",
            model(),
            "none of 1 rows is a trial",
        ),
        (
            "participant,level\n1,3\n",
            mapping("2ifc", &[]),
            "which column has the answer?",
        ),
    ] {
        let error = refused(text, wanted);
        assert!(error.contains(said), "{error}");
    }
    let error = Grid::read("t.csv", b"\xff\xfea\0b\0")
        .unwrap_err()
        .to_string();
    assert!(error.contains("not UTF-8"), "{error}");
    let error = Mapping::new("pairs")
        .set("model", "x")
        .unwrap_err()
        .to_string();
    assert_eq!(
        error,
        "a table of pairs has no `model`; it has participant, first, second, answer"
    );
}

#[test]
fn the_line_is_that_of_the_file() {
    for (table, line) in [
        ("subject,model,rating\n1,a,3\n1,b,x\n", 3),
        ("subject,model,rating\r\n1,a,3\r\n1,b,x\r\n", 3),
        ("subject,model,rating\r\n1,a,3\r\n\r\n1,b,x\r\n", 4),
        (
            "subject,model,rating,why\n1,a,3,\"so\nand so\"\n\n1,b,x,\n",
            5,
        ),
    ] {
        let error = refused(table, mapping("ratings", &[]));
        assert!(
            error.contains(&format!("t.csv, line {line}: `x`")),
            "{error}"
        );
    }
}

#[test]
fn a_rating_twice_is_named_with_both_lines() {
    let table = "subject,model,rating,repetition\nP1,a,3,1\nP1,,,\nP1,a,4,1\n";
    let error = refused(table, mapping("ratings", &[]));
    assert!(
        error.contains("t.csv, line 4") && error.contains("already on line 2"),
        "{error}"
    );
}
