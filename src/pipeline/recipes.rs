//! The registry of stages and the named recipes.
use crate::{
    stage::StageDef,
    stages::{coarsen, cut, develop, flatten, layout, nest, route},
};

/// Every stage; a new one is one line here.
pub const STAGES: &[StageDef] = &[
    StageDef::of::<coarsen::stage::CoarsenStage>(),
    StageDef::of::<develop::stage::Develop>(),
    StageDef::of::<cut::stage::CutStage>(),
    StageDef::of::<flatten::stage::FlattenStage>(),
    StageDef::of::<layout::stage::LayoutStage>(),
    StageDef::of::<nest::stage::NestStage>(),
    StageDef::of::<route::stage::RouteStage>(),
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
    stages: &["coarsen", "develop", "cut", "flatten", "layout", "nest", "route"],
}];
