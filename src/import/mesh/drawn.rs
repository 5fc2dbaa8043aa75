//! What an OBJ file holds besides a surface: drawn lines, and the names that its faces carry.
use std::{fs, path::Path};

use super::{ImportError, Malformed, Place, REEXPORT, obj::logical_lines};
use crate::geom::Vec3;

/// Lines and named faces of an OBJ file, in its own units.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Drawn {
    /// `l` elements as points.
    pub lines: Vec<Vec<Vec3>>,
    /// `f` elements.
    pub faces: Vec<NamedFace>,
}

/// A face with what it is called.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedFace {
    /// Its corners.
    pub corners: Vec<Vec3>,
    /// Names of its object, its groups and its material.
    pub names: Vec<String>,
}

/// Reads an OBJ file for its lines and names. Bytes that are not UTF-8 are replaced.
pub fn read_drawn(path: &Path) -> Result<Drawn, ImportError> {
    let bytes = fs::read(path).map_err(|source| ImportError::Unreadable { path: path.to_owned(), source })?;
    drawn(&String::from_utf8_lossy(&bytes)).map_err(|source| ImportError::Malformed { path: path.to_owned(), source })
}

fn drawn(text: &str) -> Result<Drawn, Malformed> {
    let mut out = Drawn::default();
    let mut points: Vec<Vec3> = Vec::new();
    let (mut object, mut groups, mut material) = (Vec::new(), Vec::new(), Vec::new());
    for (line, text) in logical_lines(text) {
        let mut words = text.split_whitespace();
        let keyword = words.next().unwrap_or_default();
        let rest = || words.clone().map(str::to_owned).collect::<Vec<String>>();
        let corners = |points: &[Vec3]| -> Result<Vec<Vec3>, Malformed> {
            words.clone().map(|word| corner(word, points, line)).collect()
        };
        match keyword {
            "v" => {
                let numbers: Vec<f64> = words.clone().take(3).map_while(|it| it.parse().ok()).collect();
                let [x, y, z] = numbers[..] else {
                    return Err(Malformed::line(line, "a vertex needs three numbers"));
                };
                points.push(Vec3::new(x, y, z));
            }
            "l" => out.lines.push(corners(&points)?),
            "f" => {
                let names = [&object, &groups, &material].into_iter().flatten().cloned().collect();
                out.faces.push(NamedFace { corners: corners(&points)?, names });
            }
            "o" => object = vec![rest().join(" ")],
            "g" => groups = rest(),
            "usemtl" => material = vec![rest().join(" ")],
            _ => {}
        }
    }
    Ok(out)
}

/// The point that `7`, `7/1/2` or `-1` names.
fn corner(word: &str, points: &[Vec3], line: usize) -> Result<Vec3, Malformed> {
    let number = word.split('/').next().and_then(|it| it.parse::<i64>().ok());
    let index = number.map(|it| if it < 0 { points.len() as i64 + it } else { it - 1 });
    index.and_then(|it| usize::try_from(it).ok()).and_then(|it| points.get(it)).copied().ok_or_else(|| {
        let problem = format!("`{word}` names none of the {} vertices before it", points.len());
        Malformed::new(Place::Line(line), problem, REEXPORT)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_names_are_read() {
        let text = "o body\nv 0 0 0\nv 1 0 0\nv 1 1 0 # corner\nv 0 1 0\nl 1 2 \\\n -2\ng front left\nusemtl red paint\nf 1/1 2//3 3\ng\nf 1 3 4\n";
        let it = drawn(text).unwrap();
        let at = |x, y| Vec3::new(x, y, 0.0);
        assert_eq!(it.lines, [[at(0., 0.), at(1., 0.), at(1., 1.)]]);
        assert_eq!(it.faces[0].names, ["body", "front", "left", "red paint"]);
        assert_eq!(it.faces[0].corners, [at(0., 0.), at(1., 0.), at(1., 1.)]);
        assert_eq!(it.faces[1].names, ["body", "red paint"]);
    }

    #[test]
    fn what_cannot_be_meant_is_refused_with_its_line() {
        for (text, line) in [("v 0 0 0\nl 1 2\n", 2), ("v 0 0\n", 1), ("v 0 0 0\n\nf 1 0 1\n", 3), ("l x\n", 1)] {
            assert_eq!(drawn(text).unwrap_err().place, Place::Line(line), "{text}");
        }
    }
}
