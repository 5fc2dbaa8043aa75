//! A job of the pipeline, streamed to boards in simulated time and held against its layout.
use std::{cell::RefCell, path::Path, process::Command, rc::Rc};

use fabricate::machine::{
    grbl::Grbl,
    job::{Wishes, grbl_options},
};

use crate::{
    board::{
        grbl::{Config, GrblBoard},
        hand::{Hand, drive},
    },
    layout::compare,
    strokes::{KNIFE, machine, touched},
};

#[test]
fn a_job_of_the_pipeline_arrives_as_its_layout() {
    let dir = tempfile::tempdir().unwrap();
    for (profile, limit) in [("pen-plotter", 0.03), ("drag-knife-a3", 0.1)] {
        let mesh = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/cone.obj");
        let mut run = Command::new(env!("CARGO_BIN_EXE_fabricate"));
        run.arg("run").arg(mesh).arg("--out").arg(dir.path()).args(["--quiet", "--json"]);
        assert!(run.args(["--set", &format!("machine.profile={profile}")]).output().unwrap().status.success());
        let sheet = |ending: &str| std::fs::read(dir.path().join("sheets/sheet-01").with_extension(ending)).unwrap();
        let (program, drawing) = (String::from_utf8(sheet("nc")).unwrap(), sheet("svg"));
        let machine = machine(profile, "");
        let board = Rc::new(RefCell::new(GrblBoard::new(Config::new(KNIFE))));
        let out = drive(&board, Hand::new(&board), Grbl::new(grbl_options(&machine)), |session, tell| {
            session.prepare(&machine, Wishes::default())?;
            session.perform(&program, &machine, Wishes::default(), None, tell)
        });
        out.result.unwrap_or_else(|err| panic!("{err}\n{}", out.log));
        let drawing = fabricate::import::read_svg(&drawing).unwrap();
        let fit = compare(&program, &touched(&board.borrow()), &drawing, &machine);
        println!("{profile}: {fit:?}");
        assert!(fit.beside < limit && fit.missed < limit && fit.length > 600.0, "{profile}: {fit:?}");
    }
}
