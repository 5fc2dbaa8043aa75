//! `report.html`: the report to look at, one file that needs no network. `page.html` is its skeleton; the styles and scripts
//! beside it are put in as they are, the report as JSON, and everything with many numbers as one deflated block
//! (see `pack.rs` and `payload.js`).
//!
//! A new recipe adds what it makes to the lists in `scene.rs` and, if it has figures of its own, a row to `PANELS` in
//! `panels.js`.
mod grid;
mod pack;
mod scene;
mod sheets;

use serde_json::{Value, json};

use super::pictures::{self, Subjects};
use crate::model::{Flattening, Globe, Operation, Stripes, Toolpaths};

/// What the page shows.
pub struct Content<'a> {
    /// The nouns that have pictures as well.
    pub subjects: Subjects<'a>,
    /// The pieces in the plane.
    pub flat: Option<&'a Flattening>,
    /// The lines of recipe `stripes`.
    pub stripes: Option<&'a Stripes>,
    /// The map of recipe `sphere`.
    pub globe: Option<&'a Globe>,
    /// The way of the tool.
    pub toolpaths: Option<&'a Toolpaths>,
    /// Path and content of the drawing of every sheet, as SVG.
    pub drawings: &'a [(String, Vec<u8>)],
    /// Speed of the tool at work, mm/s; 0 for what the machine does not do.
    pub feed: &'a (dyn Fn(Operation) -> f64 + Sync),
    /// Speed of the tool between, mm/s.
    pub rapid: f64,
}

const SKELETON: &str = include_str!("page.html");

/// What stands in the places `{{…}}` of the skeleton that are the same in every page.
const FIXED: &[(&str, &str)] = &[
    ("STYLE", include_str!("page.css")),
    (
        "SCRIPT",
        concat!(
            include_str!("payload.js"),
            include_str!("color.js"),
            include_str!("camera.js"),
            include_str!("mesh.js"),
            include_str!("viewer.js"),
            include_str!("sheets.js"),
            include_str!("replay.js"),
            include_str!("charts.js"),
            include_str!("sphere.js"),
            include_str!("panels.js"),
            include_str!("main.js"),
        ),
    ),
];

/// The page of a job; `report` is its report.json.
pub fn page(content: &Content<'_>, report: &Value) -> Vec<u8> {
    let mut pack = pack::Pack::default();
    let mut scene = scene::scene(content, &mut pack);
    let embedded_picture = |png: &[u8]| format!("data:image/png;base64,{}", pack::base64(png));
    if let Some(strip) = pictures::folding_strip(&content.subjects) {
        scene["folding"] = json!(embedded_picture(&strip));
    }
    let net = pictures::net_pictures(&content.subjects);
    scene["net"] = net.iter().map(|(about, png)| json!({ "about": about, "src": embedded_picture(png) })).collect();
    scene["sheets"] = sheets::sheets(content, &mut pack);
    scene["operations"] = sheets::operations(content);
    scene["rapid"] = json!(content.rapid);
    let title = report.pointer("/input/file").and_then(Value::as_str).unwrap_or("job");
    let own =
        [("TITLE", escaped(title)), ("REPORT", embedded(report)), ("SCENE", embedded(&scene)), ("DATA", pack.finish())];
    let mut places = SKELETON.split("{{");
    let mut out = places.next().unwrap_or_default().to_owned();
    for place in places {
        let (name, rest) = place.split_once("}}").expect("a test fills every place of the skeleton");
        let fixed = FIXED.iter().find(|it| it.0 == name).map(|it| it.1);
        let value = fixed.or_else(|| own.iter().find(|it| it.0 == name).map(|it| it.1.as_str()));
        out.push_str(value.expect("a test fills every place of the skeleton"));
        out.push_str(rest);
    }
    out.into_bytes()
}

/// JSON that cannot end the script element that it stands in.
fn embedded(value: &Value) -> String {
    value.to_string().replace('<', "\\u003c")
}

/// Text between tags.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
