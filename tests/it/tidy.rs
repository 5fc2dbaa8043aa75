//! House rules that the compiler does not check: who may import whom, a head on every file, where serde may live,
//! folder names, and the lists of long files and functions, which only shrink.
use std::{
    fs,
    path::{Path, PathBuf},
};

/// Who may import whom, by path prefix of the importing file (the first row that matches counts) and of the import.
const MAY_IMPORT: &[(&str, &[&str])] = &[
    ("lib.rs", &["*"]),
    ("main.rs", &["cli"]),
    ("stage.rs", &["model", "numeric", "profile"]),
    ("cli/", &["pipeline", "machine", "import", "report", "profile"]),
    (
        "pipeline/",
        &["stages/*/stage", "stage", "import", "emit", "report", "profile", "model", "mesh", "geom", "numeric"],
    ),
    ("stages/mod.rs", &[]),
    ("stages/*/stage.rs", &["stage", "stages/SELF", "model", "mesh", "profile", "geom", "numeric", "surface"]),
    ("stages/*/", &["stages/SELF", "model", "mesh", "surface", "numeric", "geom"]),
    ("emit/", &["model", "mesh", "geom", "profile"]),
    ("render/", &["model", "mesh", "geom"]),
    ("report/", &["model", "mesh", "render", "emit", "geom", "stage"]),
    ("machine/", &["profile", "import"]),
    ("import/", &["model", "mesh", "geom"]),
    ("model/", &["mesh", "geom"]),
    ("surface/", &["mesh", "numeric", "geom"]),
    ("mesh/", &["numeric", "geom"]),
    ("profile/", &["model", "geom"]),
    ("geom/", &[]),
    ("numeric/", &[]),
];

/// Where serde may be named. The cache has a codec of its own but stores sections as JSON.
const SERDE: &[&str] = &["stage.rs", "stages/*/stage.rs", "profile/", "report/", "import/", "pipeline/", "cli/"];

/// Files that may be longer than 600 lines. This list only shrinks.
const LONG_FILES: &[&str] = &["stages/develop/evaluate.rs"];

/// Functions that may be longer than 70 lines, as `file:name`. This list only shrinks.
const LONG_FUNCTIONS: &[&str] =
    &["numeric/optim/levenberg.rs:curvature", "pipeline/run.rs:run", "stages/cut/divide.rs:dividing_path"];

const BANNED_FOLDERS: &[&str] = &["utils", "util", "helpers", "common", "misc"];

fn rust_files(dir: &Path, out: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = fs::read_dir(dir).unwrap().map(|it| it.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            rust_files(&path, out);
        } else if path.extension().is_some_and(|it| it == "rs") {
            out.push(path);
        }
    }
}

/// Whether `path` falls under `pattern`, in which `*` stands for one folder and `SELF` for `own`.
fn under(path: &str, pattern: &str, own: &str) -> bool {
    let pattern = pattern.replace("SELF", own);
    let (mut path, mut pattern) = (path.split('/'), pattern.split('/').filter(|it| !it.is_empty()));
    pattern
        .all(|want| path.next().is_some_and(|have| want == "*" || want == have || want == have.trim_end_matches(".rs")))
}

/// Every `crate::a::b` path of a text as `a/b`, groups expanded, and every `super::…` resolved against `file`.
fn imports(file: &str, text: &str) -> Vec<String> {
    let mut found = Vec::new();
    for (at, _) in text.match_indices("crate::") {
        if text[..at].chars().next_back().is_some_and(|c| c.is_alphanumeric() || c == '_' || c == '$') {
            continue;
        }
        expand(&text[at + "crate::".len()..], String::new(), &mut found);
    }
    let mut folder: Vec<&str> = file.trim_end_matches(".rs").trim_end_matches("/mod").split('/').collect();
    if folder == ["lib"] {
        folder.clear();
    }
    let tests = text.find("\nmod tests {").unwrap_or(text.len());
    let mut at = 0;
    while let Some(next) = text[at..].find("super::") {
        let start = at + next;
        let mut rest = &text[start..];
        let mut ups = 0;
        while let Some(tail) = rest.strip_prefix("super::") {
            ups += 1;
            rest = tail;
        }
        at = text.len() - rest.len();
        let ups = if start > tests { ups - 1 } else { ups };
        let base = folder[..folder.len().saturating_sub(ups)].join("/");
        if !base.is_empty() {
            expand(rest, base, &mut found);
        }
    }
    found
}

/// Expands `a::{b, c::d}` behind a prefix.
fn expand(text: &str, prefix: String, out: &mut Vec<String>) {
    if let Some(group) = text.strip_prefix('{') {
        let mut depth = 0;
        let mut start = 0;
        for (i, c) in group.char_indices() {
            match c {
                '{' => depth += 1,
                '}' if depth > 0 => depth -= 1,
                ',' | '}' if depth == 0 => {
                    let item = group[start..i].trim();
                    if !item.is_empty() {
                        expand(item, prefix.clone(), out);
                    }
                    start = i + 1;
                    if c == '}' {
                        return;
                    }
                }
                _ => {}
            }
        }
        return;
    }
    let word: String = text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
    let path = if prefix.is_empty() { word.clone() } else { format!("{prefix}/{word}") };
    match text[word.len()..].strip_prefix("::") {
        Some(rest) if rest.starts_with('{') || rest.starts_with(|c: char| c.is_alphanumeric() || c == '_') => {
            expand(rest, path, out)
        }
        _ => out.push(path),
    }
}

/// Text without comments and strings, so that prose does not count.
fn code_of(text: &str) -> String {
    let mut out = String::new();
    for line in text.lines() {
        out.push_str(line.split("//").next().unwrap_or_default());
        out.push('\n');
    }
    out
}

/// Functions longer than 70 lines, by name.
fn long_functions(text: &str) -> Vec<String> {
    let lines: Vec<&str> = text.lines().collect();
    let mut found = Vec::new();
    for (i, line) in lines.iter().enumerate() {
        let body = line.trim_start();
        let indent = &line[..line.len() - body.len()];
        let Some((_, rest)) = body.split_once("fn ").filter(|(before, _)| {
            before
                .split_whitespace()
                .all(|it| matches!(it, "pub" | "const" | "pub(crate)" | "pub(super)" | "async" | "unsafe"))
        }) else {
            continue;
        };
        let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        let end = lines[i..].iter().position(|it| *it == format!("{indent}}}"));
        if end.is_some_and(|end| end + 1 > 70) {
            found.push(name);
        }
    }
    found
}

fn violations(files: &[(String, String)]) -> Vec<String> {
    let mut out = Vec::new();
    for (path, text) in files {
        if !text.starts_with("//!") {
            out.push(format!("{path}: the file does not begin with a `//!` line that says what it is for"));
        }
        if let Some(folder) = path.split('/').find(|it| BANNED_FOLDERS.contains(&it.trim_end_matches(".rs"))) {
            out.push(format!("{path}: `{folder}` says nothing about what is inside"));
        }
        if text.lines().count() > 600 && !LONG_FILES.contains(&path.as_str()) {
            out.push(format!("{path}: {} lines, more than 600", text.lines().count()));
        }
        for name in long_functions(text) {
            if !LONG_FUNCTIONS.contains(&format!("{path}:{name}").as_str()) {
                out.push(format!("{path}: function `{name}` is longer than 70 lines"));
            }
        }
        let code = code_of(text);
        let own = path.split('/').nth(1).unwrap_or_default();
        let top = path.split('/').next().unwrap_or_default().trim_end_matches(".rs");
        let Some((_, allowed)) = MAY_IMPORT.iter().find(|it| under(path, it.0, own)) else {
            out.push(format!("{path}: no row of the import table covers it"));
            continue;
        };
        for import in imports(path, &code) {
            let inside = top != "stages" && under(&import, top, own);
            if !inside && !allowed.iter().any(|it| *it == "*" || under(&import, it, own)) {
                out.push(format!("{path}: may not import `{}`", import.replace('/', "::")));
            }
        }
        if code.contains("serde") && !SERDE.iter().any(|it| under(path, it, own)) {
            out.push(format!("{path}: serde belongs in stage.rs, profile, report, import and pipeline"));
        }
    }
    out
}

#[test]
fn tidy() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut paths = Vec::new();
    rust_files(&root, &mut paths);
    let name = |it: &PathBuf| it.strip_prefix(&root).unwrap().to_str().unwrap().replace('\\', "/");
    let files: Vec<_> = paths.iter().map(|it| (name(it), fs::read_to_string(it).unwrap())).collect();
    let found = violations(&files);
    assert!(found.is_empty(), "\n{}", found.join("\n"));
}

#[test]
fn lists_only_shrink() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for path in LONG_FILES {
        let lines = fs::read_to_string(root.join(path)).unwrap().lines().count();
        assert!(lines > 600, "{path} has {lines} lines now: take it off LONG_FILES");
    }
    for entry in LONG_FUNCTIONS {
        let (path, name) = entry.split_once(':').unwrap();
        let text = fs::read_to_string(root.join(path)).unwrap();
        assert!(long_functions(&text).iter().any(|it| it == name), "{entry} is short now: take it off LONG_FUNCTIONS");
    }
}

#[test]
fn tidy_catches() {
    let check = |path: &str, text: &str, expected: &[&str]| {
        assert_eq!(violations(&[(path.into(), text.into())]), expected, "{path}: {text}");
    };
    check(
        "stages/cut/mod.rs",
        "//! x\nuse crate::{mesh::TriMesh, emit::{A, B}};",
        &["stages/cut/mod.rs: may not import `emit::A`", "stages/cut/mod.rs: may not import `emit::B`"],
    );
    check(
        "stages/cut/mod.rs",
        "//! x\nuse crate::stage::Stage;",
        &["stages/cut/mod.rs: may not import `stage::Stage`"],
    );
    check("stages/cut/stage.rs", "//! x\nuse crate::stage::Stage;\nuse serde::Serialize;\nuse super::cut;", &[]);
    check(
        "stages/cut/stage.rs",
        "//! x\nuse crate::stages::flatten::flatten;",
        &["stages/cut/stage.rs: may not import `stages::flatten::flatten`"],
    );
    check(
        "stages/cut/mod.rs",
        "//! x\nuse super::flatten::flatten;",
        &["stages/cut/mod.rs: may not import `stages::flatten::flatten`"],
    );
    check(
        "stages/cut/seam.rs",
        "//! x\nuse super::super::flatten::flatten;",
        &["stages/cut/seam.rs: may not import `stages::flatten::flatten`"],
    );
    check("stages/cut/seam.rs", "//! x\nuse super::Options;\nuse crate::stages::cut::x;", &[]);
    check("stages/cut/mod.rs", "//! x\nmod tests {\n    use super::{Options, cut};\n}", &[]);
    check(
        "mesh/mod.rs",
        "//! x\nuse serde::Serialize;",
        &["mesh/mod.rs: serde belongs in stage.rs, profile, report, import and pipeline"],
    );
    check("pipeline/run.rs", "//! x\nuse crate::stages::cut::stage::Cut;", &[]);
    check(
        "pipeline/run.rs",
        "//! x\nuse crate::stages::cut::cut;",
        &["pipeline/run.rs: may not import `stages::cut::cut`"],
    );
    check("geom/utils.rs", "//! x", &["geom/utils.rs: `utils.rs` says nothing about what is inside"]);
    check("geom/a.rs", "x", &["geom/a.rs: the file does not begin with a `//!` line that says what it is for"]);
    let long = format!("//! x\nfn f() {{\n{}}}\n", "    let _ = 0;\n".repeat(70));
    check("geom/a.rs", &long, &["geom/a.rs: function `f` is longer than 70 lines"]);
    check("mesh/a.rs", "//! x\n// use crate::emit::A;", &[]);
}
