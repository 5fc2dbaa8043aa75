//! Marlin boards and HPGL cutters in simulated time: whole jobs, faults, flow control, resume.
#![allow(clippy::unwrap_used, reason = "a test that panics is a test that fails")]
use std::{cell::RefCell, path::Path, rc::Rc};

use fabricate::{
    machine::{
        hpgl::Hpgl,
        job::{self, Wishes},
        marlin::Marlin,
        plain,
        protocol::{Fault, Line, Protocol},
        session::{SendError, Session, Wish},
    },
    profile::{Flow, Machine},
};

use crate::{
    board::{
        Device, Dice, SimWire,
        cutter::Cutter,
        hand::{Hand, drive},
        marlin::MarlinBoard,
    },
    strokes::{expected, machine, once_or_doubted, polygons, same},
};

type Sent = (Result<(), SendError>, Vec<String>);

/// Sends a program, with a wish to abort when the board has come to a time.
fn send<D: Device, P: Protocol>(
    board: &Rc<RefCell<D>>,
    protocol: P,
    stop: f64,
    job: impl FnOnce(&mut Session<'_, SimWire<D>, P>, &mut dyn FnMut(&str)) -> Result<(), SendError>,
) -> Sent {
    let mut hand = Hand::new(board);
    hand.wishes = [(stop, Wish::Abort)].into();
    let out = drive(board, hand, protocol, job);
    (out.result, out.told)
}

fn to_marlin(
    board: &Rc<RefCell<MarlinBoard>>,
    text: &str,
    machine: &Machine,
    wishes: Wishes,
    journal: Option<&Path>,
    stop: f64,
) -> Sent {
    let program = job::read(text.to_owned(), machine).unwrap();
    send(board, Marlin::new(plain::marlin_options(machine)), stop, |session, tell| {
        session.prepare(wishes)?;
        session.perform_plain(&program, machine, wishes, journal, tell)
    })
}

fn to_cutter(
    board: &Rc<RefCell<Cutter>>,
    text: &str,
    machine: &Machine,
    wishes: Wishes,
    journal: Option<&Path>,
    stop: f64,
) -> Sent {
    let program = plain::read_plot(text, machine).unwrap();
    send(board, Hpgl::new(plain::hpgl_options(machine)), stop, |session, tell| {
        session.prepare(wishes)?;
        session.perform_plain(&program, machine, wishes, journal, tell)
    })
}

const PLAIN: Wishes = Wishes { unlock: false, home: false, zero: false, check: false, frame: false, resume: false };

fn marlin() -> Machine {
    machine("drag-knife-a3", "dialect = \"marlin\"")
}

/// The polygons in Marlin's words.
pub(crate) fn marlin_polygons(count: usize) -> String {
    let text = polygons(count, 12, 12.0).replace("G21 G90 G94 G17 G54", "G21\nG90");
    text.replace("M3 S", "M400\nM280 P0 S").replace("G4 P", "G4 S").replace("M2\n", "M400\n")
}

fn fresh() -> Rc<RefCell<MarlinBoard>> {
    Rc::new(RefCell::new(MarlinBoard::new()))
}

#[test]
fn a_marlin_job_arrives_position_by_position_over_a_bad_cable_too() {
    let (machine, program) = (marlin(), marlin_polygons(8));
    let want = expected(&program, &machine);
    assert_eq!(want.len(), 8);
    let board = fresh();
    to_marlin(&board, &program, &machine, PLAIN, None, f64::INFINITY).0.unwrap();
    let whole = board.borrow().received;
    same(&want, &board.borrow().strokes).unwrap();
    assert!(!board.borrow().down && !board.borrow().moving());
    assert_eq!(board.borrow().early, 0, "the servo waits for the head");
    let mut dice = Dice::new(3);
    let board = fresh();
    // Each line has a checksum, so what is damaged is sent again; the questions at the start are left alone.
    board.borrow_mut().faults.garbled = (0..20).map(|_| 80 + dice.below(whole - 80)).collect();
    to_marlin(&board, &program, &machine, PLAIN, None, f64::INFINITY).0.unwrap();
    let board = board.borrow();
    same(&want, &board.strokes).unwrap();
    println!("20 garbled bytes, {} lines sent again", board.resends);
    assert!(board.resends >= 10, "{}", board.resends);
}

#[test]
fn an_answer_lost_by_a_marlin_board_is_asked_for_again_and_nothing_is_cut_twice() {
    let (machine, program) = (marlin(), marlin_polygons(3));
    let want = expected(&program, &machine);
    let mut dice = Dice::new(31);
    for _ in 0..20 {
        let board = fresh();
        board.borrow_mut().faults.lost_ok = Some(8 + dice.below(50));
        to_marlin(&board, &program, &machine, PLAIN, None, f64::INFINITY).0.unwrap();
        same(&want, &board.borrow().strokes).unwrap();
        assert!(board.borrow().resends >= 1);
    }
}

#[test]
fn marlin_faults_end_with_the_tool_up_and_a_message_and_can_be_resumed() {
    let (machine, program) = (marlin(), marlin_polygons(6));
    let (begin, end) = {
        let board = fresh();
        to_marlin(&board, &program, &machine, PLAIN, None, f64::INFINITY).0.unwrap();
        let board = board.borrow();
        (board.switched[0], *board.switched.last().unwrap())
    };
    let mut dice = Dice::new(5);
    let mut latest = 0.0_f64;
    for round in 0..20 {
        let at = begin + dice.share() * (end - begin);
        for (name, words) in [
            ("interrupt", "stopped on request"),
            ("reset", "reset itself"),
            ("killed", "Printer halted"),
            ("unplugged", "the connection broke off"),
        ] {
            let board = fresh();
            {
                let faults = &mut board.borrow_mut().faults;
                match name {
                    "reset" => faults.reset_at = Some(at),
                    "killed" => faults.killed_at = Some((at, "Error:Printer halted. kill() called!")),
                    "unplugged" => faults.unplug_at = Some(at),
                    _ => {}
                }
            }
            let stop = if name == "interrupt" { at } else { f64::INFINITY };
            let dir = tempfile::tempdir().unwrap();
            let journal = dir.path().join("job.journal");
            let (result, _) = to_marlin(&board, &program, &machine, PLAIN, Some(&journal), stop);
            let Err(SendError::Fault { fault, aborted }) = result else { panic!("{name} {round}: {result:?}") };
            assert!(fault.to_string().contains(words), "{name}: {fault}");
            if name != "unplugged" {
                assert!(!board.borrow().down && !board.borrow().moving(), "{name} {round}");
            }
            if name == "interrupt" {
                assert!(aborted.tool_off, "{round}");
                latest = latest.max(board.borrow().switched.last().unwrap() - at);
            }
            {
                let mut board = board.borrow_mut();
                let now = board.now();
                board.advance(now + 10.0);
                board.faults = Default::default();
            }
            let resume = |wishes: Wishes| {
                let wishes = Wishes { resume: true, ..wishes };
                to_marlin(&board, &program, &machine, wishes, Some(&journal), f64::INFINITY)
            };
            // A sudden stop loses steps.
            assert!(matches!(resume(PLAIN).0, Err(SendError::Refused(_))), "{name} {round}");
            let (result, told) = resume(Wishes { home: true, ..PLAIN });
            result.unwrap_or_else(|err| panic!("{name} {round}: {err}"));
            once_or_doubted(&expected(&program, &machine), &board.borrow().strokes, &told, name);
        }
    }
    println!("marlin: tool up {latest:.2} s after an interrupt at the latest");
    assert!(latest < 2.5, "{latest}");
}

pub(crate) fn plot(count: usize) -> String {
    let units = |it: f64| (it * 40.0).round();
    let mut text = String::from("IN;PA;SP1;");
    for i in 0..count {
        let (cx, cy) = (30.0 + 40.0 * (i % 6) as f64, 30.0 + 40.0 * (i / 6) as f64);
        for k in 0..=24 {
            let a = k as f64 / 24.0 * std::f64::consts::TAU;
            let (x, y) = (units(cx + 12.0 * a.cos()), units(cy + 12.0 * a.sin()));
            text += &format!("{}{x},{y};", if k == 0 { "PU" } else { "PD" });
        }
    }
    text + "PU;SP0;"
}

fn cutter_machine(flow: &str) -> Machine {
    machine("drag-knife-a3", &format!("link.flow = \"{flow}\"\nformats = [\"hpgl\"]"))
}

/// The strokes of a plot as they are meant.
pub(crate) fn meant(text: &str) -> Vec<Vec<[f64; 2]>> {
    let drawing = fabricate::import::read_hpgl(text).unwrap();
    let closed = |it: &fabricate::import::DrawnLine| {
        let points = it.points.iter().chain(it.closed.then(|| &it.points[0]));
        points.map(|p| [p.x, p.y]).collect()
    };
    drawing.lines.iter().map(closed).collect()
}

#[test]
fn plots_arrive_whole_under_every_flow_control() {
    let text = plot(8);
    let want = meant(&text);
    for (name, flow, size, slower) in [
        ("none", Flow::None, 1024, 1.15),
        ("xon-xoff", Flow::XonXoff, 128, 2.0),
        ("rts-cts", Flow::RtsCts, 128, 2.0),
        ("esc-b", Flow::EscB, 128, 2.0),
    ] {
        let machine = cutter_machine(name);
        let board = Rc::new(RefCell::new(Cutter::new(flow, size).slower(slower)));
        let (result, _) = to_cutter(&board, &text, &machine, PLAIN, None, f64::INFINITY);
        result.unwrap_or_else(|err| panic!("{name}: {err}"));
        let board = board.borrow();
        assert_eq!(board.overrun, 0, "{name}: bytes were lost, {} in the buffer", board.fullest);
        same(&want, &board.strokes).unwrap_or_else(|err| panic!("{name}: {err}"));
        assert!(!board.down && !board.busy(), "{name}: the port was closed while the cutter still worked");
    }
}

#[test]
fn a_stopped_cutter_lifts_its_tool() {
    let text = plot(8);
    for (name, flow) in [("xon-xoff", Flow::XonXoff), ("esc-b", Flow::EscB), ("none", Flow::None)] {
        let machine = cutter_machine(name);
        let mut dice = Dice::new(23);
        let mut latest = 0.0_f64;
        for round in 0..20 {
            let at = 2.0 + dice.share() * 20.0;
            let board = Rc::new(RefCell::new(Cutter::new(flow, 256)));
            let dir = tempfile::tempdir().unwrap();
            let journal = dir.path().join("job.journal");
            let (result, _) = to_cutter(&board, &text, &machine, PLAIN, Some(&journal), at);
            let Err(SendError::Fault { fault: Fault::Interrupted, aborted }) = result else {
                panic!("{name} {round}: {result:?}")
            };
            // Only a cutter that answers can confirm it.
            assert_eq!(aborted.tool_off, flow == Flow::EscB, "{name} {round}");
            assert!(!board.borrow().down && !board.borrow().busy(), "{name} {round}");
            latest = latest.max(board.borrow().switched.last().unwrap() - at);
            // What is surely done is not cut again.
            let again = Rc::new(RefCell::new(Cutter::new(flow, 256)));
            let (result, told) =
                to_cutter(&again, &text, &machine, Wishes { resume: true, ..PLAIN }, Some(&journal), f64::INFINITY);
            result.unwrap_or_else(|err| panic!("{name} {round}: {err}"));
            let done: usize = told[0].split(' ').next().unwrap().parse().unwrap();
            let want = meant(&text);
            same(&want[done..], &again.borrow().strokes).unwrap_or_else(|err| panic!("{name} {round}: {err}"));
            let first = board.borrow();
            assert!(done <= first.strokes.len(), "{name} {round}");
            same(&want[..done], &first.strokes[..done]).unwrap_or_else(|err| panic!("{name} {round}: not done: {err}"));
            assert!(flow == Flow::EscB || done == 0, "without answers nothing is sure");
        }
        println!("{name}: tool up {latest:.2} s after an interrupt at the latest");
        // A cutter ends the movement that it is in.
        assert!(latest < 0.5, "{name}: {latest}");
    }
}

/// The cutter has power of its own: it goes on to the end of its buffer, and after the cable is back it draws on.
#[test]
fn a_cutter_without_its_cable_runs_on_shortly_and_the_job_goes_on_after_replugging() {
    let text = plot(8);
    let want = meant(&text);
    let machine = cutter_machine("esc-b");
    let mut dice = Dice::new(29);
    let mut longest = 0.0_f64;
    for round in 0..20 {
        let at = 2.0 + dice.share() * 20.0;
        let board = Rc::new(RefCell::new(Cutter::new(Flow::EscB, 1024)));
        board.borrow_mut().unplug_at = Some(at);
        let dir = tempfile::tempdir().unwrap();
        let journal = dir.path().join("job.journal");
        let (result, _) = to_cutter(&board, &text, &machine, PLAIN, Some(&journal), f64::INFINITY);
        let Err(SendError::Fault { fault: Fault::Unplugged(_), aborted }) = result else {
            panic!("{round}: {result:?}")
        };
        assert!(!aborted.tool_off, "{round}: nobody can know");
        while board.borrow().busy() {
            let now = board.borrow().now();
            board.borrow_mut().advance(now + 0.01);
        }
        longest = longest.max(board.borrow().now() - at);
        board.borrow_mut().unplug_at = None;
        let wishes = Wishes { resume: true, ..PLAIN };
        let (result, told) = to_cutter(&board, &text, &machine, wishes, Some(&journal), f64::INFINITY);
        result.unwrap_or_else(|err| panic!("{round}: {err}"));
        once_or_doubted(&want, &board.borrow().strokes, &told, &format!("replugged {round}"));
    }
    println!("a cutter without its cable: at most {longest:.2} s of motion, {} s allowed", machine.link.buffered);
    assert!(longest < machine.link.buffered + 1.0, "{longest}");
}

#[test]
fn a_deaf_cutter_is_said() {
    let machine = cutter_machine("esc-b");
    let board = Rc::new(RefCell::new(Cutter::new(Flow::EscB, 256).deaf_from(0.0)));
    let text = to_cutter(&board, &plot(2), &machine, PLAIN, None, f64::INFINITY).0.unwrap_err().to_string();
    assert!(text.contains("nothing answers"), "{text}");
    let board = Rc::new(RefCell::new(Cutter::new(Flow::EscB, 256).deaf_from(4.0)));
    let text = to_cutter(&board, &plot(8), &machine, PLAIN, None, f64::INFINITY).0.unwrap_err().to_string();
    assert!(text.contains("has not said anything"), "{text}");
}

#[test]
fn jobs_that_leave_the_bed_are_refused_before_a_byte_of_them_is_sent() {
    let machine = cutter_machine("none");
    let board = Rc::new(RefCell::new(Cutter::new(Flow::None, 256)));
    let result = to_cutter(&board, "IN;PA;SP1;PU0,0;PD40000,0;PU;", &machine, PLAIN, None, f64::INFINITY).0;
    assert!(matches!(&result, Err(SendError::Refused(text)) if text[0].contains("X1000.00")), "{result:?}");
    assert!(board.borrow().strokes.is_empty() && board.borrow().fullest == 0);
    let board = fresh();
    let result =
        to_marlin(&board, "G21\nG90\nG0 X500\nM280 P0 S90\nG1 Y10 F500\n", &marlin(), PLAIN, None, f64::INFINITY).0;
    assert!(matches!(result, Err(SendError::Refused(_))), "{result:?}");
    assert!(board.borrow().strokes.is_empty());
}

/// Random bytes instead of a machine: never a panic.
#[test]
fn no_bytes_from_a_wire_make_them_panic() {
    let pieces: [&[u8]; 14] = [
        b"ok\n",
        b"start\n",
        b"Resend: 4\n",
        b"rs \n",
        b"Error:checksum mismatch\n",
        b"Error:x\n",
        b"echo:busy: processing\n",
        b"X:1 Y:nan Z:\n",
        b"X:1.0 Y:2.0 Z:3.0 E:0\n",
        b"123\r",
        b"99999999999\r",
        b"\x13",
        b"\x11",
        b"\xff\xfe\x00\n",
    ];
    fn fuzz(mut it: impl Protocol, pieces: &[&[u8]], seed: u64) {
        let mut dice = Dice::new(seed);
        let mut now = 0.0;
        for k in 0..400 {
            now += dice.share();
            it.tick(now);
            let mut bytes = Vec::new();
            for _ in 0..dice.below(4) {
                match dice.below(6) {
                    0 => bytes.push((dice.next() & 0xff) as u8),
                    _ => bytes.extend_from_slice(pieces[dice.below(pieces.len())]),
                }
            }
            it.receive(now, &bytes);
            let line = Line { index: Some(k), text: "G1X1F100".into(), seconds: 0.1, ..Line::default() };
            if it.can_take(&line) {
                it.push(now, line);
            }
            while it.event().is_some() {}
            let _ = (it.output(), it.at_rest(), it.ahead(), it.done());
        }
    }
    for seed in 0..200 {
        fuzz(Marlin::new(plain::marlin_options(&marlin())), &pieces, seed);
        fuzz(Hpgl::new(plain::hpgl_options(&cutter_machine("esc-b"))), &pieces, seed);
        fuzz(Hpgl::new(plain::hpgl_options(&cutter_machine("xon-xoff"))), &pieces, seed);
    }
}
