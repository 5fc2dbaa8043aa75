//! What is said to people about pieces that cannot be cut.
use super::{guard::Obstacle, kinematics::Beyond};
use crate::{
    geom::Vec3,
    model::{CutMesh, PieceId, Ruling, Setup, Strips},
};

fn place(p: Vec3) -> String {
    format!("({:.1}, {:.1}, {:.1})", p.x, p.y, p.z)
}

/// Why the machine cannot reach a ruling.
pub(super) fn beyond(strip: u32, ends: [Vec3; 2], it: &Beyond) -> String {
    let rotary = matches!(it.letter, 'A' | 'B' | 'C');
    let shown = |value: f64| if rotary { format!("{:.1}°", value.to_degrees()) } else { format!("{value:.1} mm") };
    format!(
        "strip {}, the line from {} to {}: it needs {} = {}, and that axis goes from {} to {}; choose another `up`, move \
         the part, or take a larger machine",
        strip + 1,
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
        Obstacle::Nothing => "there is no ruling to follow".into(),
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

/// Whether a cutter is too large for a concave place of a piece. Where rulings bend by θ in all over a width w, on a radius
/// R = w / θ below that of the cutter, it bridges them and leaves (r − R) (1 / cos(θ/2) − 1) in the middle; more than
/// `excess` is too much. Folds are no such place: strips end at them.
pub(super) fn too_tight(cut: &CutMesh, strips: &Strips, piece: PieceId, radius: f64, excess: f64) -> Option<String> {
    let mut concave: Vec<&Ruling> =
        strips.rulings.iter().filter(|it| it.piece == piece && it.bend < 0.0 && it.bend > -strips.fold_angle).collect();
    concave.sort_by_key(|it| it.panels[0].min(it.panels[1]));
    let (left, least, at) = (0..concave.len())
        .map(|first| bridged(strips, &concave[first..], radius))
        .fold((0.0, f64::INFINITY, Vec3::zeros()), |worst, it| if it.0 > worst.0 { it } else { worst });
    (left > excess).then(|| {
        format!(
            "the cutter, {radius:.2} mm in radius, is larger than the smallest concave radius, {least:.2} mm near {} in \
             piece {}, and would leave {left:.2} mm there; take one of less than {:.2} mm in diameter",
            place(at),
            cut.pieces[piece].name,
            2.0 * least,
        )
    })
}

/// What a cutter leaves at most over the first of some rulings and those that follow it in its strip, the radius there, and
/// the place.
fn bridged(strips: &Strips, rulings: &[&Ruling], radius: f64) -> (f64, f64, Vec3) {
    let middle = |it: &Ruling| (strips.place(it.ends[0]) + strips.place(it.ends[1])) / 2.0;
    let least_of = |it: &Ruling| it.radius.iter().copied().fold(f64::INFINITY, f64::min);
    let own = least_of(rulings[0]);
    let (mut bend, mut width) = (-rulings[0].bend, -rulings[0].bend * own);
    let left = |bend: f64, least: f64| (radius - least).max(0.0) * (1.0 / (bend / 2.0).min(1.5).cos() - 1.0);
    let mut worst = (left(bend, own), own, middle(rulings[0]));
    for w in rulings.windows(2) {
        if !w[0].panels.iter().any(|p| w[1].panels.contains(p)) {
            break;
        }
        bend -= w[1].bend;
        width -= w[1].bend * least_of(w[1]);
        let least = width / bend;
        if left(bend, least) > worst.0 {
            worst = (left(bend, least), least, middle(w[1]));
        }
    }
    worst
}
