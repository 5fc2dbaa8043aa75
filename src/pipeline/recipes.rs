//! The registry of stages and the named recipes.
use crate::{
    stage::StageDef,
    stages::{
        coarsen::stage::CoarsenStage,
        cut::stage::CutStage,
        develop::stage::Develop,
        flatten::stage::FlattenStage,
        fold::stage::FoldStage,
        layout::stage::LayoutStage,
        mill::stage::MillStage,
        mold::stage::MoldStage,
        nest::stage::NestStage,
        net::stage::{BendStage, NetStage},
        route::stage::RouteStage,
        sphere::stage::SphereStage,
        stripes::stage::StripesStage,
        strips::stage::StripsStage,
        unfold::stage::UnfoldStage,
    },
};

/// Every stage; a new one is one line here.
pub const STAGES: &[StageDef] = &[
    StageDef::of::<CoarsenStage>(),
    StageDef::of::<Develop>(),
    StageDef::of::<StripesStage>(),
    StageDef::of::<SphereStage>(),
    StageDef::of::<NetStage>(),
    StageDef::of::<BendStage>(),
    StageDef::of::<MoldStage>(),
    StageDef::of::<CutStage>(),
    StageDef::of::<FlattenStage>(),
    StageDef::of::<StripsStage>(),
    StageDef::of::<UnfoldStage>(),
    StageDef::of::<FoldStage>(),
    StageDef::of::<LayoutStage>(),
    StageDef::of::<NestStage>(),
    StageDef::of::<RouteStage>(),
    StageDef::of::<MillStage>(),
];

/// A pipeline with a name.
pub struct Recipe {
    /// `recipe = "…"` in the config.
    pub name: &'static str,
    /// One line for people.
    pub about: &'static str,
    /// The key of `[input]` that names what it reads: `mesh` or `pattern`.
    pub reads: &'static str,
    /// Names of its stages, in order.
    pub stages: &'static [&'static str],
    /// Those that come on top where the machine works blocks.
    pub of_blocks: &'static [&'static str],
    /// Tables, and lines in which it wants them different from the defaults of the stage, unless the job sets the key between.
    pub defaults: &'static [(&'static str, &'static str, &'static str)],
    /// What `init` writes into a new job.
    pub sample: &'static str,
}

impl Recipe {
    /// Name of a file that it could read.
    pub fn sample_input(&self) -> &'static str {
        if self.reads == "pattern" { "pattern.svg" } else { "model.obj" }
    }
}

/// Every recipe.
pub const RECIPES: &[Recipe] = &[
    Recipe {
        name: "developable",
        about: "make a mesh piecewise developable, cut it along its seams and flatten the pieces",
        reads: "mesh",
        stages: &["coarsen", "develop", "cut", "flatten", "strips", "layout", "nest", "route"],
        of_blocks: &["mill"],
        defaults: &[],
        sample: "[develop]\nmax_deviation = \"1 %\"      # of the diagonal, or a length such as \"2 mm\"\n",
    },
    Recipe {
        name: "facets",
        about: "coarsen a mesh to a few hundred faces and unfold it exactly, to be folded at every edge",
        reads: "mesh",
        stages: &["coarsen", "unfold", "layout", "nest", "route"],
        of_blocks: &[],
        defaults: &[
            ("coarsen", "method", "method = \"quadric\"\nfaces = 300"),
            ("layout", "fold_angle", "fold_angle = 1"),
        ],
        sample: "[coarsen]\nfaces = 300                # method = \"off\" takes a low-poly mesh as it is\n",
    },
    Recipe {
        name: "stripes",
        about: "cut a mesh into strips along lines at a spacing that start and end where you say, or only draw them",
        reads: "mesh",
        stages: &["coarsen", "stripes", "cut", "flatten", "layout", "nest", "route"],
        of_blocks: &[],
        defaults: &[
            ("coarsen", "method", "method = \"off\""),
            // Strips are narrow on purpose.
            ("cut", "min_neck", "min_neck = 0"),
        ],
        sample: "[stripes]\nfield = \"distance\"          # rings about every limb; or axis, smoothest, curvature-most, boundary, guides\nspacing = \"10 mm\"\neven_steps = 10              # evens out the spacing\none_strip = true             # one strip from tip to tip, to be zipped up\n",
    },
    Recipe {
        name: "sphere",
        about: "cut a closed mesh without handles into gores from pole to pole, for globes, balls and balloons",
        reads: "mesh",
        stages: &["sphere", "cut", "flatten", "layout", "nest", "route"],
        of_blocks: &[],
        defaults: &[],
        sample: "[sphere]\ncount = 12                 # gores; they are halved where they stretch more than the material\ngraticule = 15             # degrees between engraved parallels and meridians; 0 for none\n",
    },
    Recipe {
        name: "fold",
        about: "fold a drawing of curved creases, find mountains and valleys, and score and cut the sheet",
        reads: "pattern",
        stages: &["fold", "layout", "nest", "route"],
        of_blocks: &[],
        defaults: &[],
        sample: "[fold]\nmotion = \"lift-corners\"    # or saddle, pinch, close; or handles: [[fold.handle]] at = [0, 0], to = [10, 0, 20]\n",
    },
    Recipe {
        name: "net",
        about: "cover a patch or a surface of revolution with a net of geodesics, and bend it by handles; a model, no parts",
        reads: "mesh",
        stages: &["net", "bend"],
        of_blocks: &[],
        defaults: &[],
        sample: "[net]\nrows = 31                  # points along a geodesic\ncolumns = 21               # geodesics\n# equal_width = 1          # congruent strips; ratio = 1: isometric to revolution; developable = 1, arc_length = 1: nearly developable\n",
    },
    Recipe {
        name: "mold",
        about: "make a façade or another patch of panels that are all formed on the moulds of one surface of revolution",
        reads: "mesh",
        stages: &["net", "bend", "mold", "cut", "flatten", "layout", "nest", "route"],
        of_blocks: &[],
        defaults: &[
            ("net", "equal_width", "equal_width = 1"),
            ("net", "proximity", "proximity = [1, 0]"),
            ("net", "fairness", "fairness = [0.1, 0]"),
            // Panels are narrow on purpose.
            ("cut", "min_neck", "min_neck = 0"),
        ],
        sample: "[mold]\nwish = \"smallest\"          # or flattest; radius = \"200 mm\"; lambda = 1.0\nform = \"solid\"             # or ribs\nsize = [\"220 mm\", \"220 mm\", \"250 mm\"]   # of the machine that makes the moulds\n",
    },
];
