//! The `[strips]` table and its section of the report.
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{
    Options, Spacing, StripsError,
    measure::{Quality, quality},
    strips,
};
use crate::{
    model::{CutMesh, Flattening, PieceId, Ruling, SourceMesh, Strips},
    profile::{Angle, Extent, Profiles},
    stage::{Check, Cx, KeyError, Section, Stage},
};

/// How rulings are found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StripsStage {
    /// Chord tolerance: panels leave the seams by at most this where that can be avoided.
    pub tolerance: Extent,
    /// At most so many rulings in all, instead of a tolerance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub count: Option<u32>,
    /// Largest planarity of a quadrilateral: distance of a corner from the plane of the others over the mean diagonal.
    pub planarity: f64,
    /// Rulings that bend at least this much are folded on a press brake, the others are rolled.
    pub fold_angle: Angle,
}

impl Default for StripsStage {
    fn default() -> Self {
        Self { tolerance: Extent::Percent(0.1), count: None, planarity: 0.003, fold_angle: Angle::degrees(30.0) }
    }
}

impl Stage for StripsStage {
    const NAME: &'static str = "strips";
    const VERSION: u32 = 4;
    type Input = (SourceMesh, CutMesh, Flattening);
    type Output = Strips;
    /// Smallest radius to which the material can be bent, mm, if it is known.
    type Profile = Option<f64>;
    type Error = StripsError;

    fn profile(profiles: &Profiles) -> Option<f64> {
        profiles.material.bend_radius.map(|it| it.mm)
    }

    fn check(&self) -> Result<(), KeyError> {
        match self.tolerance {
            Extent::Length(it) => KeyError::range("tolerance", it.mm, 1e-4, 1000.0)?,
            Extent::Percent(it) => KeyError::range("tolerance", it, 1e-4, 10.0)?,
        }
        KeyError::range("count", self.count.map_or(1.0, f64::from), 1.0, 1e6)?;
        KeyError::range("planarity", self.planarity, 1e-6, 1.0)?;
        KeyError::range("fold_angle", self.fold_angle.radians.to_degrees(), 0.1, 180.0)
    }

    fn run(
        &self,
        (source, cut, flat): (&SourceMesh, &CutMesh, &Flattening),
        _: &Option<f64>,
        cx: &Cx,
    ) -> Result<Strips, StripsError> {
        let tolerance = self.tolerance.resolve(source.mesh.bounds().diagonal());
        let spacing = self.count.map_or(Spacing::Tolerance(tolerance), |it| Spacing::Count(it as usize));
        let options = Options { spacing, planarity: self.planarity, fold_angle: self.fold_angle.radians };
        strips(cut, flat, &options, &cx.monitor)
    }

    fn section(
        &self,
        (source, cut, flat): (&SourceMesh, &CutMesh, &Flattening),
        least_radius: &Option<f64>,
        strips: &Strips,
    ) -> Section {
        let it = quality(cut, flat, strips);
        let table = table(&it, strips, cut, source.mesh.bounds().diagonal());
        let mut section = Section::new("strips", table).check(solved_check(cut, &it)).check(crossing_check(&it));
        if let Some(limit) = least_radius {
            section = section.check(radius_check(cut, strips, *limit));
        }
        section
    }
}

fn names<'a>(cut: &'a CutMesh, ids: &[PieceId]) -> Vec<&'a str> {
    ids.iter().map(|&id| cut.pieces[id].name.as_str()).collect()
}

fn table(it: &Quality, strips: &Strips, cut: &CutMesh, diagonal: f64) -> serde_json::Value {
    let percent = |mm: f64| 100.0 * mm / diagonal;
    let folds = strips.rulings.iter().filter(|it| it.bend.abs() >= strips.fold_angle).count();
    json!({
        "strips": it.strips,
        "rulings": strips.rulings.len(),
        "folds": folds,
        "quads": it.panels[0],
        "polygons": it.panels[1],
        "triangles": it.panels[2],
        "quad_area_share": it.area_shares[0],
        "polygon_area_share": it.area_shares[1],
        "triangle_area_share": it.area_shares[2],
        "panel_area_share": it.panel_share,
        "interleaved": it.interleaved,
        "crossings": it.crossings,
        "shared_ends": it.shared_ends,
        "planarity_max": it.planarity_max,
        "planarity_p99": it.planarity_p99,
        "covered_share": it.covered_share,
        "mean_distance_pct": percent(it.distance.mean),
        "max_distance_pct": percent(it.distance.hausdorff),
        "normal_error_mean_deg": it.normal_error.to_degrees(),
        "direction_error_mean_deg": it.direction_error.to_degrees(),
        "chord_error_mean": it.chord_error,
        "chord_stretch_mean": it.stretch_error,
        "tolerance_mm": strips.tolerance,
        "unsolved": names(cut, &it.unsolved),
        "unreliable": names(cut, &it.unreliable),
        "flat": names(cut, &it.flat),
        "residual": strips.residual.as_slice(),
        "bending": cut.pieces.enumerate().map(|(id, piece)| bending(strips, id, &piece.name)).collect::<Vec<_>>(),
    })
}

/// What bending a piece takes: the rulings rolled and folded, their lengths, the largest bends, and the tightest roll.
fn bending(strips: &Strips, id: PieceId, name: &str) -> serde_json::Value {
    let all = || strips.rulings.iter().filter(|it| it.piece == id);
    let is_fold = |it: &&Ruling| it.bend.abs() >= strips.fold_angle;
    let length = |wanted: bool| all().filter(|it| is_fold(it) == wanted).map(|it| it.length).sum::<f64>();
    let bend = |wanted: bool| {
        all().filter(|it| is_fold(it) == wanted).map(|it| it.bend.abs()).fold(0.0, f64::max).to_degrees()
    };
    let folded = all().filter(is_fold).count();
    let mut row = json!({
        "piece": name,
        "rolled": all().count() - folded,
        "folded": folded,
        "rolled_mm": length(false),
        "folded_mm": length(true),
        "largest_roll_deg": bend(false),
        "largest_fold_deg": bend(true),
    });
    // Absent where nothing is rolled: JSON has no infinity.
    let radius = all().filter(|it| !is_fold(it)).map(|it| it.radius[1]).fold(f64::INFINITY, f64::min);
    if radius.is_finite() {
        row["least_radius_mm"] = json!(radius);
    }
    row
}

fn solved_check(cut: &CutMesh, it: &Quality) -> Check {
    let mut note = String::new();
    if !it.unsolved.is_empty() {
        let pieces = names(cut, &it.unsolved).join(", ");
        note = format!("no straight chords fill {pieces}: flipped faces, or a layout that folds over itself there");
    } else if !it.unreliable.is_empty() {
        let pieces = names(cut, &it.unreliable).join(", ");
        note =
            format!("no reliable rulings in {pieces}, which come as triangles: develop further, or cut smaller pieces");
    }
    Check::at_most("strips.solved", it.unsolved.len() as f64, 0.0, "pieces", note)
}

fn crossing_check(it: &Quality) -> Check {
    let note = if it.crossings > 0 { "where a flat piece overlaps itself, its rulings cross" } else { "" };
    Check::at_most("strips.crossings", (it.crossings + it.interleaved) as f64, 0.0, "pairs of rulings", note)
}

/// The tightest bend that is rolled, at the middle of its ruling, against what the material bears.
fn radius_check(cut: &CutMesh, strips: &Strips, limit: f64) -> Check {
    let rolled = strips.rulings.iter().filter(|it| it.bend.abs() < strips.fold_angle);
    let tightest = rolled.min_by(|a: &&Ruling, b: &&Ruling| a.radius[1].total_cmp(&b.radius[1]));
    let radius = tightest.map_or(f64::INFINITY, |it| it.radius[1]);
    let note = tightest.map_or_else(String::new, |it| {
        let [a, b] = it.ends.map(|c| strips.place(c));
        let p = (a + b) / 2.0;
        let name = &cut.pieces[it.piece].name;
        format!(
            "tightest in piece {name} near ({:.1}, {:.1}, {:.1}); a larger model or a thinner sheet bends wider",
            p.x, p.y, p.z
        )
    });
    // JSON has no infinity; a job without bends keeps any limit.
    Check { ok: radius >= limit, ..Check::at_least("strips.bend_radius", radius.min(1e9), limit, "mm", note) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        mesh::{
            TriMesh,
            shapes::ruled::{self, DEVELOPABLE},
        },
        stages::strips::tests::{one_piece, solved},
    };

    #[test]
    fn a_bend_tighter_than_the_material_bears_is_found_with_its_place() {
        // The cylinder has a radius of 40 mm.
        let piece = || ruled::patch(&DEVELOPABLE[0], 14, 0.0);
        let (strips, _) = solved(piece(), 0.2);
        let (cut, _) = one_piece(piece());
        let [borne, broken] = [30.0, 60.0].map(|limit| radius_check(&cut, &strips, limit));
        assert!(borne.ok && borne.limit == 30.0, "{borne:?}");
        assert!(!broken.ok && (30.0..45.0).contains(&broken.value), "{broken:?}");
        let place = |it: &Ruling| (strips.place(it.ends[0]) + strips.place(it.ends[1])) / 2.0;
        let tightest = strips.rulings.iter().find(|it| it.radius[1] == broken.value).map(place).unwrap();
        let wanted = format!("piece A near ({:.1}, {:.1}, {:.1})", tightest.x, tightest.y, tightest.z);
        assert!(broken.note.contains(&wanted), "{}", broken.note);
    }

    #[test]
    fn what_has_no_rulings_is_said() {
        let (uv, faces) = ruled::blob(10);
        let dome = uv.iter().map(|p| p.push((70.0_f64.powi(2) - p.norm_squared()).sqrt())).collect();
        let piece = (TriMesh::new(dome, &faces).unwrap(), uv);
        let (_, quality) = solved(piece.clone(), 0.1);
        let check = solved_check(&one_piece(piece).0, &quality);
        assert!(check.ok && check.note.contains("no reliable rulings in A, which come as triangles"), "{check:?}");
    }
}
