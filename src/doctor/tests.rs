//! Judges numbers of machines that are good, loaded, slow, full, badly connected.

use super::*;

fn spread(median_ms: f64, p99_ms: f64, largest_ms: f64) -> Spread {
    Spread {
        median_ms,
        p99_ms,
        largest_ms,
        n: 250,
    }
}

fn lateness(heartbeat_ms: f64, screen_ms: f64) -> Lateness {
    Lateness {
        turn: spread(0.06, 0.1, heartbeat_ms),
        heartbeat: spread(0.5, 0.9, heartbeat_ms),
        screen: spread(0.1, 0.2, screen_ms),
    }
}

/// A computer on which nothing is wrong, without a device.
fn good() -> Measured {
    let quick = spread(0.4, 2.0, 9.0);
    Measured {
        machine: Machine {
            system: "linux x86_64".to_owned(),
            processors: 4,
            busy: Some(0.2),
            clock_step_ns: Some(30.0),
        },
        timing: Timing {
            priority: Priority::RealTime,
            permitted: Some(99),
            quiet: Some(lateness(1.1, 0.4)),
            saving: Some(lateness(1.4, 0.6)),
        },
        disk: Disk {
            folder: "results".to_owned(),
            file_system: Some(FileSystem {
                name: "ext4".to_owned(),
                options: vec!["rw".to_owned()],
                ..FileSystem::default()
            }),
            free_bytes: Some(50_000_000_000),
            journal: Some(quick),
            head: Some(quick),
            record: Some(quick),
            ..Disk::default()
        },
        terminal: Terminal {
            input: true,
            output: true,
            size: Some([100, 30]),
            least: [80, 24],
            positions: true,
            utf8: Some(true),
            colors: 256,
            no_color: false,
            plain: false,
        },
        page: Page {
            address: Some("192.168.1.20".to_owned()),
            failure: None,
        },
        device: None,
    }
}

fn port() -> Device {
    Device {
        failure: None,
        id: Some("A-1".to_owned()),
        firmware: Some("f1".to_owned()),
        baud: Some(460_800),
        watchdog_ms: Some(30.0),
        trips: Some(spread(2.9, 4.0, 6.0)),
        line_ms: 2.5,
        ..Device::failed(Connected::Port, "/dev/ttyUSB0".to_owned(), String::new())
    }
}

/// The verdicts, in the order of [`Use::ALL`].
fn fits(measured: &Measured) -> [Fit; 4] {
    let judgement = judge(measured);
    Use::ALL.map(|purpose| judgement.of(purpose))
}

/// The finding of this name.
fn finding(measured: &Measured, id: &str) -> Finding {
    let findings = judge(measured).findings;
    let found = findings.iter().find(|finding| finding.id == id);
    found
        .unwrap_or_else(|| panic!("{id}: {findings:?}"))
        .clone()
}

#[test]
fn a_good_machine_is_fit_for_everything_and_nothing_has_to_be_done() {
    let mut measured = good();
    assert_eq!(fits(&measured), [Fit::Fit; 4]);
    measured.device = Some(port());
    assert_eq!(fits(&measured), [Fit::Fit; 4]);
    for finding in judge(&measured).findings {
        assert_eq!(finding.advice, None, "{finding:?}");
        assert!(finding.says.ends_with('.'), "{}", finding.says);
    }
}

/// Whatever is wrong, it says what to do.
#[test]
fn everything_that_is_not_fit_has_an_advice() {
    let mut bad = good();
    bad.machine.busy = Some(9.0);
    bad.timing.priority = Priority::Usual;
    bad.timing.quiet = Some(lateness(200.0, 900.0));
    bad.disk.failure = Some("no permission".to_owned());
    bad.disk.hung_s = Some(8.0);
    bad.disk.broken = vec![Broken::Journal, Broken::Head, Broken::Names, Broken::Locks];
    bad.disk.free_bytes = Some(0);
    bad.disk.record = Some(spread(3000.0, 9000.0, 9000.0));
    bad.disk.journal = Some(spread(0.001, 0.002, 0.003));
    bad.disk.left = Some("x".to_owned());
    bad.terminal.size = Some([20, 5]);
    bad.terminal.utf8 = Some(false);
    bad.terminal.positions = false;
    bad.page.failure = Some("no".to_owned());
    bad.device = Some(Device {
        simulated: true,
        trips: Some(spread(20.0, 40.0, 90.0)),
        hello_ms: Some(9000.0),
        ..port()
    });
    assert_eq!(fits(&bad), [Fit::NotFit; 4]);
    for finding in judge(&bad).findings {
        let advised = finding.advice.is_some();
        assert_eq!(advised, finding.fit != Fit::Fit, "{finding:?}");
        assert!(finding.says.ends_with('.'), "{}", finding.says);
    }
}

#[test]
fn a_loaded_machine_is_not_fit_for_a_serial_device_and_the_sentence_has_the_numbers() {
    // Late while saving alone: the limits are 10 and 20 ms for a watchdog time of 30 ms.
    for (late_ms, expected) in [
        (9.9, Fit::Fit),
        (10.0, Fit::WithLimits),
        (19.9, Fit::WithLimits),
        (20.0, Fit::NotFit),
    ] {
        let mut loaded = good();
        loaded.timing.saving = Some(lateness(late_ms, 0.4));
        let found = finding(&loaded, "heartbeat");
        assert_eq!(found.fit, expected, "{late_ms}: {}", found.says);
        assert_eq!(fits(&loaded), [Fit::Fit, expected, Fit::Fit, Fit::Fit]);
        assert!(
            found.says.contains("while records were saved"),
            "{}",
            found.says
        );
        assert!(
            found.says.contains("watchdog time of 30 ms"),
            "{}",
            found.says
        );
        assert!(
            found.says.contains(&format!("{late_ms:.1}")),
            "{}",
            found.says
        );
    }
    let mut idle = good();
    idle.timing.quiet = Some(lateness(33.0, 0.4));
    let found = finding(&idle, "heartbeat");
    assert!(
        found.says.contains("while nothing else was done"),
        "{}",
        found.says
    );
    // The same lateness is no harm to a device that waits longer.
    idle.device = Some(Device {
        watchdog_ms: Some(200.0),
        ..port()
    });
    let found = finding(&idle, "heartbeat");
    assert_eq!(found.fit, Fit::Fit, "{}", found.says);
    assert!(found.says.contains("this device"), "{}", found.says);
}

#[test]
fn a_screen_that_stands_still_stops_heartbeats_and_alive() {
    for (late_ms, serial, hand) in [
        (39.0, Fit::Fit, Fit::Fit),
        (40.0, Fit::WithLimits, Fit::Fit),
        (80.0, Fit::NotFit, Fit::Fit),
        (200.0, Fit::NotFit, Fit::WithLimits),
        (400.0, Fit::NotFit, Fit::NotFit),
    ] {
        let mut loaded = good();
        loaded.timing.quiet = Some(lateness(1.0, late_ms));
        assert_eq!(
            fits(&loaded),
            [hand, serial, Fit::Fit, Fit::Fit],
            "{late_ms}"
        );
    }
    let mut loaded = good();
    loaded.timing.quiet = Some(lateness(1.0, 60.0));
    loaded.device = Some(Device {
        connected: Connected::Program,
        watchdog_ms: Some(150.0),
        ..port()
    });
    assert_eq!(finding(&loaded, "alive").fit, Fit::NotFit);
}

#[test]
fn a_priority_that_is_refused_says_why_and_what_to_do() {
    for (permitted, why, what) in [
        (Some(0), "`ulimit -r` is 0", "limits.conf"),
        (Some(99), "container refuses it", "container"),
        (None, "the system refuses it", "may raise priorities"),
    ] {
        for (given, instead) in [
            (Priority::Usual, "no higher priority"),
            (Priority::Raised, "only more time"),
        ] {
            let mut usual = good();
            usual.timing.priority = given;
            usual.timing.permitted = permitted;
            let found = finding(&usual, "priority");
            assert_eq!(found.fit, Fit::WithLimits);
            assert!(
                found.says.contains(why) && found.says.contains(instead),
                "{found:?}"
            );
            assert!(found.advice.unwrap().contains(what));
            assert_eq!(fits(&usual)[1], Fit::WithLimits);
        }
    }
}

#[test]
fn a_coarse_timer_and_busy_processors_are_limits() {
    let mut coarse = good();
    let mut quiet = lateness(9.0, 9.0);
    quiet.turn = spread(14.6, 15.0, 15.0);
    coarse.timing.quiet = Some(quiet);
    let found = finding(&coarse, "timer");
    assert_eq!(found.fit, Fit::WithLimits);
    assert!(found.says.contains("15.6 ms"), "{}", found.says);
    for (processors, busy, fit) in [
        (4, Some(1.9), Fit::Fit),
        (4, Some(2.0), Fit::WithLimits),
        (1, Some(0.0), Fit::WithLimits),
        (2, None, Fit::Fit),
    ] {
        let mut machine = good();
        machine.machine.processors = processors;
        machine.machine.busy = busy;
        assert_eq!(
            finding(&machine, "processors").fit,
            fit,
            "{processors} {busy:?}"
        );
    }
}

#[test]
fn what_was_not_measured_is_not_called_fit() {
    let mut none = good();
    none.timing.saving = None;
    assert_eq!(fits(&none)[1], Fit::NotMeasured);
    let mut silent = good();
    silent.device = Some(Device {
        trips: None,
        ..port()
    });
    assert_eq!(fits(&silent)[1], Fit::NotMeasured);
}

#[test]
fn a_slow_disk_is_judged_by_what_a_page_waits() {
    for (p99_ms, largest_ms, expected) in [
        (199.0, 300.0, Fit::Fit),
        (200.0, 300.0, Fit::WithLimits),
        (20.0, 2000.0, Fit::WithLimits),
        (2000.0, 2000.0, Fit::NotFit),
    ] {
        let mut slow = good();
        slow.disk.record = Some(spread(15.0, p99_ms, largest_ms));
        let found = finding(&slow, "saving");
        assert_eq!(found.fit, expected, "{}", found.says);
        assert!(found.says.contains("of 250 cases"), "{}", found.says);
        // A rehearsal waits for nobody.
        assert_eq!(fits(&slow), [expected, expected, expected, Fit::Fit]);
    }
    let mut fast = good();
    fast.disk.journal = Some(spread(0.002, 0.004, 0.1));
    let found = finding(&fast, "too-fast");
    assert!(found.says.contains("2.0 µs"), "{}", found.says);
    assert_eq!(found.fit, Fit::WithLimits);
}

#[test]
fn a_file_system_that_cannot_keep_its_word_is_named() {
    let system = |name: &str, option: &str| FileSystem {
        name: name.to_owned(),
        options: vec![option.to_owned()],
        ..FileSystem::default()
    };
    for (system, expected, word) in [
        (system("ext4", "rw"), Fit::Fit, "ext4"),
        (system("btrfs", "rw"), Fit::Fit, "btrfs"),
        (system("NTFS", ""), Fit::Fit, "NTFS"),
        (
            system("tmpfs", "rw"),
            Fit::NotFit,
            "a restart loses everything",
        ),
        (system("nfs4", "rw"), Fit::WithLimits, "another computer"),
        (
            system("fuse.sshfs", "rw"),
            Fit::WithLimits,
            "another computer",
        ),
        (system("9p", "rw"), Fit::WithLimits, "another computer"),
        (system("exFAT", ""), Fit::WithLimits, "no journal"),
        (system("fuseblk", "rw"), Fit::WithLimits, "is a program"),
        (
            system("ext4", "nobarrier"),
            Fit::WithLimits,
            "does not wait",
        ),
        (
            FileSystem {
                remote: true,
                ..system("NTFS", "")
            },
            Fit::WithLimits,
            "another computer",
        ),
        (
            FileSystem {
                in_memory: true,
                ..system("NTFS", "")
            },
            Fit::NotFit,
            "in memory",
        ),
    ] {
        let mut measured = good();
        measured.disk.file_system = Some(system);
        let found = finding(&measured, "file-system");
        assert_eq!(found.fit, expected, "{}", found.says);
        assert!(found.says.contains(word), "{}", found.says);
        assert_eq!(fits(&measured), [expected, expected, expected, Fit::Fit]);
    }
    // A sync in memory is as fast as it looks, and says nothing new.
    let mut memory = good();
    memory.disk.file_system = Some(system("tmpfs", "rw"));
    memory.disk.journal = Some(spread(0.001, 0.001, 0.001));
    assert!(judge(&memory).findings.iter().all(|f| f.id != "too-fast"));
}

#[test]
fn a_folder_that_cannot_be_used_is_fit_for_nothing() {
    let broken = |change: fn(&mut Disk)| {
        let mut measured = good();
        change(&mut measured.disk);
        measured
    };
    for measured in [
        broken(|disk| disk.failure = Some("the file system is read-only".to_owned())),
        broken(|disk| disk.hung_s = Some(8.0)),
        broken(|disk| disk.broken = vec![Broken::Journal]),
        broken(|disk| disk.free_bytes = Some(100_000)),
    ] {
        assert_eq!(fits(&measured), [Fit::NotFit; 4]);
        let judgement = judge(&measured);
        assert_eq!(judgement.against(Some(About::Disk), Use::Hand).len(), 1);
        assert!(
            judgement
                .against(Some(About::Computer), Use::Hand)
                .is_empty()
        );
    }
    let locks = broken(|disk| disk.broken = vec![Broken::Locks]);
    assert_eq!(fits(&locks)[0], Fit::WithLimits);
    let little = broken(|disk| disk.free_bytes = Some(100_000_000));
    assert_eq!(fits(&little), [Fit::WithLimits; 4]);
}

#[test]
fn a_terminal_says_when_lines_are_the_thing_to_use() {
    for (change, id) in [
        ((|t| t.size = Some([79, 24])) as fn(&mut Terminal), "size"),
        (|t| t.size = Some([80, 23]), "size"),
        (|t| t.size = None, "size"),
        (|t| t.positions = false, "position"),
        (|t| t.utf8 = Some(false), "utf-8"),
        (|t| t.input = false, "terminal"),
        (|t| t.output = false, "terminal"),
    ] {
        let mut measured = good();
        change(&mut measured.terminal);
        let found = finding(&measured, id);
        assert_eq!(found.fit, Fit::WithLimits, "{}", found.says);
        assert!(found.advice.unwrap().contains("--plain"));
        let limits = Fit::WithLimits;
        assert_eq!(fits(&measured), [limits, limits, limits, Fit::Fit]);
    }
    let mut measured = good();
    measured.terminal.size = Some([80, 24]);
    (measured.terminal.no_color, measured.terminal.utf8) = (true, None);
    assert_eq!(fits(&measured), [Fit::Fit; 4]);
    assert!(finding(&measured, "colors").says.contains("NO_COLOR"));
    (measured.terminal.plain, measured.terminal.positions) = (true, false);
    assert_eq!(fits(&measured), [Fit::Fit; 4]);
}

#[test]
fn a_page_needs_an_address_that_a_tablet_can_reach() {
    let mut measured = good();
    measured.page.address = None;
    assert_eq!(fits(&measured), [Fit::Fit, Fit::Fit, Fit::NotFit, Fit::Fit]);
    measured = good();
    measured.page.failure = Some("refused".to_owned());
    assert!(finding(&measured, "page").says.contains("refused"));
    assert_eq!(fits(&measured)[2], Fit::NotFit);
}

#[test]
fn a_port_is_judged_like_clause_11_1_and_a_bad_one_in_words() {
    // 2 ms for the reply, 2.5 on the line, 4 for an adapter; 10 ms in 99 %.
    for (trips, adapter_ms, expected) in [
        (spread(8.5, 9.0, 9.9), None, Fit::Fit),
        (spread(8.6, 9.0, 9.9), None, Fit::NotFit),
        (spread(3.0, 10.1, 10.1), None, Fit::NotFit),
        (spread(3.0, 4.0, 10.1), None, Fit::WithLimits),
        (spread(3.0, 4.0, 5.0), Some(1.0), Fit::Fit),
        (spread(3.0, 4.0, 5.0), Some(16.0), Fit::WithLimits),
    ] {
        let mut measured = good();
        measured.device = Some(Device {
            trips: Some(trips),
            adapter_ms,
            ..port()
        });
        let found = finding(&measured, "round-trip");
        assert_eq!(found.fit, expected, "{}", found.says);
        assert!(found.says.contains("at 460800 baud"), "{}", found.says);
        let slow = adapter_ms.is_some_and(|timer| timer > 1.0);
        assert_eq!(found.says.contains("latency timer"), slow, "{}", found.says);
        assert_eq!(fits(&measured), [Fit::Fit, expected, Fit::Fit, Fit::Fit]);
    }
    let mut measured = good();
    let why = "there is no such port".to_owned();
    measured.device = Some(Device::failed(Connected::Port, "COM9".to_owned(), why));
    let found = finding(&measured, "device");
    assert_eq!(found.says, "COM9: there is no such port.");
    assert!(found.advice.unwrap().contains("study device list"));
    assert_eq!(fits(&measured)[1], Fit::NotFit);
}

#[test]
fn a_program_is_judged_by_its_own_watchdog_time() {
    for (p99_ms, expected) in [
        (166.0, Fit::Fit),
        (167.0, Fit::WithLimits),
        (500.0, Fit::NotFit),
    ] {
        let mut measured = good();
        measured.device = Some(Device {
            connected: Connected::Program,
            watchdog_ms: Some(500.0),
            trips: Some(spread(1.0, p99_ms, p99_ms)),
            hello_ms: Some(90.0),
            ..port()
        });
        assert_eq!(fits(&measured), [expected, Fit::Fit, Fit::Fit, Fit::Fit]);
    }
}

#[test]
fn the_document_has_the_numbers_as_they_are() {
    let mut measured = good();
    measured.timing.quiet = Some(lateness(1.0 / 3.0, 0.1));
    measured.disk.broken = vec![Broken::Locks];
    let json = serde_json::to_value(&measured).unwrap();
    assert_eq!(
        json["timing"]["quiet"]["heartbeat"]["largest_ms"],
        1.0 / 3.0
    );
    assert_eq!(json["timing"]["priority"], "real-time");
    assert_eq!(json["disk"]["broken"][0], Broken::Locks.as_str());
    assert_eq!(json["device"], serde_json::Value::Null);
    let json = serde_json::to_value(judge(&measured)).unwrap();
    assert_eq!(json["verdicts"][0]["use"], "hand");
    assert_eq!(json["verdicts"][0]["fit"], "with-limits");
    assert_eq!(json["verdicts"][0]["because"][0], "locks");
}

#[test]
fn a_spread_is_by_the_nearest_rank() {
    assert_eq!(Spread::of(Vec::new()), None);
    let times = (1..=200).rev().map(f64::from).collect();
    let spread = Spread::of(times).unwrap();
    assert_eq!(
        (spread.median_ms, spread.p99_ms, spread.largest_ms, spread.n),
        (100.0, 198.0, 200.0, 200)
    );
}
