//! The plan: every table parsed, every input proven to be made, before anything runs.
use serde_json::{Value, json};
use toml::{Spanned, de::DeTable};

use super::{
    config::{Config, ConfigError, key_spans},
    recipes::{RECIPES, STAGES},
};
use crate::{
    emit::FORMATS,
    model::Kind,
    profile::Profiles,
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

/// Parses every table and checks every input before anything runs.
pub fn plan(config: Config<'_>) -> Result<Plan, PlanError> {
    let source = config.source;
    let table_of = |name| config.profiles.get(name).map(|it| it.get_ref().clone()).unwrap_or_default();
    let (material, machine) = (table_of("material"), table_of("machine"));
    let profiles = Profiles::load(source.folder(), &material, &machine)
        .map_err(|err| source.error(err.to_string(), err.span()))?;
    let stages = stage_list(&config, profiles.machine.kind.works_blocks())?;
    let Config { seed, recipe, input, output, formats_span, mut tables, .. } = config;
    let dir = output.dir;
    let mut made = vec![Kind::SourceMesh];
    for def in &stages {
        if let Some(&needs) = def.needs.iter().find(|it| !made.contains(it)) {
            let maker = STAGES.iter().find(|it| it.makes.contains(&needs)).map_or("none", |it| it.name);
            let message =
                format!("stage `{}` needs {needs:?}, which no earlier stage makes (stage `{maker}` does)", def.name);
            return Err(source.error(message, config.stages.as_ref().map(Spanned::span)));
        }
        made.extend(def.makes);
    }
    let formats = output.formats.unwrap_or_else(|| profiles.machine.formats.clone());
    if let Some(unknown) = formats.iter().find(|it| FORMATS.iter().all(|format| format.name != it.as_str())) {
        let names: Vec<_> = FORMATS.iter().map(|it| it.name).collect();
        return Err(source.error(format!("unknown format `{unknown}`; there are {}", names.join(", ")), formats_span));
    }

    let mut rows = Vec::new();
    for def in stages {
        let mut table = tables.remove(def.name).unwrap_or_else(|| Spanned::new(0..0, DeTable::new()));
        add_defaults(table.get_mut(), recipe.get_ref(), def.name);
        let (spans, header) = (key_spans(table.get_ref()), table.span());
        let ready = (def.prepare)(table, &profiles, seed).map_err(|err| match err {
            TableError::Shape(err) => source.error(format!("[{}]: {}", def.name, err.message()), err.span()),
            TableError::Value(err) => {
                let span = spans.get(err.key).cloned().unwrap_or(header);
                source.error(format!("[{}]: {err}", def.name), Some(span))
            }
        })?;
        rows.push((def, ready));
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
        return Err(source.error(message, Some(table.span())));
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
