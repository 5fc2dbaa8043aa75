//! `fabricate send` and `fabricate run --send` to machines behind pseudo-terminals that are slow to start and are unplugged.
#![allow(clippy::unwrap_used, reason = "a test that panics is a test that fails")]
use std::{
    path::Path,
    process::{Command, Stdio},
};

use fabricate::profile::{Flow, MACHINES};

use crate::{
    board::{
        cutter::Cutter,
        grbl::{Config, GrblBoard},
        marlin::MarlinBoard,
        pty::PtyBoard,
    },
    layout::compare,
    plain::{marlin_polygons, meant, plot},
    strokes::{KNIFE, expected, machine, once_or_doubted, same, touched},
};

/// Board seconds in one second of the clock.
const SCALE: f64 = 20.0;

/// Runs the program; the exit code and all it says.
fn fabricate(args: &[&str]) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fabricate"));
    let output = command.args(args).stdin(Stdio::null()).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    (output.status.code(), text)
}

/// A profile file like a built-in one, with another first line.
fn profile(dir: &Path, base: &str, head: &str) -> String {
    let text = MACHINES.iter().find(|it| it.name == base).unwrap().text;
    let path = dir.join("machine.toml");
    std::fs::write(&path, format!("{head}\n{text}")).unwrap();
    path.display().to_string()
}

fn file(dir: &Path, name: &str, text: &str) -> String {
    let path = dir.join(name);
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

#[test]
fn a_marlin_board_that_starts_slowly_is_unplugged_and_the_job_finished() {
    let dir = tempfile::tempdir().unwrap();
    let program = marlin_polygons(4);
    let (job, machine_file) =
        (file(dir.path(), "job.gcode", &program), profile(dir.path(), "drag-knife-a3", "dialect = \"marlin\""));
    let mut board = MarlinBoard::new();
    board.starts_in = 4.0;
    board.faults.unplug_at = Some(14.0);
    let pty = PtyBoard::start(board, SCALE);
    let (code, text) = fabricate(&["send", &job, "--machine", &machine_file, "--port", &pty.port]);
    assert_eq!(code, Some(5), "{text}");
    assert!(text.contains("the connection broke off") && text.contains("--resume"), "{text}");
    pty.wait("the board has run its buffer to the end", |it| !it.moving());
    let mut board = pty.take();
    board.faults = Default::default();
    let pty = PtyBoard::start(board, SCALE);
    let (code, text) =
        fabricate(&["send", &job, "--machine", &machine_file, "--port", &pty.port, "--resume", "--home"]);
    assert_eq!(code, Some(0), "{text}");
    let told: Vec<String> = text.lines().map(str::to_owned).collect();
    let wanted = expected(&program, &machine("drag-knife-a3", "dialect = \"marlin\""));
    once_or_doubted(&wanted, &pty.board().strokes, &told, "marlin");
}

#[test]
fn a_cutter_gets_its_plot_and_a_pulled_plug_is_said() {
    let dir = tempfile::tempdir().unwrap();
    let text = plot(4);
    let job = file(dir.path(), "job.plt", &text);
    let pty = PtyBoard::start(Cutter::new(Flow::XonXoff, 256), SCALE);
    let (code, said) = fabricate(&["send", &job, "--machine", "vinyl-cutter", "--port", &pty.port]);
    assert_eq!(code, Some(0), "{said}");
    same(&meant(&text), &pty.board().strokes).unwrap();
    let mut board = Cutter::new(Flow::XonXoff, 256);
    board.unplug_at = Some(6.0);
    let pty = PtyBoard::start(board, SCALE);
    let (code, said) = fabricate(&["send", &job, "--machine", "vinyl-cutter", "--port", &pty.port]);
    assert_eq!(code, Some(5), "{said}");
    assert!(said.contains("the connection broke off"), "{said}");
}

#[test]
fn faults_of_the_board_end_with_exit_code_5() {
    let dir = tempfile::tempdir().unwrap();
    let job = file(dir.path(), "job.nc", &crate::strokes::polygons(4, 12, 12.0));
    type Set = fn(&mut crate::board::grbl::Faults);
    let cases: [(Set, &str); 3] = [
        (|it| it.alarm_at = Some(8.0), "ALARM:1"),
        (|it| it.refuse_line = Some(30), "error:20"),
        (|it| it.reset_at = Some(8.0), "reset itself"),
    ];
    for (set, words) in cases {
        let mut board = GrblBoard::new(Config::new(KNIFE));
        set(&mut board.config.faults);
        let pty = PtyBoard::start(board, SCALE);
        let (code, text) = fabricate(&["send", &job, "--machine", "drag-knife-a3", "--port", &pty.port]);
        assert_eq!(code, Some(5), "{words}: {text}");
        assert!(text.contains(words), "{words}: {text}");
        pty.wait("the tool is off", |it| !it.tool_on() && !it.moving());
    }
}

#[test]
fn a_mesh_goes_to_the_machine_in_one_go() {
    let dir = tempfile::tempdir().unwrap();
    let mesh = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/cone.obj").display().to_string();
    let pty = PtyBoard::start(GrblBoard::new(Config::new(KNIFE)), SCALE);
    let out = dir.path().display().to_string();
    // One pen for all, so that nobody has to change it.
    let sets = ["machine.profile=pen-plotter", "machine.tools.cut-outside.number=1"];
    let mut args = vec!["run", &mesh, "--out", &out, "--quiet", "--send", "--port", &pty.port];
    sets.iter().for_each(|it| args.extend(["--set", it]));
    let (code, text) = fabricate(&args);
    assert_eq!(code, Some(0), "{text}");
    let drawing = fabricate::import::read_svg(&std::fs::read(dir.path().join("sheets/sheet-01.svg")).unwrap()).unwrap();
    let machine = machine("pen-plotter", "");
    let fit = compare("", &touched(&pty.board()), &drawing, &machine);
    assert!(fit.beside < 0.03 && fit.missed < 0.03, "{fit:?}");
}
