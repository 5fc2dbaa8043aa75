//! Laws over all output formats: what is written can be read back and measures the same; the bytes never vary.
#![allow(clippy::unwrap_used, reason = "clippy takes only functions marked as tests for tests")]

use std::path::Path;

use fabricate::{
    emit::{self, FORMATS, File, Nouns, Subject},
    geom::{Vec2, arcs::ArcPath, polyline_length, signed_area},
    import::{
        gcode::{Sense, Spindle},
        read_dxf, read_gcode, read_svg,
    },
    model::{Mark, Operation, Part, Parts, Placement, Sheet, SheetPaths, Sheets, Toolpath, Toolpaths},
    numeric::Monitor,
    pipeline::{simulate, verify},
    profile::{Head, MACHINES, Profiles},
    stage::{Cx, Stage},
    stages::{nest::stage::NestStage, route::stage::RouteStage},
};
use toml::de::DeTable;

/// A job made by hand: parts with holes, a part in a hole, marks of every operation, names that no file may have,
/// coordinates that need all decimals.
struct Job {
    parts: Parts,
    sheets: Sheets,
    toolpaths: Toolpaths,
}

impl Job {
    fn new(profiles: &Profiles) -> Self {
        let ring = |center: Vec2, radius: f64, corners: usize, ccw: bool| -> Vec<Vec2> {
            let turn = if ccw { std::f64::consts::TAU } else { -std::f64::consts::TAU };
            let at = |i: usize| 0.1 + turn * i as f64 / corners as f64;
            (0..corners).map(|i| center + radius * Vec2::new(at(i).cos(), at(i).sin())).collect()
        };
        let middle = Vec2::new(100.0 / 3.0 + 50.0, 90.0);
        let washer = Part {
            name: "Washer no. 1/2".into(),
            contours: vec![ring(middle, 60.0, 257, true), ring(middle, 40.0, 101, false)],
            marks: Operation::ALL
                .into_iter()
                .filter(|it| !it.is_cut())
                .enumerate()
                .map(|(i, operation)| {
                    let turn = i as f64;
                    let along = Vec2::new(turn.cos(), turn.sin());
                    let points = vec![middle + 45.0 * along, middle + 50.0 * along, middle + 53.7 * along];
                    Mark { operation, points, closed: false }
                })
                .collect(),
        };
        let inner = Part {
            name: "washer no. 1-2".into(),
            contours: vec![ring(middle, 37.0, 3, true)],
            marks: vec![Mark { operation: Operation::Engrave, points: ring(middle, 5.0, 12, true), closed: true }],
        };
        let tongue = Part {
            name: "tongue".into(),
            contours: vec![vec![
                Vec2::new(6.0, 6.0),
                Vec2::new(200.123_456_789, 6.0),
                Vec2::new(200.0, 20.000_049_9),
                Vec2::new(6.0, 20.0),
            ]],
            marks: vec![],
        };
        let sheet = |parts: Vec<Part>| Sheet {
            size: Vec2::new(profiles.material.sheet[0].mm, profiles.material.sheet[1].mm),
            placements: (0..parts.len()).map(|part| Placement { part, angle: 0.0, offset: Vec2::zeros() }).collect(),
            parts,
        };
        let parts = vec![washer, inner, tongue];
        let sheets = vec![sheet(parts[..2].to_vec()), sheet(parts[2..].to_vec())];
        let paths = |sheet: &Sheet| {
            let mut lines: Vec<_> =
                sheet.parts.iter().flat_map(|part| part.lines().map(|line| (line, part.name.clone()))).collect();
            lines.sort_by_key(|it| profiles.machine.order.rank(it.0.operation));
            let paths = lines.into_iter().map(|(line, part)| {
                let close = line.closed.then_some(line.points[0]);
                let points = line.points.iter().copied().chain(close).collect();
                let path = ArcPath::straight(points);
                Toolpath { operation: line.operation, path, depth: 1.0, joined: false, part }
            });
            SheetPaths { size: sheet.size, paths: paths.collect() }
        };
        let toolpaths = Toolpaths {
            sheets: sheets.iter().map(paths).collect(),
            cut_length: 0.0,
            travel_length: 0.0,
            lifts: 0,
            seconds: 0.0,
            left_out: vec![],
            uncompensated: vec![],
        };
        let (margin, gap) = (profiles.material.margin.mm, profiles.material.gap.mm);
        Self {
            parts: Parts { parts, ..Parts::default() },
            sheets: Sheets { sheets, margin, gap, unplaced: vec![] },
            toolpaths,
        }
    }

    fn nouns(&self) -> Nouns<'_> {
        Nouns { parts: Some(&self.parts), sheets: Some(&self.sheets), toolpaths: Some(&self.toolpaths) }
    }

    fn files(&self, profiles: &Profiles) -> Vec<File> {
        let formats: Vec<String> = FORMATS.iter().map(|it| it.name.into()).collect();
        emit::files(&self.nouns(), profiles, &formats).unwrap()
    }
}

fn profiles(material: &str, machine: &str) -> Profiles {
    let (material, machine) = (DeTable::parse(material).unwrap(), DeTable::parse(machine).unwrap());
    Profiles::load(Path::new("."), material.get_ref(), machine.get_ref()).unwrap()
}

/// A drag knife of one's own, with a Z axis, and with more keys of its blade.
fn with_z_axis(knife: &str) -> Profiles {
    let folder = tempfile::tempdir().unwrap();
    let servo = MACHINES.iter().find(|it| it.name == "drag-knife-a3").unwrap().text;
    let (before, rest) = servo.split_once("[head.servo]").unwrap();
    let after = rest[rest.find("[knife]").unwrap()..].replace("[knife]", &format!("[knife]\n{knife}"));
    let own = format!("{before}[head.z]\nup = 5\ndown = -0.4\nplunge = 300\ndwell = 0.1\n\n{after}");
    std::fs::write(folder.path().join("router.toml"), own.replace("down = 65", "down = -0.1")).unwrap();
    let (material, machine) = (DeTable::parse("").unwrap(), DeTable::parse("profile = \"router.toml\"").unwrap());
    Profiles::load(folder.path(), material.get_ref(), machine.get_ref()).unwrap()
}

/// The job with toolpaths by the router.
fn routed(profiles: &Profiles) -> Job {
    let mut job = Job::new(profiles);
    let cx = Cx { seed: 0, monitor: Monitor::silent(), kept: None, keep: &|_| () };
    job.toolpaths = RouteStage::default().run(&job.sheets, &profiles.machine, &cx).unwrap();
    job
}

/// A knife that an axis turns.
const TANGENTIAL: &str =
    "profile = \"drag-knife-a3\"\nknife = { offset = 0, overcut = 0, lift = 20, axis = \"C\" }\narcs = false";

/// Every built-in machine for sheets with A3 sheets of what it works: paper, or plywood.
fn machines() -> impl Iterator<Item = Profiles> {
    let loaded = MACHINES.iter().map(|it| {
        let material = if it.name == "cnc-router" { "profile = \"plywood-3mm\"\nsheet = [420, 297]" } else { "" };
        profiles(material, &format!("profile = \"{}\"", it.name))
    });
    loaded.filter(|it| !it.machine.kind.works_blocks())
}

fn text(file: &File) -> &str {
    std::str::from_utf8(&file.bytes).unwrap()
}

#[test]
fn every_format_measures_the_same_when_read_back() {
    for profiles in machines() {
        let job = Job::new(&profiles);
        let files = job.files(&profiles);
        let checks = verify(&files, &job.nouns(), &profiles);
        assert_eq!(checks.len(), FORMATS.len(), "every format has a reader");
        for check in &checks {
            assert!(check.ok, "{}: {check:?}", profiles.machine.name);
            assert!(check.value > 0.0, "rounding must show, or nothing was compared: {check:?}");
        }
        // Areas and lengths, by another route than `verify` takes.
        for file in files.iter().filter(|it| matches!(it.format, "svg" | "dxf")) {
            let read = if file.format == "svg" { read_svg(&file.bytes) } else { read_dxf(&file.bytes) }.unwrap();
            let parts: Vec<&Part> = match file.subject {
                Subject::Sheet(i) => job.sheets.sheets[i].parts.iter().collect(),
                Subject::Part(i) => vec![&job.parts.parts[i]],
                Subject::Program(_) => panic!("a drawing shows sheets and parts"),
            };
            let area = |cut: &str| -> f64 {
                let on_layer = read.lines.iter().filter(|it| it.layer.eq_ignore_ascii_case(cut) && it.closed);
                on_layer.map(|it| signed_area(&it.points)).sum()
            };
            let meant: f64 = parts.iter().flat_map(|it| &it.contours).map(|it| signed_area(it)).sum();
            let found = area("CUT") + area("CUT_INNER");
            assert!((found - meant).abs() < 1e-2, "{}: {found} mm² for {meant}", file.path);
            let meant: f64 =
                parts.iter().flat_map(|it| it.lines()).map(|it| polyline_length(it.points, it.closed)).sum();
            let drawn = read.lines.iter().filter(|it| !it.layer.eq_ignore_ascii_case("CHECK"));
            let found: f64 = drawn.map(|it| polyline_length(&it.points, it.closed)).sum();
            assert!((found - meant).abs() < 1e-2, "{}: {found} mm for {meant}", file.path);
        }
    }
}

#[test]
fn a_file_that_was_tampered_with_fails_its_check() {
    let profiles = profiles("", "profile = \"laser-co2\"");
    let job = Job::new(&profiles);
    let files = job.files(&profiles);
    let sheet = |ending: &str| files.iter().find(|it| it.path == format!("sheets/sheet-02.{ending}")).unwrap();
    for (ending, from, to) in [
        ("svg", "291.0000", "291.0020"),
        ("svg", "width=\"420mm\"", "width=\"420.1mm\""),
        ("svg", " Z", ""),
        ("svg", "id=\"cut\"", "id=\"score\""),
        ("svg", "<path", "<g"),
        ("svg", "<path", "<path transform=\"translate(0.01)\""),
        ("dxf", " 10\r\n200.1235\r\n 20\r\n6.0", " 10\r\n200.1255\r\n 20\r\n6.0"),
        ("dxf", "$INSUNITS\r\n 70\r\n4", "$INSUNITS\r\n 70\r\n1"),
        ("dxf", " 70\r\n1\r\n 43", " 70\r\n0\r\n 43"),
        ("dxf", "  8\r\nCUT\r\n", "  8\r\nCUT_INNER\r\n"),
        ("svg", "M1.0000,296.0000", "M1.1000,296.0000"),
        ("pdf", " 6 l", " 6.01 l"),
        ("pdf", "/CUT BMC", "/SCORE BMC"),
        ("pdf", "/MediaBox [0 0 1190", "/MediaBox [0 0 1191"),
        ("a4.pdf", "253 7 l", "254 7 l"),
        ("r12.dxf", " 10\r\n200.1235\r\n 20\r\n6.0", " 10\r\n200.1255\r\n 20\r\n6.0"),
        ("dxf", " 20\r\n6.0000\r\n 10\r\n200.1235\r\n", ""),
        ("nc", "X200.123", "X200.125"),
        ("nc", "Y20.000", "Y20.000 S0"),
        ("nc", "G0 X6.000 Y6.000", "G0 X6.000 Y6.000 S10"),
        ("nc", "\nM5", ""),
        ("nc", "G0 X0.000 Y0.000\nM2", "G0 X0.000 Y0.000"),
        ("nc", "G21", "G20"),
        ("nc", "M4 S0", "M4 S0 D1"),
        ("plt", "PD8005,240", "PD8006,240"),
        ("plt", "PD8000,800;\n", ""),
        ("plt", "PU240", "PD240"),
    ] {
        let good = sheet(ending);
        let whole = String::from_utf8_lossy(&good.bytes);
        let bad = whole.replacen(from, to, 1);
        assert_ne!(bad, whole, "`{from}` is not in the file");
        let bad = File { bytes: bad.into_bytes(), ..good.clone() };
        let checks = verify(&[bad], &job.nouns(), &profiles);
        assert!(!checks[0].ok, "{ending}: `{from}` → `{to}`: {checks:?}");
    }
}

#[test]
fn the_same_job_gives_the_same_bytes() {
    for profiles in machines() {
        let (once, twice) = (Job::new(&profiles).files(&profiles), Job::new(&profiles).files(&profiles));
        assert_eq!(once, twice);
        let mut paths: Vec<String> = once.iter().map(|it| it.path.to_lowercase()).collect();
        paths.sort();
        paths.dedup();
        assert_eq!(paths.len(), once.len(), "two files of one name");
        for file in &once {
            assert!(file.path.bytes().all(|b| b.is_ascii_alphanumeric() || b"/-_.".contains(&b)), "{}", file.path);
        }
    }
}

#[test]
fn drawings_show_each_operation_on_its_layer_in_its_colour() {
    for profiles in machines() {
        let job = Job::new(&profiles);
        let files = job.files(&profiles);
        let svg = text(files.iter().find(|it| it.path == "sheets/sheet-01.svg").unwrap());
        let dxf = text(files.iter().find(|it| it.path == "sheets/sheet-01.dxf").unwrap());
        assert!(svg.contains("width=\"420mm\"") && svg.contains("height=\"297mm\""));
        assert!(svg.contains("viewBox=\"0 0 420 297\""));
        for banned in ["transform", "class", "style", "<text", "<use", "clip", "dasharray"] {
            assert!(!svg.contains(banned), "{banned}");
        }
        let mut place = 0;
        for operation in profiles.machine.order.iter() {
            let layer = &profiles.machine.layers[operation];
            let label = format!("inkscape:label=\"{}\"", layer.name);
            let at = svg.find(&label).unwrap_or_else(|| panic!("no layer {label}"));
            assert!(at > place, "{} stands before the operation that comes first", layer.name);
            place = at;
            let end = at + svg[at..].find("</g>").unwrap();
            let paths = svg[at..end].matches("<path").count();
            let stroke = format!("stroke=\"{}\"", String::from(layer.color));
            assert!(paths > 0 && svg[at..end].matches(&stroke).count() == paths, "{}", layer.name);
            assert!(dxf.contains("LWPOLYLINE\r\n") && dxf.contains(&format!("  8\r\n{}\r\n", layer.name)));
        }
        for pair in ["$INSUNITS\r\n 70\r\n4", "$MEASUREMENT\r\n 70\r\n1", "$ACADVER\r\n  1\r\nAC1015"] {
            assert!(dxf.contains(pair), "{pair}");
        }
        let dashed = Operation::ALL.iter().filter(|it| profiles.machine.layers[**it].dashed).count();
        assert_eq!(dxf.matches("  6\r\nDASHED\r\n").count(), dashed, "{}", profiles.machine.name);
        assert!(!dxf.contains("$TDCREATE"), "no dates");
    }
}

#[test]
fn programs_keep_the_rules_of_boards() {
    for profiles in machines() {
        let job = Job::new(&profiles);
        for file in job.files(&profiles).iter().filter(|it| it.format == "gcode") {
            let program = text(file);
            let name = &profiles.machine.name;
            assert!(program.is_ascii() && !program.contains('\r') && program.ends_with("\nM2\n"), "{name}");
            assert!(program.lines().all(|it| (1..=79).contains(&it.len())), "{name}");
            assert_eq!(program.lines().find(|it| !it.starts_with('(')), Some("G21 G90 G94 G17 G54"), "{name}");
            let read = read_gcode(program, Sense::of(&profiles.machine.head)).unwrap();
            let laser = matches!(profiles.machine.head, Head::Laser { .. });
            assert_eq!(read.spindle, Spindle::Off);
            assert_eq!(program.contains("M4 S0"), laser);
            let tools: Vec<u32> = {
                let sheet = &job.toolpaths.sheets[if file.path.contains("01") { 0 } else { 1 }];
                let mut tools: Vec<u32> =
                    sheet.paths.iter().map(|it| profiles.machine.tools[it.operation].number).collect();
                tools.dedup();
                tools
            };
            assert_eq!(read.pauses, tools.len() - 1, "{name} {}: one pause per change of tool", file.path);
            assert_eq!(read.rapid_at_work, None, "{name}");
            let extents = read.extents();
            for axis in 0..2 {
                assert!(extents.min[axis] >= 0.0 && extents.max[axis] <= profiles.machine.bed[axis].mm, "{name}");
            }
        }
    }
}

#[test]
fn programs_are_right_from_every_corner_and_with_a_z_axis() {
    for corner in ["lower-left", "lower-right", "upper-left", "upper-right"] {
        for invert in [false, true] {
            let keys = format!("profile = \"laser-co2\"\norigin = \"{corner}\"\ninvert_y = {invert}");
            let profiles = profiles("", &keys);
            let job = Job::new(&profiles);
            let checks = verify(&job.files(&profiles), &job.nouns(), &profiles);
            assert!(checks.iter().all(|it| it.ok), "{corner} {invert}: {checks:?}");
            let files = job.files(&profiles);
            let program = files.iter().find(|it| it.path == "sheets/sheet-02.nc").unwrap();
            let extents = read_gcode(text(program), Sense::Beam).unwrap().extents();
            assert_eq!(extents.min.x < 0.0, corner.ends_with("right"));
            assert_eq!(extents.min.y < 0.0, corner.starts_with("upper") != invert);
        }
    }
    let profiles = with_z_axis("");
    let job = Job::new(&profiles);
    let files = job.files(&profiles);
    let checks = verify(&files, &job.nouns(), &profiles);
    assert!(checks.iter().all(|it| it.ok), "{checks:?}");
    let program = text(files.iter().find(|it| it.path == "sheets/sheet-01.nc").unwrap());
    assert!(program.contains("G1 Z-0.400 F300\nG4 P0.1\n") && program.contains("G1 Z-0.100 F300"));
    assert_eq!(program.matches("G0 Z5.000").count(), program.matches("G1 Z").count() + 1);
}

#[test]
fn plots_hold_one_pair_per_command() {
    let profiles = profiles("", "");
    for file in Job::new(&profiles).files(&profiles).iter().filter(|it| it.format == "hpgl") {
        for line in text(file).lines() {
            assert!(line.ends_with(';') && line.matches(';').count() == 1 && line.matches(',').count() <= 1, "{line}");
        }
    }
}

#[test]
fn plots_set_speed_and_force_where_that_is_asked_for() {
    let keys =
        "profile = \"vinyl-cutter\"\nvelocity = true\n[tools.cut-outside]\nforce = 80\n[tools.engrave]\nforce = 20";
    let profiles = profiles("", keys);
    let job = Job::new(&profiles);
    let files = job.files(&profiles);
    assert!(verify(&files, &job.nouns(), &profiles).iter().all(|it| it.ok));
    let plot = text(files.iter().find(|it| it.path == "sheets/sheet-01.plt").unwrap());
    // 6000 mm/min with the pen, 3000 with the blade.
    let at = |word: &str| plot.find(word).unwrap_or_else(|| panic!("no {word}"));
    assert!(at("VS10;\n") < at("FS20;\n") && at("FS20;\n") < at("VS5;\n") && at("VS5;\n") < at("FS80;\n"));
    assert_eq!(plot.matches("VS").count(), 2);
    assert_eq!(plot.matches("FS").count(), 2);
}

/// Routed, written, read back and carried out by a model of the tool: what comes out is the layout.
#[test]
fn the_replayed_tool_cuts_what_the_layout_says() {
    let bridged = "[tools.cut-outside]\nbridges = { count = 3, width = 2 }\nlead = 2\n";
    for (material, machine) in [
        ("", "profile = \"drag-knife-a3\"".to_owned()),
        ("", "profile = \"drag-knife-a3\"\narcs = false".to_owned()),
        ("", "profile = \"drag-knife-a3\"\norigin = \"upper-right\"\ninvert_y = true".to_owned()),
        ("", "profile = \"drag-knife-a3\"\ndialect = \"marlin\"".to_owned()),
        ("", TANGENTIAL.to_owned()),
        ("", "profile = \"pen-plotter\"".to_owned()),
        ("profile = \"plywood-3mm\"", "profile = \"laser-co2\"".to_owned()),
        ("profile = \"plywood-3mm\"", format!("profile = \"laser-co2\"\n{bridged}")),
        (
            "profile = \"plywood-3mm\"\nmargin = 5",
            "profile = \"cnc-router\"\ntools.cut-outside.kerf = 2\ntools.cut-inside.kerf = 2".to_owned(),
        ),
        ("profile = \"felt-3mm\"", "profile = \"laser-co2\"\ninvert_y = true\norigin = \"upper-left\"".to_owned()),
    ] {
        let profiles = profiles(material, &machine);
        let job = routed(&profiles);
        let files = job.files(&profiles);
        for check in verify(&files, &job.nouns(), &profiles) {
            assert!(check.ok, "{material} {machine}: {check:?}");
        }
        let checks = simulate(&files, &job.nouns(), &profiles);
        assert_eq!(checks.len(), 2, "one for each format of programs");
        for check in checks {
            assert!(check.ok, "{material} {machine}: {check:?}");
            println!("{machine:?}: {} {:.4} mm, {}", check.name, check.value, check.note);
        }
        let program = files.iter().find(|it| it.path == "sheets/sheet-01.nc").unwrap();
        let arcs = text(program).lines().filter(|it| it.starts_with("G2 ") || it.starts_with("G3 ")).count();
        assert_eq!(arcs > 0, profiles.machine.arcs, "{machine}");
    }
    // The check can fail: without the compensation of the blade, or with a kerf that the router did not know of.
    for (made, cut) in [
        ("profile = \"drag-knife-a3\"\nknife.offset = 0", "profile = \"drag-knife-a3\""),
        ("profile = \"laser-co2\"", "profile = \"laser-co2\"\ntools.cut-inside.kerf = 0.5"),
    ] {
        let (made, cut) = (profiles("", made), profiles("", cut));
        let job = routed(&made);
        let files = job.files(&made);
        assert!(simulate(&files, &job.nouns(), &made).iter().all(|it| it.ok));
        assert!(simulate(&files, &job.nouns(), &cut).iter().all(|it| !it.ok));
    }
}

#[test]
fn a_hole_narrower_than_the_cut_is_cut_along_its_edge_and_said() {
    let profiles = profiles("", "profile = \"laser-co2\"\ntools.cut-inside.kerf = 90");
    let job = routed(&profiles);
    assert_eq!(job.toolpaths.uncompensated.len(), 1, "{:?}", job.toolpaths.uncompensated);
    assert!(job.toolpaths.uncompensated[0].contains("Washer no. 1/2"));
    let section = RouteStage::default().section(&job.sheets, &profiles.machine, &job.toolpaths);
    assert!(
        section.checks.iter().any(|it| it.name == "route.kerf" && !it.ok && it.note.contains("narrower than the cut"))
    );
}

#[test]
fn parts_keep_as_far_apart_as_the_cuts_around_them_are_wide() {
    let profiles = profiles("gap = 3", "profile = \"laser-co2\"\ntools.cut-outside.kerf = 20");
    let parts = Job::new(&profiles).parts;
    let cx = Cx { seed: 0, monitor: Monitor::silent(), kept: None, keep: &|_| () };
    let sheets = NestStage::default().run(&parts, &NestStage::profile(&profiles), &cx).unwrap();
    assert_eq!(sheets.sheets.iter().map(|it| it.parts.len()).sum::<usize>(), 3);
    // The tongue is 14 mm wide, less than the cut: it stays whole, because an outline is cut outside.
    let found = fabricate::stages::nest::measure(&sheets);
    let gap = found.gap.unwrap();
    assert!(gap.0 >= 20.0, "{gap:?}");
}

/// The blade looks where it goes: it turns by small angles on the way, by larger ones in place, by sharp ones lifted.
#[test]
fn a_tangential_knife_follows_the_outline() {
    let profiles = profiles("", TANGENTIAL);
    let job = routed(&profiles);
    let program = job.files(&profiles).into_iter().find(|it| it.path == "sheets/sheet-01.nc").unwrap();
    let (mut at, mut angle, mut down, mut rapid, mut checked) = ([0.0; 2], 0.0_f64, false, true, 0);
    let by_blade = text(&program).split_once("tool 2)").unwrap().1;
    for line in by_blade.lines().skip(1).filter(|it| !it.starts_with('(')) {
        let (before, old) = (at, angle);
        for word in line.split(' ') {
            let value: f64 = word[1..].parse().unwrap();
            match (&word[..1], value as i32) {
                ("G", code @ (0 | 1)) => rapid = code == 0,
                ("X", _) => at[0] = value,
                ("Y", _) => at[1] = value,
                ("C", _) => angle = value,
                ("S", s) => down = s > 50,
                _ => {}
            }
        }
        let (dx, dy) = (at[0] - before[0], at[1] - before[1]);
        if down {
            assert!((angle - old).abs() <= 20.0, "`{line}` turns the lowered blade by {}°", angle - old);
            assert!(!rapid || dx == 0.0 && dy == 0.0, "{line}");
        }
        // Rounded ends of a short line say little about its direction.
        if down && dx.hypot(dy) > 0.2 {
            let off = dy.atan2(dx).to_degrees() - angle;
            let off = off - 360.0 * (off / 360.0).round();
            assert!(off.abs() < 0.5, "`{line}` is cut {off}° askew");
            checked += 1;
        }
    }
    assert!(checked > 100, "{checked}");
}

#[test]
fn a_trailing_blade_swivels_on_the_surface_where_that_is_asked_for() {
    let profiles = with_z_axis("lift = 30");
    let job = routed(&profiles);
    let files = job.files(&profiles);
    for check in verify(&files, &job.nouns(), &profiles).iter().chain(&simulate(&files, &job.nouns(), &profiles)) {
        assert!(check.ok, "{check:?}");
    }
    let program = text(files.iter().find(|it| it.path == "sheets/sheet-02.nc").unwrap()).to_owned();
    // Every swivel of the blade: raised to the surface, round, and down again, without a lift between.
    let turned = program.match_indices("\nG1 Z0.000").filter(|(at, _)| {
        let mut rest = program[at + 1..].lines().skip_while(|it| it.starts_with("G1 Z0.000") || it.starts_with("G4"));
        rest.next().is_some_and(|it| it.starts_with("G2") || it.starts_with("G3"))
            && rest.next().is_some_and(|it| it.starts_with("G1 Z-"))
    });
    // Four corners of the tongue, the first again at the end of the way round; the first alignment leaves it askew.
    let swivels = turned.count();
    assert!((4..=6).contains(&swivels), "{swivels}\n{program}");
    let contours = job.toolpaths.sheets[1].paths.iter().filter(|it| !it.joined).count();
    assert_eq!(program.matches("G0 Z").count(), contours + 1, "one lift for each contour and one at the start");
}

#[test]
fn profiles_name_formats_that_exist() {
    for profiles in machines() {
        assert!(!profiles.machine.formats.is_empty());
        for name in &profiles.machine.formats {
            emit::format(name).unwrap();
        }
    }
    let error = emit::files(&Nouns::default(), &profiles("", ""), &["svgz".into()]).unwrap_err();
    let known = "svg, dxf, dxf-r12, pdf, pdf-a4, pdf-letter, gcode, hpgl";
    assert_eq!(error.to_string(), format!("there is no output format `svgz`; known are: {known}"));
    assert_eq!(emit::files(&Nouns::default(), &profiles("", ""), &["svg".into()]), Ok(vec![]));
}
