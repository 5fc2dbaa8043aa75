//! The config file: read with spans, so that every complaint points at its line.
use std::{
    collections::BTreeMap,
    fmt, fs,
    ops::Range,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

use super::{input::InputTable, pattern::is_drawing, recipes::STAGES};
use crate::profile::plain;

/// The text of a config and of the `--set` options on top of it.
#[derive(Debug, Clone)]
pub struct ConfigText {
    /// Where it was read, or `None` for a job without a config file.
    pub path: Option<PathBuf>,
    text: String,
    /// Each `--set` as TOML, behind so many spaces that its spans lie beyond the text.
    sets: Vec<String>,
}

/// A place in a config, for people.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// File, or `--set …`.
    pub file: String,
    /// From 1.
    pub line: usize,
    /// From 1, in characters.
    pub column: usize,
    /// The whole line.
    pub text: String,
    /// How many characters are meant.
    pub width: usize,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = self.line.to_string();
        let pad = " ".repeat(number.len());
        writeln!(f, "{pad}--> {}:{}:{}", self.file, self.line, self.column)?;
        writeln!(f, "{pad} |")?;
        writeln!(f, "{number} | {}", self.text)?;
        write!(f, "{pad} | {}{}", " ".repeat(self.column - 1), "^".repeat(self.width.max(1)))
    }
}

/// What is wrong with a config.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read the config {path}: {reason}")]
    Unreadable {
        /// The file.
        path: String,
        /// What the system said.
        reason: String,
    },
    /// Not UTF-8.
    #[error(
        "the config {path} is not UTF-8: line {line} holds the byte 0x{byte:02X}. Save it as UTF-8 (it looks like Latin-1 or Windows-1252)"
    )]
    Encoding {
        /// The file.
        path: String,
        /// Line, from 1.
        line: usize,
        /// The offending byte.
        byte: u8,
    },
    /// A `--set` without `=`.
    #[error("`--set {given}` is not KEY=VALUE (for example --set coarsen.faces=2000)")]
    Set {
        /// As written.
        given: String,
    },
    /// Something in the text.
    #[error("{message}")]
    At {
        /// What is wrong.
        message: String,
        /// Where, if it has a place.
        place: Option<Place>,
    },
}

impl ConfigText {
    /// Reads a config file. `sets` are `KEY=VALUE` options that override it.
    pub fn read(path: &Path, sets: &[String]) -> Result<Self, ConfigError> {
        let shown = || path.display().to_string();
        let bytes = fs::read(path).map_err(|err| ConfigError::Unreadable { path: shown(), reason: err.to_string() })?;
        let text = String::from_utf8(bytes).map_err(|err| {
            let at = err.utf8_error().valid_up_to();
            let line = 1 + err.as_bytes()[..at].iter().filter(|&&b| b == b'\n').count();
            ConfigError::Encoding { path: shown(), line, byte: err.as_bytes()[at] }
        })?;
        Self::new(Some(path.to_owned()), text, sets)
    }

    /// A job that names only its mesh or its crease pattern.
    pub fn for_mesh(mesh: &Path, sets: &[String]) -> Result<Self, ConfigError> {
        let path = toml::Value::String(mesh.display().to_string());
        // Dotted, so that further dotted keys can follow.
        let lines = if is_drawing(mesh) { "recipe = \"fold\"\ninput.pattern" } else { "input.mesh" };
        Self::new(None, format!("version = 1\n{lines} = {path}\n"), sets)
    }

    fn new(path: Option<PathBuf>, text: String, sets: &[String]) -> Result<Self, ConfigError> {
        // Every option lies behind the text and those before it, so that a place tells which one is meant.
        let mut from = text.len();
        let as_toml = |given: &String, pad: &str| {
            let wrong = || ConfigError::Set { given: given.clone() };
            let (key, value) = given.split_once('=').ok_or_else(wrong)?;
            let (key, value) = (key.trim(), value.trim());
            let line = format!("{pad}\n{key} = {value}");
            if DeTable::parse(&line).is_ok() {
                return Ok(line);
            }
            // A bare word is a string: --set input.mesh=bunny.obj needs no quotes inside the shell's.
            let line = format!("{pad}\n{key} = {}", toml::Value::String(value.to_owned()));
            DeTable::parse(&line).map_err(|_| wrong())?;
            Ok(line)
        };
        let mut lines = Vec::new();
        for given in sets {
            let line = as_toml(given, &" ".repeat(from))?;
            from = line.len();
            lines.push(line);
        }
        Ok(Self { path, text, sets: lines })
    }

    /// The config as TOML without the `--set` options.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// A config of its own for a job that was given by options: the text with all `--set` options as dotted keys. A key that
    /// was set twice has its last value.
    pub fn as_config(&self) -> String {
        let mut lines: Vec<&str> = self.sets.iter().map(|it| it.trim()).collect();
        let key = |line: &&str| line.split('=').next().map(|it| it.trim().to_owned());
        for k in (0..lines.len()).rev() {
            if lines[k + 1..].iter().any(|later| key(later) == key(&lines[k])) {
                lines.remove(k);
            }
        }
        lines.iter().fold(self.text.clone(), |text, line| text + line + "\n")
    }

    /// Folder that relative paths in the config start from.
    pub fn folder(&self) -> &Path {
        self.path.as_deref().and_then(Path::parent).unwrap_or(Path::new(""))
    }

    /// Turns a byte span into a place.
    pub fn place(&self, span: &Range<usize>) -> Option<Place> {
        let (file, text) = if span.start < self.text.len() || self.sets.is_empty() {
            let file = self.path.as_ref().map_or_else(|| "defaults".into(), |it| it.display().to_string());
            (file, self.text.as_str())
        } else {
            let set = self.sets.iter().find(|it| it.get(span.clone()).is_some())?;
            ("--set".into(), set.as_str())
        };
        let start = span.start.min(text.len());
        let line_start = text.get(..start)?.rfind('\n').map_or(0, |it| it + 1);
        let line_end = text[start..].find('\n').map_or(text.len(), |it| start + it);
        let (line, file) = if file == "--set" { (1, file) } else { (1 + text[..start].matches('\n').count(), file) };
        let chars = |range: Range<usize>| text.get(range).map_or(1, |it| it.chars().count());
        Some(Place {
            file,
            line,
            column: 1 + chars(line_start..start),
            text: text[line_start..line_end].trim_end().to_owned(),
            width: chars(start..span.end.clamp(start, line_end)),
        })
    }

    /// A complaint about a span.
    pub fn error(&self, message: impl Into<String>, span: Option<Range<usize>>) -> ConfigError {
        ConfigError::At { message: message.into(), place: span.and_then(|it| self.place(&it)) }
    }

    /// A complaint of the TOML deserializer.
    pub fn toml_error(&self, err: &toml::de::Error) -> ConfigError {
        self.error(plain(err.message()), err.span())
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Head {
    version: u32,
    recipe: Spanned<String>,
    seed: u64,
    stages: Option<Spanned<Vec<String>>>,
    input: InputTable,
    output: OutputTable,
}

impl Default for Head {
    fn default() -> Self {
        Self {
            version: 1,
            recipe: Spanned::new(0..0, "developable".into()),
            seed: 0,
            stages: None,
            input: InputTable::default(),
            output: OutputTable::default(),
        }
    }
}

/// The `[output]` table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OutputTable {
    /// Folder of the results, relative to the working directory.
    pub dir: PathBuf,
    /// Formats to write; the machine's own when absent.
    pub formats: Option<Vec<String>>,
}

impl Default for OutputTable {
    fn default() -> Self {
        Self { dir: "out".into(), formats: None }
    }
}

/// A parsed config: the head is typed, stage tables stay raw until the plan hands them to their stages.
pub struct Config<'t> {
    /// The text it came from.
    pub source: &'t ConfigText,
    /// `recipe`.
    pub recipe: Spanned<String>,
    /// `seed`.
    pub seed: u64,
    /// `stages`, overriding the recipe's.
    pub stages: Option<Spanned<Vec<String>>>,
    /// `[input]`.
    pub input: InputTable,
    /// Spans of the keys of `[input]`.
    pub input_spans: BTreeMap<String, Range<usize>>,
    /// `[output]`.
    pub output: OutputTable,
    /// Span of `output.formats`.
    pub formats_span: Option<Range<usize>>,
    /// `[material]` and `[machine]` as written.
    pub profiles: BTreeMap<&'static str, Spanned<DeTable<'t>>>,
    /// All other tables, by name.
    pub tables: BTreeMap<String, Spanned<DeTable<'t>>>,
}

const HEAD: [&str; 6] = ["version", "recipe", "seed", "stages", "input", "output"];
const PROFILES: [&str; 2] = ["material", "machine"];

impl<'t> Config<'t> {
    /// Parses the text and its `--set` options.
    pub fn parse(source: &'t ConfigText) -> Result<Self, ConfigError> {
        let (config, problems) = Self::parse_all(source)?;
        problems.into_iter().next().map_or(Ok(config), Err)
    }

    /// Parses the text and its `--set` options as far as that goes: keys with a problem are left out. `Err` where the text
    /// is no TOML.
    pub fn parse_all(source: &'t ConfigText) -> Result<(Self, Vec<ConfigError>), ConfigError> {
        let parse = |text: &'t str| DeTable::parse(text).map_err(|err| source.toml_error(&err));
        let mut problems = Vec::new();
        let root = parse(&source.text)?;
        let span = root.span();
        let mut root = root.into_inner();
        for set in &source.sets {
            merge(&mut root, parse(set)?.into_inner());
        }
        let mut head = DeTable::new();
        let (mut profiles, mut tables) = (BTreeMap::new(), BTreeMap::new());
        for (key, value) in root {
            let name = key.get_ref().as_ref();
            if HEAD.contains(&name) {
                head.insert(key, value);
                continue;
            }
            let (span, name) = (value.span(), name.to_owned());
            let DeValue::Table(table) = value.into_inner() else {
                let known = PROFILES.contains(&name.as_str()) || STAGES.iter().any(|it| it.name == name);
                let message = if known {
                    format!("`{name}` is a table: write its keys as {name}.KEY = …, or below a line [{name}]")
                } else {
                    format!("unknown key `{name}`; at the top level there are {} and tables", HEAD.join(", "))
                };
                problems.push(source.error(message, Some(key.span())));
                continue;
            };
            // A table's own span is only its header; complaints about a missing key should point there.
            let table = Spanned::new(span, table);
            match PROFILES.iter().find(|it| **it == name) {
                Some(&profile) => drop(profiles.insert(profile, table)),
                None => drop(tables.insert(name, table)),
            }
        }
        let spans_of =
            |table: &str| head.get(table).and_then(|it| it.get_ref().as_table()).map(key_spans).unwrap_or_default();
        let (input_spans, mut output_spans) = (spans_of("input"), spans_of("output"));
        let version_span = head.get("version").map(Spanned::span);
        let mut head = Spanned::new(span, head);
        let read = loop {
            match Head::deserialize(toml::de::Deserializer::from(head.clone())) {
                Ok(read) => break read,
                Err(err) => {
                    problems.push(source.toml_error(&err));
                    if !err.span().is_some_and(|it| forget(head.get_mut(), it.start)) {
                        break Head::default();
                    }
                }
            }
        };
        if read.version != 1 {
            let message = format!("this program reads configs of version 1, not {}", read.version);
            problems.push(source.error(message, version_span));
        }
        let Head { recipe, seed, stages, input, output, .. } = read;
        let formats_span = output_spans.remove("formats");
        let config = Self { source, recipe, seed, stages, input, input_spans, output, formats_span, profiles, tables };
        Ok((config, problems))
    }
}

/// Removes the innermost entry that has its key or value at this byte of the text; `false` where there is none.
pub(super) fn forget(table: &mut DeTable<'_>, at: usize) -> bool {
    let inner = table.iter_mut().any(|(_, value)| match value.get_mut() {
        DeValue::Table(inner) => forget(inner, at),
        _ => false,
    });
    let blamed = table.iter().find(|(key, value)| key.span().contains(&at) || value.span().contains(&at));
    let blamed = blamed.map(|(key, _)| key.get_ref().to_string());
    inner || blamed.is_some_and(|key| table.remove(key.as_str()).is_some())
}

/// Spans of the values of a table by key.
pub(super) fn key_spans(table: &DeTable<'_>) -> BTreeMap<String, Range<usize>> {
    table.iter().map(|(key, value)| (key.get_ref().to_string(), value.span())).collect()
}

/// Puts every value of `over` into `base`, table by table.
fn merge<'t>(base: &mut DeTable<'t>, over: DeTable<'t>) {
    for (key, value) in over {
        let inner = value.span();
        match (base.get_mut(key.get_ref().as_ref()).map(Spanned::get_mut), value.into_inner()) {
            (Some(DeValue::Table(old)), DeValue::Table(new)) => merge(old, new),
            (_, new) => drop(base.insert(key, Spanned::new(inner, new))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn complaint(text: &str, sets: &[&str]) -> String {
        let sets: Vec<String> = sets.iter().map(|it| (*it).to_owned()).collect();
        let source = match ConfigText::new(Some("job.toml".into()), text.into(), &sets) {
            Ok(source) => source,
            Err(err) => return err.to_string(),
        };
        match Config::parse(&source) {
            Ok(_) => "fine".into(),
            Err(ConfigError::At { message, place }) => format!("{message}\n{}", place.expect("a place")),
            Err(err) => err.to_string(),
        }
    }

    #[test]
    fn complaints_point_at_their_line() {
        assert_eq!(complaint("version = 1\n[coarsen]\nfaces = 3", &[]), "fine");
        let text = complaint("version = 1\nrecipe = 3\n", &[]);
        assert!(text.contains("--> job.toml:2:10") && text.contains("2 | recipe = 3\n  |          ^"), "{text}");
        let text = complaint("version = 1\nsead = 3\n", &[]);
        assert!(text.starts_with("unknown key `sead`; at the top level there are version, recipe, seed"), "{text}");
        assert!(text.contains("job.toml:2:1"), "{text}");
        let text = complaint("[input]\nmash = \"a.obj\"\n", &[]);
        assert!(text.contains("unknown key `mash` (did you mean `mesh`?)") && text.contains("job.toml:2:1"), "{text}");
    }

    #[test]
    fn set_overrides_and_complains_by_itself() {
        let sets = ["input.mesh=b.obj".to_owned(), "coarsen.faces = 7".to_owned()];
        let source = ConfigText::new(None, "[input]\nmesh = \"a.obj\"\n".into(), &sets).unwrap();
        let config = Config::parse(&source).unwrap();
        assert_eq!(config.input.mesh, Some(PathBuf::from("b.obj")));
        assert!(config.tables["coarsen"].get_ref().contains_key("faces"));
        let text = complaint("version = 1\n", &["seed=\"x\""]);
        assert!(text.contains("--> --set:1:8") && text.contains("| seed = \"x\""), "{text}");
        let text = complaint("version = 1\n", &["input.mesh=a.obj", "input.mash=3"]);
        assert!(text.contains("--> --set:1:7") && text.contains("| input.mash = 3"), "{text}");
        assert!(complaint("", &["seed"]).contains("is not KEY=VALUE"));
    }
}
