//! What is said to people about pieces that cannot be cut.
use std::collections::BTreeSet;

use super::{guard::Obstacle, kinematics::Beyond, lines::Band};
use crate::{
    geom::{Vec3, signed_area},
    model::{CutMesh, PieceId, Ruling, Setup, Strips},
};

fn place(p: Vec3) -> String {
    format!("({:.1}, {:.1}, {:.1})", p.x, p.y, p.z)
}

/// Why the machine cannot reach a ruling of a strip.
pub(super) fn beyond(band: &Band<'_>, t: f64, it: &Beyond) -> String {
    let line = band.line(t.clamp(0.0, band.end()));
    let ends = line.map_or([Vec3::zeros(); 2], |it| [it.p, it.q]);
    let rotary = matches!(it.letter, 'A' | 'B' | 'C');
    let shown = |value: f64| if rotary { format!("{:.1}°", value.to_degrees()) } else { format!("{value:.1} mm") };
    format!(
        "strip {}, the line from {} to {}: it needs {} = {}, and that axis goes from {} to {}; choose another `up`, move \
         the part, or take a larger machine",
        band.strip + 1,
        place(ends[0]),
        place(ends[1]),
        it.letter,
        shown(it.value),
        shown(it.range[0]),
        shown(it.range[1]),
    )
}

/// What is in the way.
pub(super) fn obstacle(it: &Obstacle, setup: &Setup) -> String {
    match it {
        Obstacle::Nothing => "there are no rulings that the cutter could be led along".into(),
        Obstacle::Cutter(p) => format!("the body at {} is in the way of the cutter; a thinner one may fit", place(*p)),
        Obstacle::Holder(p) => {
            format!("the body at {} is in the way of the shank or holder; let the cutter stick out farther", place(*p))
        }
        Obstacle::Fixture(p) => format!(
            "the fixture is in the way at {} (of the body); choose another `up`, or a smaller `fixture`",
            place(setup.back(*p))
        ),
    }
}

/// Where a cutter is too large for concave places of a piece.
pub(super) struct Tight {
    /// Share of the area of the piece, by the panels there.
    pub(super) share: f64,
    /// For people: the smallest radius, where, what would be left.
    pub(super) reason: String,
}

/// Whether a cutter is too large for a concave place of a piece. Where rulings bend by θ in all over a width w, on a radius
/// R = w / θ below that of the cutter, it bridges them and leaves (r − R) (1 / cos(θ/2) − 1) in the middle; more than
/// `excess` is too much. Folds are no such place: strips end at them.
pub(super) fn too_tight(cut: &CutMesh, strips: &Strips, piece: PieceId, radius: f64, excess: f64) -> Option<Tight> {
    /// Concave radii below this share of the cutter's are creases.
    const CREASE: f64 = 0.05;
    let mut concave: Vec<&Ruling> =
        strips.rulings.iter().filter(|it| it.piece == piece && it.bend < 0.0 && it.bend > -strips.fold_angle).collect();
    concave.sort_by_key(|it| it.panels[0].min(it.panels[1]));
    let mut panels = BTreeSet::new();
    let mut worst = Bridged::default();
    for first in 0..concave.len() {
        let it = bridged(strips, &concave[first..], radius);
        if it.left > excess {
            panels.extend(concave[first].panels);
        }
        if it.left > worst.left {
            worst = it;
        }
    }
    let area = |p: usize| signed_area(&strips.flat_outline(&strips.panels[p]));
    let of_piece = (0..strips.panels.len()).filter(|&p| strips.panels[p].piece == piece);
    let total: f64 = of_piece.map(area).sum();
    let share = panels.iter().map(|&p| area(p as usize)).sum::<f64>() / total.max(f64::MIN_POSITIVE);
    let (at, name, left) = (place(worst.at), &cut.pieces[piece].name, worst.left);
    let reason = if worst.radius < CREASE * radius {
        format!(
            "the cutter, {radius:.2} mm in radius, cannot follow the concave crease near {at} in piece {name}, which turns \
             by {:.1}°, and would leave {left:.2} mm there",
            worst.bend.to_degrees()
        )
    } else {
        format!(
            "the cutter, {radius:.2} mm in radius, is larger than the smallest concave radius, {:.2} mm near {at} in piece \
             {name}, and would leave {left:.2} mm there; take one of less than {:.2} mm in diameter",
            worst.radius,
            2.0 * worst.radius,
        )
    };
    (worst.left > excess).then_some(Tight { share, reason })
}

/// What a cutter leaves over some rulings.
#[derive(Debug, Clone, Copy, Default)]
struct Bridged {
    /// mm.
    left: f64,
    /// Their radius, mm.
    radius: f64,
    /// By how much they bend, radians.
    bend: f64,
    at: Vec3,
}

/// What a cutter leaves at most over the first of some rulings and those that follow it in its strip.
fn bridged(strips: &Strips, rulings: &[&Ruling], radius: f64) -> Bridged {
    let least_of = |it: &Ruling| it.radius.iter().copied().fold(f64::INFINITY, f64::min);
    let left = |bend: f64, least: f64| (radius - least).max(0.0) * (1.0 / (bend / 2.0).min(1.5).cos() - 1.0);
    let (mut bend, mut width) = (0.0, 0.0);
    let mut worst = Bridged::default();
    for (k, it) in rulings.iter().enumerate() {
        if k > 0 && !rulings[k - 1].panels.iter().any(|p| it.panels.contains(p)) {
            break;
        }
        bend -= it.bend;
        width -= it.bend * least_of(it);
        let least = width / bend;
        if left(bend, least) > worst.left {
            let at = (strips.place(it.ends[0]) + strips.place(it.ends[1])) / 2.0;
            worst = Bridged { left: left(bend, least), radius: least, bend, at };
        }
    }
    worst
}
