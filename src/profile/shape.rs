//! What a config table may hold, as JSON schema, found by asking serde: a deserializer that notes what a type wants to read.
//!
//! A struct is read many times, each time with one of its keys alone, so that a value that is refused (an empty name, a missing
//! key beside it) hides nothing of the others.
use std::{cell::RefCell, fmt};

use serde::de::{self, DeserializeOwned, DeserializeSeed, IntoDeserializer, Visitor, value::BorrowedStrDeserializer};
use serde_json::{Map, Value, json};

/// The schema of a type.
pub fn shape<T: DeserializeOwned>() -> Value {
    let root = RefCell::new(Node::default());
    while !root.borrow().done {
        // What is read is of no interest, nor whether it could be.
        let _ = T::deserialize(Tracer(&root));
        let mut root = root.borrow_mut();
        // A type that refuses before it reads anything says nothing.
        root.done |= root.schema.is_null();
    }
    root.into_inner().schema()
}

/// What is known of one value.
#[derive(Default)]
struct Node {
    schema: Value,
    /// Keys of a struct, items of a list (one), or the same value behind an option (one).
    inner: Vec<(&'static str, RefCell<Node>)>,
    done: bool,
}

impl Node {
    fn schema(self) -> Value {
        let Self { mut schema, inner, .. } = self;
        if schema.is_null() {
            return json!({});
        }
        let is = |kind: &str, schema: &Value| schema["type"] == kind;
        if is("array", &schema) {
            schema["items"] = inner.into_iter().next().map_or(json!({}), |it| it.1.into_inner().schema());
        } else if is("object", &schema) && !inner.is_empty() {
            let keys: Map<String, Value> =
                inner.into_iter().map(|it| (it.0.to_owned(), it.1.into_inner().schema())).collect();
            schema["properties"] = Value::Object(keys);
            schema["additionalProperties"] = json!(false);
        } else if let Some(only) = inner.into_iter().next() {
            return only.1.into_inner().schema();
        }
        schema
    }
}

/// Reads nothing into one node.
struct Tracer<'n>(&'n RefCell<Node>);

#[derive(Debug)]
struct Nothing;

impl fmt::Display for Nothing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("there is nothing to read")
    }
}

impl std::error::Error for Nothing {}

impl de::Error for Nothing {
    fn custom<T: fmt::Display>(_: T) -> Self {
        Self
    }
}

impl<'n> Tracer<'n> {
    fn leaf(&self, schema: Value) {
        let mut node = self.0.borrow_mut();
        node.schema = schema;
        node.done = true;
    }

    /// Notes the parts of a value once; then those still to be looked into.
    fn open(&self, schema: Value, keys: &[&'static str]) {
        let mut node = self.0.borrow_mut();
        if node.schema.is_null() {
            node.schema = schema;
            node.inner = keys.iter().map(|it| (*it, RefCell::default())).collect();
        }
    }

    /// Reads into the first part that is not done, and looks whether that was the last.
    fn read_next<T>(&self, read: impl FnOnce(&'static str, Tracer<'_>) -> Result<T, Nothing>) -> Result<T, Nothing> {
        let result = {
            let node = self.0.borrow();
            match node.inner.iter().find(|it| !it.1.borrow().done) {
                Some((key, next)) => {
                    let result = read(key, Tracer(next));
                    let mut next = next.borrow_mut();
                    next.done |= next.schema.is_null();
                    result
                }
                None => Err(Nothing),
            }
        };
        let mut node = self.0.borrow_mut();
        node.done = node.inner.iter().all(|it| it.1.borrow().done);
        result
    }
}

macro_rules! leaves {
    ($($name:ident: $visit:ident($($value:expr)?) = $schema:tt),* $(,)?) => {$(
        fn $name<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Nothing> {
            self.leaf(json!($schema));
            visitor.$visit($($value)?)
        }
    )*};
}

impl<'de> de::Deserializer<'de> for Tracer<'_> {
    type Error = Nothing;

    leaves! {
        deserialize_bool: visit_bool(false) = { "type": "boolean" },
        deserialize_i8: visit_i8(0) = { "type": "integer" },
        deserialize_i16: visit_i16(0) = { "type": "integer" },
        deserialize_i32: visit_i32(0) = { "type": "integer" },
        deserialize_i64: visit_i64(0) = { "type": "integer" },
        deserialize_u8: visit_u8(0) = { "type": "integer", "minimum": 0 },
        deserialize_u16: visit_u16(0) = { "type": "integer", "minimum": 0 },
        deserialize_u32: visit_u32(0) = { "type": "integer", "minimum": 0 },
        deserialize_u64: visit_u64(0) = { "type": "integer", "minimum": 0 },
        deserialize_f32: visit_f32(0.0) = { "type": "number" },
        deserialize_f64: visit_f64(0.0) = { "type": "number" },
        deserialize_char: visit_char('a') = { "type": "string" },
        deserialize_str: visit_str("") = { "type": "string" },
        deserialize_string: visit_str("") = { "type": "string" },
        deserialize_identifier: visit_str("") = { "type": "string" },
        deserialize_unit: visit_unit() = {},
        deserialize_bytes: visit_str("") = { "type": "string" },
        deserialize_byte_buf: visit_str("") = { "type": "string" },
        deserialize_ignored_any: visit_unit() = {},
    }

    /// Types that take several forms say which in their message.
    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Nothing> {
        struct Expecting<'v, V>(&'v V);
        impl<'de, V: Visitor<'de>> fmt::Display for Expecting<'_, V> {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.expecting(f)
            }
        }
        self.leaf(json!({ "description": Expecting(&visitor).to_string() }));
        visitor.visit_f64(1.0)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Nothing> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Result<V::Value, Nothing> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_unit_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Result<V::Value, Nothing> {
        self.deserialize_unit(visitor)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Nothing> {
        self.open(json!({ "type": "array" }), &["item"]);
        self.read_next(|_, next| visitor.visit_seq(One(Some(("item", next)))))
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, count: usize, visitor: V) -> Result<V::Value, Nothing> {
        self.open(json!({ "type": "array", "minItems": count, "maxItems": count }), &["item"]);
        self.read_next(|_, next| visitor.visit_seq(One(Some(("item", next)))))
    }

    fn deserialize_tuple_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        count: usize,
        visitor: V,
    ) -> Result<V::Value, Nothing> {
        self.deserialize_tuple(count, visitor)
    }

    /// Tables with keys of the user's own choice; their values are not looked into.
    fn deserialize_map<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Nothing> {
        self.leaf(json!({ "type": "object" }));
        Err(Nothing)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        keys: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Nothing> {
        // toml's way of handing a place in the file along: its value is what the user writes.
        if name.starts_with("$__") {
            return visitor.visit_map(Placed { keys, at: 0, value: self });
        }
        self.open(json!({ "type": "object" }), keys);
        if keys.is_empty() {
            self.0.borrow_mut().done = true;
            return Err(Nothing);
        }
        self.read_next(|key, next| visitor.visit_map(One(Some((key, next)))))
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        names: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Nothing> {
        // A variant with content of its own is a table with its name as the key.
        self.leaf(json!({ "anyOf": [{ "enum": names }, { "type": "object" }] }));
        match names.first() {
            Some(&first) => visitor.visit_enum(IntoDeserializer::<Nothing>::into_deserializer(first)),
            None => Err(Nothing),
        }
    }
}

/// A map or a list of one.
struct One<'n>(Option<(&'static str, Tracer<'n>)>);

impl<'de> de::MapAccess<'de> for One<'_> {
    type Error = Nothing;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, Nothing> {
        let Some((key, _)) = &self.0 else { return Ok(None) };
        seed.deserialize(BorrowedStrDeserializer::<Nothing>::new(key)).map(Some)
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Nothing> {
        seed.deserialize(self.0.take().ok_or(Nothing)?.1)
    }
}

impl<'de> de::SeqAccess<'de> for One<'_> {
    type Error = Nothing;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Nothing> {
        self.0.take().map(|(_, next)| seed.deserialize(next)).transpose()
    }
}

/// A value with its place: start, end, value.
struct Placed<'n> {
    keys: &'static [&'static str],
    at: usize,
    value: Tracer<'n>,
}

impl<'de> de::MapAccess<'de> for Placed<'_> {
    type Error = Nothing;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, Nothing> {
        let Some(&key) = self.keys.get(self.at) else { return Ok(None) };
        self.at += 1;
        seed.deserialize(BorrowedStrDeserializer::<Nothing>::new(key)).map(Some)
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Nothing> {
        if self.keys[self.at - 1].ends_with("value") {
            return seed.deserialize(Tracer(self.value.0));
        }
        seed.deserialize(0_usize.into_deserializer())
    }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;
    use crate::profile::Length;

    #[derive(Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Kind {
        One,
        Two,
    }

    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "only their types count")]
    struct Inner {
        pairs: Vec<[f64; 2]>,
        kind: Kind,
    }

    #[derive(Deserialize)]
    #[expect(dead_code, reason = "only their types count")]
    struct Outer {
        count: usize,
        word: toml::Spanned<String>,
        length: Option<Length>,
        inner: Option<Inner>,
        many: Vec<Inner>,
    }

    #[test]
    fn every_key_of_a_type_is_found() {
        let schema = shape::<Outer>();
        let keys = &schema["properties"];
        assert_eq!(keys["count"], json!({ "type": "integer", "minimum": 0 }));
        assert_eq!(keys["word"]["type"], "string");
        assert!(keys["length"]["description"].as_str().unwrap().contains("unit"), "{schema:#}");
        for inner in [&keys["inner"], &keys["many"]["items"]] {
            assert_eq!(inner["properties"]["kind"]["anyOf"][0]["enum"], json!(["one", "two"]), "{schema:#}");
            assert_eq!(inner["properties"]["pairs"]["items"]["items"]["type"], "number", "{schema:#}");
            assert_eq!(inner["additionalProperties"], false);
        }
    }
}
