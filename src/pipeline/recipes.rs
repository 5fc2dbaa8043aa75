//! The registry of stages and the named recipes.
use crate::{
    stage::StageDef,
    stages::{
        coarsen::stage::CoarsenStage, cut::stage::CutStage, develop::stage::Develop, flatten::stage::FlattenStage,
        layout::stage::LayoutStage, nest::stage::NestStage, route::stage::RouteStage, strips::stage::StripsStage,
    },
};

/// Every stage; a new one is one line here.
pub const STAGES: &[StageDef] = &[
    StageDef::of::<CoarsenStage>(),
    StageDef::of::<Develop>(),
    StageDef::of::<CutStage>(),
    StageDef::of::<FlattenStage>(),
    StageDef::of::<StripsStage>(),
    StageDef::of::<LayoutStage>(),
    StageDef::of::<NestStage>(),
    StageDef::of::<RouteStage>(),
];

/// A pipeline with a name.
pub struct Recipe {
    /// `recipe = "…"` in the config.
    pub name: &'static str,
    /// One line for people.
    pub about: &'static str,
    /// Names of its stages, in order.
    pub stages: &'static [&'static str],
}

/// Every recipe.
pub const RECIPES: &[Recipe] = &[Recipe {
    name: "developable",
    about: "make a mesh piecewise developable, cut it along its seams and flatten the pieces",
    stages: &["coarsen", "develop", "cut", "flatten", "strips", "layout", "nest", "route"],
}];
