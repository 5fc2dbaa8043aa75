//! Creases: a table of their fold angles, and the pattern as a FOLD file (version 1.2).
use std::{collections::BTreeMap, fmt::Write as _};

use crate::{
    geom::Vec2,
    model::{CutMesh, Flattening, Fold, Folded, Run},
};

/// The fold angle at every place that was measured, as CSV. Angles in degrees, more than 0 for a mountain; a note says why no
/// fold was demanded at a place.
pub fn angles(folded: &Folded) -> Vec<u8> {
    let mut out = String::from("crease,along_mm,flat_x_mm,flat_y_mm,x_mm,y_mm,z_mm,angle_deg,fold,note\n");
    for (k, crease) in folded.creases.iter().enumerate() {
        for it in &crease.samples {
            let fold = if it.angle > 0.0 { Fold::Mountain } else { Fold::Valley };
            writeln!(
                out,
                "{},{:.4},{:.4},{:.4},{:.4},{:.4},{:.4},{:.3},{},{}",
                k + 1,
                it.along,
                it.flat.x,
                it.flat.y,
                it.place.x,
                it.place.y,
                it.place.z,
                it.angle.to_degrees(),
                fold.name(),
                it.excluded
            )
            .expect("writing to memory cannot fail");
        }
    }
    out.into_bytes()
}

/// Points of a drawing with a number each; points nearer than a nanometre are one.
#[derive(Default)]
struct Points {
    places: Vec<Vec2>,
    index: BTreeMap<[i64; 2], usize>,
}

impl Points {
    fn of(&mut self, p: Vec2) -> usize {
        let key = [p.x, p.y].map(|it| (it * 1e6).round() as i64);
        *self.index.entry(key).or_insert_with(|| {
            self.places.push(p);
            self.places.len() - 1
        })
    }
}

/// An edge with its assignment and fold angle (degrees, valleys positive).
struct Edge {
    ends: [usize; 2],
    assignment: char,
    angle: f64,
}

/// The flat pattern with the mountains and valleys that were found. Curves are polylines; those that belong to one curve are
/// listed under `fabricate:curves`, with the fold angles along it.
pub fn pattern(folded: &Folded, cut: &CutMesh, flat: &Flattening) -> Vec<u8> {
    let mut points = Points::default();
    let mut edges: Vec<Edge> = Vec::new();
    for path in cut.mesh.boundary_loops() {
        for h in path {
            let ends = [cut.mesh.tail(h), cut.mesh.head(h)].map(|v| points.of(flat.uv[v]));
            edges.push(Edge { ends, assignment: 'B', angle: 0.0 });
        }
    }
    let mut curves = Vec::new();
    for crease in &folded.creases {
        let first = edges.len();
        for run in crease.runs() {
            add_run(&run, &mut points, &mut edges);
        }
        let angles = crease.samples.iter().map(|it| format!("[{:.4}, {:.4}]", it.along, -it.angle.to_degrees()));
        curves.push(format!(
            "{{\"edges\": {}, \"closed\": {}, \"along_mm_and_angle\": {}}}",
            list((first..edges.len()).map(|it| it.to_string())),
            crease.closed,
            list(angles)
        ));
    }
    let vertices = list(points.places.iter().map(|p| format!("[{}, {}]", p.x, p.y)));
    let ends = list(edges.iter().map(|it| format!("[{}, {}]", it.ends[0], it.ends[1])));
    let assignments = list(edges.iter().map(|it| format!("\"{}\"", it.assignment)));
    let angles = list(edges.iter().map(|it| format!("{:.4}", it.angle)));
    format!(
        "{{\n\"file_spec\": 1.2,\n\"file_creator\": \"fabricate\",\n\"file_classes\": [\"singleModel\"],\n\
         \"frame_classes\": [\"creasePattern\"],\n\"frame_attributes\": [\"2D\"],\n\"frame_unit\": \"mm\",\n\
         \"vertices_coords\": {vertices},\n\"edges_vertices\": {ends},\n\"edges_assignment\": {assignments},\n\
         \"edges_foldAngle\": {angles},\n\"fabricate:curves\": {}\n}}\n",
        list(curves)
    )
    .into_bytes()
}

fn add_run(run: &Run, points: &mut Points, edges: &mut Vec<Edge>) {
    let assignment = match run.fold {
        Fold::Mountain => 'M',
        Fold::Valley => 'V',
        Fold::Unknown => 'U',
    };
    let again = run.points.first().filter(|_| run.closed);
    let numbers: Vec<usize> = run.points.iter().chain(again).map(|&p| points.of(p)).collect();
    for pair in numbers.windows(2).filter(|it| it[0] != it[1]) {
        edges.push(Edge { ends: [pair[0], pair[1]], assignment, angle: -run.angle.to_degrees() });
    }
}

fn list(items: impl IntoIterator<Item = String>) -> String {
    let items: Vec<String> = items.into_iter().collect();
    format!("[{}]", items.join(", "))
}
