//! `fabricate send` as a program, over a pseudo-terminal: exit codes, signals, messages, resume.
#![allow(clippy::unwrap_used, reason = "a test that panics is a test that fails")]
use std::{
    path::Path,
    process::{Child, Command, Output, Stdio},
};

use crate::{
    board::{
        Device,
        grbl::{Config, GrblBoard},
        pty::PtyBoard,
    },
    machine::HOME_ZERO,
    strokes::{KNIFE, expected, machine, polygons, same, touched},
};

/// Board seconds in one second of the clock.
const SCALE: f64 = 10.0;

fn command(dir: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fabricate"));
    command.current_dir(dir).arg("send").args(["--machine", "drag-knife-a3"]).args(args);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn run(dir: &Path, args: &[&str]) -> (Option<i32>, String) {
    told(command(dir, args).output().unwrap())
}

fn told(output: Output) -> (Option<i32>, String) {
    let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    (output.status.code(), text)
}

fn signal(child: &Child, name: &str) {
    assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
}

fn homing() -> GrblBoard {
    GrblBoard::new(Config::new(KNIFE).homing()).zero_at(HOME_ZERO)
}

#[test]
fn usage_files_and_ports_have_their_exit_codes() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("job.nc"), polygons(2, 12, 12.0)).unwrap();
    std::fs::write(dir.path().join("wide.nc"), "G21 G90\nM3 S90\nG1 X900 F100\n").unwrap();
    std::fs::write(dir.path().join("bad.nc"), "G1 X1 F1\nG1 X#3\n").unwrap();
    for (args, code, words) in [
        (&["job.nc"][..], 2, "--port"),
        (&["job.nc", "--port", "/dev/no-such-port"], 5, "there is no port `/dev/no-such-port`"),
        (&["job.nc", "--dry-run"], 0, "contours  2"),
        (&["wide.nc", "--dry-run"], 1, "X900.00, the bed of `drag-knife-a3`"),
        (&["bad.nc", "--dry-run"], 3, "line 2: variables"),
        (&["none.nc", "--dry-run"], 3, "cannot read none.nc"),
    ] {
        let (got, text) = run(dir.path(), args);
        assert_eq!(got, Some(code), "{args:?}: {text}");
        assert!(text.contains(words), "{args:?}: {text}");
    }
}

#[test]
fn a_job_is_sent_and_its_journal_says_so() {
    let dir = tempfile::tempdir().unwrap();
    let program = polygons(4, 12, 12.0);
    std::fs::write(dir.path().join("job.nc"), &program).unwrap();
    let pty = PtyBoard::start(homing(), SCALE);
    let args = ["job.nc", "--port", &pty.port, "--home"];
    let (code, text) = run(dir.path(), &args);
    assert_eq!(code, Some(0), "{text}");
    same(&expected(&program, &machine("drag-knife-a3", "")), &touched(&pty.board())).unwrap();
    assert!(std::fs::read_to_string(dir.path().join("job.nc.journal")).unwrap().ends_with("finished\n"));
    assert!(std::fs::read_to_string(dir.path().join("job.nc.log")).unwrap().contains("> $H\n"));
    let (code, text) = run(dir.path(), &["job.nc", "--port", &pty.port, "--resume"]);
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("the job was finished"), "{text}");
}

#[test]
fn signals_stop_safely_and_resume_finishes() {
    let program = polygons(6, 12, 12.0);
    for name in ["-INT", "-TERM"] {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("job.nc"), &program).unwrap();
        let pty = PtyBoard::start(homing(), SCALE);
        let child = command(dir.path(), &["job.nc", "--port", &pty.port, "--home"]).spawn().unwrap();
        pty.wait("the third contour", |it| it.switched.len() >= 5);
        signal(&child, name);
        let (code, text) = told(child.wait_with_output().unwrap());
        assert_eq!(code, Some(130), "{text}");
        assert!(text.contains("the tool is off and the position is kept"), "{text}");
        assert!(!pty.board().tool_on() && !pty.board().moving());
        let (code, text) = run(dir.path(), &["job.nc", "--port", &pty.port, "--resume"]);
        assert_eq!(code, Some(0), "{text}");
        let strokes = touched(&pty.board());
        for want in expected(&program, &machine("drag-knife-a3", "")) {
            let whole = strokes.iter().any(|it| same(std::slice::from_ref(&want), std::slice::from_ref(it)).is_ok());
            assert!(whole, "a contour is missing after --resume");
        }
    }
}

#[test]
fn a_killed_sender_leaves_little_motion_behind() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("job.nc"), polygons(6, 12, 12.0)).unwrap();
    let pty = PtyBoard::start(homing(), SCALE);
    let mut child = command(dir.path(), &["job.nc", "--port", &pty.port, "--home"]).spawn().unwrap();
    pty.wait("the third contour", |it| it.switched.len() >= 5);
    let at = pty.board().now();
    signal(&child, "-KILL");
    child.wait().unwrap();
    pty.wait("rest", |it| !it.moving() && it.now() > it.moved_at + 3.0);
    let board = pty.board();
    // Two seconds of motion may be on the board; the rest is the lag of this loaded computer, ten times enlarged.
    assert!(board.moved_at - at < 6.0, "{} s of motion after the kill", board.moved_at - at);
}

/// The largest memory of a running process so far, kB (VmHWM of proc(5)).
#[cfg(target_os = "linux")]
fn peak(child: &Child) -> Option<u64> {
    let text = std::fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
    text.lines().find_map(|it| it.strip_prefix("VmHWM:")?.trim().trim_end_matches("kB").trim().parse().ok())
}

#[test]
#[cfg(target_os = "linux")]
fn a_long_job_needs_little_memory() {
    let dir = tempfile::tempdir().unwrap();
    let mut program = String::from("G21 G90 G94 G17 G54\nM3 S40\nG0 X10 Y10\nM3 S90\nG4 P0.2\nG1 F6000\n");
    for k in 0..100_000 {
        let a = f64::from(k) * 0.01;
        program += &format!("X{:.2}Y{:.2}\n", 150.0 + 50.0 * a.cos(), 150.0 + 50.0 * a.sin());
    }
    std::fs::write(dir.path().join("job.nc"), program + "M3 S40\nM2\n").unwrap();
    // A machine so fast that only the wire counts: 1.4 MB at 11 kB/s take two minutes of the board's time.
    let mut config = Config::new(KNIFE);
    config.settings.extend([110, 111].map(|it| (it, 600_000.0)));
    config.settings.extend([120, 121].map(|it| (it, 1e6)));
    let pty = PtyBoard::start(GrblBoard::new(config), 20.0);
    let mut child = command(dir.path(), &["job.nc", "--port", &pty.port]).stderr(Stdio::null()).spawn().unwrap();
    let mut most = 0;
    let code = loop {
        most = most.max(peak(&child).unwrap_or(0));
        match child.try_wait().unwrap() {
            Some(status) => break status.code(),
            None => std::thread::sleep(std::time::Duration::from_millis(20)),
        }
    };
    println!("100 000 lines sent with at most {most} kB");
    assert_eq!(code, Some(0));
    assert!(most > 0 && most < 30_000, "{most} kB");
}
