//! Operations as profiles write them: by name in kebab case, one value per operation.
use std::{collections::BTreeMap, fmt, ops::Index};

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use crate::model::Operation;

/// An operation written by its name; an unknown one is refused with the list of names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Named(pub(super) Operation);

struct NameVisitor;

impl de::Visitor<'_> for NameVisitor {
    type Value = Named;
    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = Operation::ALL.iter().map(|it| it.name()).collect();
        write!(f, "the name of an operation: {}", names.join(", "))
    }
    fn visit_str<E: de::Error>(self, text: &str) -> Result<Named, E> {
        let found = Operation::ALL.into_iter().find(|it| it.name() == text);
        found.map(Named).ok_or_else(|| E::invalid_value(de::Unexpected::Str(text), &self))
    }
}

impl<'de> Deserialize<'de> for Named {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_str(NameVisitor)
    }
}

impl Serialize for Named {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.0.name())
    }
}

/// At most one value per operation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct PerOperation<T>(BTreeMap<Named, T>);

impl<T> PerOperation<T> {
    /// The value of an operation, if there is one.
    pub fn get(&self, operation: Operation) -> Option<&T> {
        self.0.get(&Named(operation))
    }

    /// Operations that have a value, with it.
    pub fn iter(&self) -> impl Iterator<Item = (Operation, &T)> {
        self.0.iter().map(|(it, value)| (it.0, value))
    }

    pub(crate) fn get_mut(&mut self, operation: Operation) -> Option<&mut T> {
        self.0.get_mut(&Named(operation))
    }
}

impl<T> Default for PerOperation<T> {
    fn default() -> Self {
        Self(BTreeMap::new())
    }
}

impl<T> FromIterator<(Operation, T)> for PerOperation<T> {
    fn from_iter<I: IntoIterator<Item = (Operation, T)>>(values: I) -> Self {
        Self(values.into_iter().map(|(operation, value)| (Named(operation), value)).collect())
    }
}

/// Every operation once, in the order of work.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Order(Vec<Named>);

impl Order {
    /// The operations, first to last.
    pub fn iter(&self) -> impl Iterator<Item = Operation> {
        self.0.iter().map(|it| it.0)
    }

    /// Position of an operation in the order of work.
    pub fn rank(&self, operation: Operation) -> usize {
        self.0.iter().position(|it| it.0 == operation).unwrap_or(self.0.len())
    }

    /// The first operation that is missing or named twice.
    pub(super) fn fault(&self) -> Option<Operation> {
        Operation::ALL.into_iter().find(|&it| self.iter().filter(|&other| other == it).count() != 1)
    }
}

impl Default for Order {
    fn default() -> Self {
        Self(Operation::ALL.map(Named).to_vec())
    }
}

impl<T> Index<Operation> for PerOperation<T> {
    type Output = T;
    /// Panics where the operation has no value: only for tables that [`super::Machine`] checked to be complete.
    fn index(&self, operation: Operation) -> &T {
        self.get(operation).expect("the loader refuses profiles whose layers are incomplete")
    }
}
