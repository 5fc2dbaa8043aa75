//! Laws over the registries: names are unique, every recipe plans with its defaults, every stage has a row.
use fabricate::{
    emit::FORMATS,
    pipeline::{Config, ConfigText, RECIPES, STAGES, plan},
    profile::{BuiltIn, MACHINES, MATERIALS},
};

#[test]
fn names_are_unique() {
    let lists: [Vec<&str>; 3] = [
        STAGES.iter().map(|it| it.name).collect(),
        RECIPES.iter().map(|it| it.name).collect(),
        FORMATS.iter().map(|it| it.name).collect(),
    ];
    for mut names in lists {
        let all = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), all);
    }
}

#[test]
fn every_recipe_plans_with_its_defaults() {
    for recipe in RECIPES {
        let sets = [format!("recipe={}", recipe.name)];
        let text = ConfigText::for_mesh(recipe.sample_input().as_ref(), &sets).unwrap();
        let made = plan(Config::parse(&text).unwrap()).unwrap_or_else(|err| panic!("{}: {err}", recipe.name));
        let names: Vec<_> = made.stages.iter().map(|it| it.0.name).collect();
        assert_eq!(names, recipe.stages, "{}", recipe.name);
        for (machine, on_top) in [("mill-ac", recipe.of_blocks), ("hot-wire", recipe.of_blocks), ("pen-plotter", &[])] {
            let sets = [format!("recipe={}", recipe.name), format!("machine.profile={machine}")];
            let text = ConfigText::for_mesh(recipe.sample_input().as_ref(), &sets).unwrap();
            let made = plan(Config::parse(&text).unwrap()).unwrap_or_else(|err| panic!("{}: {err}", recipe.name));
            let names: Vec<_> = made.stages.iter().map(|it| it.0.name).collect();
            assert_eq!(names, [recipe.stages, on_top].concat(), "{} on {machine}", recipe.name);
        }
    }
}

#[test]
fn every_pair_of_profiles_that_go_together_plans() {
    for machine in MACHINES {
        let works = |material: &&BuiltIn| {
            let sets = [format!("material.profile={}", material.name), format!("machine.profile={}", machine.name)];
            let text = ConfigText::for_mesh("mesh.obj".as_ref(), &sets).unwrap();
            match plan(Config::parse(&text).unwrap()) {
                Ok(made) => !made.stages.is_empty(),
                Err(refused) => {
                    let said = refused.to_string();
                    assert!(said.contains("do not go together"), "{} on {}: {said}", material.name, machine.name);
                    false
                }
            }
        };
        let count = MATERIALS.iter().filter(works).count();
        assert!(count > 0, "nothing can be worked on {}", machine.name);
    }
}

#[test]
fn every_stage_belongs_to_a_recipe() {
    for stage in STAGES {
        assert!(
            RECIPES.iter().any(|it| it.stages.contains(&stage.name) || it.of_blocks.contains(&stage.name)),
            "{}",
            stage.name
        );
    }
}
