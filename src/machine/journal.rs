//! The journal of a job on disk: which contours may have begun, which are surely done. Append-only; what a line
//! promises is on the disk before the machine gets the bytes it speaks of.
use std::{
    fs::{File, OpenOptions},
    io::{self, Read, Seek, SeekFrom, Write},
    path::Path,
};

use crate::import::gcode::path::Point;

const HEAD: &str = "fabricate journal 1";

/// Contours that are short are promised together, so that the disk is asked once for at least this much work, s.
const BATCH: f64 = 1.0;

/// Why a journal cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// The disk.
    #[error("the journal {file} cannot be used: {cause}")]
    Io {
        /// The file.
        file: String,
        /// Why.
        cause: io::Error,
    },
    /// No journal, so nothing to go on with.
    #[error("there is no journal {0}; nothing to resume. Send the job without --resume")]
    Missing(String),
    /// Not one of ours.
    #[error("{0} is not a journal of fabricate")]
    Foreign(String),
    /// It speaks of another program.
    #[error(
        "the journal {0} belongs to another version of the program; --resume needs the very file that was being sent"
    )]
    Changed(String),
    /// The job was done.
    #[error("the journal {0} says that the job was finished; nothing to resume")]
    Finished(String),
}

/// What a journal says about a job.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Past {
    /// blake3 of the program.
    pub program: String,
    /// Contours that may have begun: all with a smaller index.
    pub begun: usize,
    /// Contours that are surely done: all with a smaller index.
    pub done: usize,
    /// Machine position at the end of a safe abort that kept it.
    pub kept: Option<Point>,
    /// It ran to its end.
    pub finished: bool,
}

impl Past {
    /// Reads a journal. A torn last line, from a power cut, does not count.
    pub fn read(text: &str) -> Option<Self> {
        let mut lines = text.split_inclusive('\n').filter_map(|it| it.strip_suffix('\n'));
        if lines.next() != Some(HEAD) {
            return None;
        }
        let mut past = Self::default();
        for line in lines {
            let (key, value) = line.split_once(' ').unwrap_or((line, ""));
            match key {
                "program" => value.clone_into(&mut past.program),
                "begin" => past.begun = past.begun.max(value.parse().ok()?),
                "done" => past.done = past.done.max(value.parse().ok()?),
                "resume" => {
                    // What is done anew may be interrupted anew.
                    past.done = past.done.min(value.parse().ok()?);
                    (past.kept, past.finished) = (None, false);
                }
                "kept" => {
                    let numbers: Vec<f64> = value.split(' ').filter_map(|it| it.parse().ok()).collect();
                    past.kept = <[f64; 3]>::try_from(numbers).ok();
                }
                "finished" => past.finished = true,
                _ => {}
            }
        }
        Some(past)
    }

    /// Contours that began and are not surely done.
    pub fn in_doubt(&self) -> std::ops::Range<usize> {
        self.done..self.begun.max(self.done)
    }
}

/// A journal being written.
pub struct Journal {
    file: File,
    name: String,
    begun: usize,
    done: usize,
}

fn hash(program: &str) -> String {
    blake3::hash(program.as_bytes()).to_hex().to_string()
}

impl Journal {
    fn error(name: &str, cause: io::Error) -> JournalError {
        JournalError::Io { file: name.to_owned(), cause }
    }

    /// Begins a journal for a program; an old one is replaced.
    pub fn create(path: &Path, program: &str) -> Result<Self, JournalError> {
        let name = path.display().to_string();
        let open = || -> io::Result<File> {
            let mut file = File::create(path)?;
            file.write_all(format!("{HEAD}\nprogram {}\n", hash(program)).as_bytes())?;
            file.sync_all()?;
            // The name must survive a power cut as well.
            if let Some(dir) = path.parent().filter(|it| !it.as_os_str().is_empty()) {
                File::open(dir)?.sync_all()?;
            }
            Ok(file)
        };
        let file = open().map_err(|err| Self::error(&name, err))?;
        Ok(Self { file, name, begun: 0, done: 0 })
    }

    /// Opens the journal of an interrupted job to go on with it.
    pub fn resume(path: &Path, program: &str) -> Result<(Self, Past), JournalError> {
        let name = path.display().to_string();
        let mut text = String::new();
        let mut file = OpenOptions::new().read(true).write(true).open(path).map_err(|err| match err.kind() {
            io::ErrorKind::NotFound => JournalError::Missing(name.clone()),
            _ => Self::error(&name, err),
        })?;
        file.read_to_string(&mut text).map_err(|err| Self::error(&name, err))?;
        let past = Past::read(&text).ok_or_else(|| JournalError::Foreign(name.clone()))?;
        if past.program != hash(program) {
            return Err(JournalError::Changed(name));
        }
        if past.finished {
            return Err(JournalError::Finished(name));
        }
        // A torn last line is cut off, so that what follows stands on a line of its own.
        let whole = text.rfind('\n').map_or(0, |it| it + 1);
        let cut = |file: &mut File| -> io::Result<()> {
            file.set_len(whole as u64)?;
            file.seek(SeekFrom::End(0)).map(|_| ())
        };
        cut(&mut file).map_err(|err| Self::error(&name, err))?;
        let mut journal = Self { file, name, begun: past.begun, done: past.done };
        journal.write(&format!("resume {}\n", past.done), true)?;
        Ok((journal, past))
    }

    fn write(&mut self, text: &str, sync: bool) -> Result<(), JournalError> {
        let mut put = || -> io::Result<()> {
            self.file.write_all(text.as_bytes())?;
            if sync { self.file.sync_data() } else { Ok(()) }
        };
        put().map_err(|err| Self::error(&self.name, err))
    }

    /// Contour `contour` is about to be sent; `seconds` gives the estimates of all contours. Returns once the promise
    /// is on the disk.
    pub fn begin(&mut self, contour: usize, seconds: impl Fn(usize) -> Option<f64>) -> Result<(), JournalError> {
        if contour < self.begun {
            return Ok(());
        }
        let mut end = contour;
        let mut batch = 0.0;
        while let Some(more) = seconds(end).filter(|_| batch < BATCH) {
            batch += more;
            end += 1;
        }
        self.begun = end.max(contour + 1);
        self.write(&format!("begin {}\n", self.begun), true)
    }

    /// All contours before `count` are surely done.
    pub fn done(&mut self, count: usize) -> Result<(), JournalError> {
        if count <= self.done {
            return Ok(());
        }
        self.done = count;
        // The next promise takes it to the disk; if it is lost, a contour is doubted that need not be.
        self.write(&format!("done {count}\n"), false)
    }

    /// The job was stopped; `sent` contours really began.
    pub fn stopped(&mut self, kept: Option<Point>, reason: &str) -> Result<(), JournalError> {
        let mut text = format!("stopped {}\n", reason.replace('\n', " "));
        if let Some([x, y, z]) = kept {
            text += &format!("kept {x} {y} {z}\n");
        }
        self.write(&text, true)
    }

    /// The job is done.
    pub fn finished(&mut self) -> Result<(), JournalError> {
        self.write("finished\n", true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_promised_is_read_back_even_after_a_power_cut() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("job.journal");
        let program = "G1 X1 F1";
        let mut journal = Journal::create(&path, program).unwrap();
        let seconds = |i: usize| (i < 10).then_some(0.4);
        journal.begin(0, seconds).unwrap();
        journal.begin(2, seconds).unwrap();
        journal.begin(3, seconds).unwrap();
        journal.done(2).unwrap();
        drop(journal);
        OpenOptions::new().append(true).open(&path).unwrap().write_all(b"done 9").unwrap();
        let (mut journal, past) = Journal::resume(&path, program).unwrap();
        assert_eq!((past.begun, past.done), (6, 2), "three at a time, and the torn line does not count");
        assert_eq!(past.in_doubt(), 2..6);
        journal.done(10).unwrap();
        journal.stopped(Some([1.0, -2.5, 0.0]), "a\nb").unwrap();
        let past = Past::read(&std::fs::read_to_string(&path).unwrap()).unwrap();
        assert_eq!((past.done, past.kept), (10, Some([1.0, -2.5, 0.0])));
        journal.finished().unwrap();
        assert!(matches!(Journal::resume(&path, program), Err(JournalError::Finished(_))));
        assert!(matches!(Journal::resume(&path, "G1"), Err(JournalError::Changed(_))));
        assert!(matches!(Journal::resume(&dir.path().join("no"), program), Err(JournalError::Missing(_))));
    }
}
