//! The header is that of the library, and C and C++ read it.

use super::*;
use core::mem::offset_of;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;
use std::process::Command;
use std::string::String;
use std::vec::Vec;

fn read(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

fn header() -> String {
    read("include/study_device.h")
}

#[test]
fn the_header_has_every_function_and_no_other() {
    let names = |text: &str, before: &str| {
        let found = text.split(before).skip(1).filter_map(|rest| {
            let end = rest.find('(')?;
            let name = &rest[..end];
            name.chars()
                .all(|c| c.is_ascii_lowercase() || c == '_')
                .then(|| name.to_owned())
        });
        let mut names: Vec<String> = found.collect();
        names.sort();
        names.dedup();
        names
    };
    let mut in_c = names(&header(), "study_device_");
    in_c.retain(|name| name != "panic");
    let in_rust = names(&read("src/lib.rs"), "pub extern \"C\" fn study_device_");
    let unsafe_ones = names(
        &read("src/lib.rs"),
        "pub unsafe extern \"C\" fn study_device_",
    );
    let mut exported = [in_rust, unsafe_ones].concat();
    exported.sort();
    assert_eq!(in_c, exported);
}

#[test]
fn the_header_states_the_sizes_of_the_library() {
    let defined = |name: &str| {
        let header = header();
        let (_, rest) = header.split_once(&format!("#define {name} ")).unwrap();
        rest.lines().next().unwrap().parse::<usize>().unwrap()
    };
    assert_eq!(defined("STUDY_NODES"), NODES);
    assert_eq!(defined("STUDY_DEVICE_SIZE"), DEVICE_SIZE);
}

/// Fields of a struct in the header, in order, with their C types.
fn fields(name: &str) -> Vec<(String, String)> {
    let header = header();
    let (_, rest) = header
        .split_once(&format!("typedef struct {name} {{"))
        .unwrap();
    let (body, _) = rest.split_once('}').unwrap();
    let lines = body.lines().filter_map(|line| {
        let (declared, _) = line.split_once(';')?;
        let (kind, name) = declared.trim().rsplit_once([' ', '*'])?;
        Some((name.to_owned(), kind.trim().to_owned()))
    });
    lines.collect()
}

/// What C reads at each offset is what Rust wrote there.
#[test]
fn the_structs_have_the_same_layout() {
    macro_rules! layout {
        ($type:ident: $($field:ident $kind:literal)+) => {{
            let listed = fields(stringify!($type));
            let own = [$((stringify!($field), $kind, offset_of!($type, $field))),+];
            let names: Vec<_> = listed.iter().map(|(name, kind)| (name.as_str(), kind.as_str())).collect();
            assert_eq!(names, own.map(|(name, kind, _)| (name, kind)));
            // C places fields in this order, each at a multiple of its size.
            let mut end = 0;
            for (name, kind, offset) in own {
                let size = match kind {
                    "double" => 8,
                    "uint32_t" | "int32_t" => 4,
                    _ => size_of::<usize>(),
                };
                end = usize::next_multiple_of(end, size);
                assert_eq!(offset, end, "{name}");
                end += size;
            }
        }};
    }
    layout!(StudySettings:
        firmware "const char" serial "const char" servo_hz "double" telemetry_hz "double"
        force_n "double" velocity_mm_s "double" stiffness_n_per_mm "double"
        damping_n_s_per_mm "double" stroke_from_mm "double" stroke_to_mm "double"
        handle_kg "double" watchdog_ms "uint32_t" force_sensor "int32_t" simulated "int32_t"
        acceleration_from_speed "int32_t");
    layout!(StudyMotion:
        x_mm "double" v_mm_s "double" a_m_s2 "double" force_n "double" has_force "int32_t");
}

/// Compiles the header alone; `None` without this compiler.
fn compiles(compiler: &str, language: &[&str]) -> Option<String> {
    let header = concat!(env!("CARGO_MANIFEST_DIR"), "/include/study_device.h");
    let strict = ["-fsyntax-only", "-Wall", "-Wextra", "-pedantic", "-Werror"];
    let output = Command::new(compiler)
        .args(strict)
        .args(language)
        .arg(header)
        .output();
    match output {
        Ok(output) if output.status.success() => Some(String::new()),
        Ok(output) => Some(String::from_utf8_lossy(&output.stderr).into_owned()),
        Err(error) if error.kind() == ErrorKind::NotFound => None,
        Err(error) => panic!("{compiler}: {error}"),
    }
}

#[test]
#[allow(clippy::print_stderr, reason = "says what was skipped")]
fn the_header_compiles_as_c99_and_as_cpp() {
    for (compiler, language) in [
        ("cc", ["-std=c99", "-xc"]),
        ("c++", ["-std=c++11", "-xc++"]),
    ] {
        match compiles(compiler, &language) {
            Some(said) => assert_eq!(said, "", "{compiler} {language:?}"),
            None => std::eprintln!("SKIPPED: no {compiler} here: the header was not compiled"),
        }
    }
}

fn settings() -> StudySettings {
    StudySettings {
        firmware: c"test".as_ptr(),
        serial: c"1".as_ptr(),
        servo_hz: 4000.0,
        telemetry_hz: 1000.0,
        force_n: 10.0,
        velocity_mm_s: 1000.0,
        stiffness_n_per_mm: 10.0,
        damping_n_s_per_mm: 0.1,
        stroke_from_mm: 0.0,
        stroke_to_mm: 35.0,
        handle_kg: 0.1,
        watchdog_ms: 30,
        force_sensor: 0,
        simulated: 1,
        acceleration_from_speed: 1,
    }
}

unsafe extern "C" fn collect(context: *mut c_void, frame: *const u8, len: usize, stream: i32) {
    // SAFETY: the tests give a vector as the context.
    let sent = unsafe { &mut *context.cast::<Vec<(Vec<u8>, i32)>>() };
    // SAFETY: the library gives `len` bytes.
    let frame = unsafe { core::slice::from_raw_parts(frame, len) };
    sent.push((frame.to_vec(), stream));
}

/// Memory as a C program has it.
#[repr(C, align(8))]
struct Memory([u8; DEVICE_SIZE]);

#[test]
fn a_device_in_memory_of_c_answers_and_a_wrong_call_does_nothing() {
    let mut memory = Memory([0xAA; DEVICE_SIZE]);
    let at = (&raw mut memory).cast::<c_void>();
    let mut sent: Vec<(Vec<u8>, i32)> = Vec::new();
    let context = (&raw mut sent).cast::<c_void>();
    let motion = StudyMotion {
        x_mm: 10.0,
        v_mm_s: 0.0,
        a_m_s2: 0.0,
        force_n: 0.0,
        has_force: 0,
    };
    // SAFETY: memory, settings and texts are valid, and so are the wrong pointers that the
    // interface promises to check.
    unsafe {
        assert_eq!(study_device_state(core::ptr::null_mut()), -1);
        assert_eq!(study_device_state(at), -1, "not initialized");
        assert_eq!(study_device_servo(at, &motion, 0), 0.0);
        let init = |memory, size, settings: &StudySettings| {
            study_device_init(memory, size, settings, Some(collect), context)
        };
        let good = settings();
        assert_eq!(init(at, 100, &good), -1, "too small");
        assert_eq!(
            init(at.byte_add(4), DEVICE_SIZE - 4, &good),
            -1,
            "not aligned"
        );
        for bad in [
            StudySettings {
                servo_hz: 0.0,
                ..good
            },
            StudySettings {
                force_n: f64::NAN,
                ..good
            },
            StudySettings {
                watchdog_ms: 0,
                ..good
            },
            StudySettings {
                handle_kg: -1.0,
                ..good
            },
            StudySettings {
                stroke_to_mm: 0.0,
                ..good
            },
            StudySettings {
                serial: core::ptr::null(),
                ..good
            },
            StudySettings {
                serial: c"".as_ptr(),
                ..good
            },
        ] {
            assert_eq!(init(at, DEVICE_SIZE, &bad), -1, "{bad:?}");
        }
        assert_eq!(init(at, DEVICE_SIZE, &good), 0);
        assert_eq!(study_device_state(at), 0);
        // HELLO of docs/wire-frames.json
        let hello = b"\0\x03\x01\x01\x01\x09\x01\xee\xff\xc0\x4e\x71\x7f\x1c\0";
        study_device_receive(at, hello.as_ptr(), hello.len(), 5);
        assert_eq!(study_device_state(at), 1);
        assert_eq!(sent.len(), 1);
        assert_eq!((sent[0].0[3], sent[0].1), (0x81, 0), "IDENTITY is a reply");
        study_device_overrun(at, 6);
        assert_eq!(study_device_state(at), 1, "no force, no fault");
        assert_eq!(study_device_servo(at, &motion, 6), 0.0);
        study_device_trip(at, 7);
        assert_eq!(
            (study_device_state(at), study_device_applies_force(at)),
            (7, 0)
        );
        assert_eq!(sent[1].1, 1, "EVENT is part of the stream");
    }
    assert!(study_device_size() <= DEVICE_SIZE);
}
