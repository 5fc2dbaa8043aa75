//! What a nested job really keeps, measured on the placed contours in f64.
use crate::{
    geom::{Box2, polygon::contour_contains, segment_tree::SegmentTree},
    model::{Part, Sheets},
};

/// Parts nearer than this touch, mm.
const TOUCH: f64 = 1e-9;

/// Distances on all sheets, mm.
#[derive(Debug, Clone, PartialEq)]
pub struct Clearances {
    /// Pairs of parts whose material overlaps or touches: "A and B on sheet 1".
    pub overlaps: Vec<String>,
    /// Least distance of two parts, and between which; `None` when no sheet has two parts.
    pub gap: Option<(f64, String)>,
    /// Least distance of a part from the edge of its sheet (negative: outside), and which.
    pub margin: Option<(f64, String)>,
}

/// Measures every pair of parts and every part against its sheet. A part in a hole of another counts as apart from it.
pub fn measure(sheets: &Sheets) -> Clearances {
    let mut found = Clearances { overlaps: Vec::new(), gap: None, margin: None };
    for (number, sheet) in sheets.sheets.iter().enumerate() {
        let trees: Vec<SegmentTree> = sheet.parts.iter().map(|it| SegmentTree::of_contours(&it.contours)).collect();
        let place = |names: &str| format!("{names} on sheet {}", number + 1);
        for (i, part) in sheet.parts.iter().enumerate() {
            let Box2 { min, max } = trees[i].bounds();
            let edge = min.min().min((sheet.size - max).min());
            if found.margin.as_ref().is_none_or(|it| edge < it.0) {
                found.margin = Some((edge, place(&format!("part {}", part.name))));
            }
            for (j, other) in sheet.parts.iter().enumerate().skip(i + 1) {
                let names = || place(&format!("parts {} and {}", part.name, other.name));
                let best = found.gap.as_ref().map_or(f64::INFINITY, |it| it.0);
                let nearest = trees[i].closest(&trees[j], best.max(TOUCH)).map_or(f64::INFINITY, |it| it.0);
                if nearest < TOUCH || buried(part, other) || buried(other, part) {
                    found.overlaps.push(names());
                }
                if nearest < best {
                    found.gap = Some((nearest, names()));
                }
            }
        }
    }
    found
}

/// Whether `inner`, whose contours do not cross those of `outer`, lies in its material rather than outside or in a hole.
fn buried(inner: &Part, outer: &Part) -> bool {
    let point = inner.contours[0][0];
    outer.contours.iter().filter(|it| contour_contains(it, point)).count() % 2 == 1
}
