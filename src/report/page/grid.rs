//! Coordinates as 16-bit numbers: a 200 mm model is kept to 3 micrometres, which no screen shows.
use serde_json::{Value, json};

/// Cells of equal sides over a box.
pub(super) struct Grid<const D: usize> {
    least: [f64; D],
    step: f64,
}

impl<const D: usize> Grid<D> {
    /// The grid over some points; a single cell where there are none.
    pub(super) fn of(points: impl Iterator<Item = [f64; D]>) -> Self {
        let (mut least, mut most) = ([f64::INFINITY; D], [f64::NEG_INFINITY; D]);
        for point in points {
            for k in 0..D {
                least[k] = least[k].min(point[k]);
                most[k] = most[k].max(point[k]);
            }
        }
        let extent = (0..D).map(|k| most[k] - least[k]).fold(0.0, f64::max);
        if least[0].is_infinite() {
            return Self { least: [0.0; D], step: 1.0 };
        }
        Self { least, step: if extent > 0.0 { extent / f64::from(u16::MAX) } else { 1.0 } }
    }

    /// The nearest corner of a cell.
    pub(super) fn cell(&self, point: [f64; D]) -> [u16; D] {
        std::array::from_fn(|k| ((point[k] - self.least[k]) / self.step).round() as u16)
    }

    /// How the page turns them back: `least + step * number`.
    pub(super) fn json(&self) -> Value {
        json!({ "least": self.least.to_vec(), "step": self.step })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_come_back_within_half_a_cell() {
        let points = [[-3.0, 0.5], [97.0, 20.0], [12.345, 7.0]];
        let grid = Grid::of(points.into_iter());
        assert_eq!(grid.step, 100.0 / 65_535.0);
        for point in points {
            for (k, cell) in grid.cell(point).into_iter().enumerate() {
                assert!((grid.least[k] + grid.step * f64::from(cell) - point[k]).abs() <= 0.5 * grid.step + 1e-12);
            }
        }
        assert_eq!(Grid::<3>::of(std::iter::empty()).cell([0.0; 3]), [0; 3]);
        assert_eq!(Grid::of([[4.0, 4.0]].into_iter()).cell([4.0, 4.0]), [0; 2]);
    }
}
