//! The commented config that `fabricate init` writes.
use std::{fs, path::Path};

use toml::de::DeTable;

use super::args::Init;
use crate::{
    pipeline::RECIPES,
    profile::{self, Profiles},
};

/// Machines tried in turn for a material when none is named: what a maker is likely to have, and files for a shop at last.
const USUAL: [&str; 4] = ["drag-knife-a3", "laser-co2", "cnc-router", "shop"];

/// A config that runs as soon as its mesh exists; `Err` says what is wrong with what was asked for.
pub(super) fn config(args: &Init) -> Result<String, String> {
    let recipe = RECIPES.iter().find(|it| it.name == args.recipe).ok_or_else(|| {
        let names: Vec<_> = RECIPES.iter().map(|it| it.name).collect();
        format!("unknown recipe `{}`; there are {}", args.recipe, names.join(", "))
    })?;
    let quoted = |text: &str| toml::Value::String(text.to_owned()).to_string();
    let load = |machine: &str| {
        let table = |name: &str| format!("profile = {}", quoted(name));
        let (material, machine) = (table(&args.material), table(machine));
        let parse = |text| DeTable::parse(text).expect("a quoted string is valid TOML");
        Profiles::load(&args.dir, parse(&material).get_ref(), parse(&machine).get_ref())
    };
    let (machine, profiles) = match &args.machine {
        Some(name) => (name.as_str(), load(name).map_err(|it| it.to_string())?),
        None => {
            let usual = USUAL.into_iter().find_map(|name| load(name).ok().map(|it| (name, it)));
            usual.map_or_else(|| load(USUAL[0]).map(|it| (USUAL[0], it)).map_err(|it| it.to_string()), Ok)?
        }
    };
    let (endings, input): (&[&str], &str) = match recipe.reads {
        "pattern" => (&["svg", "dxf", "fold"], PATTERN),
        _ => (&["obj", "stl", "ply", "off"], MESH),
    };
    let mesh = match &args.mesh {
        Some(path) => path.display().to_string(),
        // Where the folder does not tell, the config runs as soon as there is such a file.
        None => only_file(&args.dir, endings).unwrap_or_else(|| recipe.sample_input().into()),
    };
    let profile::Material { stretch, thickness, sheet, join, .. } = &profiles.material;
    let join = format!("{:?}", join.kind).to_lowercase();
    let sheet = sheet.map(|it| format!("{:.0}", it.mm)).join(", ");
    Ok(TEMPLATE
        .replace("{recipe}", &quoted(recipe.name))
        .replace("{about}", recipe.about)
        .replace("{sample}", recipe.sample)
        .replace("{input}", input)
        .replace("{mesh}", &quoted(&mesh))
        .replace("{material}", &quoted(&args.material))
        .replace("{title}", &profiles.material.title)
        .replace("{stretch}", &stretch.to_string())
        .replace("{thickness}", &thickness.mm.to_string())
        .replace("{sheet}", &sheet)
        .replace("{join}", &join)
        .replace("{machine}", &quoted(machine))
        .replace("{machine_title}", &profiles.machine.title))
}

/// The name of the file with one of the endings in a folder, where there is one and no other.
fn only_file(folder: &Path, endings: &[&str]) -> Option<String> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let is_mesh =
        |path: &Path| path.extension().is_some_and(|it| endings.iter().any(|known| it.eq_ignore_ascii_case(known)));
    let names = fs::read_dir(folder).ok()?.flatten().map(|it| it.path()).filter(|it| is_mesh(it));
    let mut names = names.filter_map(|it| it.file_name()?.to_str().map(str::to_owned));
    names.next().filter(|_| names.next().is_none())
}

/// Keys of the input of recipes that read a mesh.
const MESH: &str = r##"mesh = {mesh}              # .obj .stl .ply .off, relative to this file
height = "180 mm"          # or width, depth, diagonal, or units = "mm" | "cm" | "m" | "in" | "ft", or scale = 1.0
# up = "y"                 # "z" by default for STL
# component = "one"        # "largest" or "all" when the file holds several surfaces
# fill_holes = 0           # close holes of at most this many edges
"##;
/// Keys of the input of those that read a crease pattern.
const PATTERN: &str = r##"pattern = {mesh}           # .svg .dxf .fold, relative to this file; black is border, magenta crease
# width = "200 mm"         # or height, diagonal, scale; or units = "mm", or dpi = 72 for pixels of drawing software
# border = "drawn"         # "rectangle", "outermost" or "annulus" where the drawing has none
# colors = { "#000000" = "crease" }    # or layers = { "NAME" = "border" }; cut, mountain, valley, ignored
# snap = "0.05 mm"         # gaps up to this are closed
"##;

const TEMPLATE: &str = r##"# A job for `fabricate run`. Every key has a default; lines with a leading # show it or another choice.
# For help while typing: `fabricate schema > fabricate.schema.json`, and a first line `#:schema fabricate.schema.json`.
version = 1
recipe = {recipe}
# ^ {about}
# seed = 0

[input]
{input}
[material]
profile = {material}       # {title}; others: fabricate profiles
# sheet = [{sheet}]        # mm; these are its own: any key of the profile can be set here
# thickness = {thickness}
# stretch = {stretch}      # how far it gives without harm: more makes fewer, larger pieces
# join.kind = "{join}"     # butt, tabs, rivets, allowance, holes, fingers

[machine]
profile = {machine}        # {machine_title}

[output]
dir = "out"                # look at out/report.html when it has run
# formats = ["svg", "dxf", "gcode"]

{sample}"##;
