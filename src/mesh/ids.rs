//! Typed element ids and per-element data that lives beside the mesh.
use std::{
    marker::PhantomData,
    ops::{Index, IndexMut},
};

/// An element id: a dense index that cannot be mistaken for another kind of element.
pub trait Id: Copy {
    /// From a dense index.
    fn new(index: usize) -> Self;
    /// The dense index.
    fn index(self) -> usize;
}

macro_rules! ids {
    ($($(#[$doc:meta])* $name:ident),* $(,)?) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub u32);
        impl Id for $name {
            fn new(index: usize) -> Self {
                Self(u32::try_from(index).expect("TriMesh::new refuses meshes with more than 2^30 elements"))
            }
            fn index(self) -> usize {
                self.0 as usize
            }
        }
        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                self.0.fmt(f)
            }
        }
    )*};
}

ids! {
    /// A vertex.
    VertexId,
    /// A face; its halfedges are `3 f`, `3 f + 1`, `3 f + 2`.
    FaceId,
    /// A directed edge of one face. Also names the corner at its tail.
    HalfedgeId,
    /// An undirected edge.
    EdgeId,
}

/// One value per element, in id order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Field<I, T> {
    values: Vec<T>,
    id: PhantomData<fn(I)>,
}

impl<I: Id, T> Field<I, T> {
    /// From values in id order.
    pub fn from_vec(values: Vec<T>) -> Self {
        Self { values, id: PhantomData }
    }

    /// `len` values, each made from its id.
    pub fn from_fn(len: usize, mut value: impl FnMut(I) -> T) -> Self {
        Self::from_vec((0..len).map(|i| value(I::new(i))).collect())
    }

    /// Number of elements.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there are no elements.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The values in id order.
    pub fn as_slice(&self) -> &[T] {
        &self.values
    }

    /// The values in id order, mutable.
    pub fn as_mut_slice(&mut self) -> &mut [T] {
        &mut self.values
    }

    /// The values, by value.
    pub fn into_vec(self) -> Vec<T> {
        self.values
    }

    /// The values in id order.
    pub fn iter(&self) -> std::slice::Iter<'_, T> {
        self.values.iter()
    }

    /// Ids with their values.
    pub fn enumerate(&self) -> impl Iterator<Item = (I, &T)> {
        self.values.iter().enumerate().map(|(i, value)| (I::new(i), value))
    }
}

impl<I: Id, T: Clone> Field<I, T> {
    /// `len` copies of `value`.
    pub fn filled(len: usize, value: T) -> Self {
        Self::from_vec(vec![value; len])
    }
}

impl<I: Id, T> Index<I> for Field<I, T> {
    type Output = T;
    fn index(&self, id: I) -> &T {
        &self.values[id.index()]
    }
}

impl<I: Id, T> IndexMut<I> for Field<I, T> {
    fn index_mut(&mut self, id: I) -> &mut T {
        &mut self.values[id.index()]
    }
}
