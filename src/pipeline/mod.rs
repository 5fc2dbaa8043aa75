//! From a config to a plan, from a plan to artifacts and files: recipes, config, cache, run.

mod beginning;
mod cache;
mod codec;
mod config;
mod coupon;
mod deliver;
mod estimate;
mod guides;
mod input;
mod output;
mod pattern;
mod plan;
mod recipes;
mod replay;
mod run;
mod schema;
mod simulate;
mod verify;

pub use config::{Config, ConfigError, ConfigText, Place};
pub use coupon::{Coupon, CouponError, coupon};
pub use estimate::{Estimate, estimate};
pub use input::{InputError, Source, inspect_mesh};
pub use output::OutputError;
pub use pattern::is_drawing;
pub use plan::{Plan, PlanError, plan, plan_all};
pub use recipes::{RECIPES, Recipe, STAGES};
pub use replay::replay;
pub use run::{Event, Outcome, Range, RunError, run};
pub use schema::schema;
pub use simulate::simulate;
pub use verify::verify;
