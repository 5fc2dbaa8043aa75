//! The plan: every table parsed, every input proven to be made, before anything runs.
use serde_json::{Value, json};
use toml::{Spanned, de::DeTable};

use super::{
    config::{Config, ConfigError, ConfigText, forget, key_spans},
    recipes::{RECIPES, STAGES},
};
use crate::{
    emit::FORMATS,
    model::Kind,
    profile::{Profiles, plain},
    stage::{Ready, StageDef, TableError},
};

/// What is wrong with a plan. Every variant has been given its place in the config.
pub type PlanError = ConfigError;

/// A checked plan.
pub struct Plan {
    /// Name of the recipe.
    pub recipe: String,
    /// The seed.
    pub seed: u64,
    /// Stages with their parsed tables, in order.
    pub stages: Vec<(StageDef, Ready)>,
    /// The profiles of the job.
    pub profiles: Profiles,
    /// Names of the formats to write.
    pub formats: Vec<String>,
    /// The config with all defaults, for the report.
    pub echo: Value,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// Parses every table and checks every input before anything runs; `Err` is the first problem.
pub fn plan(config: Config<'_>) -> Result<Plan, PlanError> {
    plan_all(config).map_err(|mut it| it.swap_remove(0))
}

/// The same, with every problem that there is (at least one).
pub fn plan_all(config: Config<'_>) -> Result<Plan, Vec<PlanError>> {
    let source = config.source;
    let mut problems = Vec::new();
    let table_of = |name| config.profiles.get(name).map(|it| it.get_ref().clone()).unwrap_or_default();
    let (material, machine) = (table_of("material"), table_of("machine"));
    let profiles = Profiles::load(source.folder(), &material, &machine).unwrap_or_else(|err| {
        let header = || config.profiles.get("machine").or(config.profiles.get("material")).map(Spanned::span);
        problems.push(source.error(err.to_string(), err.span().or_else(header)));
        Profiles::load(source.folder(), &DeTable::new(), &DeTable::new()).expect("a test loads the default profiles")
    });
    let stages = stage_list(&config, profiles.machine.kind.works_blocks()).unwrap_or_else(|err| {
        problems.push(err);
        vec![]
    });
    problems.extend(wrong_input(&config, &stages));
    let Config { seed, recipe, input, output, formats_span, mut tables, .. } = config;
    let dir = output.dir;
    let mut made = vec![Kind::SourceMesh, Kind::CreasePattern];
    for def in &stages {
        if let Some(&needs) = def.needs.iter().find(|it| !made.contains(it)) {
            let maker = STAGES.iter().find(|it| it.makes.contains(&needs)).map_or("none", |it| it.name);
            let message =
                format!("stage `{}` needs {needs:?}, which no earlier stage makes (stage `{maker}` does)", def.name);
            problems.push(source.error(message, config.stages.as_ref().map(Spanned::span)));
        }
        made.extend(def.makes);
    }
    let formats = output.formats.unwrap_or_else(|| profiles.machine.formats.clone());
    if let Some(unknown) = formats.iter().find(|it| FORMATS.iter().all(|format| format.name != it.as_str())) {
        let names: Vec<_> = FORMATS.iter().map(|it| it.name).collect();
        problems
            .push(source.error(format!("unknown format `{unknown}`; there are {}", names.join(", ")), formats_span));
    }

    let mut rows = Vec::new();
    for def in stages {
        let mut table = tables.remove(def.name).unwrap_or_else(|| Spanned::new(0..0, DeTable::new()));
        add_defaults(table.get_mut(), recipe.get_ref(), def.name);
        rows.extend(prepare(source, def, table, &profiles, seed, &mut problems).map(|ready| (def, ready)));
    }
    let mut warnings = Vec::new();
    for (name, table) in tables {
        if STAGES.iter().any(|it| it.name == name) {
            warnings.push(format!("table [{name}] is not used by the stages of this job"));
            continue;
        }
        let known: Vec<_> = STAGES.iter().map(|it| it.name).collect();
        let message =
            format!("unknown table [{name}]; there are input, material, machine, output, {}", known.join(", "));
        problems.push(source.error(message, Some(table.span())));
    }
    if !problems.is_empty() {
        return Err(problems);
    }
    let recipe = recipe.into_inner();
    let mut echo = json!({
        "version": 1,
        "recipe": recipe,
        "seed": seed,
        "input": input,
        "material": profiles.material,
        "machine": profiles.machine,
        "output": { "dir": dir, "formats": formats },
    });
    for (def, ready) in &rows {
        echo[def.name] = ready.options.clone();
    }
    Ok(Plan { recipe, seed, stages: rows, profiles, formats, echo, warnings })
}

/// A mesh where a crease pattern is wanted, or the other way round.
fn wrong_input(config: &Config<'_>, stages: &[StageDef]) -> Option<PlanError> {
    let folds = stages.iter().any(|it| it.needs.contains(&Kind::CreasePattern));
    let drawn = config.input.pattern.is_some();
    let span = |key: &str| config.input_spans.get(key).cloned();
    match (folds, drawn) {
        (true, false) => {
            let message = "recipe `fold` reads a crease pattern: [input] pattern = \"FILE\" (svg, dxf or fold)";
            Some(config.source.error(message, span("mesh").or(Some(config.recipe.span()))))
        }
        (false, true) if !stages.is_empty() => {
            let message = "a crease pattern is read by recipe = \"fold\" only; the others need input.mesh";
            Some(config.source.error(message, span("pattern")))
        }
        _ => None,
    }
}

/// Parses the table of a stage. A key with a problem is said and left out, so that the others are looked at, too.
fn prepare(
    source: &ConfigText,
    def: StageDef,
    mut table: Spanned<DeTable<'_>>,
    profiles: &Profiles,
    seed: u64,
    problems: &mut Vec<PlanError>,
) -> Option<Ready> {
    loop {
        let err = match (def.prepare)(table.clone(), profiles, seed) {
            Ok(ready) => return Some(ready),
            Err(err) => err,
        };
        let (message, span) = match &err {
            TableError::Shape(err) => (plain(err.message()), err.span()),
            TableError::Value(err) => (err.to_string(), key_spans(table.get_ref()).remove(err.key)),
        };
        let place = span.clone().unwrap_or(table.span());
        problems.push(source.error(format!("[{}]: {message}", def.name), Some(place)));
        if !span.is_some_and(|it| forget(table.get_mut(), it.start)) {
            return None;
        }
    }
}

/// Adds what the recipe wants different from the defaults of a stage.
fn add_defaults(table: &mut DeTable<'_>, recipe: &str, stage: &str) {
    let tables = RECIPES.iter().filter(|it| it.name == recipe).flat_map(|it| it.defaults);
    let lines: Vec<&str> = tables.filter(|it| it.0 == stage && !table.contains_key(it.1)).map(|it| it.2).collect();
    for lines in lines {
        for (key, value) in DeTable::parse(lines).expect("a test plans every recipe").into_inner() {
            if !table.contains_key(&key) {
                table.insert(key, value);
            }
        }
    }
}

/// The stages of the recipe, with those that a machine for blocks adds, or those that `stages = […]` names.
fn stage_list(config: &Config<'_>, blocks: bool) -> Result<Vec<StageDef>, ConfigError> {
    let (names, span): (Vec<&str>, _) = match &config.stages {
        Some(stages) => (stages.get_ref().iter().map(String::as_str).collect(), stages.span()),
        None => {
            let name = config.recipe.get_ref();
            let recipe = RECIPES.iter().find(|it| it.name == name).ok_or_else(|| {
                let names: Vec<_> = RECIPES.iter().map(|it| it.name).collect();
                let message = format!("unknown recipe `{name}`; there are {}", names.join(", "));
                config.source.error(message, Some(config.recipe.span()))
            })?;
            let on_top = if blocks { recipe.of_blocks } else { &[] };
            ([recipe.stages, on_top].concat(), config.recipe.span())
        }
    };
    let find = |name: &str| {
        STAGES.iter().copied().find(|it| it.name == name).ok_or_else(|| {
            let known: Vec<_> = STAGES.iter().map(|it| it.name).collect();
            config.source.error(format!("no stage `{name}`; there are {}", known.join(", ")), Some(span.clone()))
        })
    };
    names.into_iter().map(find).collect()
}
