//! Writers: pure functions of a finished noun. One list, [`FORMATS`]; one call, [`files`].

pub mod booklet;
pub mod creases;
mod drawing;
mod dxf;
mod dxf12;
mod gcode;
pub mod globe;
mod hpgl;
pub mod mill;
pub mod mold;
pub mod net;
pub mod obj;
mod pdf;
pub mod stl;
pub mod stripes;
pub mod strips;
mod svg;

use std::{collections::BTreeSet, io};

pub use drawing::{CHECK_LAYER, Drawing};
pub use gcode::Number;

use crate::{
    model::{Part, Parts, SheetPaths, Sheets, Toolpaths},
    profile::{Machine, Profiles},
};

/// What a format is made from.
#[derive(Clone, Copy)]
pub enum Writer {
    /// A drawing: one file per sheet and one per part.
    Drawing(fn(&Drawing<'_>, &Machine, &mut dyn io::Write) -> io::Result<()>),
    /// A machine program: one file per sheet.
    Program(fn(&SheetPaths, Number, &Profiles, &mut dyn io::Write) -> io::Result<()>),
}

/// An output format.
#[derive(Clone, Copy)]
pub struct Format {
    /// What the config calls it.
    pub name: &'static str,
    /// Ending of its files.
    pub extension: &'static str,
    /// The writer and the noun it takes.
    pub writer: Writer,
}

/// Chords of arcs stay this near to them where a format or a machine has no arcs, mm: half a plotter unit.
pub const CHORD: f64 = 0.0125;

/// All output formats for sheets and parts.
pub const FORMATS: &[Format] = &[
    Format { name: "svg", extension: "svg", writer: Writer::Drawing(svg::write) },
    Format { name: "dxf", extension: "dxf", writer: Writer::Drawing(dxf::write) },
    Format { name: "dxf-r12", extension: "r12.dxf", writer: Writer::Drawing(dxf12::write) },
    Format { name: "pdf", extension: "pdf", writer: Writer::Drawing(pdf::write) },
    Format { name: "pdf-a4", extension: "a4.pdf", writer: Writer::Drawing(pdf::write_a4) },
    Format { name: "pdf-letter", extension: "letter.pdf", writer: Writer::Drawing(pdf::write_letter) },
    Format { name: "gcode", extension: "nc", writer: Writer::Program(gcode::write) },
    Format {
        name: "hpgl",
        extension: "plt",
        writer: Writer::Program(|sheet, _, profiles, out| hpgl::write(sheet, &profiles.machine, out)),
    },
];

/// Why nothing was written.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum EmitError {
    /// A name that is no format.
    #[error("there is no output format `{name}`; known are: {}", known())]
    UnknownFormat {
        /// What was asked for.
        name: String,
    },
}

fn known() -> String {
    let names: Vec<&str> = FORMATS.iter().map(|it| it.name).collect();
    names.join(", ")
}

/// The format of a name.
pub fn format(name: &str) -> Result<&'static Format, EmitError> {
    FORMATS.iter().find(|it| it.name == name).ok_or_else(|| EmitError::UnknownFormat { name: name.into() })
}

/// The nouns that a job has made; what is absent gets no files.
#[derive(Debug, Clone, Copy, Default)]
pub struct Nouns<'a> {
    /// For one file per part.
    pub parts: Option<&'a Parts>,
    /// For one drawing per sheet.
    pub sheets: Option<&'a Sheets>,
    /// For one program per sheet.
    pub toolpaths: Option<&'a Toolpaths>,
}

/// What a file shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Subject {
    /// A part, by its index in [`Parts`].
    Part(usize),
    /// A sheet, by its index in [`Sheets`].
    Sheet(usize),
    /// The toolpaths of a sheet, by its index in [`Toolpaths`].
    Program(usize),
}

/// A file to be written.
#[derive(Debug, Clone, PartialEq)]
pub struct File {
    /// Relative to the output folder, with `/`.
    pub path: String,
    /// Name of the format.
    pub format: &'static str,
    /// What it shows.
    pub subject: Subject,
    /// The content.
    pub bytes: Vec<u8>,
}

/// Every file of a job in the given formats, in the order of the formats: `sheets/sheet-01.svg`,
/// `parts/NAME_MATERIAL_THICKNESSmm_qN.dxf`, … The same input gives the same bytes.
pub fn files(nouns: &Nouns<'_>, profiles: &Profiles, formats: &[String]) -> Result<Vec<File>, EmitError> {
    let machine = &profiles.machine;
    let mut files = Vec::new();
    let mut push = |path: String, format: &Format, subject, write: &dyn Fn(&mut dyn io::Write) -> io::Result<()>| {
        let mut bytes = Vec::new();
        write(&mut bytes).expect("writing to memory cannot fail");
        files.push(File { path: format!("{path}.{}", format.extension), format: format.name, subject, bytes });
    };
    let formats = formats.iter().map(|it| format(it)).collect::<Result<Vec<_>, _>>()?;
    for format in formats {
        match format.writer {
            Writer::Drawing(write) => {
                for (i, sheet) in nouns.sheets.iter().flat_map(|it| it.sheets.iter().enumerate()) {
                    let drawing = Drawing::of_sheet(sheet, &machine.order);
                    push(sheet_path(i), format, Subject::Sheet(i), &|out| write(&drawing, machine, out));
                }
                let names = nouns.parts.map(|it| part_paths(it, profiles)).unwrap_or_default();
                for (i, part) in nouns.parts.iter().flat_map(|it| it.parts.iter().enumerate()) {
                    let drawing = Drawing::of_part(part, &machine.order);
                    push(names[i].clone(), format, Subject::Part(i), &|out| write(&drawing, machine, out));
                }
            }
            Writer::Program(write) => {
                for (i, sheet) in nouns.toolpaths.iter().flat_map(|it| it.sheets.iter().enumerate()) {
                    let count = nouns.toolpaths.map_or(0, |it| it.sheets.len());
                    let number = Number { index: i + 1, count };
                    push(sheet_path(i), format, Subject::Program(i), &|out| write(sheet, number, profiles, out));
                }
            }
        }
    }
    Ok(files)
}

/// A part by itself as DXF.
pub fn part_dxf(part: &Part, machine: &Machine) -> Vec<u8> {
    let mut bytes = Vec::new();
    let drawing = Drawing::of_part(part, &machine.order);
    dxf::write(&drawing, machine, &mut bytes).expect("writing to memory cannot fail");
    bytes
}

fn sheet_path(index: usize) -> String {
    format!("sheets/sheet-{:02}", index + 1)
}

/// One path per part, without ending: plain characters, and different on file systems that ignore case.
fn part_paths(parts: &Parts, profiles: &Profiles) -> Vec<String> {
    let plain = |text: &str| -> String {
        let keep = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
        text.chars().map(|c| if keep(c) { c } else { '-' }).collect()
    };
    let material = plain(&profiles.material.name);
    let thickness = drawing::short(profiles.material.thickness.mm);
    let mut taken = BTreeSet::new();
    let name = |part: &Part| {
        let name = plain(&part.name);
        let names = std::iter::once(name.clone()).chain((2_usize..).map(|n| format!("{name}-{n}")));
        // Parts of one name do not exist; parts whose names differ only by what a file name cannot hold do.
        let free = names.into_iter().find(|it| taken.insert(it.to_lowercase())).unwrap_or(name);
        format!("parts/{free}_{material}_{thickness}mm_q1")
    };
    parts.parts.iter().map(name).collect()
}
