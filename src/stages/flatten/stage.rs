//! The `[flatten]` table and its sections of the report.
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{
    FlattenError, MISMATCH, Options, Outline, Quality, SeamLengths, flatten, mirrored, quality, ribbons, seam_lengths,
};
use crate::{
    mesh::{FaceId, TriMesh},
    model::{CutMesh, Flattening, PieceId, Stripes},
    profile::{Angle, Profiles},
    stage::{Check, Cx, Inputs, KeyError, Section, Stage},
};

/// How pieces are laid flat.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FlattenStage {
    /// What the outlines of the pieces are like.
    pub outline: OutlineKey,
    /// Least angle at a corner of a straight outline.
    pub corner: Angle,
    /// Length of the open edges of the model in the plane over their length in space: less than 1 for a hem that is to pull
    /// in, more for one that is gathered.
    pub hem: f64,
    /// Whether seams whose sides differ by more than 0.2 % and 0.05 mm in the plane are made equal.
    pub equal_seams: bool,
}

impl Default for FlattenStage {
    fn default() -> Self {
        Self { outline: OutlineKey::Isometric, corner: Angle::degrees(30.0), hem: 1.0, equal_seams: true }
    }
}

/// What outlines are like, as it is written in the config.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OutlineKey {
    /// As long as in space, with the least stretch.
    Isometric,
    /// Straight from corner to corner, conformal inside; for materials that stretch.
    Straight,
}

impl Stage for FlattenStage {
    const NAME: &'static str = "flatten";
    const VERSION: u32 = 3;
    type Input = (CutMesh, Option<Stripes>);
    type Output = Flattening;
    type Profile = ();
    type Error = FlattenError;

    fn profile(_: &Profiles) {}

    fn check(&self) -> Result<(), KeyError> {
        KeyError::range("hem", self.hem, 0.5, 2.0)?;
        KeyError::range("corner", self.corner.radians.to_degrees(), 1.0, 120.0)
    }

    fn run(&self, (cut, _): <Self::Input as Inputs>::Refs<'_>, (): &(), cx: &Cx) -> Result<Flattening, FlattenError> {
        let outline = match self.outline {
            OutlineKey::Isometric => Outline::Isometric,
            OutlineKey::Straight => Outline::Straight,
        };
        let options = Options { outline, corner: self.corner.radians, hem: self.hem, equal_seams: self.equal_seams };
        flatten(cut, &options, &cx.monitor)
    }

    fn section(&self, (cut, stripes): <Self::Input as Inputs>::Refs<'_>, (): &(), flat: &Flattening) -> Section {
        let quality = quality(cut, flat);
        let seams = seam_lengths(cut, flat);
        let pieces: Vec<_> = quality
            .pieces
            .enumerate()
            .map(|(id, it): (PieceId, _)| {
                json!({
                    "name": cut.pieces[id].name,
                    "faces": it.faces,
                    "area_3d_mm2": it.area_3d,
                    "area_2d_mm2": it.area_2d,
                    "max_abs_log_scale": it.max_log_scale,
                })
            })
            .collect();
        let pairs: Vec<[&str; 2]> =
            mirrored(cut, flat).into_iter().map(|pair| pair.map(|id| cut.pieces[id].name.as_str())).collect();
        let overlap_area: f64 = flat.overlaps.iter().map(|it| it.area).sum();
        let table = json!({
            "max_abs_log_scale": quality.max_log_scale.0,
            "p999_abs_log_scale": quality.p999_log_scale,
            "p99_abs_log_scale": quality.p99_log_scale,
            "mean_abs_log_scale": quality.mean_log_scale,
            "share_over_limit": quality.share_over_limit,
            "max_principal_stretch": quality.max_principal_stretch.0,
            "p999_principal_stretch": quality.p999_principal_stretch,
            "p99_principal_stretch": quality.p99_principal_stretch,
            "max_qc": quality.max_quasi_conformal,
            "flipped": quality.flipped.len(),
            "overlaps": flat.overlaps.len(),
            "overlap_area_mm2": overlap_area,
            "stretch_limit": flat.stretch_limit,
            "pieces": pieces,
            "mirrored_pairs": pairs,
        });
        let seam_table = json!({
            "count": seams.len(),
            "max_mismatch_mm": seams.iter().fold(0.0, |max, it| it.mismatch().max(max)),
            "max_mismatch_rel": seams.iter().fold(0.0, |max, it| it.relative().max(max)),
        });
        let mut section = Section::new("flatten", table).table("seams", seam_table);
        if stripes.is_some_and(|it| !it.drawn) {
            let (pieces, all) = ribbons(cut, flat);
            let rows: Vec<_> = pieces.enumerate().map(|(id, it)| ribbon_row(&cut.pieces[id].name, it)).collect();
            section = section.table("ribbons", json!(rows)).table("strip", ribbon_row("all", &all));
        }
        section
            .check(overlap_check(cut, flat, overlap_area))
            .check(flip_check(cut, &quality))
            .check(stretch_check(cut, flat, &quality))
            .check(mismatch_check(cut, &seams))
    }
}

/// Length and width of a ribbon.
fn ribbon_row(name: &str, it: &super::Ribbon) -> serde_json::Value {
    let [p5, median, p95] = it.width;
    let width = json!({ "p5": p5, "median": median, "p95": p95 });
    json!({ "name": name, "length_mm": it.length, "width_mm": width })
}

/// "piece A near (1.0, 2.0, 3.0)".
fn place(cut: &CutMesh, f: FaceId) -> String {
    let mesh: &TriMesh = &cut.mesh;
    let [a, b, c] = mesh.face_positions(f);
    let p = (a + b + c) / 3.0;
    format!("piece {} near ({:.1}, {:.1}, {:.1})", cut.pieces[cut.piece_of[f]].name, p.x, p.y, p.z)
}

fn overlap_check(cut: &CutMesh, flat: &Flattening, area: f64) -> Check {
    let worst = flat.overlaps.iter().max_by(|a, b| a.area.total_cmp(&b.area));
    let note = worst.map_or_else(String::new, |it| {
        format!(
            "{area:.3} mm² in all, worst in {}; cut it apart there or let [cut] choose the seams",
            place(cut, it.faces[0])
        )
    });
    Check::at_most("flatten.overlaps", flat.overlaps.len() as f64, 0.0, "pairs of faces", note)
}

fn flip_check(cut: &CutMesh, quality: &Quality) -> Check {
    let note = quality.flipped.first().map_or_else(String::new, |&f| {
        format!("first in {}; slivers cause it: coarsen with method = \"remesh\"", place(cut, f))
    });
    Check::at_most("flatten.flipped", quality.flipped.len() as f64, 0.0, "faces", note)
}

/// The promise is for 99.9 % of the area: single slivers may exceed it, and the note says by how much.
fn stretch_check(cut: &CutMesh, flat: &Flattening, quality: &Quality) -> Check {
    let (max, face) = quality.max_principal_stretch;
    let note = if max <= flat.stretch_limit {
        format!("principal stretch of every triangle at most {max:.5}")
    } else {
        format!(
            "principal stretch kept by 99.9 % of the area; {:.4} % exceed the limit, the worst triangle with {max:.4} in {}",
            100.0 * quality.share_over_limit,
            place(cut, face)
        )
    };
    Check::at_most("flatten.stretch", quality.p999_principal_stretch, flat.stretch_limit, "", note)
}

fn mismatch_check(cut: &CutMesh, seams: &[SeamLengths]) -> Check {
    let share = |it: &SeamLengths| it.mismatch() / it.allowance();
    let Some(worst) = seams.iter().max_by(|a, b| share(a).total_cmp(&share(b))) else {
        return Check::at_most("seams.mismatch", 0.0, MISMATCH, "mm", "no seams");
    };
    let [p, q] = [0, 1].map(|side| {
        let h = cut.seams[worst.label as usize - 1].sides[side][0];
        &cut.pieces[cut.piece_of[cut.mesh.face(h)]].name
    });
    let note =
        format!("worst seam {} between {p} and {q}: {:.3} and {:.3} mm", worst.label, worst.sides[0], worst.sides[1]);
    Check::at_most("seams.mismatch", worst.mismatch(), worst.allowance(), "mm", note)
}
