//! Makes an oriented manifold of what a file holds, or says why that cannot be done safely.
//!
//! Safe is what changes neither the shape nor its topology beyond doubt: dropping what has no area or is there twice,
//! joining boundary edges that coincide exactly, separating fans of faces that meet in a point alone, orienting neighbours
//! alike. Everything else is refused with the places, because only the owner knows which faces are meant.
//!
//! All ids in messages are those of the file, counted from 0; coordinates are those of the file.

mod faces;
mod glue;
mod holes;

use std::fmt;

use super::{FaceId, Id, MeshError, Soup, TriMesh};
use crate::geom::{Box3, Vec3};

/// What to do with several connected components.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Components {
    /// Refuse more than one.
    One,
    /// Keep the one with the largest area.
    Largest,
    /// Keep all.
    All,
}

/// What the repair may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RepairOptions {
    /// Fill holes of at most this many edges; 0 fills none.
    pub fill_holes: usize,
    /// Which components to keep.
    pub components: Components,
}

/// Something that was mended.
#[derive(Debug, Clone, PartialEq)]
pub struct Repair {
    /// What was done; one sentence is made of it by `Display`.
    pub action: Action,
    /// How often.
    pub count: usize,
    /// The first places.
    pub places: Vec<Place>,
}

/// Kinds of repair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Faces with a repeated corner were removed.
    DropRepeatedCorner,
    /// Faces that are there more than once were removed.
    DropDuplicate,
    /// Faces without area were removed, merging or reconnecting their neighbours.
    MendFlat,
    /// Vertices that no face uses were removed.
    DropUnreferenced,
    /// Coinciding vertices along coinciding boundary edges were merged.
    Weld,
    /// Vertices that joined separate fans of faces were duplicated.
    Split,
    /// Edges along which surfaces touch, each with faces on both sides of its own, were duplicated.
    SplitEdge,
    /// Faces were turned to agree with their neighbours.
    Orient,
    /// Closed components that were inside out were turned.
    TurnOutwards,
    /// All but the largest component were removed.
    KeepLargest,
    /// Holes were filled.
    FillHole,
}

/// A vertex or face of the file and where it lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// `vertex`, `face`, `hole` …
    pub what: &'static str,
    /// Its id in the file, from 0; `None` for what has none.
    pub id: Option<usize>,
    /// In the coordinates of the file.
    pub at: Vec3,
}

/// How many places a message names.
const NAMED: usize = 3;

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.id {
            Some(id) => write!(f, "{} {id} at {}", self.what, Point(self.at)),
            None => write!(f, "{} at {}", self.what, Point(self.at)),
        }
    }
}

/// A point with six significant digits.
struct Point(Vec3);

impl fmt::Display for Point {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = |x: f64| {
            let rounded = format!("{x:.5e}").parse().unwrap_or(x);
            format!("{rounded:?}").trim_end_matches(".0").to_owned()
        };
        write!(f, "({}, {}, {})", digits(self.0.x), digits(self.0.y), digits(self.0.z))
    }
}

/// The first places in a list, with dots when there are more.
fn list<T: fmt::Display>(items: &[T], count: usize) -> String {
    let named: Vec<String> = items.iter().map(ToString::to_string).collect();
    named.join(", ") + if count > items.len() { ", …" } else { "" }
}

fn plural(count: usize, one: &str, many: &str) -> String {
    if count == 1 { format!("1 {one}") } else { format!("{count} {many}") }
}

impl fmt::Display for Repair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let n = |one, many| plural(self.count, one, many);
        let done = match self.action {
            Action::DropRepeatedCorner => format!("removed {} with a repeated corner", n("face", "faces")),
            Action::DropDuplicate => format!("removed {} that were there twice", n("face", "faces")),
            Action::MendFlat => format!("removed {} without area", n("face", "faces")),
            Action::DropUnreferenced => format!("removed {} that no face uses", n("vertex", "vertices")),
            Action::Weld => format!("welded {} to others at the same place", n("vertex", "vertices")),
            Action::Split => format!("split {} where faces touch in a point alone", n("vertex", "vertices")),
            Action::SplitEdge => format!("separated the surfaces that touch along {}", n("edge", "edges")),
            Action::Orient => format!("turned {} to face like their neighbours", n("face", "faces")),
            Action::TurnOutwards => format!("turned {} outwards", n("closed component", "closed components")),
            Action::KeepLargest => format!("removed {}, keeping the largest", n("component", "components")),
            Action::FillHole => format!("filled {}", n("hole", "holes")),
        };
        write!(f, "{done} ({})", list(&self.places, self.count))
    }
}

/// An edge that more than two faces share.
#[derive(Debug, Clone, PartialEq)]
pub struct OverusedEdge {
    /// Its vertices.
    pub vertices: [u32; 2],
    /// The faces along it.
    pub faces: Vec<usize>,
    /// Its midpoint.
    pub at: Vec3,
}

impl fmt::Display for OverusedEdge {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let faces: Vec<String> = self.faces.iter().take(6).map(ToString::to_string).collect();
        let [a, b] = self.vertices;
        write!(f, "edge {a}-{b} at {} in faces {}", Point(self.at), list(&faces, self.faces.len()))
    }
}

/// A connected component for a message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComponentSize {
    /// Number of faces.
    pub faces: usize,
    /// Middle of its bounding box.
    pub at: Vec3,
}

impl fmt::Display for ComponentSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} around {}", plural(self.faces, "face", "faces"), Point(self.at))
    }
}

/// Why a mesh is refused. Ids are those of the file, from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshRefusal {
    /// No faces.
    #[error("the mesh has no faces, only {}; export it as a surface mesh, not as points or curves", plural(*vertices, "vertex", "vertices"))]
    Empty {
        /// Vertices in the file.
        vertices: usize,
    },
    /// Every face was without area or there twice.
    #[error("no face is left after removing those without area; is the mesh scaled to nothing along an axis?")]
    NothingLeft,
    /// Too many faces for 32-bit ids.
    #[error("the mesh has {faces} faces, more than {limit}; simplify it first")]
    TooLarge {
        /// Faces in the file.
        faces: usize,
        /// Most that are supported.
        limit: usize,
    },
    /// A face names a vertex that does not exist.
    #[error("face {face} names vertex {index}, but the mesh has {}; export it again", plural(*vertices, "vertex", "vertices"))]
    IndexOutOfRange {
        /// The face.
        face: usize,
        /// The index it holds.
        index: u32,
        /// Vertices in the file.
        vertices: usize,
    },
    /// Coordinates that are NaN or infinite.
    #[error("{} not a finite number: first vertex {vertex}, {position:?}; delete or move these vertices and export again",
        plural(*count, "vertex has a coordinate that is", "vertices have coordinates that are"))]
    NotFinite {
        /// How many vertices.
        count: usize,
        /// The first.
        vertex: usize,
        /// What it holds.
        position: [f64; 3],
    },
    /// Larger or smaller than arithmetic with squares and cubes of lengths allows.
    #[error("the mesh measures {diagonal:e} from corner to corner; scale it to between 1e-30 and 1e30")]
    Extent {
        /// Diagonal of the bounding box.
        diagonal: f64,
    },
    /// Faces without area that cannot be removed safely.
    #[error("{} no area and cannot be removed safely: {}; merge vertices by distance or remesh there",
        plural(*count, "face has", "faces have"), list(places, *count))]
    Degenerate {
        /// How many.
        count: usize,
        /// The first ones.
        places: Vec<Place>,
    },
    /// Edges with more than two faces.
    #[error("{} more than two faces, so the mesh is not a surface there: {}; delete inner or doubled faces, or separate \
        the parts (Blender: Select > All by Trait > Non Manifold)",
        plural(*count, "edge has", "edges have"), list(edges, *count))]
    NonManifold {
        /// How many.
        count: usize,
        /// The first ones.
        edges: Vec<OverusedEdge>,
    },
    /// The surface has one side only.
    #[error("the surface has only one side, like a Möbius strip: its faces cannot all be oriented alike (found at edge \
        {}-{} at {}); cut it open along a line of edges", edge[0], edge[1], Point(*at))]
    NonOrientable {
        /// An edge where the contradiction shows.
        edge: [u32; 2],
        /// Its midpoint.
        at: Vec3,
    },
    /// More components than asked for.
    #[error("the mesh has {count} separate components ({}); set input.component to \"largest\" or \"all\", or join them",
        list(largest, *count))]
    SeveralComponents {
        /// How many.
        count: usize,
        /// The largest by area.
        largest: Vec<ComponentSize>,
    },
    /// What was made is still no mesh; a defect of the repair. Ids are those after the repair.
    #[error("the repair failed: {0}; please report this with the file")]
    Internal(#[from] MeshError),
}

/// Counts and measures of a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshFacts {
    /// Number of vertices.
    pub vertices: usize,
    /// Number of faces.
    pub faces: usize,
    /// Number of connected components.
    pub components: usize,
    /// Number of boundary loops.
    pub boundary_loops: usize,
    /// Sum of the genera of the components.
    pub genus: usize,
    /// Diagonal of the bounding box, in the unit of the positions.
    pub diagonal: f64,
}

impl MeshFacts {
    /// Measures `mesh`.
    pub fn of(mesh: &TriMesh) -> Self {
        Self {
            vertices: mesh.vertex_count(),
            faces: mesh.face_count(),
            components: mesh.components().1,
            boundary_loops: mesh.boundary_loops().len(),
            genus: mesh.genus(),
            diagonal: mesh.bounds().diagonal(),
        }
    }
}

/// A soup on its way to a mesh. Vertex ids stay those of the file.
struct Work<'a> {
    positions: &'a [Vec3],
    faces: Vec<[u32; 3]>,
    /// Id in the file of every face.
    ids: Vec<usize>,
    repairs: Vec<Repair>,
}

impl Work<'_> {
    fn corners(&self, face: usize) -> [Vec3; 3] {
        self.faces[face].map(|v| self.positions[v as usize])
    }

    fn face_place(&self, face: usize) -> Place {
        let [a, b, c] = self.corners(face);
        Place { what: "face", id: Some(self.ids[face]), at: (a + b + c) / 3.0 }
    }

    fn vertex_place(&self, vertex: usize) -> Place {
        Place { what: "vertex", id: Some(vertex), at: self.positions[vertex] }
    }

    /// Records a repair, unless there was nothing to do.
    fn report(&mut self, action: Action, count: usize, places: Vec<Place>) {
        if count > 0 {
            self.repairs.push(Repair { action, count, places });
        }
    }

    /// Removes the faces for which `keep` says no and reports them.
    fn retain(&mut self, action: Action, keep: &[bool]) {
        let dropped: Vec<usize> = (0..keep.len()).filter(|&f| !keep[f]).collect();
        let places = dropped.iter().take(NAMED).map(|&f| self.face_place(f)).collect();
        self.report(action, dropped.len(), places);
        self.drop_faces(keep);
    }

    fn drop_faces(&mut self, keep: &[bool]) {
        let mut it = keep.iter();
        self.faces.retain(|_| *it.next().expect("one flag per face"));
        let mut it = keep.iter();
        self.ids.retain(|_| *it.next().expect("one flag per face"));
    }
}

/// Repairs what is safe to repair, in the order of [`Action`], and reports it; refuses the rest.
///
/// Vertices and faces that stay keep their order. Positions are never changed.
pub fn repair(soup: &Soup, options: &RepairOptions) -> Result<(TriMesh, Vec<Repair>), MeshRefusal> {
    check(soup)?;
    let mut work = Work {
        positions: &soup.positions,
        faces: soup.faces.clone(),
        ids: (0..soup.faces.len()).collect(),
        repairs: Vec::new(),
    };
    faces::drop_repeated_corners(&mut work);
    faces::drop_duplicates(&mut work);
    check_coordinates(&work)?;
    faces::mend_flat(&mut work)?;
    faces::drop_doubled_components(&mut work);
    if work.faces.is_empty() {
        return Err(MeshRefusal::NothingLeft);
    }
    report_unreferenced(&mut work);
    let glued = glue::glue(&mut work)?;
    let mut repairs = work.repairs;
    let mesh = TriMesh::new(glued.positions, &glued.faces)?;
    let mesh = select(mesh, options.components, &mut repairs)?;
    let mesh = holes::fill(mesh, options.fill_holes, &mut repairs)?;
    Ok((mesh, repairs))
}

/// Number of faces and indices.
fn check(soup: &Soup) -> Result<(), MeshRefusal> {
    let vertices = soup.positions.len();
    if soup.faces.is_empty() {
        return Err(MeshRefusal::Empty { vertices });
    }
    if soup.faces.len() > TriMesh::LIMIT {
        return Err(MeshRefusal::TooLarge { faces: soup.faces.len(), limit: TriMesh::LIMIT });
    }
    for (face, corners) in soup.faces.iter().enumerate() {
        if let Some(&index) = corners.iter().find(|&&it| it as usize >= vertices) {
            return Err(MeshRefusal::IndexOutOfRange { face, index, vertices });
        }
    }
    Ok(())
}

/// Coordinates of the vertices in use.
fn check_coordinates(work: &Work<'_>) -> Result<(), MeshRefusal> {
    let mut bad: Vec<u32> = work.faces.iter().flatten().copied().collect();
    bad.retain(|&v| !work.positions[v as usize].iter().all(|it| it.is_finite()));
    bad.sort_unstable();
    bad.dedup();
    if let Some(&first) = bad.first() {
        let position = work.positions[first as usize].into();
        return Err(MeshRefusal::NotFinite { count: bad.len(), vertex: first as usize, position });
    }
    let diagonal = Box3::of(work.faces.iter().flatten().map(|&v| &work.positions[v as usize])).diagonal();
    if work.faces.is_empty() || (1e-30..=1e30).contains(&diagonal) {
        Ok(())
    } else {
        Err(MeshRefusal::Extent { diagonal })
    }
}

fn report_unreferenced(work: &mut Work<'_>) {
    let mut used = vec![false; work.positions.len()];
    work.faces.iter().flatten().for_each(|&v| used[v as usize] = true);
    let unused: Vec<usize> = (0..used.len()).filter(|&v| !used[v]).collect();
    let places = unused.iter().take(NAMED).map(|&v| work.vertex_place(v)).collect();
    work.report(Action::DropUnreferenced, unused.len(), places);
}

/// Applies the choice of components.
fn select(mesh: TriMesh, choice: Components, repairs: &mut Vec<Repair>) -> Result<TriMesh, MeshRefusal> {
    let (component, count) = mesh.components();
    if count == 1 || choice == Components::All {
        return Ok(mesh);
    }
    let mut members: Vec<Vec<FaceId>> = vec![Vec::new(); count];
    for (f, &c) in component.enumerate() {
        members[c as usize].push(f);
    }
    let area = |faces: &[FaceId]| faces.iter().map(|&f| mesh.area(f)).sum::<f64>();
    let mut order: Vec<(f64, usize)> = members.iter().enumerate().map(|(k, faces)| (area(faces), k)).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let size = |&(_, k): &(f64, usize)| {
        let bounds = Box3::of(members[k].iter().flat_map(|&f| mesh.face_vertices(f)).map(|v| &mesh.positions()[v]));
        ComponentSize { faces: members[k].len(), at: (bounds.min + bounds.max) / 2.0 }
    };
    if choice == Components::One {
        return Err(MeshRefusal::SeveralComponents { count, largest: order.iter().take(NAMED).map(size).collect() });
    }
    let dropped = order[1..].iter().take(NAMED);
    let places = dropped.map(|it| Place { what: "component", id: None, at: size(it).at }).collect();
    repairs.push(Repair { action: Action::KeepLargest, count: count - 1, places });
    let kept = &members[order[0].1];
    let mut new_id = vec![u32::MAX; mesh.vertex_count()];
    kept.iter().flat_map(|&f| mesh.face_vertices(f)).for_each(|v| new_id[v.index()] = 0);
    let mut positions = Vec::new();
    for v in mesh.vertices().filter(|v| new_id[v.index()] == 0).collect::<Vec<_>>() {
        new_id[v.index()] = positions.len() as u32;
        positions.push(mesh.position(v));
    }
    let faces: Vec<[u32; 3]> = kept.iter().map(|&f| mesh.face_vertices(f).map(|v| new_id[v.index()])).collect();
    Ok(TriMesh::new(positions, &faces)?)
}

#[cfg(test)]
mod tests;
