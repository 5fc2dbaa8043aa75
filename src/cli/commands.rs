//! What each command does.
use std::{error::Error, fs, path::Path};

use clap::CommandFactory;

use super::{
    CANCEL, Exit,
    args::{Args, Check, Command, Coupon, Init, Profiles, Run, Send},
    inspect, send, show, template, watch,
};
use crate::{
    machine,
    pipeline::{self, Config, ConfigError, ConfigText, InputError, Plan, Range, RunError, STAGES, Source},
    profile,
};

/// Runs a command; every complaint has been shown when it returns.
pub(super) fn run(args: Args) -> Exit {
    match args.command {
        Command::Run(args) if args.watch => watch::watch(&args),
        Command::Run(args) => job(&args),
        Command::Check(args) => check(&args),
        Command::Init(args) => init(&args),
        Command::Inspect { file, json, machine, picture } => {
            inspect::inspect(&file, json, machine.as_deref(), picture.as_deref())
        }
        Command::Send(args) => send::send(&args),
        Command::Coupon(args) => coupon(&args),
        Command::Ports => ports(),
        Command::Profiles { show } => profiles(show),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Args::command(), "fabricate", &mut script);
            show::data(&String::from_utf8_lossy(&script));
            Exit::Done
        }
        Command::Schema => {
            show::data(&format!("{:#}", pipeline::schema()));
            Exit::Done
        }
        Command::Man => man(),
    }
}

pub(super) fn is_config(path: &Path) -> bool {
    path.extension().is_some_and(|it| it.eq_ignore_ascii_case("toml"))
}

pub(super) fn config_text(job: &Path, sets: &[String]) -> Result<ConfigText, ConfigError> {
    if is_config(job) { ConfigText::read(job, sets) } else { ConfigText::for_mesh(job, sets) }
}

/// A plan with its input and the output folder the config names.
struct Prepared {
    plan: Plan,
    source: Source,
    dir: std::path::PathBuf,
}

fn prepare(text: &ConfigText, seed: Option<u64>) -> Result<Prepared, InputError> {
    let mut config = Config::parse(text)?;
    config.seed = seed.unwrap_or(config.seed);
    let dir = config.output.dir.clone();
    // The plan first: a wrong key is found at once, before a large mesh is read.
    let source_of = Config::parse(text)?;
    let plan = pipeline::plan(config)?;
    let source = Source::load(&source_of)?;
    Ok(Prepared { plan, source, dir })
}

fn refuse(err: &InputError) -> Exit {
    match err {
        InputError::Config(err) => {
            show::config_error(err);
            Exit::Usage
        }
        other => {
            show::error(other);
            Exit::Input
        }
    }
}

/// The config with all options of the command line.
pub(super) fn text_of(args: &Run) -> Result<ConfigText, ConfigError> {
    let mut sets = args.sets.clone();
    if !args.only.is_empty() {
        let names: Vec<String> = args.only.iter().map(|it| format!("{it:?}")).collect();
        sets.push(format!("nest.only=[{}]", names.join(", ")));
    }
    config_text(&args.job, &sets)
}

fn job(args: &Run) -> Exit {
    use_threads(args.threads);
    run_once(args)
}

/// Fixes the number of threads; once, as there is one pool.
pub(super) fn use_threads(threads: Option<u16>) {
    if let Some(threads) = threads
        && let Err(err) = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global()
    {
        show::warning(&format!("--threads {threads} has no effect: {err}"));
    }
}

/// Runs the job once.
pub(super) fn run_once(args: &Run) -> Exit {
    for stage in [&args.from, &args.to].into_iter().flatten() {
        if STAGES.iter().all(|it| it.name != stage) {
            let names: Vec<_> = STAGES.iter().map(|it| it.name).collect();
            show::note(&format!("error: no stage `{stage}`; there are {}", names.join(", ")));
            return Exit::Usage;
        }
    }
    let text = text_of(args);
    let prepared = text.clone().map_err(InputError::from).and_then(|it| prepare(&it, args.seed));
    let Prepared { plan, source, dir } = match prepared {
        Ok(it) => it,
        Err(err) => return refuse(&err),
    };
    for warning in plan.warnings.iter().chain(&source.warnings) {
        show::warning(warning);
    }
    let out = args.out.as_deref().unwrap_or(&dir);
    let machine = plan.profiles.machine.clone();
    let range = Range { from: args.from.clone(), to: args.to.clone() };
    let progress = show::Progress::new(args.quiet);
    // Inside the pool: from outside, each of many thousand small parallel passes would be handed over to it and waited for.
    let result = rayon::scope(|_| pipeline::run(&plan, source, out, &range, &CANCEL, &|event| progress.tell(event)));
    progress.finish();
    match result {
        Ok(outcome) => {
            if let Some((stage, reasons)) = &outcome.failure {
                show::note(&format!("error: stage `{stage}` could not finish: {}", reasons.join("\n  because: ")));
            }
            if args.json {
                show::data(&format!("{:#}", outcome.report));
            } else {
                show::summary(&outcome.report, &out.display().to_string());
            }
            if let Some(text) = text.ok().filter(|_| !is_config(&args.job) && !args.quiet) {
                let seed = args.seed.map(|it| format!("seed = {it}\n")).unwrap_or_default();
                show::note(&format!(
                    "this job had no config; the same as one (job.toml, to change):\n\n{}{seed}\n`fabricate init --mesh {}` \
                     writes one with the usual keys explained",
                    text.as_config(),
                    args.job.display()
                ));
            }
            match (outcome.ok(), args.send) {
                (false, true) => {
                    show::note("error: nothing is sent, because not every check holds");
                    Exit::ChecksFailed
                }
                (false, false) => Exit::ChecksFailed,
                (true, false) => Exit::Done,
                (true, true) => send_sheets(args, &outcome.report, out, &machine),
            }
        }
        Err(RunError::Interrupted) => {
            show::note("interrupted; finished stages are kept, and the next run goes on from there");
            Exit::Interrupted
        }
        Err(RunError::Output(err)) => {
            show::error(&err);
            Exit::Output
        }
    }
}

/// Sends the programs of the sheets that a run has written and checked.
fn send_sheets(args: &Run, report: &serde_json::Value, out: &Path, machine: &profile::Machine) -> Exit {
    let programs = |format: &str| -> Vec<std::path::PathBuf> {
        let files = report["files"].as_array().into_iter().flatten().filter(|it| it["format"] == format);
        files.filter_map(|it| Some(out.join(it["path"].as_str()?))).collect()
    };
    let files = Some(programs("gcode")).filter(|it| !it.is_empty()).unwrap_or_else(|| programs("hpgl"));
    if files.is_empty() {
        show::note("error: there is no program to send; add `gcode` or `hpgl` to output.formats");
        return Exit::Usage;
    }
    let send = Send {
        files,
        machine: machine.name.clone(),
        port: args.port.clone(),
        dry_run: false,
        check: false,
        frame: false,
        home: args.home,
        unlock: false,
        zero: false,
        resume: false,
        quiet: args.quiet,
    };
    send::send_to(&send, machine)
}

/// Shows every problem of a config; the mesh is read even where there are some, so that its own are told at once, too.
fn check(args: &Check) -> Exit {
    let text = match config_text(&args.job, &args.sets) {
        Ok(it) => it,
        Err(err) => return refuse(&err.into()),
    };
    let (config, mut problems) = match Config::parse_all(&text) {
        Ok(it) => it,
        Err(err) => return refuse(&err.into()),
    };
    let source = Source::load(&config);
    let dir = config.output.dir.clone();
    let plan = pipeline::plan_all(config).map_err(|mut found| problems.append(&mut found)).ok();
    let source = match source {
        Ok(it) => Some(it),
        Err(InputError::Config(err)) => {
            // `input` is also read where another of its keys was at fault.
            problems.retain(|it| *it != err);
            problems.push(err);
            None
        }
        Err(err) => {
            problems.iter().for_each(show::config_error);
            let mesh = refuse(&err);
            return if problems.is_empty() { mesh } else { Exit::Usage };
        }
    };
    problems.iter().for_each(show::config_error);
    let (Some(plan), Some(source)) = (plan.filter(|_| problems.is_empty()), source) else {
        show::note(&format!("{} to mend", show::count(problems.len(), "problem")));
        return Exit::Usage;
    };
    for warning in plan.warnings.iter().chain(&source.warnings) {
        show::warning(warning);
    }
    show::data(&show::forecast(&plan, &source, &dir));
    Exit::Done
}

fn init(args: &Init) -> Exit {
    let text = match template::config(args) {
        Ok(text) => text,
        Err(message) => {
            show::note(&format!("error: {message}"));
            return Exit::Usage;
        }
    };
    let path = args.dir.join("fabricate.toml");
    if path.exists() {
        show::note(&format!("error: {} exists already; move it away or choose another folder", path.display()));
        return Exit::Output;
    }
    match fs::create_dir_all(&args.dir).and_then(|()| fs::write(&path, text)) {
        Ok(()) => {
            let path = path.display();
            show::note(&format!("wrote {path}; `fabricate check {path}` reads it, `fabricate run {path}` runs it"));
            Exit::Done
        }
        Err(err) => {
            show::note(&format!("error: cannot write {}: {err}", path.display()));
            Exit::Output
        }
    }
}

/// Writes a coupon and says what to measure on it.
fn coupon(args: &Coupon) -> Exit {
    let table = |name: &str| format!("profile = {}", toml::Value::String(name.to_owned()));
    let (material, machine) = (table(&args.material), table(&args.machine));
    let parse = |text| toml::de::DeTable::parse(text).expect("a quoted string is valid TOML");
    let profiles = profile::Profiles::load(Path::new("."), parse(&material).get_ref(), parse(&machine).get_ref());
    let made = match profiles {
        Ok(profiles) => pipeline::coupon(&profiles, &args.out),
        Err(err) => {
            show::error(&err);
            return Exit::Usage;
        }
    };
    match made {
        Ok(coupon) => {
            let files: String = coupon.files.iter().map(|it| format!("{}\n", it.display())).collect();
            show::data(&format!("{files}{}\n", coupon.instruction));
            let failed: Vec<_> = coupon.checks.iter().filter(|it| !it.ok).collect();
            failed.iter().for_each(|it| show::note(&format!("error: {}: {}", it.name, it.note)));
            if failed.is_empty() { Exit::Done } else { Exit::ChecksFailed }
        }
        Err(err) => {
            show::error(&err);
            if matches!(err, pipeline::CouponError::Output(_)) { Exit::Output } else { Exit::Usage }
        }
    }
}

fn ports() -> Exit {
    match machine::ports() {
        Ok(ports) if ports.is_empty() => {
            show::note("no serial ports; is the machine plugged in and switched on?");
            Exit::Done
        }
        Ok(ports) => {
            ports.iter().for_each(|it| show::data(&format!("{}  {}", it.name, it.about)));
            Exit::Done
        }
        Err(err) => {
            let err: &dyn Error = &err;
            show::error(err);
            Exit::Input
        }
    }
}

fn profiles(command: Option<Profiles>) -> Exit {
    let all = || [("material", profile::MATERIALS), ("machine", profile::MACHINES)].into_iter();
    let Some(Profiles::Show { name }) = command else {
        for (kind, list) in all() {
            list.iter().for_each(|it| show::data(&format!("{kind:9} {}", it.name)));
        }
        return Exit::Done;
    };
    match all().flat_map(|(_, list)| list).find(|it| it.name == name) {
        Some(found) => {
            show::data(found.text);
            Exit::Done
        }
        None => {
            let names: Vec<_> = all().flat_map(|(_, list)| list).map(|it| it.name).collect();
            show::note(&format!("error: no built-in profile `{name}`; there are {}", names.join(", ")));
            Exit::Usage
        }
    }
}

/// The page of the program, with the options of every command.
fn man() -> Exit {
    let mut page = Vec::new();
    let mut command = Args::command();
    command.build();
    let mut render = || -> std::io::Result<()> {
        clap_mangen::Man::new(command.clone()).render(&mut page)?;
        for sub in command.get_subcommands().filter(|it| it.get_name() != "help") {
            let man = clap_mangen::Man::new(sub.clone());
            let mut section = Vec::new();
            man.render_synopsis_section(&mut section)?;
            man.render_description_section(&mut section)?;
            man.render_options_section(&mut section)?;
            let text = String::from_utf8_lossy(&section).replace(".SH ", ".SS ");
            page.extend(format!(".SH \"FABRICATE {}\"\n{text}", sub.get_name().to_uppercase()).into_bytes());
        }
        Ok(())
    };
    match render() {
        Ok(()) => {
            show::data(&String::from_utf8_lossy(&page));
            Exit::Done
        }
        Err(err) => {
            show::error(&err);
            Exit::Output
        }
    }
}
