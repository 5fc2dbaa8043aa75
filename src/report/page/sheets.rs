//! What the page shows of the sheets: the drawing that is cut, the parts on it, and the way of the tool.
use serde_json::{Value, json};

use super::{Content, grid::Grid, pack::Pack, scene::rounded};
use crate::model::{Operation, Part, Placement, Sheet, SheetPaths};

/// Arcs of a toolpath are shown by chords this near to them, mm.
const CHORD: f64 = 0.05;

/// Every sheet as JSON, with its drawing and its numbers in `pack`.
pub(super) fn sheets(content: &Content<'_>, pack: &mut Pack) -> Value {
    let Some(sheets) = content.subjects.sheets else { return json!([]) };
    let row = |(i, sheet): (usize, &Sheet)| {
        let grid = Grid::of([[0.0; 2], [sheet.size.x, sheet.size.y]].into_iter());
        let mut out = json!({
            "name": format!("Sheet {}", i + 1),
            "size": [sheet.size.x, sheet.size.y],
            "grid": grid.json(),
            "parts": sheet.parts.iter().zip(&sheet.placements).map(|it| part(it, &grid, pack)).collect::<Vec<_>>(),
        });
        if let Some((path, svg)) = content.drawings.get(i) {
            out["path"] = json!(path);
            out["svg"] = pack.bytes(svg);
        }
        if let Some(paths) = content.toolpaths.and_then(|it| it.sheets.get(i)) {
            out["paths"] = toolpaths(paths, &sheet.parts, &grid, pack);
        }
        out
    };
    sheets.sheets.iter().enumerate().map(row).collect()
}

/// Outline and place of a part. A part can lie over the edge of the sheet only where the nesting failed, and is cut off there.
fn part((part, placement): (&Part, &Placement), grid: &Grid<2>, pack: &mut Pack) -> Value {
    let points: Vec<[u16; 2]> = part.contours.iter().flatten().map(|p| grid.cell([p.x, p.y])).collect();
    let offset = [placement.offset.x, placement.offset.y].map(rounded);
    json!({
        "name": part.name,
        "angle": placement.angle,
        "offset": offset,
        "points": pack.shorts(&points),
        "contours": part.contours.iter().map(Vec::len).collect::<Vec<_>>(),
    })
}

/// The movements of the tool at work, in order; between them it goes straight.
fn toolpaths(sheet: &SheetPaths, parts: &[Part], grid: &Grid<2>, pack: &mut Pack) -> Value {
    let chains: Vec<_> = sheet.paths.iter().map(|it| it.path.chords(CHORD)).collect();
    let points: Vec<[u16; 2]> = chains.iter().flatten().map(|p| grid.cell([p.x, p.y])).collect();
    let operation = |it: Operation| Operation::ALL.iter().position(|known| *known == it).unwrap_or_default() as u32;
    let part = |name: &str| parts.iter().position(|it| it.name == name).map_or(0, |it| it as u32 + 1);
    json!({
        "points": pack.shorts(&points),
        "runs": pack.integers(chains.iter().map(|it| it.len() as u32)),
        "operations": pack.integers(sheet.paths.iter().map(|it| operation(it.operation))),
        "parts": pack.integers(sheet.paths.iter().map(|it| part(&it.part))),
        "joined": pack.integers(sheet.paths.iter().map(|it| u32::from(it.joined))),
    })
}

/// Names, colours and speeds of the operations.
pub(super) fn operations(content: &Content<'_>) -> Value {
    let row = |&it: &Operation| {
        let [r, g, b] = (content.subjects.line)(it);
        json!({ "name": it.name(), "color": format!("#{r:02x}{g:02x}{b:02x}"), "feed": (content.feed)(it) })
    };
    Operation::ALL.iter().map(row).collect()
}
