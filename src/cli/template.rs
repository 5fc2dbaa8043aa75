//! The commented config that `fabricate init` writes.
use super::args::Init;
use crate::{pipeline::RECIPES, profile};

/// A config that runs as soon as its mesh exists; `Err` names what does not exist.
pub(super) fn config(args: &Init) -> Result<String, String> {
    let recipe = RECIPES.iter().find(|it| it.name == args.recipe).ok_or_else(|| {
        let names: Vec<_> = RECIPES.iter().map(|it| it.name).collect();
        format!("unknown recipe `{}`; there are {}", args.recipe, names.join(", "))
    })?;
    for (kind, name, list) in
        [("material", &args.material, profile::MATERIALS), ("machine", &args.machine, profile::MACHINES)]
    {
        if list.iter().all(|it| it.name != name) {
            let names: Vec<_> = list.iter().map(|it| it.name).collect();
            return Err(format!("unknown {kind} profile `{name}`; there are {}", names.join(", ")));
        }
    }
    let quoted = |text: &str| toml::Value::String(text.to_owned()).to_string();
    Ok(TEMPLATE
        .replace("{recipe}", &quoted(recipe.name))
        .replace("{sample}", recipe.sample)
        .replace("{mesh}", &quoted(&args.mesh.display().to_string()))
        .replace("{material}", &quoted(&args.material))
        .replace("{machine}", &quoted(&args.machine)))
}

const TEMPLATE: &str = r#"# A job for `fabricate run`. Every key has a default; lines with a leading # show it.
version = 1
recipe = {recipe}
# seed = 0

[input]
mesh = {mesh}              # .obj .stl .ply .off, relative to this file
height = "180 mm"          # or width, depth, diagonal, or units = "mm" | "cm" | "m" | "in" | "ft", or scale = 1.0
# up = "y"                 # "z" by default for STL
# component = "one"        # "largest" or "all" when the file holds several surfaces
# fill_holes = 0           # close holes of at most this many edges

[material]
profile = {material}
# sheet = ["210 mm", "297 mm"]   # any key of the profile can be set here: fabricate profiles show NAME

[machine]
profile = {machine}

[output]
dir = "out"
# formats = ["svg", "dxf", "gcode"]

{sample}"#;
