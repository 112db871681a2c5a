use super::time::{rate_of, seconds_of};
use super::*;
use crate::recording;

const TABLE: &str = "Maximum,192.1,@,No.3,,,,,,\nNumber of NG,0,,,,,,,,\n\
    No.,Force,Unit,Displacement,Unit,Judge,Position,Time,Date,\n\
    1,-0.1,gf,0.000,mm,OK,--,11:59:59 AM,7/3/2025,\n\
    2,10,gf,0.500,mm,OK,--,12:00:00 PM,7/3/2025,\n\
    3,20.0,gf,1.000,mm,OK,--,12:00:00 PM,7/3/2025,\n\
    4,5.0,gf,0.500,mm,OK,--,12:00:01 PM,7/3/2025,\n\
    5,0.0,gf,0.000,mm,OK,--,12:00:01 PM,7/3/2025,\n";

const FINE: &str = "MAX FORCE = 192.4,4.275\nUNIT = N,mm\nDATA COUNT = 3,\n\
    RECORDING RATE = 0.0005,\nMARK POINT ON = ---,---\n0.0,0.000\n1.5,1.000\n0.5,0.100\n";

const TIDY: &str =
    "force,displacement,judge,name\n0,0,0,A switch\n100,1,0,A switch\n50,0.1,0,A switch\n";

fn message(text: &str) -> String {
    read(text).unwrap_err().to_string()
}

#[test]
fn a_table_has_units_in_its_rows_and_times_in_whole_seconds() {
    let curve = read(TABLE).unwrap();
    assert_eq!(curve.layout, Layout::Table);
    assert_eq!(curve.x_mm, [0.0, 0.5, 1.0, 0.5, 0.0]);
    // 1 gf = 9.80665 mN by definition
    assert!((curve.f_n[2] - 0.196133).abs() < 1e-12);
    // two rows in the second that is whole
    assert_eq!(curve.rate_hz, Some(2.0));
}

#[test]
fn a_fine_file_has_a_rate_and_a_count() {
    let curve = read(FINE).unwrap();
    assert_eq!(curve.layout, Layout::HighResolution);
    assert_eq!(curve.f_n, [0.0, 1.5, 0.5]);
    assert_eq!(curve.rate_hz, Some(2000.0));
}

#[test]
fn tidy_columns_stand_in_any_order_with_units_in_their_names() {
    let curve = read(TIDY).unwrap();
    assert_eq!((curve.layout, curve.rate_hz), (Layout::Tidy, None));
    assert_eq!(curve.target.as_deref(), Some("A switch"));
    assert!((curve.f_n[1] - 0.980665).abs() < 1e-12);
    let other = read("Displacement (um);Force [mN]\n0;0\n1000,5;900\n0;1\n").unwrap();
    assert_eq!(other.x_mm, [0.0, 1.0005, 0.0]);
    assert!((other.f_n[1] - 0.9).abs() < 1e-12);
    assert_eq!(other.assumed, [""; 0]);
}

/// A column of newtons that is called `force` is read as gf: a hundredth of the force, and nobody would see it.
#[test]
fn a_unit_that_nobody_stated_is_told() {
    assert_eq!(read(FINE).unwrap().assumed, [""; 0]);
    let bare = read("force,displacement\n0,0\n0.6,1\n0.1,0\n").unwrap();
    assert_eq!(bare.assumed, ["force in gf", "displacement in mm"]);
    let half = read("force_n,displacement\n0,0\n0.6,1\n0.1,0\n").unwrap();
    assert_eq!(half.assumed, ["displacement in mm"]);
}

#[test]
fn a_day_may_end_during_a_measurement() {
    assert_eq!(seconds_of("12:00:01 AM"), Some(1.0));
    assert_eq!(seconds_of("12:29:11 pm"), Some(44_951.0));
    assert_eq!(seconds_of("23:59:59"), Some(86_399.0));
    assert_eq!(
        rate_of(&[86_398.0, 86_399.0, 86_399.0, 0.0, 0.0]),
        Some(2.0)
    );
    assert_eq!(rate_of(&[5.0, 5.0, 5.0]), None);
}

#[test]
fn curves_become_one_recording_whose_header_says_where_they_are_from() {
    let (first, second) = (read(TIDY).unwrap(), read(FINE).unwrap());
    let source = |curve, file, sha256| Source {
        curve,
        file,
        sha256,
    };
    let sources = [
        source(&first, "a.csv", "aa"),
        source(&second, "b.csv", "bb"),
    ];
    let stated = Stated {
        credit: Some("A lab"),
        file_names: true,
        ..Stated::default()
    };
    let bytes = join(&sources, stated);
    let recording = recording::read("r", bytes.as_slice()).unwrap();
    assert_eq!(
        recording.header,
        [
            "measured force curve: A switch; A lab",
            "target: A switch",
            "credit: A lab",
            "quasi-static: the file has no time; 10 rows a second are assumed, and bounds of mass and damping rest on that",
            "resolution: x 1.000e-1 mm, F 4.903e-1 N",
            "source: a.csv, sha256 aa; columns of displacement and force, 3 rows from 0.000 s",
            "source: b.csv, sha256 bb; high-resolution file of a force tester, 3 rows from 0.300 s",
        ]
    );
    assert!(recording.quasi_static().is_some());
    assert_eq!(recording.t_s, [0.0, 0.1, 0.2, 0.3, 0.3005, 0.301]);
    // differences within a curve: (1 − 0) / 0.1, (0.1 − 0) / 0.2, (0.1 − 1) / 0.1
    let close = |v: &[f64], of: [f64; 3]| v.iter().zip(of).all(|(a, b)| (a - b).abs() < 1e-3);
    assert!(close(&recording.v_mm_s[..3], [10.0, 0.5, -9.0]));
    assert!(close(&recording.v_mm_s[3..], [2000.0, 100.0, -1800.0]));
    assert_eq!(join(&sources, stated), bytes);
    // another lab, which calls the files otherwise, has the same recording
    let [here, there] = [["a.csv", "b.csv"], ["1.csv", "2.csv"]].map(|names| {
        let sources = [
            source(&first, names[0], "aa"),
            source(&second, names[1], "bb"),
        ];
        let unnamed = Stated {
            file_names: false,
            ..stated
        };
        join(&sources, unnamed)
    });
    assert_eq!(here, there);
    let recording = recording::read("r", here.as_slice()).unwrap();
    assert_eq!(
        recording.header_line("source:"),
        Some("sha256 aa; columns of displacement and force, 3 rows from 0.000 s")
    );
}

#[test]
fn text_of_the_files_cannot_begin_a_line_of_the_header() {
    let curve = read(TIDY).unwrap();
    let sources = [Source {
        curve: &curve,
        file: "a\nlicense: none",
        sha256: "aa",
    }];
    let stated = Stated {
        target: Some("x\nlicense: mine"),
        file_names: true,
        ..Stated::default()
    };
    let bytes = join(&sources, stated);
    let recording = recording::read("r", bytes.as_slice()).unwrap();
    assert_eq!(recording.header_line("license:"), None);
    assert_eq!(recording.header_line("target:"), Some("x\\nlicense: mine"));
}

#[test]
fn every_bad_file_is_told_with_its_line() {
    let without = |line: &str| FINE.replace(line, "");
    for (text, expected) in [
        (String::new(), "line 1: no column names"),
        ("a,b\n1,2\n".into(), "line 1: no column names"),
        (
            "force,force_n,displacement\n".into(),
            "line 1: two columns are called force",
        ),
        (
            "force_lb,displacement\n0,0\n".into(),
            "line 1: `lb` is no unit of force: gf, kgf",
        ),
        (
            TIDY.replace("100,1", "100,1x"),
            "line 3: displacement is `1x`, which is not a number",
        ),
        (
            TIDY.replace("100,1", "nan,1"),
            "line 3: force is `nan`, which is not a number",
        ),
        (
            TIDY.replace("100,1,0,A switch", "100"),
            "line 3: 1 of 4 fields: complete or remove the row",
        ),
        (
            TIDY.replace("100,1,0", "100,0,0").replace("0.1", "0"),
            "line 2: displacement never changes",
        ),
        (
            TIDY.replace("50,0.1", "50,0.9"),
            "line 4: the displacement goes one way only",
        ),
        (
            "force,displacement\n1,0\n2,1\n".into(),
            "line 3: 2 rows: a curve has at least 3",
        ),
        (
            TABLE.replace("2,10,gf", "2,10,N"),
            "line 5: the unit of force changes",
        ),
        (
            TABLE.replace("1,-0.1,gf", "1,-0.1,oz"),
            "line 4: `oz` is no unit of force",
        ),
        (
            FINE.replace("= 3,", "= 4,"),
            "line 8: 3 rows, but DATA COUNT is 4: the file is not complete",
        ),
        (
            FINE.replace("0.0005", "0"),
            "line 4: the recording rate is `0`: it has to be a time from 0.000001 to 1000 s",
        ),
        (
            FINE.replace("0.0005", "1e-300"),
            "line 4: the recording rate is `1e-300`: it has to be a time from",
        ),
        (
            FINE.replace("UNIT = N", "UNIT = V"),
            "line 2: `V` is no unit of force",
        ),
        (
            without("UNIT = N,mm\n"),
            "line 5: no `UNIT =` above the rows",
        ),
        (
            without("DATA COUNT = 3,\n"),
            "line 5: no `DATA COUNT =` above the rows",
        ),
    ] {
        let message = message(&text);
        assert!(message.starts_with(expected), "{message}\n{expected}");
    }
}

/// What is missing of a row that was cut would be read as 0.
#[test]
fn a_file_that_ends_within_a_row_is_refused() {
    for (whole, end, cut, found) in [
        (TIDY, "50,0.1,0,A switch\n", "50,0.", "line 4: 2 of 4"),
        (TIDY, "50,0.1,0,A switch\n", "50", "line 4: 1 of 4"),
        (FINE, "0.5,0.100\n", "0.5", "line 8: 1 of 2"),
        (TABLE, ",12:00:01 PM,7/3/2025,\n", "", "line 8: 7 of 9"),
    ] {
        let begin = whole.strip_suffix(end).unwrap();
        assert_eq!(
            message(&format!("{begin}{cut}")),
            format!(
                "{found} fields: the file ends within this row; export it again, or remove the row"
            )
        );
    }
    // without a line break at the end, or with fields that are empty, a row is complete
    let names = "force\tdisplacement\tname\n";
    for text in [
        TIDY.trim_end().to_owned(),
        TIDY.replace(",A switch", ","),
        format!("{names}0\t0\t\n100\t1\t\n50\t0.1\t"),
    ] {
        assert_eq!(read(&text).unwrap().x_mm, [0.0, 1.0, 0.1]);
    }
}

#[test]
fn a_time_in_numbers_gives_the_rate_and_a_wrong_one_is_named() {
    let with = |name: &str, times: [&str; 4]| {
        let rows = ["0,0", "50,0.5", "100,1", "0,0.1"];
        let rows: String = (times.iter().zip(rows))
            .map(|(t, row)| format!("{t},{row}\n"))
            .collect();
        read(&format!("{name},force,displacement\n{rows}"))
    };
    for (name, times) in [
        ("time", ["0", "0.02", "0.04", "0.06"]),
        ("time_s", ["5", "5.02", "5.04", "5.06"]),
        ("Time (ms)", ["0", "20", "40", "60"]),
        ("t_ms", ["0", "20", "40", "60"]),
    ] {
        let rate = with(name, times).unwrap().rate_hz.unwrap();
        assert!((rate - 50.0).abs() < 1e-9, "{name}: {rate}");
    }
    for (times, line, text) in [
        (["0", "0.02", "0.01", "0.06"], 4, "does not increase"),
        (
            ["0", "0.02", "soon", "0.06"],
            4,
            "the time is `soon`, neither",
        ),
        (
            ["0", "0.02", "0.04", "0.5"],
            5,
            "0.460 s apart here and 0.020 s usually",
        ),
        (["0", "12:00:01", "0.04", "0.06"], 3, "the time is"),
        (
            ["0", "1e-300", "2e-300", "3e-300"],
            1,
            "rows a second, and from 0.001 to 1000000 are possible",
        ),
        (
            ["12:00:03", "12:00:04", "12:00:01", "12:00:02"],
            4,
            "does not increase",
        ),
    ] {
        let error = with("time", times).unwrap_err().to_string();
        assert!(
            error.starts_with(&format!("line {line}: ")) && error.contains(text),
            "{error}"
        );
    }
    // a column that only begins with these letters is none
    assert_eq!(
        with("tactility", ["0", "1", "0", "1"]).unwrap().rate_hz,
        None
    );
}

#[test]
fn a_decimal_comma_is_read_in_quotes_and_refused_without() {
    let quoted = "force,displacement\n\"0,0\",\"0,000\"\n\"30,5\",\"1,250\"\n\"0,0\",\"0,010\"\n";
    assert_eq!(read(quoted).unwrap().x_mm, [0.0, 1.25, 0.01]);
    let bare = quoted.replace('"', "");
    let error = message(&bare);
    assert!(
        error.starts_with("line 2: 4 fields under 2 column names"),
        "{error}"
    );
    assert!(error.contains("semicolons"), "{error}");
}

/// Repeated measurements, one of them in N with a column name that says nothing, which means gf.
#[test]
fn curves_of_other_units_are_doubted_and_repetitions_are_not() {
    let [gf, n, slow] = [
        "force,displacement\n0,0\n60,1\n0,0.1\n",
        "force,displacement\n0,0\n0.588,1\n0,0.1\n",
        "force,displacement\n0,0\n40,1\n0,0.1\n",
    ]
    .map(|text| read(text).unwrap());
    let source = |curve, file| Source {
        curve,
        file,
        sha256: "",
    };
    assert_eq!(
        unlike(&[source(&gf, "a.csv"), source(&slow, "b.csv")]),
        [""; 0]
    );
    let doubts = unlike(&[source(&gf, "a.csv"), source(&n, "b.csv")]);
    assert_eq!(doubts.len(), 1);
    assert!(
        doubts[0].starts_with("the force varies by 0.0058 N in b.csv and by 0.5884 N in a.csv"),
        "{doubts:?}"
    );
    assert_eq!(unlike(&[source(&gf, "a.csv")]), [""; 0]);
}

#[test]
fn a_tester_that_counts_downwards_is_named() {
    let error = message("force,displacement\n0,0\n50,-0.5\n100,-1\n50,-0.5\n0,-0.01\n");
    assert!(error.contains("decreases during the press"), "{error}");
}

/// A press and a release of 1 mm in 2 × 101 rows: displacement, mm, and force, gf, with a stop from 0.9 mm on and friction.
fn rows() -> Vec<[f64; 2]> {
    let force = |x: f64, friction: f64| 40.0 + 20.0 * x + 900.0 * (x - 0.9).max(0.0) + friction;
    let x = |i: i32| f64::from(i) / 100.0;
    let press = (0..=100).map(|i| [x(i), force(x(i), 5.0)]);
    let release = (0..=100).rev().map(|i| [x(i), force(x(i), -5.0)]);
    press.chain(release).collect()
}

/// Their file.
fn file(rows: &[[f64; 2]]) -> String {
    let line = |[x, f]: &[f64; 2]| format!("{f:.3},{x:.3}\n");
    "force,displacement\n".to_owned() + &rows.iter().map(line).collect::<String>()
}

#[test]
fn a_file_that_begins_at_the_bottom_is_the_same_curve() {
    let usual = read(&file(&rows())).unwrap();
    assert!(!usual.release_first);
    let mut turned = rows();
    turned.rotate_left(101);
    let turned = read(&file(&turned)).unwrap();
    assert!(turned.release_first);
    assert_eq!((&turned.x_mm, &turned.f_n), (&usual.x_mm, &usual.f_n));
    assert_eq!([usual.passive(), turned.passive()], [Ok(()), Ok(())]);
    let source = Source {
        curve: &turned,
        file: "a.csv",
        sha256: "aa",
    };
    let bytes = join(&[source], Stated::default());
    let recording = recording::read("r", bytes.as_slice()).unwrap();
    let line = recording.header_line("source:").unwrap();
    assert!(
        line.ends_with("202 rows from 0.000 s, the press put before the release"),
        "{line}"
    );
}

/// More presses than releases, or less, are all in their order.
#[test]
fn half_a_loop_more_does_no_harm() {
    let [press, release] = [0..101, 101..202].map(|of| rows()[of].to_vec());
    for parts in [[&press, &release, &press], [&release, &press, &release]] {
        let rows: Vec<[f64; 2]> = parts.into_iter().flatten().copied().collect();
        let curve = read(&file(&rows)).unwrap();
        assert!(!curve.release_first);
        assert_eq!(curve.x_mm[0], rows[0][0]);
        assert_eq!(curve.passive(), Ok(()));
    }
}

#[test]
fn what_makes_a_passive_target_active_is_told_with_the_line() {
    let changed = |change: &dyn Fn([f64; 2]) -> [f64; 2]| -> Vec<[f64; 2]> {
        rows().into_iter().map(change).collect()
    };
    let reversed: Vec<[f64; 2]> = rows().into_iter().rev().collect();
    for (rows, expected) in [
        (
            reversed,
            "line 2: the rows from here on are in the reverse order of time: at ",
        ),
        (
            changed(&|[x, f]| [f, x]),
            "line 1: the columns force and displacement are swapped: ",
        ),
        (
            changed(&|[x, f]| [x, -f]),
            "line 2: there is less force at the bottom than at rest",
        ),
    ] {
        let message = read(&file(&rows)).unwrap().passive().unwrap_err();
        assert!(message.to_string().starts_with(expected), "{message}");
    }
    // a latch whose force falls over most of its way takes energy all the same
    let falls = changed(&|[x, f]| [x, 200.0 + f - 300.0 * x.min(0.9)]);
    assert_eq!(read(&file(&falls)).unwrap().passive(), Ok(()));
}

#[test]
fn an_order_that_is_none_of_time_is_told() {
    let listed_upwards = {
        let mut rows = rows();
        rows[101..].reverse();
        rows
    };
    assert_eq!(
        message(&file(&listed_upwards)),
        "line 103: the displacement jumps here from 1.000 to 0.000 mm, and its strokes all go the same way: list the rows in the order \
         of time, the press from rest to the bottom and the release from there to rest"
    );
    let mut sorted = rows();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let error = message(&file(&sorted));
    assert!(
        error.starts_with("line 203: the displacement goes one way only"),
        "{error}"
    );
    let down: Vec<[f64; 2]> = rows().iter().map(|[x, f]| [-x, -f]).collect();
    let error = message(&file(&down));
    assert!(error.contains("change the sign of both"), "{error}");
}

#[test]
fn the_unit_of_the_other_column_names_the_swap() {
    for (text, expected) in [
        (
            "force_mm,displacement_gf\n0,0\n".to_owned(),
            "line 1: `mm` is a unit of displacement, not of force: the columns of force and displacement are swapped",
        ),
        (
            TABLE.replace("gf", "mm"),
            "line 4: `mm` is a unit of displacement, not of force: ",
        ),
        (
            FINE.replace("N,mm", "mm,N"),
            "line 2: `mm` is a unit of displacement, not of force: ",
        ),
    ] {
        let message = message(&text);
        assert!(message.starts_with(expected), "{message}");
    }
}
