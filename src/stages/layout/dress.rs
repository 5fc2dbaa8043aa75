//! What is printed on parts: folds, ticks, numbers of seams, names, angles of bends.
use std::collections::BTreeMap;

use super::{
    Options,
    bends::BendLine,
    join::{Body, Join},
    lettering::Placer,
    seams::{self, Measured, Ticks},
};
use crate::{
    mesh::Id,
    model::{CutMesh, Flattening, Mark, Part, Parts, PieceId},
    numeric::{Cancelled, Monitor},
};

/// Scales of the lettering and of the ticks of a part to try in turn until everything finds room on it, and how often at each:
/// what found none chooses first the next time. On a sliver that has no room for both, ticks are left out: its corners show how
/// it lies, and no tick says where it belongs.
const SCALES: [(f64, f64, usize); 5] = [(1.0, 1.0, 2), (0.75, 0.75, 2), (0.6, 0.6, 2), (0.45, 0.45, 4), (0.45, 0.0, 4)];

/// Squares that leaders may look at on all parts together, so that hundreds of short seams come to an end, and the share of a
/// part's own that one try may use.
const SQUARES: (usize, usize) = (10_000_000, 4);

/// What the parts are made of.
pub(super) struct Job<'a> {
    pub(super) cut: &'a CutMesh,
    pub(super) flat: &'a Flattening,
    pub(super) bodies: &'a BTreeMap<PieceId, Body>,
    pub(super) seams: &'a [Measured],
    pub(super) bends: &'a [BendLine],
    pub(super) options: &'a Options,
}

/// A side of a seam: index of the seam, and 0 or 1.
type SideOf = (usize, usize);

/// Numbers of seams that name the part on the other side, too.
type Calls = BTreeMap<SideOf, String>;

/// The printed side of a part.
struct Face {
    /// Sides of seams that it has, the shortest seam first: it has the least choice of places.
    sides: Vec<SideOf>,
    lettering: Lettering,
}

/// In which order the lettering of a part chooses its places.
#[derive(PartialEq)]
struct Order {
    sides: Vec<SideOf>,
    /// Whether the name comes before the numbers.
    name_first: bool,
}

/// Lettering of a part at one scale.
#[derive(Default)]
struct Lettering {
    /// Folds, ticks and letters.
    marks: Vec<Mark>,
    /// Sides without their number.
    bare: Vec<SideOf>,
    /// Sides that also name the part that comes there.
    naming: Vec<SideOf>,
    /// Whether the name of the part found no room.
    nameless: bool,
    /// Angles of bends that found no room.
    unsaid: Vec<String>,
}

/// Prints on all bodies, which become parts, and says what stands on another part or nowhere.
pub(super) fn dress(job: &Job<'_>, monitor: &Monitor, parts: &mut Parts) -> Result<(), Cancelled> {
    let mut faces: BTreeMap<PieceId, Face> = BTreeMap::new();
    for (&piece, body) in job.bodies {
        monitor.check()?;
        monitor.progress(piece.index() as f64 / job.cut.pieces.len() as f64, &body.name);
        faces.insert(piece, job.face(piece, body));
    }
    let calls = job.names_of_partners(&faces);
    for (&piece, body) in job.bodies {
        monitor.check()?;
        let called = |&(seam, side): &SideOf| job.seams[seam].sides[side].piece == piece;
        if let Some(face) = faces.get_mut(&piece).filter(|_| calls.keys().any(called)) {
            let found = job.letter(piece, body, face, &calls);
            if job.missing(&found) <= job.missing(&face.lettering) {
                face.lettering = found;
            }
        }
    }
    job.say_what_is_missing(&faces, &calls, parts);
    for (piece, body) in job.bodies {
        let Some(face) = faces.remove(piece) else { continue };
        let marks = face.lettering.marks;
        parts.parts.push(Part { name: body.name.clone(), contours: body.contours.clone(), marks });
    }
    Ok(())
}

impl Job<'_> {
    fn face(&self, piece: PieceId, body: &Body) -> Face {
        let sides = (0..self.seams.len()).flat_map(|i| [(i, 0), (i, 1)]);
        let mut sides: Vec<SideOf> = sides.filter(|&(i, side)| self.seams[i].sides[side].piece == piece).collect();
        sides.sort_by(|a, b| self.seams[a.0].length().total_cmp(&self.seams[b.0].length()));
        let mut face = Face { sides, lettering: Lettering::default() };
        face.lettering = self.letter(piece, body, &face, &BTreeMap::new());
        face
    }

    /// Large letters take the room of others: where one finds none even when it chooses first, all of the part are smaller.
    fn letter(&self, piece: PieceId, body: &Body, face: &Face, calls: &Calls) -> Lettering {
        let mut best: Option<Lettering> = None;
        let share = SQUARES.0 / self.bodies.len();
        let mut left = share;
        for (scale, of_ticks, rounds) in SCALES {
            let style = Ticks {
                longest: of_ticks * self.options.tick,
                spacing: self.options.tick_spacing,
                outward: matches!(self.options.join, Join::Allowance(_)),
            };
            let mut lines = body.marks.clone();
            lines.extend(seams::ticks(self.cut, self.flat, piece, &body.contours, &lines, self.seams, style));
            // What speaks for a part without letters of its own has the first choice.
            let (mut sides, others): (Vec<SideOf>, Vec<SideOf>) =
                face.sides.iter().partition(|it| calls.contains_key(it));
            sides.extend(others);
            let mut order = Order { sides, name_first: false };
            for _ in 0..rounds {
                let mut placer = Placer::new(&body.contours, &lines, left.min(share / SQUARES.1));
                left -= placer.search.borrow().left;
                let found = self.inscribe((piece, body), &mut placer, &lines, &order, calls, scale);
                left += placer.search.borrow().left;
                let lost = self.missing(&found);
                let next = self.urgent_first(&order, &found);
                if best.as_ref().is_none_or(|it| lost < self.missing(it)) {
                    best = Some(found);
                }
                if lost == 0 {
                    return best.unwrap_or_default();
                }
                if next == order {
                    break;
                }
                order = next;
            }
        }
        best.unwrap_or_default()
    }

    /// The order in which what found no room comes before what did.
    fn urgent_first(&self, order: &Order, found: &Lettering) -> Order {
        let urgent = |it: &&SideOf| found.bare.contains(it) && self.promised(it.0);
        let (mut sides, others): (Vec<SideOf>, Vec<SideOf>) = order.sides.iter().partition(urgent);
        sides.extend(others);
        Order { sides, name_first: order.name_first || found.nameless }
    }

    /// The lettering at `scale` of its preferred heights, beside `lines` that are there already.
    fn inscribe(
        &self,
        (piece, body): (PieceId, &Body),
        placer: &mut Placer<'_>,
        lines: &[Mark],
        order: &Order,
        calls: &Calls,
        scale: f64,
    ) -> Lettering {
        let mut out = Lettering { marks: lines.to_vec(), ..Lettering::default() };
        let least = self.options.least_height;
        let [label, title] =
            [self.options.label_height, self.options.name_height].map(|height| (scale * height).max(least));
        let name = |placer: &mut Placer<'_>, out: &mut Lettering| match placer.name(&body.name, title, least) {
            Some(strokes) => out.marks.extend(strokes),
            None => out.nameless = true,
        };
        if order.name_first {
            name(placer, &mut out);
        }
        for &(i, side) in &order.sides {
            let (seam, number) = (&self.seams[i], self.seams[i].label.to_string());
            let named = calls.get(&(i, side)).map(|name| format!("{number} {name}"));
            let must = named.is_some() || self.promised(i);
            let named = named.and_then(|it| placer.seam_label(seam, side, &it, [label, least], must));
            out.naming.extend(named.is_some().then_some((i, side)));
            match named.or_else(|| placer.seam_label(seam, side, &number, [label, least], must)) {
                Some(strokes) => out.marks.extend(strokes),
                None => out.bare.push((i, side)),
            }
        }
        for bend in self.bends.iter().filter(|it| it.piece == piece) {
            match placer.bend_label(&bend.line, &bend.text, label, least) {
                Some(strokes) => out.marks.extend(strokes),
                None => out.unsaid.push(format!("bend {} of part {}", bend.text, body.name)),
            }
        }
        if !order.name_first {
            name(placer, &mut out);
        }
        out
    }

    /// Whether a seam is long enough to be promised a number and needs one.
    fn promised(&self, seam: usize) -> bool {
        let seam = &self.seams[seam];
        !seam.is_slit() && seam.length() >= self.options.label_from
    }

    /// How much lettering was promised and is missing.
    fn missing(&self, lettering: &Lettering) -> usize {
        let promised = lettering.bare.iter().filter(|it| self.promised(it.0)).count();
        promised + usize::from(lettering.nameless) + lettering.unsaid.len()
    }

    /// Numbers that are to name the part on the other side: where that has no number there, and all around a part without a
    /// name.
    fn names_of_partners(&self, faces: &BTreeMap<PieceId, Face>) -> Calls {
        let mut calls = BTreeMap::new();
        for (piece, face) in faces {
            let far = |&(i, side): &SideOf| (i, 1 - side);
            let elsewhere = |it: &&SideOf| self.seams[it.0].sides[1 - it.1].piece != *piece;
            let bare = face.lettering.bare.iter().filter(|it| self.promised(it.0)).filter(elsewhere);
            let all = face.sides.iter().filter(elsewhere).filter(|_| face.lettering.nameless);
            calls.extend(bare.chain(all).map(|it| (far(it), self.bodies[piece].name.clone())));
        }
        calls
    }

    /// Names what stands on the part on the other side only, and what stands nowhere.
    fn say_what_is_missing(&self, faces: &BTreeMap<PieceId, Face>, calls: &Calls, parts: &mut Parts) {
        let face_of = |(i, side): SideOf| faces.get(&self.seams[i].sides[side].piece);
        let name = |(i, side): SideOf| self.bodies.get(&self.seams[i].sides[side].piece).map_or("", |it| &it.name);
        let numbered = |it: SideOf| face_of(it).is_some_and(|face| !face.lettering.bare.contains(&it));
        for (piece, face) in faces {
            let own = &self.bodies[piece].name;
            for &(i, side) in face.lettering.bare.iter().filter(|it| !self.seams[it.0].is_slit()) {
                let what = format!("seam {} ({:.1} mm) of part {own}", self.seams[i].label, self.seams[i].length());
                match (numbered((i, 1 - side)), self.promised(i)) {
                    (true, _) => parts.on_partner.push(format!("{what}: on part {}", name((i, 1 - side)))),
                    (false, true) => parts.unlabelled.push(what),
                    // Once for both sides.
                    (false, false) if side == 0 => parts.unnumbered.push(what),
                    (false, false) => {}
                }
            }
            parts.unlabelled.extend(face.lettering.unsaid.iter().cloned());
            if face.lettering.nameless {
                let called = |it: &&SideOf| {
                    let far = (it.0, 1 - it.1);
                    calls.contains_key(&far) && face_of(far).is_some_and(|face| face.lettering.naming.contains(&far))
                };
                match face.sides.iter().find(called) {
                    Some(&(i, side)) => {
                        let (seam, far) = (self.seams[i].label, name((i, 1 - side)));
                        parts.on_partner.push(format!("name of part {own}: along seam {seam} on part {far}"));
                    }
                    // Where its neighbour has the number of a seam, that still says where the part belongs.
                    None => match face.sides.iter().find(|it| numbered((it.0, 1 - it.1))) {
                        Some(&(i, side)) => {
                            let (seam, far) = (self.seams[i].label, name((i, 1 - side)));
                            let known =
                                format!("name of part {own}: on no part; it comes along seam {seam} of part {far}");
                            parts.on_partner.push(known);
                        }
                        None => parts.unlabelled.push(format!("name of part {own}")),
                    },
                }
            }
        }
    }
}
