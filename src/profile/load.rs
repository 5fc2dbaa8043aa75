//! Finding profiles by name or path, laying single keys of the config over them, and saying what is wrong where.
use std::{
    fs, io,
    ops::Range,
    path::{Path, PathBuf},
};

use serde::de::DeserializeOwned;
use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

use super::{
    Machine, Material, Profiles,
    check::{Fault, Rule},
    plain,
};

/// A profile that lies in the binary.
#[derive(Debug, Clone, Copy)]
pub struct BuiltIn {
    /// What people write in the config.
    pub name: &'static str,
    /// The TOML file, comments and all.
    pub text: &'static str,
}

macro_rules! built_in {
    ($folder:literal: $($name:literal),* $(,)?) => {
        &[$(BuiltIn {
            name: $name,
            text: include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/profiles/", $folder, "/", $name, ".toml")),
        }),*]
    };
}

/// Machines known by name; the first is the default.
pub const MACHINES: &[BuiltIn] = built_in!(
    "machines": "drag-knife-a3", "laser-co2", "pen-plotter", "vinyl-cutter", "craft-cutter", "cnc-router", "shop",
    "mill-ac", "mill-bc", "mill-bc-head", "hot-wire",
);

/// Materials known by name; the first is the default.
pub const MATERIALS: &[BuiltIn] = built_in!(
    "materials": "paper-200gsm", "paper-80gsm", "card-300gsm", "greyboard-2mm", "felt-3mm", "leather-2mm",
    "ripstop-40gsm", "cardboard-3mm", "plywood-3mm", "aluminium-1mm", "steel-1mm",
);

/// Why a profile could not be had.
#[derive(Debug, thiserror::Error)]
pub enum ProfileError {
    /// Neither a built-in name nor a path.
    #[error(
        "there is no {table} profile `{name}`; built in are: {}; a profile of your own is named by a path ending in .toml",
        names(table)
    )]
    Unknown {
        /// "machine" or "material".
        table: &'static str,
        /// What was asked for.
        name: String,
        /// Where the config asks for it.
        span: Option<Range<usize>>,
    },
    /// The file cannot be read.
    #[error("cannot read the {table} profile {}: {source}; built in are: {}", path.display(), names(table))]
    Read {
        /// "machine" or "material".
        table: &'static str,
        /// The file.
        path: PathBuf,
        /// Where the config asks for it.
        span: Option<Range<usize>>,
        /// Why.
        source: io::Error,
    },
    /// Something is wrong in the profile's own file.
    #[error("{file}:{line}:{column}: {}{message}", quoted(key))]
    File {
        /// The file, or the built-in name.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Column in characters, from 1.
        column: usize,
        /// Dotted key, empty where there is none (a syntax error).
        key: String,
        /// What is wrong and what is possible.
        message: String,
    },
    /// Something is wrong in the keys that the config lays over the profile.
    #[error("[{table}] {}{message}", quoted(key))]
    Config {
        /// "machine" or "material".
        table: &'static str,
        /// Dotted key.
        key: String,
        /// Bytes of the config.
        span: Option<Range<usize>>,
        /// What is wrong and what is possible.
        message: String,
    },
    /// The two profiles do not go together.
    #[error("material `{material}` and machine `{machine}` do not go together: `{key}` {message}")]
    Mismatch {
        /// Name of the material.
        material: String,
        /// Name of the machine.
        machine: String,
        /// Dotted key of the material.
        key: String,
        /// What is wrong and what to do.
        message: String,
    },
}

impl ProfileError {
    /// Bytes of the config that are to blame, where there are some.
    pub fn span(&self) -> Option<Range<usize>> {
        match self {
            Self::Unknown { span, .. } | Self::Read { span, .. } | Self::Config { span, .. } => span.clone(),
            Self::File { .. } | Self::Mismatch { .. } => None,
        }
    }
}

fn quoted(key: &str) -> String {
    if key.is_empty() { String::new() } else { format!("`{key}`: ") }
}

fn built_in(table: &str) -> &'static [BuiltIn] {
    if table == MACHINE { MACHINES } else { MATERIALS }
}

fn names(table: &str) -> String {
    let names: Vec<&str> = built_in(table).iter().map(|it| it.name).collect();
    names.join(", ")
}

/// Config tables of the two profiles.
const MACHINE: &str = "machine";
const MATERIAL: &str = "material";

impl Profiles {
    /// Loads both profiles of a job. `material` and `machine` are the tables of that name in the config (empty where the
    /// config has none): `profile` names a built-in one or a file relative to `base_dir`, other keys lie over it.
    /// The settings that the material needs on this kind of machine are written into the machine's tools, except where
    /// the config sets them itself.
    pub fn load(base_dir: &Path, material: &DeTable<'_>, machine: &DeTable<'_>) -> Result<Self, ProfileError> {
        let material = load_material(base_dir, material)?;
        let keys = machine;
        let mut machine = load_machine(base_dir, keys)?;
        let mismatch = |fault: Fault, machine: &Machine| ProfileError::Mismatch {
            material: material.name.clone(),
            machine: machine.name.clone(),
            key: fault.key,
            message: fault.message,
        };
        let kept = |operation: crate::model::Operation, field: &str| {
            find(keys, &format!("tools.{}.{field}", operation.name())).is_some()
        };
        material.prepare(&mut machine, kept).map_err(|fault| mismatch(fault, &machine))?;
        machine.check().map_err(|fault| mismatch(fault, &machine))?;
        Ok(Self { material, machine })
    }
}

/// Loads a machine profile: see [`Profiles::load`].
pub fn load_machine(base_dir: &Path, table: &DeTable<'_>) -> Result<Machine, ProfileError> {
    load(MACHINE, base_dir, table)
}

/// Loads a material profile: see [`Profiles::load`].
pub fn load_material(base_dir: &Path, table: &DeTable<'_>) -> Result<Material, ProfileError> {
    load(MATERIAL, base_dir, table)
}

fn load<P: DeserializeOwned + Rule>(
    table: &'static str,
    base_dir: &Path,
    keys: &DeTable<'_>,
) -> Result<P, ProfileError> {
    let mut keys = keys.clone();
    let source = Source::find(table, base_dir, keys.remove("profile"))?;
    let base =
        DeTable::parse(&source.text).map_err(|error| source.fault(None, error.span(), "", &plain(error.message())))?;
    let read = |table: Spanned<DeTable<'_>>| P::deserialize(toml::de::Deserializer::from(table));
    let mut profile = read(base.clone())
        .map_err(|error| source.fault(Some(base.get_ref()), error.span(), "", &plain(error.message())))?;
    profile.check().map_err(|fault| source.fault(Some(base.get_ref()), None, &fault.key, &fault.message))?;
    if !keys.is_empty() {
        // The profile alone is sound, so whatever is wrong now comes from the keys laid over it.
        let config_fault = |span: Option<Range<usize>>, key: &str, message: &str| {
            let (key, span) = place(&keys, key, span);
            ProfileError::Config { table, key, span, message: message.into() }
        };
        let mut merged = base.clone();
        merge(merged.get_mut(), &keys);
        profile = read(merged).map_err(|error| config_fault(error.span(), "", &plain(error.message())))?;
        profile.check().map_err(|fault| config_fault(None, &fault.key, &fault.message))?;
    }
    profile.rename(source.name);
    Ok(profile)
}

/// The text of a profile and what to call it.
struct Source {
    name: String,
    /// For messages.
    file: String,
    text: String,
}

impl Source {
    fn find(table: &'static str, base_dir: &Path, asked: Option<Spanned<DeValue<'_>>>) -> Result<Self, ProfileError> {
        let span = asked.as_ref().map(Spanned::span);
        let name = match asked.as_ref().map(Spanned::get_ref) {
            None => built_in(table)[0].name,
            Some(DeValue::String(name)) => name,
            Some(other) => {
                let message = format!(
                    "must be a string, not {}: the name of a profile ({}) or a path ending in .toml",
                    other.type_str(),
                    names(table)
                );
                return Err(ProfileError::Config { table, key: "profile".into(), span, message });
            }
        };
        if let Some(found) = built_in(table).iter().find(|it| it.name == name) {
            let file = format!("built-in {table} profile {name}");
            return Ok(Self { name: name.into(), file, text: found.text.into() });
        }
        let path = Path::new(name);
        if path.extension().is_none_or(|it| it != "toml") {
            return Err(ProfileError::Unknown { table, name: name.into(), span });
        }
        let path = base_dir.join(path);
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        match fs::read_to_string(&path) {
            Ok(text) => Ok(Self { name: stem, file: path.display().to_string(), text }),
            Err(source) => Err(ProfileError::Read { table, path, span, source }),
        }
    }

    /// A fault in this file, at a span or at a dotted key.
    fn fault(&self, table: Option<&DeTable<'_>>, span: Option<Range<usize>>, key: &str, message: &str) -> ProfileError {
        let (key, span) = match table {
            Some(table) => place(table, key, span),
            None => (key.into(), span),
        };
        let before = &self.text[..span.map_or(0, |it| it.start.min(self.text.len()))];
        let line = before.matches('\n').count() + 1;
        let column = before.chars().rev().take_while(|&c| c != '\n').count() + 1;
        ProfileError::File { file: self.file.clone(), line, column, key, message: message.into() }
    }
}

/// Lays `over` over `base`: tables key by key, everything else as a whole.
fn merge<'t>(base: &mut DeTable<'t>, over: &DeTable<'t>) {
    for (key, value) in over {
        // The key as the config writes it, so that an error about the key points there.
        let old = base.remove(key.get_ref().as_ref());
        let merged = match (old.map(Spanned::into_inner), value.get_ref()) {
            (Some(DeValue::Table(mut below)), DeValue::Table(above)) => {
                merge(&mut below, above);
                Spanned::new(value.span(), DeValue::Table(below))
            }
            _ => value.clone(),
        };
        base.insert(key.clone(), merged);
    }
}

/// Span of the value at a dotted key.
fn find(table: &DeTable<'_>, key: &str) -> Option<Range<usize>> {
    let (first, rest) = key.split_once('.').map_or((key, None), |(first, rest)| (first, Some(rest)));
    let value = table.get(first)?;
    match rest {
        None => Some(value.span()),
        Some(rest) => find(value.get_ref().as_table()?, rest),
    }
}

/// Completes a key by its span or a span by its key: the value of the longest prefix of `key` that the table has, or the
/// deepest key whose own text or value holds `span`.
fn place(table: &DeTable<'_>, key: &str, span: Option<Range<usize>>) -> (String, Option<Range<usize>>) {
    match span {
        Some(span) => (deepest(table, span.start).unwrap_or_default(), Some(span)),
        None => {
            let mut prefix = key;
            loop {
                if let Some(span) = find(table, prefix) {
                    return (key.into(), Some(span));
                }
                match prefix.rsplit_once('.') {
                    Some((shorter, _)) => prefix = shorter,
                    None => return (key.into(), None),
                }
            }
        }
    }
}

fn deepest(table: &DeTable<'_>, at: usize) -> Option<String> {
    table.iter().find_map(|(key, value)| {
        let name = key.get_ref();
        let below = value.get_ref().as_table().and_then(|table| deepest(table, at));
        match below {
            Some(below) => Some(format!("{name}.{below}")),
            None if key.span().contains(&at) || value.span().contains(&at) => Some(name.to_string()),
            None => None,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        model::Operation,
        profile::{Head, Tool},
    };

    fn tables(material: &str, machine: &str) -> Result<Profiles, ProfileError> {
        let (material, machine) = (DeTable::parse(material).unwrap(), DeTable::parse(machine).unwrap());
        Profiles::load(Path::new("."), material.get_ref(), machine.get_ref())
    }

    fn message(material: &str, machine: &str) -> String {
        tables(material, machine).expect_err("this must be refused").to_string()
    }

    #[test]
    fn every_pair_of_built_in_profiles_loads_or_says_why_not() {
        for material in MATERIALS {
            let mut good = 0;
            for machine in MACHINES {
                let quoted = |name: &str| format!("profile = \"{name}\"");
                match tables(&quoted(material.name), &quoted(machine.name)) {
                    Ok(profiles) => {
                        good += 1;
                        assert_eq!(profiles.material.name, material.name);
                        assert_eq!(profiles.machine.name, machine.name);
                        for operation in Operation::ALL {
                            let tool = profiles.machine.tools.get(operation);
                            assert_eq!(tool.is_none(), profiles.machine.kind.works_blocks(), "{}", machine.name);
                            let Some(tool) = tool else { continue };
                            let beam = matches!(profiles.machine.head, Head::Laser { .. });
                            assert!(!beam || tool.power > 0.0, "{}: {operation:?} without power", machine.name);
                        }
                    }
                    Err(ProfileError::Mismatch { key, .. }) => assert_eq!(key, "process"),
                    Err(other) => panic!("{} on {}: {other}", material.name, machine.name),
                }
            }
            assert!(good >= 2, "{} can be worked by {good} machines", material.name);
        }
    }

    #[test]
    fn the_material_sets_tools_and_the_config_has_the_last_word() {
        let feed = |profiles: &Profiles| profiles.machine.tools[Operation::CutOutside].feed;
        let laser = "profile = \"laser-co2\"";
        assert_eq!(feed(&tables("", laser).unwrap()), 3000.0);
        let wood = tables("profile = \"plywood-3mm\"", laser).unwrap();
        assert_eq!(feed(&wood), 900.0);
        assert_eq!(wood.machine.tools[Operation::CutOutside].kerf.mm, 0.2);
        let own = tables("profile = \"plywood-3mm\"", "profile = \"laser-co2\"\ntools.cut-outside.feed = 700").unwrap();
        assert_eq!(feed(&own), 700.0);
        assert_eq!(own.machine.tools[Operation::CutOutside].power, 0.75, "the rest is the material's");
        let patched =
            tables("profile = \"plywood-3mm\"\nprocess.laser.cut-outside.feed = 800", "profile = \"laser-co2\"");
        assert_eq!(feed(&patched.unwrap()), 800.0);
    }

    #[test]
    fn single_keys_lie_over_the_profile() {
        let profiles = tables("sheet = [\"20 cm\", 287]\nmargin = 8", "head.servo.up = 20").unwrap();
        assert_eq!(profiles.material.sheet[0].mm, 200.0);
        assert_eq!(profiles.material.margin.mm, 8.0);
        assert_eq!(profiles.material.thickness.mm, 0.25);
        let Head::Servo { up, down, .. } = profiles.machine.head else { panic!("the drag knife has a servo") };
        assert_eq!((up, down), (20.0, 90.0));
    }

    #[test]
    fn wrong_keys_of_the_config_are_named_with_their_place() {
        let config = "profile = \"paper-200gsm\"\nmargn = 3\n";
        let error = tables(config, "").unwrap_err();
        assert_eq!(error.span(), Some(config.find("margn").map(|at| at..at + 5).unwrap()));
        assert!(
            error.to_string().contains("[material] `margn`: unknown key `margn` (did you mean `margin`?)"),
            "{error}"
        );

        for (material, machine, expected) in [
            ("profile = \"papier\"", "", "no material profile `papier`; built in are: paper-200gsm, paper-80gsm"),
            ("profile = \"mine.toml\"", "", "cannot read the material profile ./mine.toml"),
            ("profile = 3", "", "[material] `profile`: must be a string, not integer"),
            ("sheet = [100]", "", "[material] `sheet`: must be a list of 2, not a list of 1"),
            ("thickness = \"3 foot\"", "", "[material] `thickness`: must be a length"),
            ("thickness = -1", "", "[material] `thickness`: must be a finite number above 0, not -1"),
            ("thickness = nan", "", "[material] `thickness`: must be a finite number above 0, not NaN"),
            ("margin = 160", "", "[material] `margin`: of 160 mm on both sides leaves nothing"),
            (
                "profile = \"plywood-3mm\"",
                "",
                "has no [process.drag-knife], and `drag-knife-a3` is a machine of that kind",
            ),
            ("process.laser.cut-out.feed = 1", "", "must be the name of an operation: text, registration, engrave"),
            ("", "tools.cut-outside.feed = 0", "[machine] `tools.cut-outside.feed`: must be a finite number above 0"),
            ("", "tools.cut-outside.feed = inf", "must be a finite number above 0, not inf"),
            ("", "tools.cut-outside.power = 1.5", "`tools.cut-outside.power`: must be between 0 and 1, not 1.5"),
            ("", "tools.glue.feed = 100", "`tools.glue`: must be the name of an operation"),
            ("", "layers.text.color = \"red\"", "`red` is not a colour; write it as \"#rrggbb\""),
            ("", "layers.text.name = \"CUT\"", "must share both name and colour or neither"),
            ("", "layers.text.name = \"A B\"", "`layers.text.name`: must be 1 to 31 letters"),
            ("", "order = [\"text\"]", "`order`: must name `registration` exactly once"),
            (
                "",
                "kind = \"lasr\"",
                "unknown value `lasr` (did you mean `laser`?); there are `laser`, `drag-knife`, `router`, `pen`, `mill`, `hot-wire`",
            ),
            ("", "kind = \"laser\"", "`head`: does not fit `kind = \"laser\"`"),
            ("", "head.servo.down = 40", "`head.servo.down`: must differ from `up`"),
        ] {
            let text = message(material, machine);
            assert!(text.contains(expected), "{material} {machine}\n  says: {text}\n  expected: {expected}");
        }
    }

    #[test]
    fn a_file_of_ones_own_is_read_and_its_faults_are_placed() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        let load = |name: &str| {
            let text = format!("profile = \"{name}\"");
            load_material(folder.path(), DeTable::parse(&text).unwrap().get_ref())
        };
        let good = MATERIALS[0].text.replace("thickness = 0.25", "thickness = 0.3");
        write("my-card.toml", &good);
        let card = load("my-card.toml").unwrap();
        assert_eq!((card.name.as_str(), card.thickness.mm), ("my-card", 0.3));

        let line = good.lines().position(|it| it.starts_with("gap")).unwrap() + 1;
        for (from, to, expected) in [
            ("gap = 2", "gap = \"2 furlongs\"", "`gap`: must be a length"),
            ("gap = 2", "gap = -2", "`gap`: must be a finite number, 0 or more, not -2"),
            ("gap = 2", "gapp = 2", "`gapp`: unknown key `gapp`"),
            ("gap = 2", "gap = = 2", "extra `=`, expected nothing"),
        ] {
            write("bad.toml", &good.replace(from, to));
            let text = load("bad.toml").unwrap_err().to_string();
            assert!(text.contains(&format!("bad.toml:{line}:")), "{text}");
            assert!(text.contains(expected), "{text}");
        }
        write("short.toml", "title = \"half a profile\"\n");
        let text = load("short.toml").unwrap_err().to_string();
        assert!(text.contains("the key `thickness` is missing"), "{text}");
    }

    #[test]
    fn profiles_survive_serialisation() {
        for built_in in MACHINES {
            let keys = format!("profile = \"{}\"", built_in.name);
            let machine = load_machine(Path::new("."), DeTable::parse(&keys).unwrap().get_ref()).unwrap();
            let text = toml::to_string(&machine).unwrap();
            let mut back: Machine = toml::from_str(&text).unwrap();
            back.rename(built_in.name.into());
            assert_eq!(back, machine);
            assert!(machine.tools.iter().all(|(_, tool): (_, &Tool)| tool.number >= 1));
        }
    }
}
