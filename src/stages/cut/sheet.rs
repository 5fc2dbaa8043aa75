//! Pieces that fit on no sheet.
use crate::geom::{
    Box2, Vec2,
    polygon::{least_excess, turned},
};

/// Edges within this share of the extent from either end of an outline that is too long must part.
const END: f64 = 0.3;
/// Edges taken at either end at most: their pairs weigh against one another, so a few dozen say as much as all.
const EDGES: usize = 24;

/// Pairs of outline edges from the two ends of an outline that fits into `size` in no rotation, along the axis that exceeds
/// it most in the rotation that exceeds it least; none if it fits. Dividing the piece so that they part makes it shorter.
pub(super) fn too_far_apart(outline: &[Vec2], size: [f64; 2]) -> Vec<(usize, usize)> {
    let (excess, angle) = least_excess(outline, size);
    if excess <= 1.0 {
        return Vec::new();
    }
    let turned: Vec<Vec2> = outline.iter().map(|&p| turned(p, angle)).collect();
    let bounds = Box2::of(&turned);
    let axis = usize::from(bounds.size().y / size[1] > bounds.size().x / size[0]);
    let reach = END * bounds.size()[axis];
    let thin = |wanted: &dyn Fn(f64) -> bool| -> Vec<usize> {
        let all: Vec<usize> = (0..turned.len()).filter(|&i| wanted(turned[i][axis])).collect();
        all.iter().step_by(all.len().div_ceil(EDGES).max(1)).copied().collect()
    };
    let low = thin(&|x| x < bounds.min[axis] + reach);
    let high = thin(&|x| x > bounds.max[axis] - reach);
    low.iter().flat_map(|&i| high.iter().map(move |&j| (i.min(j), i.max(j)))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(width: f64, height: f64, angle: f64) -> Vec<Vec2> {
        let turn = nalgebra::Rotation2::new(angle);
        let corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)];
        let sides = (0..4).flat_map(|k| {
            let (a, b) = (corners[k], corners[(k + 1) % 4]);
            (0..10).map(move |i| {
                let t = f64::from(i) / 10.0;
                Vec2::new(a.0 + t * (b.0 - a.0), a.1 + t * (b.1 - a.1))
            })
        });
        sides.map(|p| turn * p).collect()
    }

    #[test]
    fn what_fits_in_some_rotation_has_no_pairs() {
        for angle in [0.0, 0.3, 1.2, 2.9] {
            assert!(too_far_apart(&rectangle(95.0, 45.0, angle), [100.0, 50.0]).is_empty(), "{angle}");
        }
    }

    #[test]
    fn pairs_lie_at_opposite_ends_of_what_is_too_long() {
        let outline = rectangle(150.0, 40.0, 0.0);
        let pairs = too_far_apart(&outline, [100.0, 50.0]);
        assert!(!pairs.is_empty());
        for (i, j) in pairs {
            assert!((outline[i].x - outline[j].x).abs() > 0.4 * 150.0, "{i} {j}");
        }
    }
}
