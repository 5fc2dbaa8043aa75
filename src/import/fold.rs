//! Lines of a crease pattern in the FOLD format, version 1.2 (Demaine, Ku and Lang), through serde_json.
use serde::Deserialize;

use super::{
    creases::Assignment,
    drawing::{Drawing, DrawingError, DrawnLine},
};
use crate::geom::Vec2;

/// The keys of the first frame that are read; others are passed over, as the format asks.
#[derive(Deserialize)]
struct Frame {
    #[serde(default)]
    frame_unit: Option<String>,
    #[serde(default)]
    frame_classes: Vec<String>,
    vertices_coords: Vec<Vec<f64>>,
    edges_vertices: Vec<[usize; 2]>,
    #[serde(default)]
    edges_assignment: Vec<String>,
}

/// Reads the creases of the first frame: a line per edge on a layer named after its assignment, "unassigned" where it has
/// none. A frame without a unit of length counts as millimetres.
pub fn read_fold(bytes: &[u8]) -> Result<Drawing, DrawingError> {
    let refuse = |message: String| DrawingError::Fold(message);
    let frame: Frame = serde_json::from_slice(bytes).map_err(|error| refuse(error.to_string()))?;
    if frame.frame_classes.iter().any(|it| it == "foldedForm") {
        return Err(refuse("its first frame is a folded form; expected a crease pattern".into()));
    }
    let scale = match frame.frame_unit.as_deref() {
        None | Some("unit") => None,
        Some("mm") => Some(1.0),
        Some("cm") => Some(10.0),
        Some("m") => Some(1000.0),
        Some("in") => Some(25.4),
        Some("pt") => Some(25.4 / 72.0),
        Some("um") => Some(1e-3),
        Some("nm") => Some(1e-6),
        Some(other) => {
            return Err(refuse(format!("frame_unit `{other}` is not one of unit, in, pt, m, cm, mm, um, nm")));
        }
    };
    let corner = |edge: usize, vertex: usize| match frame.vertices_coords.get(vertex).map(Vec::as_slice) {
        Some([x, y]) => Ok(Vec2::new(*x, *y) * scale.unwrap_or(1.0)),
        Some([x, y, z]) if *z == 0.0 => Ok(Vec2::new(*x, *y) * scale.unwrap_or(1.0)),
        Some(it) => Err(refuse(format!(
            "vertex {vertex} lies at {it:?}; a crease pattern is flat: two coordinates, or a third that is 0"
        ))),
        None => {
            let count = frame.vertices_coords.len();
            Err(refuse(format!("edge {edge} ends at vertex {vertex}, but there are only {count}")))
        }
    };
    if !frame.edges_assignment.is_empty() && frame.edges_assignment.len() != frame.edges_vertices.len() {
        let (given, edges) = (frame.edges_assignment.len(), frame.edges_vertices.len());
        return Err(refuse(format!("{given} assignments for {edges} edges")));
    }
    let mut lines = Vec::new();
    for (edge, &[a, b]) in frame.edges_vertices.iter().enumerate() {
        let letter = frame.edges_assignment.get(edge).map_or("U", String::as_str);
        let assignment = Assignment::from_letter(letter).ok_or_else(|| {
            refuse(format!("edge {edge} is assigned `{letter}`, which is not one of B, M, V, F, U, C, J"))
        })?;
        lines.push(DrawnLine {
            layer: assignment.name().into(),
            color: Some(assignment.color()),
            points: vec![corner(edge, a)?, corner(edge, b)?],
            closed: false,
        });
    }
    Ok(Drawing { size: None, measured: scale.is_some(), lines, ignored: Vec::new() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn assignments_and_units_are_read() {
        let text = br#"{"file_spec": 1.2, "frame_unit": "cm", "ours:curves": [], "vertices_coords": [[0, 0], [2, 0], [2, 1, 0]],
            "edges_vertices": [[0, 1], [1, 2], [2, 0]], "edges_assignment": ["B", "V", "U"]}"#;
        let drawing = read_fold(text).unwrap();
        assert!(drawing.measured);
        let layers: Vec<&str> = drawing.lines.iter().map(|it| it.layer.as_str()).collect();
        assert_eq!(layers, ["border", "valley", "unassigned"]);
        assert_eq!(drawing.lines[1].points, [Vec2::new(20.0, 0.0), Vec2::new(20.0, 10.0)]);
    }

    #[test]
    fn broken_files_are_refused_with_the_place() {
        let refusal = |text: &str| read_fold(text.as_bytes()).unwrap_err().to_string();
        let edges =
            |rest: &str| format!(r#"{{"vertices_coords": [[0, 0], [1, 1]], "edges_vertices": [[0, 1]]{rest}}}"#);
        assert!(!read_fold(edges("").as_bytes()).unwrap().measured);
        assert!(refusal("{").contains("line 1"));
        assert!(refusal(&edges(r#", "edges_assignment": ["X"]"#)).contains("edge 0 is assigned `X`"));
        assert!(refusal(&edges(r#", "edges_assignment": ["B", "B"]"#)).contains("2 assignments for 1 edges"));
        assert!(refusal(&edges(r#", "frame_unit": "ell""#)).contains("`ell`"));
        assert!(refusal(&edges(r#", "frame_classes": ["foldedForm"]"#)).contains("folded form"));
        assert!(refusal(r#"{"vertices_coords": [[0, 0]], "edges_vertices": [[0, 7]]}"#).contains("vertex 7"));
        assert!(
            refusal(r#"{"vertices_coords": [[0, 0, 5], [0, 1]], "edges_vertices": [[0, 1]]}"#).contains("vertex 0")
        );
    }
}
