//! The sum of all nouns, so that a plan can be checked and a store can hold them.
use super::{
    CreasePattern, CutMesh, DevelopableMesh, Flattening, Folded, Globe, Guides, Milling, Molds, NetFit, Parts, Sheets,
    SourceMesh, Stripes, Strips, Toolpaths,
};
use crate::mesh::TriMesh;

macro_rules! nouns {
    ($($name:ident),* $(,)?) => {
        /// Which noun.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Kind { $(#[doc = stringify!($name)] $name),* }

        /// Any one noun.
        #[derive(Debug, Clone, PartialEq)]
        pub enum Artifact { $(#[doc = stringify!($name)] $name(Box<$name>)),* }

        impl Artifact {
            /// Its kind.
            pub fn kind(&self) -> Kind {
                match self { $(Self::$name(_) => Kind::$name),* }
            }
        }

        $(impl Noun for $name {
            const KIND: Kind = Kind::$name;
            fn wrap(self) -> Artifact {
                Artifact::$name(Box::new(self))
            }
            fn peek(artifact: &Artifact) -> Option<&Self> {
                match artifact {
                    Artifact::$name(it) => Some(it.as_ref()),
                    _ => None,
                }
            }
        })*
    };
}

/// A type that may cross a stage boundary.
pub trait Noun: Sized + Send + Sync + 'static {
    /// Its kind.
    const KIND: Kind;
    /// Into the sum.
    fn wrap(self) -> Artifact;
    /// Out of the sum, if it is this noun.
    fn peek(artifact: &Artifact) -> Option<&Self>;
}

/// Hands the list of all nouns to a macro.
macro_rules! with_nouns {
    ($run:ident) => {
        $run! {
            SourceMesh, Guides, TriMesh, DevelopableMesh, CutMesh, Flattening, Strips, Parts, Sheets, Toolpaths, Milling, Stripes,
            Globe, CreasePattern, Folded, NetFit, Molds
        }
    };
}
pub(crate) use with_nouns;

with_nouns!(nouns);
