//! Files appear under their final name only when whole.
use std::{
    collections::BTreeSet,
    fs,
    io::{self, Write},
    path::{Path, PathBuf},
};

/// An output file or folder cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}", path.display())]
pub struct OutputError {
    /// Where.
    pub path: PathBuf,
    /// What the system said.
    pub source: io::Error,
}

/// How names of half-written files begin.
const PART: &str = ".part-";

/// Removes what a run that was killed left half written, in a folder and the folders in it. What cannot be removed does
/// no harm.
fn clear(root: &Path) {
    let list = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten().collect::<Vec<_>>();
    let here = list(root);
    let below = here.iter().filter(|it| it.file_type().is_ok_and(|it| it.is_dir())).flat_map(|it| list(&it.path()));
    for entry in below.chain(list(root)) {
        let ours = entry.file_name().to_str().is_some_and(|it| it.starts_with(PART));
        if ours && entry.file_type().is_ok_and(|it| it.is_file()) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Writes beside, syncs, renames.
pub(super) fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    let mut file = tempfile::Builder::new().prefix(PART).tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_data()?;
    #[cfg(unix)]
    {
        // Temporary files are private by default; results should be readable like any other file.
        use std::os::unix::fs::PermissionsExt;
        file.as_file().set_permissions(fs::Permissions::from_mode(0o644))?;
    }
    file.persist(path).map_err(|err| err.error)?;
    Ok(())
}

/// The output folder of a job.
pub(super) struct Output {
    root: PathBuf,
}

impl Output {
    /// Creates the folder, and proves that it can be written before anything long begins.
    pub(super) fn open(root: &Path) -> Result<Self, OutputError> {
        let wrap = |source| OutputError { path: root.to_owned(), source };
        fs::create_dir_all(root).map_err(wrap)?;
        clear(root);
        tempfile::Builder::new().prefix(PART).tempfile_in(root).map_err(wrap)?;
        Ok(Self { root: root.to_owned() })
    }

    /// Writes one file, whole.
    pub(super) fn write(&self, path: &str, bytes: &[u8]) -> Result<(), OutputError> {
        let path = self.root.join(path);
        write_whole(&path, bytes).map_err(|source| OutputError { path, source })
    }

    /// Reads one file back.
    pub(super) fn read(&self, path: &str) -> Result<Vec<u8>, OutputError> {
        let path = self.root.join(path);
        fs::read(&path).map_err(|source| OutputError { path, source })
    }

    /// Removes what the last run wrote and this one did not, so that no sheet of an older job lies among the new ones.
    pub(super) fn sweep(&self, written: &BTreeSet<String>) -> Result<(), OutputError> {
        const LIST: &str = ".cache/files.txt";
        let old = fs::read_to_string(self.root.join(LIST)).unwrap_or_default();
        for stale in old.lines().filter(|it| !written.contains(*it)) {
            let path = self.root.join(stale);
            // Only names that we wrote ourselves; a list that somebody changed must not reach outside the folder.
            let inside = Path::new(stale).components().all(|it| matches!(it, std::path::Component::Normal(_)));
            if inside && path.is_file() {
                fs::remove_file(&path).map_err(|source| OutputError { path, source })?;
            }
        }
        let list: String = written.iter().flat_map(|it| [it.as_str(), "\n"]).collect();
        self.write(LIST, list.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_killed_run_left_half_written_is_removed_and_nothing_else() {
        let root = tempfile::tempdir().unwrap();
        fs::create_dir(root.path().join("sheets")).unwrap();
        let file = |name: &str| root.path().join(name);
        for name in [".part-x1", "sheets/.part-x2", "notes.txt", "sheets/part-3.svg"] {
            fs::write(file(name), "x").unwrap();
        }
        Output::open(root.path()).unwrap();
        assert!(!file(".part-x1").exists() && !file("sheets/.part-x2").exists());
        assert!(file("notes.txt").exists() && file("sheets/part-3.svg").exists());
    }
}
