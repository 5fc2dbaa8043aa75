//! The sender against boards in simulated time: whole jobs, every fault at many places, resume, throughput.
#![allow(clippy::unwrap_used, reason = "a test that panics is a test that fails")]
use std::{cell::RefCell, path::Path, rc::Rc};

use fabricate::{
    machine::{
        grbl::Grbl,
        job::{self, Wishes},
        protocol::{Event, Fault},
        session::{Operator, SendError, Session, Wish},
    },
    profile::Machine,
};

use crate::{
    board::{
        Device, Dice, SimWire,
        grbl::{Config, GrblBoard, Tool},
        hand::{Hand, Outcome, drive},
    },
    strokes::{KNIFE, along, expected, machine, once_or_doubted, polygons, same, segment_distance, touched},
};

struct Run<'a> {
    machine: &'a Machine,
    wishes: Wishes,
    journal: Option<&'a Path>,
    hands: Vec<(f64, Wish)>,
}

/// Sends a program to a board, from opening the port to the end.
fn send(board: &Rc<RefCell<GrblBoard>>, program: &str, run: Run<'_>) -> Outcome {
    let mut hand = Hand::new(board);
    hand.wishes = run.hands.into();
    drive(board, hand, Grbl::new(job::grbl_options(run.machine)), |session, tell| {
        session.prepare(run.machine, run.wishes)?;
        session.perform(program, run.machine, run.wishes, run.journal, tell)
    })
}

fn board(config: Config) -> Rc<RefCell<GrblBoard>> {
    Rc::new(RefCell::new(GrblBoard::new(config)))
}

const PLAIN: Wishes = Wishes { unlock: false, home: false, zero: false, check: false, frame: false, resume: false };

#[test]
fn a_job_arrives_position_by_position() {
    let program = polygons(20, 24, 15.0);
    for (config, streaming) in [
        (Config::new(KNIFE), "counting"),
        (Config::new(KNIFE), "send-response"),
        (Config { hal: true, receive: 1024, blocks: 100, reset_on_open: false, ..Config::new(KNIFE) }, "counting"),
    ] {
        let machine = machine("drag-knife-a3", &format!("link.streaming = \"{streaming}\""));
        let board = board(config);
        let out = send(&board, &program, Run { machine: &machine, wishes: PLAIN, journal: None, hands: vec![] });
        out.result.unwrap_or_else(|err| panic!("{err}\n{}", &out.log[out.log.len().saturating_sub(3000)..]));
        let board = board.borrow();
        assert_eq!(board.overrun, 0);
        same(&expected(&program, &machine), &touched(&board)).unwrap();
        assert!(!board.moving() && !board.tool_on());
        let done = out.events.iter().filter_map(|it| if let Event::Executed(n) = it { Some(*n) } else { None }).max();
        assert_eq!(done, Some(program.lines().count() - 1), "the last line is known to be done");
        assert!(out.log.contains("> G21G90G94G17G54\n") && out.log.contains("< ok\n"));
    }
}

#[test]
fn arcs_arrive_and_are_followed() {
    let machine = machine("drag-knife-a3", "");
    let mut program = String::from("G21 G90 G94 G17 G54\nM3 S40\nG4 P0.15\n");
    for i in 0..6 {
        let (x, y) = (30.0 + 60.0 * f64::from(i), 60.0);
        // A slot with round ends, and a swivel of a quarter of a millimetre.
        program += &format!("G0 X{x:.3} Y{y:.3}\nM3 S90\nG4 P0.2\nG1 X{:.3} F1500\n", x + 20.0);
        program += &format!("G3 Y{:.3} I0 J10\nG1 X{x:.3}\nG3 X{x:.3} Y{y:.3} I0 J-10\n", y + 20.0);
        program += &format!("G2 X{:.3} Y{:.3} I0 J-0.25\nM3 S40\nG4 P0.15\n", x + 0.25, y - 0.25);
    }
    program += "G0 X0 Y0\nM2\n";
    let board = board(Config::new(KNIFE));
    let out = send(&board, &program, Run { machine: &machine, wishes: PLAIN, journal: None, hands: vec![] });
    out.result.unwrap();
    let worst = along(&expected(&program, &machine), &touched(&board.borrow())).unwrap();
    println!("arcs: {worst:.4} mm between the chords of the board and of the reader");
}

/// The same polygons for a laser: power rides with the motion.
fn burnt(count: usize, corners: usize, radius: f64) -> String {
    let mut text = String::from("G21 G90 G94 G17 G54\nM4 S0\n");
    for line in polygons(count, corners, radius).lines().skip(4) {
        match line {
            "M3 S90" | "M3 S40" | "G4 P0.2" | "G4 P0.15" => {}
            _ if line.starts_with("G0") => text += &format!("{line} S0\n"),
            _ if line.contains('F') => text += &format!("{line} S500\n"),
            "M2" => text += "M5\nM2\n",
            _ => text += &format!("{line} S500\n"),
        }
    }
    text
}

#[test]
fn a_laser_job_burns_only_what_it_should() {
    let machine = machine("laser-co2", "");
    let program = burnt(6, 24, 15.0);
    let mut config = Config::new(Tool::Laser);
    config.settings.extend([(130, 600.0), (131, 400.0)]);
    let board = board(config);
    let out = send(&board, &program, Run { machine: &machine, wishes: PLAIN, journal: None, hands: vec![] });
    out.result.unwrap();
    same(&expected(&program, &machine), &touched(&board.borrow())).unwrap();
}

#[test]
fn a_board_that_does_not_fit_the_profile_is_refused_before_anything_moves() {
    let program = polygons(1, 8, 5.0);
    for (profile, setting, words) in [
        ("drag-knife-a3", (32, 1.0), "$32=0"),
        ("laser-co2", (32, 0.0), "$32=1"),
        ("laser-co2", (30, 255.0), "$30"),
        ("drag-knife-a3", (30, 50.0), "the servo needs S90"),
        ("drag-knife-a3", (13, 1.0), "$13=0"),
    ] {
        let machine = machine(profile, "");
        let mut config = Config::new(if profile == "laser-co2" { Tool::Laser } else { KNIFE });
        config.settings.insert(setting.0, setting.1);
        let board = board(config);
        let out = send(&board, &program, Run { machine: &machine, wishes: PLAIN, journal: None, hands: vec![] });
        let Err(SendError::Refused(text)) = out.result else { panic!("{profile} {setting:?} went through") };
        assert!(text.join(" ").contains(words), "{text:?}");
        assert_eq!(board.borrow().lines, 0, "no line of G-code reached the board");
    }
}

#[test]
fn a_job_outside_the_travel_is_refused_before_anything_moves() {
    let machine = machine("drag-knife-a3", "");
    let program = polygons(1, 8, 5.0);
    let refused = |config: Config, zero, wishes| {
        let board = Rc::new(RefCell::new(GrblBoard::new(config).zero_at(zero)));
        let out = send(&board, &program, Run { machine: &machine, wishes, journal: None, hands: vec![] });
        let lines = board.borrow().lines;
        (out.result.map_err(|err| err.to_string()), lines)
    };
    let home = Wishes { home: true, ..PLAIN };
    let (result, lines) = refused(Config::new(KNIFE).homing(), [-10.0, -290.0, -20.0], home);
    let text = result.unwrap_err();
    assert!(text.contains("X0.00 ($130)") && text.contains("the work zero is at X-10.00"), "{text}");
    assert_eq!(lines, 0);
    assert!(refused(Config::new(KNIFE).homing(), [-410.0, -290.0, -20.0], home).0.is_ok());
    // Without homing the bed is all there is to go by.
    let far = program.replace("X25", "X450");
    let board = board(Config::new(KNIFE));
    let out = send(&board, &far, Run { machine: &machine, wishes: PLAIN, journal: None, hands: vec![] });
    let text = out.result.unwrap_err().to_string();
    assert!(text.contains("X450.00, the bed of `drag-knife-a3` from X0.00 to X420.00"), "{text}");
    assert_eq!(board.borrow().lines, 0);
}

#[test]
fn an_axis_that_the_board_has_not_got_is_missed_before_anything_moves() {
    let machine =
        machine("drag-knife-a3", "knife = { offset = 0, overcut = 0, lift = 20, axis = \"A\" }\narcs = false");
    let program = polygons(4, 12, 12.0).replace("M3 S90", "G0 A30\nM3 S90");
    let run = |journal| Run { machine: &machine, wishes: HOME, journal, hands: vec![] };
    let three = homed(false);
    let text = send(&three, &program, run(None)).result.unwrap_err().to_string();
    assert!(text.contains("line 6: the program turns an axis A; the board reports 3 axes"), "{text}");
    assert_eq!(three.borrow().lines, 0);
    let four = homed(false);
    four.borrow_mut().config.rotary = true;
    // Only the first contour turns it: whoever goes on behind that must turn it as well.
    let once = program.replacen("G0 A30", "G0 A75", 1).replace("G0 A30\n", "");
    let dir = tempfile::tempdir().unwrap();
    let journal = dir.path().join("job.journal");
    let hands = vec![(15.0, Wish::Abort)];
    let out = send(&four, &once, Run { hands, ..run(Some(&journal)) });
    assert!(matches!(out.result, Err(SendError::Fault { fault: Fault::Interrupted, .. })), "{:?}", out.result);
    four.borrow_mut().angle = 0.0;
    let out = send(&four, &once, Run { wishes: Wishes { resume: true, ..PLAIN }, ..run(Some(&journal)) });
    out.result.unwrap_or_else(|err| panic!("{err}\n{}", out.log));
    assert!(out.told[0].starts_with(|it: char| ('1'..='3').contains(&it)), "{:?}", out.told);
    assert_eq!(four.borrow().angle, 75.0);
}

#[test]
fn a_locked_machine_says_what_to_do_and_home_and_unlock_do_it() {
    let machine = machine("drag-knife-a3", "");
    let program = polygons(1, 8, 5.0);
    for (wishes, works) in
        [(PLAIN, false), (Wishes { home: true, ..PLAIN }, true), (Wishes { unlock: true, zero: true, ..PLAIN }, false)]
    {
        let board = Rc::new(RefCell::new(GrblBoard::new(Config::new(KNIFE).homing()).zero_at([-410.0, -290.0, -20.0])));
        let out = send(&board, &program, Run { machine: &machine, wishes, journal: None, hands: vec![] });
        match (works, out.result) {
            (true, Ok(())) => {}
            (false, Err(SendError::Fault { fault: Fault::Locked(_), .. })) if !wishes.unlock => {}
            // Unlocked without homing it counts from where it stands, with no room towards positive: refused.
            (false, Err(SendError::Refused(text))) if wishes.unlock => assert!(text[0].contains("$130"), "{text:?}"),
            (_, other) => panic!("{wishes:?}: {other:?}"),
        }
    }
}

#[test]
fn check_and_frame_move_nothing_or_only_the_lifted_tool() {
    let machine = machine("drag-knife-a3", "");
    let program = polygons(3, 12, 10.0);
    let board = board(Config::new(KNIFE));
    let check = Run { machine: &machine, wishes: Wishes { check: true, ..PLAIN }, journal: None, hands: vec![] };
    let out = send(&board, &program, check);
    out.result.unwrap_or_else(|err| panic!("{err}\n{}", out.log));
    assert!(out.told.iter().any(|it| it.contains("found no error")));
    assert!(board.borrow().trace.is_empty(), "nothing moved");
    assert_eq!(board.borrow().state, crate::board::grbl::St::Idle, "check mode was left");

    let bad = program.replace("G1 X20.000 Y30.000", "G1 X20.000 Y30.000 T-1 U3");
    assert_ne!(bad, program);
    let out = send(
        &board,
        &bad,
        Run { machine: &machine, wishes: Wishes { check: true, ..PLAIN }, journal: None, hands: vec![] },
    );
    let text = out.result.unwrap_err().to_string();
    assert!(text.contains("error:20") && text.contains("does not know"), "{text}");

    let frame = Run { machine: &machine, wishes: Wishes { frame: true, ..PLAIN }, journal: None, hands: vec![] };
    send(&board, &program, frame).result.unwrap();
    let board = board.borrow();
    assert!(board.trace.iter().all(|it| !it.on), "the tool stays up");
    let zero = board.work_zero();
    let xs: Vec<f64> = board.trace.iter().map(|it| it.at[0] - zero[0]).collect();
    let (low, high) = (xs.iter().copied().fold(f64::MAX, f64::min), xs.iter().copied().fold(f64::MIN, f64::max));
    assert!((low - 10.0).abs() < 0.01 && (high - 120.0).abs() < 0.01, "{low} {high}");
}

#[test]
fn pauses_wait_with_the_tool_up() {
    let machine = machine("drag-knife-a3", "");
    let program = polygons(3, 12, 10.0).replacen("G0 X75", "M0\nG0 X75", 1);
    let board = board(Config::new(KNIFE));
    let hands = vec![(6.0, Wish::Pause)];
    let out = send(&board, &program, Run { machine: &machine, wishes: PLAIN, journal: None, hands });
    out.result.unwrap();
    assert!(out.pauses.iter().any(|it| it.contains("(M0)")), "{:?}", out.pauses);
    assert!(out.pauses.iter().any(|it| it.contains("between two contours")), "{:?}", out.pauses);
    same(&expected(&program, &machine), &touched(&board.borrow())).unwrap();
}

#[test]
fn feed_overrides_reach_the_board_one_by_one() {
    let machine = machine("drag-knife-a3", "");
    let program = polygons(4, 8, 15.0);
    let time = |hands: Vec<(f64, Wish)>| {
        let board = board(Config::new(KNIFE));
        send(&board, &program, Run { machine: &machine, wishes: PLAIN, journal: None, hands }).result.unwrap();
        let board = board.borrow();
        board.motion_time
    };
    let half = (0..5).map(|_| (3.0, Wish::Feed(-10))).collect();
    let (plain, slow) = (time(vec![]), time(half));
    assert!(slow > 1.3 * plain, "{slow} against {plain}");
}

/// A 6 ms latency more than the USB timer's 16 ms costs nothing that the planner cannot bridge.
#[test]
fn short_segments_keep_the_planner_fed_over_a_slow_link() {
    // 800 segments of 0.157 mm at F5000 round a circle, as MACHINE.md measured.
    let mut program = String::from("G21 G90 G94 G17 G54\nM3 S40\nG0 X45 Y25\nM3 S90\nG4 P0.2\n");
    for k in 1..=800 {
        let a = f64::from(k) / 800.0 * std::f64::consts::TAU;
        program += &format!(
            "G1 X{:.3} Y{:.3}{}\n",
            25.0 + 20.0 * a.cos(),
            25.0 + 20.0 * a.sin(),
            if k == 1 { " F5000" } else { "" }
        );
    }
    program += "M3 S40\nM2\n";
    let cut_time = |latency: f64, receive: usize, streaming: &str| {
        let machine = machine("drag-knife-a3", &format!("link.streaming = \"{streaming}\""));
        let mut config = Config { receive, ..Config::new(KNIFE) };
        config.faults.latency = latency;
        let board = board(config);
        let out = send(&board, &program, Run { machine: &machine, wishes: PLAIN, journal: None, hands: vec![] });
        out.result.unwrap();
        let board = board.borrow();
        let down: Vec<f64> = board.switched.iter().map(|it| it.0).collect();
        down[1] - down[0]
    };
    // The board's own time: everything in its buffer at once.
    let own = cut_time(0.0, 1 << 16, "counting");
    let slow = cut_time(0.016, 128, "counting");
    let single = cut_time(0.016, 128, "send-response");
    println!("own {own:.2} s, counting {slow:.2} s, send-response {single:.2} s");
    assert!(slow < 1.15 * own, "{slow} against {own}");
    assert!(single > 2.0 * own, "the latency is not felt: {single}");
}

/// One fault, the places where it strikes, and what must come of it.
struct Case {
    name: &'static str,
    /// Sets the fault at a share of the job in [0, 1); times run from `begin` to `end`, bytes and answers to `bytes` and
    /// `oks`.
    set: fn(&mut crate::board::grbl::Faults, &Span, f64),
    right: fn(&Fault) -> bool,
    says: &'static str,
    /// Seconds after the fault within which the tool must be off and the head at rest.
    within: f64,
    /// Whether the safe abort must have kept the position.
    kept: Option<bool>,
}

/// Where the plain job runs: times, bytes, answers, lines.
struct Span {
    begin: f64,
    end: f64,
    bytes: [usize; 2],
    oks: [usize; 2],
    lines: usize,
}

impl Span {
    fn at(&self, share: f64) -> f64 {
        self.begin + share * (self.end - self.begin)
    }
}

fn between(range: [usize; 2], share: f64) -> usize {
    range[0] + ((range[1] - range[0]) as f64 * share) as usize
}

const CASES: &[Case] = &[
    Case {
        name: "lost ok",
        set: |faults, span, share| faults.lost_ok = Some(between(span.oks, share)),
        right: |it| matches!(it, Fault::LostOk { missing: 1, .. }),
        says: "answer(s) never came",
        within: f64::INFINITY,
        kept: Some(true),
    },
    Case {
        name: "mute",
        set: |faults, span, share| faults.mute_at = Some(span.at(share)),
        right: |it| matches!(it, Fault::Mute { .. }),
        says: "has not said anything for",
        within: 1.0 + 0.5,
        kept: None,
    },
    Case {
        name: "limit switch",
        set: |faults, span, share| faults.alarm_at = Some(span.at(share)),
        right: |it| matches!(it, Fault::Alarm { code: 1, .. }),
        says: "ALARM:1",
        within: 0.5,
        kept: Some(false),
    },
    Case {
        name: "soft limit",
        set: |faults, span, share| faults.soft_limit_at = Some(span.at(share)),
        right: |it| matches!(it, Fault::Alarm { code: 2, .. }),
        says: "ALARM:2",
        within: 0.5,
        kept: None,
    },
    Case {
        name: "power dip",
        set: |faults, span, share| faults.reset_at = Some(span.at(share)),
        right: |it| matches!(it, Fault::Reset(_)),
        says: "reset itself",
        within: 0.5,
        kept: Some(false),
    },
    Case {
        name: "refused line",
        set: |faults, span, share| faults.refuse_line = Some(1 + (share * (span.lines - 1) as f64) as usize),
        right: |it| matches!(it, Fault::Error { code: 20, .. }),
        says: "error:20: the board does not know this G or M word",
        within: f64::INFINITY,
        kept: Some(true),
    },
];

pub(crate) const HOME_ZERO: [f64; 3] = [-410.0, -290.0, -20.0];

fn homed(hal: bool) -> Rc<RefCell<GrblBoard>> {
    let config = if hal {
        Config { hal, receive: 1024, blocks: 100, ..Config::new(KNIFE).homing() }
    } else {
        Config::new(KNIFE).homing()
    };
    Rc::new(RefCell::new(GrblBoard::new(config).zero_at(HOME_ZERO)))
}

const HOME: Wishes = Wishes { home: true, ..PLAIN };

/// Runs the job without a fault.
fn measure(program: &str, machine: &Machine, hal: bool) -> Span {
    let board = homed(hal);
    let out = send(&board, program, Run { machine, wishes: HOME, journal: None, hands: vec![] });
    out.result.unwrap();
    let board = board.borrow();
    let begin = board.switched.first().unwrap().0;
    let end = board.switched.last().unwrap().0;
    // The first bytes and answers belong to the questions at the start; what is lost there is asked for again.
    Span { begin, end, bytes: [60, board.received - 20], oks: [12, board.oks - 3], lines: board.lines }
}

/// After a fault: `--resume` homes, goes on, and every contour is cut once, or was named as in doubt.
fn resumes(board: &Rc<RefCell<GrblBoard>>, program: &str, machine: &Machine, journal: &Path, name: &str) {
    {
        let mut board = board.borrow_mut();
        let hal = board.config.hal;
        board.config.faults = Default::default();
        assert_eq!(hal, board.config.hal);
    }
    let wishes = Wishes { resume: true, ..PLAIN };
    let out = send(board, program, Run { machine, wishes, journal: Some(journal), hands: vec![] });
    let tail = &out.log[out.log.len().saturating_sub(1500)..];
    out.result.unwrap_or_else(|err| panic!("{name}: {err}\n{tail}"));
    once_or_doubted(&expected(program, machine), &touched(&board.borrow()), &out.told, name);
}

#[test]
fn every_fault_at_many_places_ends_with_the_tool_off_and_can_be_resumed() {
    let machine = machine("drag-knife-a3", "");
    let program = polygons(8, 12, 12.0);
    for hal in [false, true] {
        let span = measure(&program, &machine, hal);
        for case in CASES {
            let mut dice = Dice::new(7);
            let mut latest = 0.0_f64;
            for round in 0..20 {
                let name = format!("{} {round} {}", case.name, if hal { "hal" } else { "grbl" });
                let board = homed(hal);
                let share = dice.share();
                (case.set)(&mut board.borrow_mut().config.faults, &span, share);
                let dir = tempfile::tempdir().unwrap();
                let journal = dir.path().join("job.journal");
                let out = send(
                    &board,
                    &program,
                    Run { machine: &machine, wishes: HOME, journal: Some(&journal), hands: vec![] },
                );
                let tail = &out.log[out.log.len().saturating_sub(1500)..];
                let Err(SendError::Fault { fault, aborted }) = out.result else {
                    panic!("{name}: {:?}\n{tail}", out.result)
                };
                assert!((case.right)(&fault), "{name}: {fault:?}\n{tail}");
                assert!(fault.to_string().contains(case.says), "{name}: {fault}");
                if let Some(kept) = case.kept {
                    assert_eq!((aborted.position_kept, aborted.tool_off), (kept, true), "{name}\n{tail}");
                }
                {
                    let board = board.borrow();
                    assert!(!board.tool_on() && !board.moving(), "{name}\n{tail}");
                    let timed = case.within.is_finite();
                    let struck = if timed { span.at(share) } else { f64::INFINITY };
                    let off = board.switched.last().unwrap().0;
                    latest = latest.max(off - struck).max(board.moved_at - struck);
                    assert!(
                        off - struck <= case.within && board.moved_at - struck <= case.within,
                        "{name}: {}",
                        off - struck
                    );
                }
                resumes(&board, &program, &machine, &journal, &name);
            }
            println!(
                "{} (hal: {hal}): tool off and head at rest {latest:.3} s after the fault at the latest",
                case.name
            );
        }
    }
}

/// A job homed, begun, and stopped at a time: the tool is off and the position kept.
fn interrupted(board: &Rc<RefCell<GrblBoard>>, program: &str, machine: &Machine, journal: &Path, at: f64) -> Outcome {
    let hands = vec![(at, Wish::Abort)];
    let out = send(board, program, Run { machine, wishes: HOME, journal: Some(journal), hands });
    let Err(SendError::Fault { fault: Fault::Interrupted, aborted }) = &out.result else { panic!("{:?}", out.result) };
    assert!(aborted.position_kept && aborted.tool_off, "{at}: {aborted:?}\n{}", out.log);
    out
}

/// Ctrl-C: the wish to abort at any moment.
#[test]
fn an_interrupt_at_any_moment_stops_with_the_tool_off_and_the_position_kept() {
    let machine = machine("drag-knife-a3", "");
    let program = polygons(8, 12, 12.0);
    let span = measure(&program, &machine, false);
    let mut dice = Dice::new(11);
    let mut latest = 0.0_f64;
    for round in 0..20 {
        let at = span.begin + dice.share() * (span.end - span.begin);
        let board = homed(false);
        let dir = tempfile::tempdir().unwrap();
        let journal = dir.path().join("job.journal");
        let out = interrupted(&board, &program, &machine, &journal, at);
        {
            let board = board.borrow();
            assert!(!board.tool_on() && !board.moving() && !board.locked());
            let off = board.switched.last().unwrap().0.max(board.moved_at) - at;
            latest = latest.max(off);
            assert!(off <= 0.5, "round {round}: {off} s, at {at}\n{}", out.log);
            let Some(Event::Position(told, _)) = out.events.iter().rfind(|it| matches!(it, Event::Position(..))) else {
                panic!()
            };
            assert!((0..2).all(|i| (told[i] - board.reported()[i]).abs() < 0.002), "{told:?} {:?}", board.reported());
        }
        resumes(&board, &program, &machine, &journal, "interrupt");
    }
    println!("interrupt: tool off and head at rest {latest:.3} s after it at the latest");
}

/// With the cable out, or the sender killed, nobody can stop the machine: what counts is how little it still does. A board
/// that lives by the cable starts anew when it is back, one with power of its own goes on to the end of its buffer.
#[test]
fn a_machine_left_alone_runs_on_only_shortly() {
    let program = polygons(8, 12, 12.0);
    for limit in [1.0, 2.0] {
        let machine = machine("drag-knife-a3", &format!("link.buffered = {limit}"));
        let span = measure(&program, &machine, false);
        let mut dice = Dice::new(13);
        let mut longest = 0.0_f64;
        for round in 0..40 {
            let powered = round % 2 == 0;
            let at = span.begin + dice.share() * (span.end - span.begin - 3.0);
            let board = homed(false);
            board.borrow_mut().config.faults.unplug_at = Some(at);
            let dir = tempfile::tempdir().unwrap();
            let journal = dir.path().join("job.journal");
            let out =
                send(&board, &program, Run { machine: &machine, wishes: HOME, journal: Some(&journal), hands: vec![] });
            let Err(SendError::Fault { fault: Fault::Unplugged(_), .. }) = out.result else {
                panic!("{:?}", out.result)
            };
            {
                let mut board = board.borrow_mut();
                let now = board.now();
                board.advance(now + 60.0);
                longest = longest.max(board.moved_at - at);
                if !powered {
                    board.replug();
                    let now = board.now();
                    board.advance(now + 3.0);
                    assert!(board.locked() && !board.tool_on());
                }
            }
            resumes(&board, &program, &machine, &journal, "left alone");
        }
        println!("left alone: at most {longest:.2} s of motion, {limit} s allowed");
        // Two lines are always let through, and one may have begun: their time comes on top.
        assert!(longest <= limit + 1.0, "{longest}");
    }
}

#[test]
fn a_panic_runs_the_safe_abort() {
    let machine = machine("drag-knife-a3", "");
    let program = polygons(4, 12, 12.0);
    for at in [4.0, 5.3, 7.7] {
        let board = board(Config::new(KNIFE));
        let mut hand = Hand::new(&board);
        hand.panic_at = Some(at);
        let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            let mut session =
                Session::new(SimWire::new(&board), Grbl::new(job::grbl_options(&machine)), &mut hand, None);
            session.prepare(&machine, PLAIN).unwrap();
            let _ = session.perform(&program, &machine, PLAIN, None, &mut |_| ());
        }));
        assert!(result.is_err(), "the panic goes on after the abort");
        let board = board.borrow();
        assert!(!board.tool_on() && !board.moving() && !board.locked());
        assert!(board.switched.last().unwrap().0 - at < 0.5 && board.moved_at - at < 0.5);
    }
}

#[test]
fn an_old_job_still_running_is_stopped_first() {
    let machine = machine("drag-knife-a3", "");
    let board = board(Config { reset_on_open: false, ..Config::new(KNIFE) });
    {
        let mut board = board.borrow_mut();
        for byte in b"M3S90\nG1X100F1000\nG1X1" {
            board.receive(*byte);
        }
        board.advance(1.0);
        assert!(board.moving() && board.tool_on());
    }
    let program = polygons(1, 8, 5.0);
    let run = || Run { machine: &machine, wishes: PLAIN, journal: None, hands: vec![] };
    let out = send(&board, &program, run());
    assert!(matches!(out.result, Err(SendError::Fault { fault: Fault::WasRunning("Run"), .. })), "{:?}", out.result);
    assert!(!board.borrow().tool_on() && !board.borrow().moving());
    // Half a line of the old job in an idle board's buffer does not become part of the new one.
    for byte in b"G1X9" {
        board.borrow_mut().receive(*byte);
    }
    send(&board, &program, run()).result.unwrap();
}

/// Bytes lost or garbled on the way. There is no checksum: a line may stay valid and mean something else. What the sender
/// can see, it must see: a missing answer, an error, a place where the program does not lead.
#[test]
fn lost_and_garbled_bytes_never_leave_the_tool_on_and_are_seen_where_they_can_be() {
    let machine = machine("drag-knife-a3", "");
    let program = polygons(8, 12, 12.0);
    let span = measure(&program, &machine, false);
    let want = expected(&program, &machine);
    let mut dice = Dice::new(17);
    let (mut seen, mut harmless, mut missed) = (0, 0, 0);
    for round in 0..60 {
        let board = homed(false);
        let at = between(span.bytes, dice.share());
        {
            let faults = &mut board.borrow_mut().config.faults;
            if round % 2 == 0 {
                faults.drop_byte = Some(at);
            } else {
                faults.garble_byte = Some((at, 1 << dice.below(7)));
            }
        }
        let dir = tempfile::tempdir().unwrap();
        let journal = dir.path().join("job.journal");
        let out =
            send(&board, &program, Run { machine: &machine, wishes: HOME, journal: Some(&journal), hands: vec![] });
        assert!(!board.borrow().tool_on() && !board.borrow().moving(), "{round}: {:?}\n{}", out.result, out.log);
        match out.result {
            Err(SendError::Fault { .. }) => {
                seen += 1;
                resumes(&board, &program, &machine, &journal, &format!("byte {round}"));
            }
            Err(other) => panic!("{round}: {other}"),
            Ok(()) => {
                // How far from the meant path the tool went.
                let touched = touched(&board.borrow());
                let off = touched.iter().flatten().map(|p| {
                    want.iter()
                        .flat_map(|it| it.windows(2))
                        .map(|it| segment_distance(*p, it[0], it[1]))
                        .fold(f64::INFINITY, f64::min)
                });
                let worst = off.fold(0.0, f64::max);
                if worst < 1.0 { harmless += 1 } else { missed += 1 }
            }
        }
    }
    println!("bytes lost or garbled: {seen} seen, {harmless} within 1 mm, {missed} not seen");
    assert!(missed <= 3, "{missed} not seen");
}

#[test]
fn a_crawling_machine_is_warned_about() {
    let machine = machine("drag-knife-a3", "");
    // F3000 became F30 on the way: the board sees another program than the sender.
    let program = polygons(1, 8, 15.0);
    let mut config = Config::new(KNIFE);
    config.settings.extend([(110, 60.0), (111, 60.0)]);
    let board = board(config);
    {
        // The sender believes the profile's speed: hide the board's limits.
        let mut board = board.borrow_mut();
        board.hidden = vec![110, 111];
    }
    let out = send(
        &board,
        &program,
        Run { machine: &machine, wishes: PLAIN, journal: None, hands: vec![(60.0, Wish::Abort)] },
    );
    assert!(
        out.events.iter().any(|it| matches!(it, Event::Warning(text) if text.contains("much slower than planned"))),
        "{}",
        out.log
    );
}

#[test]
fn boards_that_say_nothing_or_start_slowly() {
    let machine = machine("drag-knife-a3", "");
    let program = polygons(1, 8, 5.0);
    let dead = board(Config { boot: 1e9, ..Config::new(KNIFE) });
    let out = send(&dead, &program, Run { machine: &machine, wishes: PLAIN, journal: None, hands: vec![] });
    let text = out.result.unwrap_err().to_string();
    assert!(text.contains("nothing answers after 8 s") && text.contains("link.dtr"), "{text}");
    let slow = board(Config { boot: 6.0, ..Config::new(KNIFE) });
    send(&slow, &program, Run { machine: &machine, wishes: PLAIN, journal: None, hands: vec![] }).result.unwrap();
}

/// Random bytes instead of a board: never a panic, and always an end.
#[test]
fn no_bytes_from_a_wire_make_it_panic() {
    use fabricate::machine::protocol::{Line, Protocol};
    let machine = machine("drag-knife-a3", "");
    let pieces: [&[u8]; 16] = [
        b"ok\r\n",
        b"error:",
        b"error:9\r\n",
        b"ALARM:1\r\n",
        b"<Idle|MPos:0.000,0.000,0.000|FS:0,0>\r\n",
        b"<Run|MPos:",
        b"1e308,-1e308,nan|",
        b"Grbl 1.1h ['$' for help]\r\n",
        b"[OPT:V,15,128]\r\n",
        b"[OPT:V,99999999999,0]\r\n",
        b"$32=0\r\n",
        b"[G5",
        b"[G54:1,2,3]\r\n",
        b"<Hold:0|WPos:1,2,3|Ov:999,1,1|WCO:1,2,3>\r\n",
        b"\n",
        b"\xff\xfe\x00",
    ];
    for seed in 0..400 {
        let mut dice = Dice::new(seed);
        let mut grbl = Grbl::new(job::grbl_options(&machine));
        let mut now = 0.0;
        let mut sent = 0;
        for _ in 0..400 {
            now += dice.share() * 0.3;
            grbl.tick(now);
            let mut bytes = Vec::new();
            for _ in 0..dice.below(4) {
                match dice.below(6) {
                    0 => bytes.push((dice.next() & 0xff) as u8),
                    _ => bytes.extend_from_slice(pieces[dice.below(pieces.len())]),
                }
            }
            grbl.receive(now, &bytes);
            let line = Line { index: Some(sent), text: "G1X1F100".into(), seconds: 0.1, ..Line::default() };
            if grbl.can_take(&line) {
                grbl.push(now, line);
                sent += 1;
            }
            while grbl.event().is_some() {}
            let _ = (grbl.output(), grbl.at_rest(), grbl.ahead(), grbl.done());
        }
    }
}

#[test]
fn a_hundred_thousand_lines_stream_without_a_pause() {
    let machine = machine("drag-knife-a3", "");
    let mut program = String::from("G21 G90 G94 G17 G54\nM3 S40\nG0 X10 Y10\nM3 S90\nG4 P0.2\nG1 F6000\n");
    for k in 0..100_000 {
        let a = f64::from(k) * 0.01;
        let r = 20.0 + 80.0 * f64::from(k) / 100_000.0;
        program += &format!("X{:.2}Y{:.2}\n", 150.0 + r * a.cos(), 150.0 + r * a.sin());
    }
    program += "M3 S40\nM2\n";
    let board = board(Config::new(KNIFE));
    let out = send(&board, &program, Run { machine: &machine, wishes: PLAIN, journal: None, hands: vec![] });
    out.result.unwrap();
    let board = board.borrow();
    println!("100 000 lines: {:.0} s of motion, the planner ran dry {} times", board.motion_time, board.starved);
    assert_eq!((board.overrun, board.starved), (0, 1), "dry only at the end of the path");
}

#[test]
fn a_z_axis_is_raised_by_the_abort() {
    let mut machine = machine("pen-plotter", "");
    machine.head = fabricate::profile::Head::Z { up: 4.0, down: -0.5, plunge: 300.0, dwell: 0.1 };
    let mut program = String::from("G21 G90 G94 G17 G54\nM5\nG0 Z4\n");
    for i in 0..4 {
        let x = 20.0 + 40.0 * f64::from(i);
        program += &format!("G0 X{x:.1} Y20\nG1 Z-0.5 F300\nG4 P0.1\nG1 X{:.1} F1000\nG1 Y50\nG0 Z4\n", x + 30.0);
    }
    program += "G0 X0 Y0\nM2\n";
    let mut dice = Dice::new(19);
    for round in 0..20 {
        let mut board = GrblBoard::new(Config::new(Tool::Z { clear: 2.0 }).homing()).zero_at([-400.0, -280.0, -20.0]);
        board.config.faults.latency = 0.004;
        let board = Rc::new(RefCell::new(board));
        let at = 6.0 + dice.share() * 14.0;
        let dir = tempfile::tempdir().unwrap();
        let journal = dir.path().join("job.journal");
        interrupted(&board, &program, &machine, &journal, at);
        let now = board.borrow().now();
        board.borrow_mut().advance(now + 2.0);
        let height = board.borrow().pos[2] - board.borrow().work_zero()[2];
        assert!((4.0..=20.0).contains(&(height + 1e-3)), "{round}: the tool is at {height} mm");
        assert!(board.borrow().moved_at - at < 0.5);
    }
}

/// The real serial layer, over a pseudo-terminal.
mod over_a_port {
    use std::cell::Cell;

    use fabricate::machine::link::{OpenError, Serial};

    use super::*;
    use crate::board::pty::PtyBoard;

    struct Quiet(Cell<usize>);

    impl Operator for Quiet {
        fn wish(&mut self) -> Option<Wish> {
            None
        }
        fn event(&mut self, _: &Event) {
            self.0.set(self.0.get() + 1);
        }
        fn progress(&mut self, _: f64) {}
        fn paused(&mut self, _: &str) {}
    }

    fn send(port: &str, program: &str, machine: &Machine) -> Result<(), SendError> {
        let mut quiet = Quiet(Cell::new(0));
        let wire = Serial::open(port, &machine.link).unwrap();
        let mut session = Session::new(wire, Grbl::new(job::grbl_options(machine)), &mut quiet, None);
        session.prepare(machine, PLAIN)?;
        session.perform(program, machine, PLAIN, None, &mut |_| ())
    }

    #[test]
    fn a_job_arrives_whole() {
        let machine = machine("drag-knife-a3", "");
        let program = polygons(6, 24, 15.0);
        let pty = PtyBoard::start(GrblBoard::new(Config::new(KNIFE)), 10.0);
        send(&pty.port, &program, &machine).unwrap();
        let board = pty.board();
        same(&expected(&program, &machine), &touched(&board)).unwrap();
        assert!(!board.tool_on() && board.overrun == 0);
    }

    #[test]
    fn a_pulled_plug_is_said() {
        let machine = machine("drag-knife-a3", "");
        let program = polygons(6, 24, 15.0);
        let mut config = Config::new(KNIFE);
        config.faults.unplug_at = Some(15.0);
        let pty = PtyBoard::start(GrblBoard::new(config), 10.0);
        let text = send(&pty.port, &program, &machine).unwrap_err().to_string();
        assert!(text.contains("the connection broke off"), "{text}");
        pty.wait("the board has run its buffer to the end", |it| !it.moving() && it.now() > it.moved_at + 1.0);
    }

    #[test]
    fn ports_that_cannot_be_had_say_why() {
        let link = machine("drag-knife-a3", "").link;
        let missing = Serial::open("/dev/no-such-port", &link).err().unwrap();
        assert!(matches!(missing, OpenError::Missing { .. }), "{missing}");
        let pty = PtyBoard::start(GrblBoard::new(Config::new(KNIFE)), 1.0);
        let _first = Serial::open(&pty.port, &link).unwrap();
        let second = Serial::open(&pty.port, &link).err().unwrap();
        assert!(matches!(second, OpenError::Busy(_)), "{second}");
        assert!(second.to_string().contains("in use by another program"));
    }
}
