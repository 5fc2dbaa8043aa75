//! A coupon: a small job from which the kerf and the scale of a machine in a material are measured.
//!
//! One part with a window of known size, cut along its lines without any compensation. What falls out of the window is
//! smaller than drawn by the kerf, the window larger by it, and both are scaled alike: with A and B their measured widths
//! and w the width drawn, the kerf is (B − A) / 2 and the scale (A + B) / 2w, in each direction on its own.
use std::path::{Path, PathBuf};

use super::{
    output::{Output, OutputError},
    verify::verify,
};
use crate::{
    emit::{self, EmitError, File, Nouns},
    geom::{Vec2, stroke_font},
    model::{Mark, Operation, Part, Parts, Placement, Sheet, Sheets},
    numeric::Monitor,
    profile::{Length, Profiles},
    stage::{Check, Cx, Stage},
    stages::route::stage::RouteStage,
};

/// The window as drawn, mm: long enough that a caliper's 0.02 mm is a fiftieth of a per cent of it.
const WINDOW: [f64; 2] = [100.0, 50.0];
/// The frame around it, mm.
const FRAME: f64 = 15.0;
/// Height of the lettering, mm.
const LETTERING: f64 = 4.0;

/// Why there is no coupon.
#[derive(Debug, thiserror::Error)]
pub enum CouponError {
    /// The stock or the bed is too small.
    #[error("the coupon takes {needed} mm, `{what}` leaves {room} mm", needed = size(*needed), room = size(*room))]
    Room {
        /// Name of the profile.
        what: String,
        /// Width and height that are needed, mm.
        needed: Vec2,
        /// What there is, mm.
        room: Vec2,
    },
    /// The machine cannot do it.
    #[error(transparent)]
    Route(#[from] <RouteStage as Stage>::Error),
    /// No such format.
    #[error(transparent)]
    Emit(#[from] EmitError),
    /// Not written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

fn size(it: Vec2) -> String {
    format!("{:.0} × {:.0}", it.x, it.y)
}

/// What was written, and whether it reads back as it was meant.
#[derive(Debug)]
pub struct Coupon {
    /// The files.
    pub files: Vec<PathBuf>,
    /// One check per format.
    pub checks: Vec<Check>,
    /// What to measure, for people.
    pub instruction: String,
}

/// Writes the coupon of a machine and a material into a folder, in the formats of the machine.
pub fn coupon(profiles: &Profiles, folder: &Path) -> Result<Coupon, CouponError> {
    let mut profiles = profiles.clone();
    let window = Vec2::from(WINDOW);
    let needed = window + Vec2::repeat(2.0 * FRAME);
    let margin = profiles.material.margin.mm;
    let stock = Vec2::new(profiles.material.sheet[0].mm, profiles.material.sheet[1].mm);
    let bed = Vec2::new(profiles.machine.bed[0].mm, profiles.machine.bed[1].mm);
    for (what, whole) in [(&profiles.material.name, stock), (&profiles.machine.name, bed)] {
        let room = whole - Vec2::repeat(2.0 * margin);
        if (room - needed).min() < 0.0 {
            return Err(CouponError::Room { what: what.clone(), needed, room });
        }
    }
    // Along the lines, whole, once round: only then is the difference the kerf.
    for operation in [Operation::CutInside, Operation::CutOutside] {
        if let Some(tool) = profiles.machine.tools.get_mut(operation) {
            (tool.kerf, tool.lead, tool.bridges) = (Length::mm(0.0), Length::mm(0.0), None);
        }
    }
    let part = part(Vec2::repeat(margin), window);
    let sheet = Sheet {
        size: needed + Vec2::repeat(2.0 * margin),
        placements: vec![Placement { part: 0, angle: 0.0, offset: Vec2::zeros() }],
        parts: vec![part.clone()],
    };
    let parts = Parts { parts: vec![part], ..Parts::default() };
    let sheets = Sheets { sheets: vec![sheet], margin, gap: profiles.material.gap.mm, unplaced: vec![] };
    let cx = Cx { seed: 0, monitor: Monitor::silent(), kept: None, keep: &|_| () };
    let toolpaths = RouteStage::default().run(&sheets, &profiles.machine, &cx)?;
    let nouns = Nouns { parts: Some(&parts), sheets: Some(&sheets), toolpaths: Some(&toolpaths) };
    let output = Output::open(folder)?;
    let mut read_back = Vec::new();
    for file in emit::files(&nouns, &profiles, &profiles.machine.formats)? {
        if !file.path.starts_with("sheets/") {
            continue;
        }
        output.write(&file.path, &file.bytes)?;
        read_back.push(File { bytes: output.read(&file.path)?, ..file });
    }
    let checks = verify(&read_back, &nouns, &profiles);
    let [width, height] = WINDOW;
    let instruction = format!(
        "measure the piece that falls out (A wide, a high) and the window (B wide, b high):\n\
         kerf = (B - A) / 2 along x, (b - a) / 2 along y; scale = (A + B) / {:.0} along x, (a + b) / {:.0} along y",
        2.0 * width,
        2.0 * height
    );
    Ok(Coupon { files: read_back.iter().map(|it| folder.join(&it.path)).collect(), checks, instruction })
}

/// The frame with its window and what to measure, with its lower left corner at `at`.
fn part(at: Vec2, window: Vec2) -> Part {
    let corner = |low: Vec2, size: Vec2| -> Vec<Vec2> {
        [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|it| low + size.component_mul(&Vec2::from(it))).to_vec()
    };
    let frame = corner(at, window + Vec2::repeat(2.0 * FRAME));
    let mut hole = corner(at + Vec2::repeat(FRAME), window);
    hole.reverse();
    let line = |text: &str, place: Vec2| -> Vec<Mark> {
        let lettering = stroke_font::letter(text, LETTERING);
        let shift = |it: Vec<Vec2>| it.into_iter().map(|p| place + p).collect();
        let mark = |it| Mark { operation: Operation::Text, points: shift(it), closed: false };
        lettering.strokes.into_iter().map(mark).collect()
    };
    let above = at + Vec2::new(FRAME, FRAME + window.y + (FRAME - LETTERING) / 2.0);
    let below = at + Vec2::new(FRAME, (FRAME - LETTERING) / 2.0);
    let marks = line("piece A x a, window B x b", above).into_iter().chain(line("kerf (B-A)/2, (b-a)/2", below));
    Part { name: "coupon".into(), contours: vec![frame, hole], marks: marks.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use toml::de::DeTable;

    #[test]
    fn the_coupon_is_cut_along_its_lines_whatever_the_kerf() {
        let table = |text: &'static str| DeTable::parse(text).unwrap();
        let (material, machine) = (table("profile = \"plywood-3mm\""), table("profile = \"laser-co2\""));
        let profiles = Profiles::load(Path::new("."), material.get_ref(), machine.get_ref()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let coupon = coupon(&profiles, folder.path()).unwrap();
        assert!(coupon.checks.iter().all(|it| it.ok) && coupon.checks.len() == 4, "{:?}", coupon.checks);
        let program = std::fs::read_to_string(folder.path().join("sheets/sheet-01.nc")).unwrap();
        let read = crate::import::read_gcode(&program, crate::import::gcode::Sense::Beam).unwrap();
        // The window comes first, then the frame: 100 × 50 and 130 × 80, in whatever direction and from any corner.
        let cuts: Vec<f64> =
            read.strokes().iter().map(|it| it.iter().map(crate::import::gcode::path::Move::length).sum()).collect();
        let last = &cuts[cuts.len() - 2..];
        assert!((last[0] - 300.0).abs() < 1e-6 && (last[1] - 420.0).abs() < 1e-6, "{last:?}");
        let error = super::coupon(&profiles, Path::new("/dev/null/coupon")).unwrap_err();
        assert!(matches!(error, CouponError::Output(_)));
        let part = part(Vec2::zeros(), Vec2::from(WINDOW));
        let frame = crate::geom::Box2::of(&part.contours[0]);
        assert!(
            part.marks.iter().flat_map(|it| &it.points).all(|p| frame.distance(&crate::geom::Box2::of([p])) == 0.0)
        );
    }
}
