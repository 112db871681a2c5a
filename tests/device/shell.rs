//! `study device simulate` as people start it: with `&`, in a terminal.

use crate::support::program;
use portable_pty::{CommandBuilder, PtySize, native_pty_system};
use std::fs;
use std::io::Read as _;

/// What a shell with job control does in a terminal. `$0` is the program.
const SCRIPT: &str = r#"
set -m
"$0" device simulate --watchdog 200 --link board &
until [ -L board ]; do sleep 0.05; done
sleep 0.5
"$0" device simulate --link board > second 2>&1; echo "exit $?" >> second
"$0" device info --port board > info 2>&1; echo "exit $?" >> info
kill %1
"#;

/// Reading its terminal from the background would stop the device, and a second device with the same name would take
/// the port from under a session.
#[test]
fn a_device_answers_in_the_background_of_a_shell_and_keeps_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let pair = native_pty_system().openpty(PtySize::default()).unwrap();
    let mut shell = CommandBuilder::new("sh");
    shell.args(["-c".as_ref(), SCRIPT.as_ref(), program().as_os_str()]);
    shell.cwd(folder.path());
    let mut child = pair.slave.spawn_command(shell).unwrap();
    drop(pair.slave);
    let mut terminal = pair.master.try_clone_reader().unwrap();
    let drained = std::thread::spawn(move || {
        let mut printed = Vec::new();
        // The end of a pseudo-terminal is an error on Linux.
        let _ = terminal.read_to_end(&mut printed);
    });
    assert!(child.wait().unwrap().success());
    drop(pair.master);
    drained.join().unwrap();
    let text = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap();
    let (info, second) = (text("info"), text("second"));
    assert!(
        info.contains("simulated-1") && info.contains("exit 0"),
        "{info}"
    );
    assert!(
        second.contains("board: the port of another device"),
        "{second}"
    );
    assert!(second.contains("exit 3"), "{second}");
}
