//! Stage results on disk, keyed by content. A broken entry is a miss with a warning, never an error.
use std::{
    fs, io,
    path::{Path, PathBuf},
    time::SystemTime,
};

use super::{codec, output};
use crate::{
    model::Artifact,
    stage::{Key, Section, StageDef},
};

const MAGIC: &[u8; 8] = b"fabrcch1";
/// Results kept per stage: enough to go back and forth between a few variants of a config.
const KEEP: usize = 6;

/// The cache folder of one output directory.
pub(super) struct Cache {
    folder: PathBuf,
}

/// What a look-up found.
pub(super) enum Lookup {
    /// The result.
    Hit(Box<(Vec<Artifact>, Section)>),
    /// Nothing.
    Miss,
    /// An entry that cannot be used; why.
    Broken(String),
}

impl Cache {
    /// Under `out/.cache`.
    pub(super) fn new(out: &Path) -> Self {
        Self { folder: out.join(".cache") }
    }

    fn path(&self, stage: &str, key: &Key) -> PathBuf {
        let hex: String = key[..12].iter().map(|b| format!("{b:02x}")).collect();
        self.folder.join(format!("{stage}-{hex}.bin"))
    }

    /// Where the unfinished result of a stage is kept: one per stage, whatever its key.
    fn draft(&self, stage: &str) -> PathBuf {
        self.folder.join(format!("unfinished-{stage}.bin"))
    }

    /// Looks a result up.
    pub(super) fn get(&self, def: &StageDef, key: &Key) -> Lookup {
        let path = self.path(def.name, key);
        let found = read(&path, def, key);
        if matches!(found, Lookup::Hit(_)) {
            // The age of an entry is that of its last use; failing to note it only means an earlier eviction.
            let _ = fs::File::options().append(true).open(&path).and_then(|it| it.set_modified(SystemTime::now()));
        }
        found
    }

    /// Keeps a result, and drops its unfinished form and the oldest results of the same stage.
    pub(super) fn put(&self, def: &StageDef, key: &Key, made: &[Artifact], section: &Section) -> io::Result<()> {
        write(&self.path(def.name, key), key, made, section)?;
        match fs::remove_file(self.draft(def.name)) {
            Err(err) if err.kind() != io::ErrorKind::NotFound => return Err(err),
            _ => {}
        }
        self.evict(def.name)
    }

    /// What a stage had done of this work when it was interrupted.
    pub(super) fn unfinished(&self, def: &StageDef, key: &Key) -> Option<Artifact> {
        match read(&self.draft(def.name), def, key) {
            Lookup::Hit(found) => found.0.into_iter().next(),
            Lookup::Miss | Lookup::Broken(_) => None,
        }
    }

    /// Keeps an unfinished result.
    pub(super) fn keep(&self, def: &StageDef, key: &Key, artifact: &Artifact) -> io::Result<()> {
        write(&self.draft(def.name), key, std::slice::from_ref(artifact), &Section::default())
    }

    fn evict(&self, stage: &str) -> io::Result<()> {
        let mut entries = Vec::new();
        for entry in fs::read_dir(&self.folder)? {
            let entry = entry?;
            if entry.file_name().to_string_lossy().starts_with(&format!("{stage}-")) {
                entries.push((entry.metadata()?.modified()?, entry.path()));
            }
        }
        entries.sort();
        let surplus = entries.len().saturating_sub(KEEP);
        entries[..surplus].iter().try_for_each(|(_, path)| fs::remove_file(path))
    }
}

fn read(path: &Path, def: &StageDef, key: &Key) -> Lookup {
    let bytes = match fs::read(path) {
        Ok(bytes) => bytes,
        Err(err) if err.kind() == io::ErrorKind::NotFound => return Lookup::Miss,
        Err(err) => return Lookup::Broken(format!("{}: {err}", path.display())),
    };
    match parse(def, key, &bytes) {
        Some(found) => Lookup::Hit(Box::new(found)),
        None => Lookup::Broken(format!("{} is damaged", path.display())),
    }
}

fn write(path: &Path, key: &Key, made: &[Artifact], section: &Section) -> io::Result<()> {
    let section = serde_json::to_vec(section)?;
    let mut body = key.to_vec();
    body.extend_from_slice(&(section.len() as u64).to_le_bytes());
    body.extend_from_slice(&section);
    body.extend_from_slice(&codec::encode(made));
    let mut bytes = MAGIC.to_vec();
    bytes.extend_from_slice(blake3::hash(&body).as_bytes());
    bytes.extend_from_slice(&body);
    output::write_whole(path, &bytes)
}

fn parse(def: &StageDef, key: &Key, bytes: &[u8]) -> Option<(Vec<Artifact>, Section)> {
    let body = bytes.strip_prefix(MAGIC)?;
    let (hash, body) = body.split_at_checked(32)?;
    if blake3::hash(body).as_bytes() != hash {
        return None;
    }
    let body = body.strip_prefix(key)?;
    let (length, body) = body.split_at_checked(8)?;
    let length = u64::from_le_bytes(length.try_into().ok()?);
    let (section, made) = body.split_at_checked(usize::try_from(length).ok()?)?;
    let made = codec::decode(def.makes, made).ok()?;
    Some((made, serde_json::from_slice(section).ok()?))
}
