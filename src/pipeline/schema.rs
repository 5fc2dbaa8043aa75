//! JSON schema of the config, for editors: what serde reads, with the defaults of the plan.
use serde_json::{Map, Value, json};
use toml::{Spanned, de::DeTable};

use super::{
    config::OutputTable,
    input::InputTable,
    recipes::{RECIPES, STAGES},
};
use crate::{
    emit::FORMATS,
    profile::{self, Machine, Material, Profiles, shape},
};

/// The schema (JSON Schema, draft 2020-12).
pub fn schema() -> Value {
    let mut keys = Map::new();
    let mut put = |key: &str, value: Value| drop(keys.insert(key.into(), value));
    put("version", json!({ "const": 1 }));
    let recipes: Vec<Value> = RECIPES.iter().map(|it| json!({ "const": it.name, "description": it.about })).collect();
    put("recipe", json!({ "oneOf": recipes, "default": "developable" }));
    put("seed", json!({ "type": "integer", "minimum": 0, "default": 0 }));
    let names: Vec<&str> = STAGES.iter().map(|it| it.name).collect();
    let about = "stages to run, instead of those of the recipe";
    put("stages", json!({ "type": "array", "items": { "enum": names }, "description": about }));
    put("input", shape::<InputTable>());
    let mut output = shape::<OutputTable>();
    let formats: Vec<&str> = FORMATS.iter().map(|it| it.name).collect();
    output["properties"]["formats"]["items"] = json!({ "enum": formats });
    put("output", output);
    put("material", with_profile(shape::<Material>(), profile::MATERIALS));
    put("machine", with_profile(shape::<Machine>(), profile::MACHINES));
    let none = DeTable::new();
    let profiles = Profiles::load(std::path::Path::new(""), &none, &none).expect("a test loads the default profiles");
    for def in STAGES {
        let mut table = (def.shape)();
        let ready = (def.prepare)(Spanned::new(0..0, DeTable::new()), &profiles, 0);
        for (key, value) in ready.iter().flat_map(|it| it.options.as_object()).flatten() {
            // A default of null is a key that is absent.
            if !value.is_null() && table["properties"][key].is_object() {
                table["properties"][key]["default"] = value.clone();
            }
        }
        put(def.name, table);
    }
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A job of fabricate",
        "type": "object",
        "properties": keys,
        "additionalProperties": false,
    })
}

/// Any key of a profile can be set over the one that `profile` names.
fn with_profile(mut table: Value, known: &[profile::BuiltIn]) -> Value {
    let names: Vec<&str> = known.iter().map(|it| it.name).collect();
    let about = "a built-in name, or the path of a profile of your own, ending in .toml";
    table["properties"]["profile"] =
        json!({ "anyOf": [{ "enum": names }, { "type": "string", "pattern": "\\.toml$" }], "description": about });
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::{Config, ConfigText, plan};

    /// Keys of `value` that `schema` does not have.
    fn unknown(value: &Value, schema: &Value, path: &str, out: &mut Vec<String>) {
        let (Some(table), Some(keys)) = (value.as_object(), schema["properties"].as_object()) else { return };
        for (key, value) in table {
            match keys.get(key) {
                Some(schema) => unknown(value, schema, &format!("{path}.{key}"), out),
                None => out.push(format!("{path}.{key}")),
            }
        }
    }

    #[test]
    fn every_key_of_every_recipe_is_in_the_schema() {
        let schema = schema();
        for recipe in RECIPES {
            let set = [format!("recipe={}", recipe.name)];
            let text = ConfigText::for_mesh(recipe.sample_input().as_ref(), &set).unwrap();
            let plan = plan(Config::parse(&text).unwrap()).unwrap();
            let mut missing = Vec::new();
            unknown(&plan.echo, &schema, "", &mut missing);
            assert!(missing.is_empty(), "{}: {missing:?}", recipe.name);
        }
    }

    #[test]
    fn values_are_described() {
        let schema = schema();
        let key = |path: &str| schema.pointer(&format!("/properties/{}", path.replace('.', "/properties/"))).unwrap();
        assert_eq!(key("coarsen.faces")["type"], "integer");
        assert!(key("coarsen.method")["anyOf"][0]["enum"].as_array().unwrap().contains(&json!("isotropic")));
        assert_eq!(key("layout.fold_angle")["type"], "number");
        assert!(key("input.height")["description"].as_str().unwrap().starts_with("a length"));
        assert_eq!(key("material.join.width")["description"], key("input.height")["description"]);
        assert!(key("cut.style").get("default").is_some());
    }
}
