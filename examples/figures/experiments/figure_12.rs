//! A cone of eight faces, taller than wide in one direction so that no direction of the hinge is as good as all others.
use super::{
    FREE, Figure, Report, descend, energy,
    measures::{creases, defects},
    noisy,
};
use fabricate::{
    geom::Vec3,
    mesh::{TriMesh, VertexId},
    stages::develop::energy::ENERGIES,
};

pub(super) const FIGURE: Figure = Figure {
    number: 12,
    claim: "around a single vertex, the least squared angle defect is a flat patch, the least developability energy a hinge",
    run,
};

const STEPS: usize = 300;

fn run(report: &mut Report) {
    let regular = cone();
    let irregular = noisy(&regular, 0.02, 12);
    report.show("start", &regular);

    let (flat, _) = descend(&regular, energy("angle-defect"), FREE, STEPS);
    report.show("angle-defect", &flat);
    report.at_most("angle defect: sharpest crease, degrees", creases(&flat, APEX)[0], 1.0);
    // Less than the figure says: without defect the star need not be flat, nor a hinge.
    let (left, _) = descend(&irregular, energy("angle-defect"), FREE, STEPS);
    report.at_most("angle defect, irregular cone: defect", defects(&left)[0], 1e-6);
    report.at_least("angle defect, irregular cone: third crease, degrees", creases(&left, APEX)[2], 1.0);

    for energy in ENERGIES {
        for (name, start) in [("", &regular), (", irregular cone", &irregular)] {
            let (hinge, _) = descend(start, energy, FREE, STEPS);
            let creases = creases(&hinge, APEX);
            report.show(&format!("{}{}", energy.name, if name.is_empty() { "" } else { "-irregular" }), &hinge);
            report.at_most(&format!("{}{name}: third crease, degrees", energy.name), creases[2], 1e-3);
            // The combinatorial energy may end at the special case of a hinge that is flat; the figure is about covariance.
            if energy.name != "combinatorial" && energy.name != "combinatorial-max" {
                report.at_least(&format!("{}{name}: its two creases, degrees", energy.name), creases[1], 10.0);
            } else {
                report.note(format!("{}{name}: creases of the hinge {:.1}°", energy.name, creases[1]));
            }
        }
    }
}

const APEX: VertexId = VertexId(0);

fn cone() -> TriMesh {
    const FACES: u32 = 8;
    let mut points = vec![Vec3::new(0.0, 0.0, 0.5)];
    points.extend((0..FACES).map(|i| {
        let angle = std::f64::consts::TAU * f64::from(i) / f64::from(FACES);
        Vec3::new(1.15 * angle.cos(), angle.sin(), 0.0)
    }));
    let faces: Vec<[u32; 3]> = (0..FACES).map(|i| [0, 1 + i, 1 + (i + 1) % FACES]).collect();
    TriMesh::new(points, &faces).expect("a cone is a mesh")
}
