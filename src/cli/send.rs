//! `fabricate send`: programs to a machine over a serial port, with progress, keys, and a journal beside each file.
use std::{
    fs::{self, File},
    io::{BufRead, BufWriter, IsTerminal, Write},
    path::{Path, PathBuf},
    sync::{
        atomic::Ordering,
        mpsc::{Receiver, TryRecvError, channel},
    },
};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use toml::de::DeTable;

use super::{CANCEL, Exit, args::Send, show};
use crate::{
    machine::{
        grbl::Grbl,
        hpgl::Hpgl,
        job::{self, Wishes},
        journal::{JournalError, Past},
        link::Serial,
        marlin::Marlin,
        plain,
        program::Program,
        protocol::{Event, Fault, Protocol},
        session::{Operator, SendError, Session, Wish},
    },
    profile::{Dialect, Machine, load_machine},
};

/// How long a cutter may hold back the flow of bytes, s.
const HELD_BACK: f64 = 600.0;

/// Faults of a program that are shown.
const SHOWN: usize = 5;

/// A program and where it lies.
struct Job {
    path: PathBuf,
    text: String,
    program: Program,
}

impl Job {
    fn beside(&self, ending: &str) -> PathBuf {
        let mut name = self.path.clone().into_os_string();
        name.push(ending);
        name.into()
    }

    fn summary(&self) -> String {
        let (program, work) = (&self.program, &self.program.work);
        let mut text = format!("{}\n", self.path.display());
        if !work.is_empty() {
            text += &format!(
                "   extents  X {:.2} to {:.2}, Y {:.2} to {:.2}, Z {:.2} to {:.2} mm (work coordinates)\n",
                work.min[0], work.max[0], work.min[1], work.max[1], work.min[2], work.max[2]
            );
        }
        text + &format!(
            "  contours  {}, {:.0} mm at work, {:.0} mm between, {} pause(s)\n      time  about {}\n",
            program.contours.len(),
            program.worked,
            program.travelled,
            program.pauses.len(),
            clock(program.total_seconds())
        )
    }
}

/// Minutes and seconds.
fn clock(seconds: f64) -> String {
    let seconds = seconds.round() as u64;
    format!("{}:{:02} min", seconds / 60, seconds % 60)
}

/// Runs the command; every complaint has been shown when it returns.
pub(super) fn send(args: &Send) -> Exit {
    match profile(&args.machine) {
        Ok(machine) => send_to(args, &machine),
        Err(message) => {
            show::note(&format!("error: {message}"));
            Exit::Usage
        }
    }
}

/// Sends programs to a machine of a known profile.
pub(super) fn send_to(args: &Send, machine: &Machine) -> Exit {
    let mut jobs = Vec::new();
    for path in &args.files {
        match read(path, machine) {
            Ok(job) => jobs.push(job),
            Err(message) => {
                show::note(&format!("error: {message}"));
                return Exit::Input;
            }
        }
    }
    for job in &jobs {
        show::data(&job.summary());
    }
    let Some(port) = args.port.as_deref().filter(|_| !args.dry_run) else {
        return dry_run(&jobs, machine);
    };
    match over_port(args, machine, &jobs, port) {
        Ok(()) => Exit::Done,
        Err(exit) => exit,
    }
}

/// A machine profile by its name or path.
pub(super) fn profile(name: &str) -> Result<Machine, String> {
    let text = format!("profile = {}", toml::Value::String(name.to_owned()));
    let table = DeTable::parse(&text).map_err(|err| err.to_string())?;
    load_machine(Path::new("."), table.get_ref()).map_err(|err| err.to_string())
}

fn read(path: &Path, machine: &Machine) -> Result<Job, String> {
    let name = path.display();
    if ["svg", "dxf", "pdf", "fold", "obj", "stl", "ply", "off", "png", "json", "toml"].iter().any(|it| ends(path, it))
    {
        return Err(format!(
            "{name} is no program for a machine: send G-code (.nc, .gcode) or HPGL (.plt), which `fabricate run` writes \
             into sheets/ where output.formats asks for them"
        ));
    }
    let bytes = fs::read(path).map_err(|err| format!("cannot read {name}: {err}"))?;
    let text = String::from_utf8(bytes).map_err(|_| format!("{name} is no text, and so no program"))?;
    let program = if is_plot(path) { plain::read_plot(&text, machine) } else { job::read(text.clone(), machine) };
    let program = program.map_err(|err| {
        let lines = err.to_string();
        let (shown, count) = (lines.lines().take(SHOWN).collect::<Vec<_>>().join("\n"), lines.lines().count());
        let more = if count > SHOWN { format!("\nand {} more", count - SHOWN) } else { String::new() };
        format!("{name}:\n{shown}{more}")
    })?;
    Ok(Job { path: path.to_owned(), text, program })
}

/// Whether a file name has an ending, in whatever case.
fn ends(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|it| it.eq_ignore_ascii_case(ending))
}

/// Whether a file is HPGL, by its ending.
fn is_plot(path: &Path) -> bool {
    ["plt", "hpgl", "hpg"].iter().any(|it| ends(path, it))
}

/// What is spoken at the other end of the port: plots go to cutters, G-code to boards of the profile's dialect.
fn language(jobs: &[Job], machine: &Machine) -> Result<Language, String> {
    let plots = jobs.iter().filter(|it| is_plot(&it.path)).count();
    match machine.dialect {
        _ if plots > 0 && plots < jobs.len() => Err("HPGL and G-code cannot go to one machine".into()),
        _ if plots > 0 => Ok(Language::Hpgl),
        Dialect::Grbl => Ok(Language::Grbl),
        Dialect::Marlin => Ok(Language::Marlin),
        Dialect::LinuxCnc => Err(format!("`{}` reads whole files; load them at its own controls", machine.name)),
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Language {
    Grbl,
    Marlin,
    Hpgl,
}

fn dry_run(jobs: &[Job], machine: &Machine) -> Exit {
    let faults: Vec<String> = jobs.iter().flat_map(|it| job::bed_faults(&it.program, machine)).collect();
    for fault in &faults {
        show::note(&format!("error: {fault}"));
    }
    if faults.is_empty() { Exit::Done } else { Exit::ChecksFailed }
}

fn over_port(args: &Send, machine: &Machine, jobs: &[Job], port: &str) -> Result<(), Exit> {
    let language = language(jobs, machine).map_err(|message| {
        show::note(&format!("error: {message}"));
        Exit::Usage
    })?;
    let wire = Serial::open(port, &machine.link).map_err(|err| {
        show::error(&err);
        Exit::Machine
    })?;
    let log: Option<Box<dyn Write>> = match jobs.first().map(|it| it.beside(".log")) {
        None => None,
        Some(path) => match File::create(&path) {
            Ok(file) => Some(Box::new(BufWriter::new(file))),
            Err(err) => {
                show::note(&format!("error: cannot write the log {}: {err}", path.display()));
                return Err(Exit::Output);
            }
        },
    };
    if !args.check && !args.frame && !jobs.is_empty() {
        show::note(&format!(
            "if the cable or this computer fails, the tool goes on for up to {:.1} s ([machine] link.buffered)",
            machine.link.buffered
        ));
    }
    let mut console = Console::new(args.quiet);
    let wishes = wishes(args);
    let mut current = None;
    let result = match language {
        Language::Grbl => {
            let mut session = Session::new(wire, Grbl::new(job::grbl_options(machine)), &mut console, log);
            session.prepare(machine, wishes).and_then(|()| {
                each(&mut session, jobs, args, &mut current, |session, job, wishes, tell| {
                    session.perform(&job.text, machine, wishes, Some(&job.beside(".journal")), tell)
                })
            })
        }
        Language::Marlin => {
            let mut session = Session::new(wire, Marlin::new(plain::marlin_options(machine)), &mut console, log);
            session.prepare(wishes).and_then(|()| {
                each(&mut session, jobs, args, &mut current, |session, job, wishes, tell| match wishes.frame {
                    true => session.frame(&job.program, machine),
                    false => session.perform_plain(&job.program, machine, wishes, Some(&job.beside(".journal")), tell),
                })
            })
        }
        Language::Hpgl => {
            let mut session = Session::new(wire, Hpgl::new(plain::hpgl_options(machine)), &mut console, log);
            // A cutter that holds the bytes back is not broken: it may wait for a sheet.
            session.set_patience(HELD_BACK);
            session.prepare(wishes).and_then(|()| {
                each(&mut session, jobs, args, &mut current, |session, job, wishes, tell| match wishes.frame {
                    true => session.frame(&job.program),
                    false => session.perform_plain(&job.program, machine, wishes, Some(&job.beside(".journal")), tell),
                })
            })
        }
    };
    console.bar.finish_and_clear();
    result.map_err(|err| complain(&err, current))
}

/// Sends one program after the other. Of several, those whose journal says that they are done are left out when a job
/// is resumed.
fn each<'j, P: Protocol>(
    session: &mut Session<'_, Serial, P>,
    jobs: &'j [Job],
    args: &Send,
    current: &mut Option<&'j Job>,
    mut perform: impl FnMut(&mut Session<'_, Serial, P>, &Job, Wishes, &mut dyn FnMut(&str)) -> Result<(), SendError>,
) -> Result<(), SendError> {
    for (i, job) in jobs.iter().enumerate() {
        if i > 0 && !args.check {
            session.ask(&format!("put in the material for {}", job.path.display()))?;
        }
        *current = Some(job);
        session.begin(&job.path.display().to_string(), job.program.total_seconds());
        let mut tell = |text: &str| show::note(text);
        let several = jobs.len() > 1;
        match perform(session, job, wishes(args), &mut tell) {
            Err(SendError::Journal(JournalError::Finished(_))) if several => {}
            Err(SendError::Journal(JournalError::Missing(_))) if several => {
                perform(session, job, Wishes { resume: false, ..wishes(args) }, &mut tell)?;
            }
            other => other?,
        }
    }
    Ok(())
}

fn wishes(args: &Send) -> Wishes {
    Wishes {
        unlock: args.unlock,
        home: args.home,
        zero: args.zero,
        check: args.check,
        frame: args.frame,
        resume: args.resume,
    }
}

/// Says what happened and what to do, and picks the exit code.
fn complain(err: &SendError, job: Option<&Job>) -> Exit {
    show::error(err);
    let exit = match err {
        SendError::Fault { fault: Fault::Interrupted, .. } => Exit::Interrupted,
        SendError::Fault { .. } | SendError::Refused(_) => Exit::Machine,
        SendError::Journal(JournalError::Io { .. }) => return Exit::Output,
        SendError::Journal(_) => return Exit::Usage,
    };
    if let SendError::Fault { fault, aborted } = err {
        show::note(match (fault, aborted.tool_off, aborted.position_kept) {
            (Fault::Locked(_) | Fault::NoReply(_), ..) => return exit,
            (_, true, true) => "the tool is off and the position is kept",
            (_, true, false) => "the tool is off; the position may be lost, so home the machine before you go on",
            (_, false, _) => "WARNING: nobody has confirmed that the tool is off; go and look at the machine",
        });
    }
    if let Some(job) = job {
        let past = fs::read_to_string(job.beside(".journal")).ok().and_then(|it| Past::read(&it));
        if let Some(past) = past.filter(|it| !it.finished) {
            let of = job.program.contours.len();
            show::note(&format!("{} of {of} contours are surely done; --resume goes on with the rest", past.done));
            for contour in past.in_doubt().take(10) {
                show::note(&format!("in doubt: {}", job.program.describe(contour)));
            }
        }
    }
    exit
}

/// The person in front of the terminal.
struct Console {
    bar: ProgressBar,
    quiet: bool,
    keys: Receiver<String>,
    paused: bool,
    aborted: bool,
}

impl Console {
    fn new(quiet: bool) -> Self {
        let fancy = !quiet && std::io::stderr().is_terminal();
        let target = if fancy { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(1000), target);
        let style = ProgressStyle::with_template("{bar:24} {percent:>3} % {wide_msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        let (sender, keys) = channel();
        // Ends with the program; it only waits for lines.
        std::thread::spawn(move || {
            for line in std::io::stdin().lock().lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    return;
                }
            }
        });
        if fancy {
            show::note("keys, each with Enter: p pause after this contour, Enter go on, + and - feed, = planned feed");
        }
        Self { bar, quiet, keys, paused: false, aborted: false }
    }
}

impl Operator for Console {
    fn wish(&mut self) -> Option<Wish> {
        if CANCEL.load(Ordering::Relaxed) && !self.aborted {
            self.aborted = true;
            self.bar.suspend(|| show::note("stopping: the machine is brought to rest and the tool off"));
            return Some(Wish::Abort);
        }
        match self.keys.try_recv() {
            Ok(line) => match line.trim() {
                "p" => Some(Wish::Pause),
                "+" => Some(Wish::Feed(10)),
                "-" => Some(Wish::Feed(-10)),
                "=" => Some(Wish::PlannedFeed),
                "" => {
                    self.paused = false;
                    Some(Wish::Go)
                }
                _ => None,
            },
            // Nobody can press Enter any more.
            Err(TryRecvError::Disconnected) if self.paused && !self.aborted => {
                self.aborted = true;
                self.bar.suspend(|| show::note("the job waits for a person, but there is no input: stopping"));
                Some(Wish::Abort)
            }
            Err(_) => None,
        }
    }

    fn event(&mut self, event: &Event) {
        if let Event::Warning(text) = event {
            self.bar.suspend(|| show::warning(text));
        }
    }

    fn begin(&mut self, name: &str, seconds: f64) {
        self.bar.set_length((seconds * 1000.0) as u64);
        self.bar.set_position(0);
        self.bar.set_prefix(name.to_owned());
        if !self.quiet && !std::io::stderr().is_terminal() {
            show::note(&format!("sending {name}, about {}", clock(seconds)));
        }
    }

    fn progress(&mut self, done: f64) {
        let at = (done * 1000.0) as u64;
        if at != self.bar.position() {
            self.bar.set_position(at);
            let left = self.bar.length().unwrap_or(0).saturating_sub(at) as f64 / 1000.0;
            self.bar.set_message(format!("{} left", clock(left)));
        }
    }

    fn paused(&mut self, why: &str) {
        self.paused = true;
        self.bar.suspend(|| show::note(&format!("{why}: press Enter to go on, Ctrl-C to stop")));
    }
}
