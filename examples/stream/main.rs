//! Streams a program of the job to a simulated board and holds what the tool does against the sheet's drawing:
//! `cargo run --release --example stream -- drag-knife-a3 out/sheets/sheet-01.nc out/sheets/sheet-01.svg`.
#![allow(clippy::unwrap_used, reason = "a trial that cannot go on panics")]
#![allow(dead_code, reason = "the board and its measures are those of the tests, which use more of them")]
#![allow(clippy::print_stdout, reason = "its results go to stdout")]
use std::{cell::RefCell, rc::Rc, time::Instant};

use fabricate::machine::{
    grbl::Grbl,
    job::{Wishes, grbl_options},
};

#[path = "../../tests/it/board/mod.rs"]
mod board;
#[path = "../../tests/it/layout.rs"]
mod layout;
#[path = "../../tests/it/strokes.rs"]
mod strokes;

use board::{
    Device,
    grbl::{Config, GrblBoard},
    hand::{Hand, drive},
};

fn main() {
    let [profile, program, drawing] = std::env::args().skip(1).collect::<Vec<_>>().try_into().unwrap();
    let (machine, program) = (strokes::machine(&profile, ""), std::fs::read_to_string(program).unwrap());
    let drawing = fabricate::import::read_svg(&std::fs::read(drawing).unwrap()).unwrap();
    let board = Rc::new(RefCell::new(GrblBoard::new(Config::new(strokes::KNIFE))));
    let began = Instant::now();
    let out = drive(&board, Hand::new(&board), Grbl::new(grbl_options(&machine)), |session, tell| {
        session.prepare(&machine, Wishes::default())?;
        session.perform(&program, &machine, Wishes::default(), None, tell)
    });
    out.result.unwrap();
    let board = board.borrow();
    let fit = layout::compare(&program, &strokes::touched(&board), &drawing, &machine);
    println!("{} lines, {} strokes, {:.0} mm touched", program.lines().count(), fit.strokes, fit.length);
    println!("{:.4} mm beside the layout at most, {:.4} mm of it missed at most", fit.beside, fit.missed);
    println!(
        "{:.0} s on the board, simulated in {:.1} s; {} pauses, {} bytes overran",
        board.now(),
        began.elapsed().as_secs_f64(),
        out.pauses.len(),
        board.overrun
    );
}
