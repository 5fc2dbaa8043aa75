//! Flank milling and hot wire on fixtures that are cut, flattened and ruled like the pieces of a job, and what is refused.
use std::{fs, path::Path, process::Command};

use fabricate::{
    emit,
    geom::Vec3,
    mesh::{TriMesh, sweep::Tool},
    model::{CutMesh, Milling, Strips},
    numeric::Monitor,
    pipeline::replay,
    profile::{Length, Profiles},
    stage::{Cx, Stage},
    stages::{
        mill::stage::MillStage,
        mill::{Carrier, Kinematics, Linear, Machine, MillError, Options, Rotary, Wire, mill},
        strips::{self, Spacing, strips},
    },
};

use crate::{fixtures::good, pieces::run};

fn ruled(mesh: TriMesh) -> (CutMesh, Strips) {
    let (_, cut, flat) = run(mesh, 0.005);
    let options = strips::Options { spacing: Spacing::Tolerance(0.05), planarity: 0.003, fold_angle: 0.5 };
    let found = strips(&cut, &flat, &options, &Monitor::silent()).unwrap();
    (cut, found)
}

fn turned(mesh: &TriMesh) -> TriMesh {
    let faces: Vec<[u32; 3]> = mesh.face_indices().into_iter().map(|[a, b, c]| [a, c, b]).collect();
    TriMesh::new(mesh.positions().as_slice().to_vec(), &faces).unwrap()
}

fn rotary(letter: char, carrier: Carrier, point: [f64; 3], degrees: [f64; 2]) -> Rotary {
    let range = degrees.map(f64::to_radians);
    let about = "ABC".find(letter).unwrap();
    Rotary { letter, about, carrier, point: Vec3::from(point), reverse: false, range, speed: 1.0 }
}

fn machine(first: Rotary, second: Rotary) -> Machine {
    let linear = ['X', 'Y', 'Z'].map(|letter| Linear { letter, range: [-1000.0, 1000.0], speed: 100.0 });
    Machine::Mill(Kinematics { linear, rotary: [first, second], pivot: 200.0 })
}

fn tables_ac() -> Machine {
    let trunnion = rotary('A', Carrier::Table, [0.0, 0.0, 40.0], [-110.0, 110.0]);
    machine(trunnion, rotary('C', Carrier::Table, [0.0; 3], [-3600.0, 3600.0]))
}

fn options(machine: Machine) -> Options {
    let tool =
        Tool { radius: 3.0, taper: 0.0, flute: 60.0, shank: 2.9, reach: 75.0, holder: 12.0, holder_length: 40.0 };
    Options {
        pieces: vec![],
        machine,
        tool,
        overhang: 1.0,
        overlap: 0.5,
        lead: 4.0,
        clearance: 10.0,
        stock: 0.0,
        depth: 1.0,
        gouge: 0.02,
        excess: 0.05,
        feed: 10.0,
        spindle: 1000.0,
        up: None,
        // An open patch is held from elsewhere.
        fixture: Vec3::new(0.0, 0.0, 60.0),
        table: Vec3::zeros(),
    }
}

fn milled(mesh: TriMesh, options: &Options) -> Milling {
    let (cut, strips) = ruled(mesh);
    mill(&cut, &strips, options, &Monitor::silent()).unwrap()
}

fn within(name: &str, it: &Milling) {
    assert!(it.gouge.depth <= it.limits[0], "{name}: gouge {:?}", it.gouge);
    assert!(it.excess.depth <= it.limits[1], "{name}: excess {:?}", it.excess);
    assert_eq!(it.collision.depth, 0.0, "{name}: {:?}", it.collision);
    assert!(it.covered > 0.97, "{name}: {}", it.covered);
}

#[test]
fn a_cone_and_a_twisted_patch_are_milled_from_both_sides_by_every_kind_of_machine() {
    let free = [-3600.0, 3600.0];
    let tables_bc = machine(
        rotary('B', Carrier::Table, [0.0, 0.0, -50.0], [-110.0, 110.0]),
        rotary('C', Carrier::Table, [0.0; 3], free),
    );
    let tables_ab = machine(rotary('A', Carrier::Table, [0.0; 3], free), rotary('B', Carrier::Table, [0.0; 3], free));
    let head =
        machine(rotary('B', Carrier::Head, [0.0; 3], [-110.0, 110.0]), rotary('C', Carrier::Table, [0.0; 3], free));
    for (fixture, machine) in
        [("cone-patch.obj", tables_ac()), ("twisted-patch.obj", head), ("twisted-patch.obj", tables_ab)]
    {
        let outside = milled(good(fixture), &options(machine));
        within(fixture, &outside);
        // One way along, and a few short ones where too much was left at its ends.
        assert!(outside.segments < 10, "{fixture}: {}", outside.segments);
    }
    within("cone, inside", &milled(turned(&good("cone-patch.obj")), &options(tables_bc)));
}

#[test]
fn a_conical_cutter_keeps_out_of_the_surface() {
    let base = options(tables_ac());
    let tool = Tool { taper: 0.1, radius: 2.0, shank: 7.0, holder: 12.0, ..base.tool };
    within("conical", &milled(good("cone-patch.obj"), &Options { tool, ..base }));
}

#[test]
fn long_rulings_are_cut_in_levels_and_stock_in_depths() {
    // 50 mm rulings with edges of 30 mm take two levels, 1.8 mm of stock take two depths of at most 1 mm.
    let base = options(tables_ac());
    let tool = Tool { flute: 30.0, ..base.tool };
    let passes = milled(good("cone-patch.obj"), &Options { tool, stock: 1.8, ..base });
    within("passes", &passes);
    assert!((4..20).contains(&passes.segments) && passes.segments.is_multiple_of(2), "{}", passes.segments);
}

#[test]
fn what_a_holder_cannot_get_past_stays_as_it_is_and_is_told_of() {
    let base = options(tables_ac());
    let tool = Tool { flute: 12.0, reach: 16.0, ..base.tool };
    let stubby = milled(good("cone-patch.obj"), &Options { tool, ..base });
    assert_eq!(stubby.collision.depth, 0.0);
    assert!(stubby.gouge.depth <= stubby.limits[0], "{:?}", stubby.gouge);
    // From both ends of the rulings it comes to what lies within its reach of them.
    assert!((0.3..0.8).contains(&stubby.covered), "{}", stubby.covered);
    let told = stubby.left.iter().any(|it| it.reason.contains("in the way of the shank or holder"));
    assert!(told, "{:?}", stubby.left);
}

#[test]
fn a_surface_that_bows_along_its_rulings_is_cut_in_as_many_levels_as_it_takes() {
    // The cone stands out or in by 0.5 mm in the middle of its rulings: a straight cutter would leave as much at their ends, or
    // there.
    let cone = good("cone-patch.obj");
    let normals: Vec<Vec3> = {
        let mut sums = vec![Vec3::zeros(); cone.vertex_count()];
        for f in cone.faces() {
            cone.face_vertices(f).iter().for_each(|v| sums[v.0 as usize] += cone.area_vector(f));
        }
        sums
    };
    let bounds = cone.bounds();
    let share = |p: &Vec3| (p - bounds.min).component_div(&bounds.size());
    for sign in [1.0, -1.0] {
        let bowed = cone.positions().iter().zip(&normals).map(|(p, n)| {
            let s = share(p).y;
            p + n.normalize() * (sign * 2.0 * s * (1.0 - s))
        });
        let mesh = TriMesh::new(bowed.collect(), &cone.face_indices()).unwrap();
        let found = milled(mesh, &Options { excess: 0.1, ..options(tables_ac()) });
        within("bowed", &found);
        assert!(found.segments > 9, "{sign}: {}", found.segments);
    }
}

#[test]
fn a_hot_wire_cuts_a_patch() {
    let axis = |letter| Linear { letter, range: [0.0, 1000.0], speed: 20.0 };
    let wire = Machine::Wire(Wire { span: 400.0, axes: ['X', 'Y', 'U', 'V'].map(axis) });
    let base = options(wire);
    let options = Options {
        tool: Tool::wire(0.4, 800.0),
        table: Vec3::new(400.0, 200.0, 0.0),
        fixture: Vec3::new(0.0, 0.0, 50.0),
        ..base
    };
    let it = milled(good("cone-patch.obj"), &options);
    within("wire", &it);
    assert_eq!(it.axes, ['X', 'Y', 'U', 'V']);
    assert!(it.moves.iter().all(|it| it.joints.len() == 4));
    // The rulings are not parallel, so a right carriage that cannot climb leaves no room for the left one.
    let low = Linear { letter: 'V', range: [0.0, 10.0], speed: 20.0 };
    let tight = Machine::Wire(Wire { span: 400.0, axes: [axis('X'), axis('Y'), axis('U'), low] });
    let reason = refusal(good("cone-patch.obj"), &Options { machine: tight, pieces: vec!["A".into()], ..options });
    assert!(reason.contains("it needs Y = -") && reason.contains("goes from 0.0 mm to 1000.0 mm"), "{reason}");
}

fn refusal(mesh: TriMesh, options: &Options) -> String {
    let (cut, strips) = ruled(mesh);
    mill(&cut, &strips, options, &Monitor::silent()).unwrap_err().to_string()
}

#[test]
fn what_cannot_be_milled_is_refused_with_its_reason() {
    let base = options(tables_ac());
    let flat = refusal(fabricate::mesh::shapes::grid(6, 4, 10.0), &base);
    assert!(flat.contains("piece A: is flat, so it has no rulings"), "{flat}");

    // Inside, the cone is 20 mm wide at its narrow end: r = s tan 20° = 21.8 mm.
    let large = Options { tool: Tool { radius: 28.0, shank: 27.0, holder: 40.0, ..base.tool }, ..base.clone() };
    let tight = refusal(turned(&good("cone-patch.obj")), &large);
    let radius = tight.split("smallest concave radius, ").nth(1).and_then(|it| it.split(' ').next());
    let radius: f64 = radius.unwrap_or_else(|| panic!("{tight}")).parse().unwrap();
    assert!((18.0..26.0).contains(&radius), "{tight}");

    let trunnion = rotary('A', Carrier::Table, [0.0; 3], [-2.0, 2.0]);
    let stiff = machine(trunnion, rotary('C', Carrier::Table, [0.0; 3], [-3600.0, 3600.0]));
    let range = refusal(good("cone-patch.obj"), &Options { up: Some(Vec3::y()), ..options(stiff) });
    assert!(
        range.contains("the line from (") && range.contains("it needs A = ") && range.contains("from -2.0° to 2.0°"),
        "{range}"
    );

    let (cut, strips) = ruled(good("cone-patch.obj"));
    let unknown = Options { pieces: vec!["Q".into()], ..base };
    let error = mill(&cut, &strips, &unknown, &Monitor::silent()).unwrap_err();
    assert_eq!(error, MillError::Unknown { name: "Q".into(), known: "A".into() });
}

/// The stage as a job runs it, on a machine profile.
fn staged(mesh: TriMesh, profile: &str, stage: &MillStage) -> (Milling, CutMesh, Profiles) {
    let (cut, strips) = ruled(mesh);
    let table = format!("profile = {profile:?}");
    let machine = toml::de::DeTable::parse(&table).unwrap();
    let profiles = Profiles::load(Path::new("."), &toml::de::DeTable::new(), machine.get_ref()).unwrap();
    let cx = Cx { seed: 0, monitor: Monitor::silent(), kept: None, keep: &|_| () };
    let made = stage.run((&cut, &strips), &MillStage::profile(&profiles), &cx).unwrap();
    (made, cut, profiles)
}

#[test]
fn programs_are_replayed_from_their_text() {
    for (profile, programs) in [("mill-bc-head", 2), ("hot-wire", 1)] {
        let block = [0.0, 0.0, 60.0].map(Length::mm);
        let stage = MillStage { fixture: block, ..MillStage::default() };
        let (job, cut, profiles) = staged(good("cone-patch.obj"), profile, &stage);
        within(profile, &job);
        let texts = emit::mill::programs(&job, &profiles.machine);
        assert_eq!(texts.len(), programs, "{profile}");
        let files = |texts: &[(&str, String)]| -> Vec<(String, Vec<u8>)> {
            texts.iter().map(|(name, text)| (name.to_string(), text.clone().into_bytes())).collect()
        };
        for check in replay(&files(&texts), &job, &cut, &profiles.machine) {
            assert!(check.ok, "{profile}: {check:?}");
            assert!((check.value - job.gouge.depth).abs() < 0.005, "{profile}: {check:?} for {:?}", job.gouge);
        }
        for (name, text) in &texts {
            let mut timed = false;
            for line in text.lines() {
                timed = if line.starts_with("G93") { true } else { timed && !line.starts_with("G94") };
                assert_eq!(line.starts_with("G1 "), timed && line.contains(" F"), "{name}: {line}");
                assert!(!line.starts_with("G0") || !timed, "{name}: {line}");
            }
            assert!(text.ends_with("M2\n"));
        }
        // A program that is not as it was swept is found out: a tenth of a millimetre too deep, a rotary word left out, a
        // word beyond the travel.
        let name = texts[0].0;
        let spoiled = |change: &dyn Fn(&str) -> String| {
            let lines: Vec<String> = texts[0].1.lines().map(change).collect();
            replay(&files(&[(name, lines.join("\n") + "\n")]), &job, &cut, &profiles.machine).remove(0)
        };
        let first = texts[0].1.lines().filter(|it| it.starts_with("G1 ")).nth(3).unwrap().to_owned();
        let letter = job.axes[3];
        let off = spoiled(&|line| {
            if line == first { line.replace(&format!(" {letter}"), &format!(" {letter}9")) } else { line.into() }
        });
        assert!(!off.ok, "{profile}: {off:?}");
        let stopped =
            spoiled(&|line| if line == first { line.split(" F").next().unwrap().into() } else { line.into() });
        assert!(stopped.note.contains("without its F") && stopped.note.contains("line "), "{stopped:?}");
    }
}

#[test]
fn a_machine_for_sheets_is_named() {
    let (cut, strips) = ruled(good("cone-patch.obj"));
    let profiles = Profiles::load(Path::new("."), &toml::de::DeTable::new(), &toml::de::DeTable::new()).unwrap();
    let cx = Cx { seed: 0, monitor: Monitor::silent(), kept: None, keep: &|_| () };
    let error = MillStage::default().run((&cut, &strips), &MillStage::profile(&profiles), &cx).unwrap_err();
    assert_eq!(error, MillError::Machine { name: "drag-knife-a3".into() });
}

fn complaint(folder: &Path, config: &str) -> (i32, String) {
    let path = folder.join("job.toml");
    fs::write(&path, config).unwrap();
    let out = folder.join("out").display().to_string();
    let args = ["run", &path.display().to_string(), "--out", &out, "--quiet"];
    let result = Command::new(env!("CARGO_BIN_EXE_fabricate")).args(args).output().unwrap();
    (result.status.code().unwrap(), String::from_utf8_lossy(&result.stderr).into_owned())
}

fn config(rest: &str) -> String {
    let mesh = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/cone-patch.obj");
    format!("version = 1\n[input]\nmesh = {:?}\n{rest}\n", mesh.display().to_string())
}

#[test]
fn controllers_and_machines_that_cannot_are_named() {
    let folder = tempfile::tempdir().unwrap();
    for (rest, wanted) in [
        ("[machine]\nprofile = \"mill-ac\"\ndialect = \"grbl\"", "`grbl` does not know two rotary axes"),
        ("[machine]\nprofile = \"hot-wire\"\ndialect = \"marlin\"", "`marlin` does not know the axes U and V"),
        ("[machine]\nprofile = \"mill-ac\"\ndialect = \"fanuc\"", "unknown value `fanuc`; there are `grbl`"),
        ("[machine]\nprofile = \"mill-ac\"\nmill.x.speed = 0", "`mill.x.speed`: must be a finite number above 0"),
        ("[mill]\nup = \"top\"\n[machine]\nprofile = \"mill-ac\"", "`up` must be \"auto\""),
        ("[mill]\ndiameter = 0\n[machine]\nprofile = \"mill-ac\"", "`diameter` must be between"),
    ] {
        let (code, stderr) = complaint(folder.path(), &config(rest));
        assert_eq!(code, 2, "{rest}: {stderr}");
        assert!(stderr.contains(wanted) && stderr.contains("job.toml:"), "{rest}: {stderr}");
    }
}
