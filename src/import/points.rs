//! Tables of points: two numbers on each line.
use crate::geom::Vec2;

/// A line of a table that holds no point.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line} is not two numbers: `{text}`")]
pub struct NoPoint {
    /// From 1.
    pub line: usize,
    /// As written.
    pub text: String,
}

/// Reads points, one on each line, their numbers apart by commas, semicolons or blanks. Empty lines and what follows a `#` are
/// skipped, and so is a first line without any number.
pub fn read_points(text: &str) -> Result<Vec<Vec2>, NoPoint> {
    let mut points = Vec::new();
    let lines = text.lines().map(|it| it.split('#').next().unwrap_or_default().trim()).enumerate();
    for (k, line) in lines.filter(|it| !it.1.is_empty()) {
        let words: Vec<&str> = line.split([',', ';', ' ', '\t']).filter(|it| !it.is_empty()).collect();
        let numbers: Vec<f64> = words.iter().filter_map(|it| it.parse().ok()).collect();
        match numbers[..] {
            [x, y] if words.len() == 2 => points.push(Vec2::new(x, y)),
            [] if points.is_empty() => {}
            _ => return Err(NoPoint { line: k + 1, text: line.to_owned() }),
        }
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_with_any_separator_and_a_heading_are_read() {
        let points = read_points("radius; height\n# a bottle\n40, 0\n41.5\t10 # belly\n\n30;25\n").unwrap();
        assert_eq!(points, [Vec2::new(40.0, 0.0), Vec2::new(41.5, 10.0), Vec2::new(30.0, 25.0)]);
        assert_eq!(read_points("1 2\n3\n"), Err(NoPoint { line: 2, text: "3".into() }));
        assert_eq!(read_points("1 2 3"), Err(NoPoint { line: 1, text: "1 2 3".into() }));
    }
}
