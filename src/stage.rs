//! What a stage is, and how its types are erased so that a plan can be checked and a result cached.
use std::{collections::BTreeMap, error::Error as StdError, sync::Arc};

use serde::{Serialize, de::DeserializeOwned};
use serde_json::{Map, Value, json};
use toml::{Spanned, de::DeTable};

use crate::{
    model::{Artifact, Kind, Noun},
    numeric::Monitor,
    profile::{Profiles, shape},
};

/// What a run hands to every stage.
#[derive(Clone, Copy)]
pub struct Cx<'a> {
    /// Seed of everything that is drawn by chance. Part of the cache key only where [`Stage::DRAWS`] says so.
    pub seed: u64,
    /// Cancellation, progress and laps, to hand down to kernels.
    pub monitor: Monitor<'a>,
    /// What the same stage had given to `keep` when it was interrupted at the same work.
    pub kept: Option<&'a Artifact>,
    /// Keeps an unfinished result, so that the stage can go on from it after an interruption. The latest replaces those before.
    pub keep: &'a dyn Fn(Artifact),
}

/// A promise that was kept or missed.
#[derive(Debug, Clone, PartialEq, Serialize, serde::Deserialize)]
pub struct Check {
    /// Short name, `stage.what`.
    pub name: String,
    /// Whether it holds.
    pub ok: bool,
    /// What was measured.
    pub value: f64,
    /// What was promised.
    pub limit: f64,
    /// Unit of both.
    pub unit: String,
    /// For a person: where, and what to do when it failed.
    pub note: String,
}

impl Check {
    /// A check that holds when `value <= limit`.
    pub fn at_most(name: &str, value: f64, limit: f64, unit: &str, note: impl Into<String>) -> Self {
        Self { name: name.into(), ok: value <= limit, value, limit, unit: unit.into(), note: note.into() }
    }
    /// A check that holds when `value >= limit`.
    pub fn at_least(name: &str, value: f64, limit: f64, unit: &str, note: impl Into<String>) -> Self {
        Self { ok: value >= limit, ..Self::at_most(name, value, limit, unit, note) }
    }
}

/// What a stage says about its result: its tables of `report.json` and its checks.
#[derive(Debug, Clone, Default, PartialEq, Serialize, serde::Deserialize)]
pub struct Section {
    /// Top-level keys of the report (CONTRACT.md) with their tables; most stages write one, flatten also `seams`.
    pub tables: Map<String, Value>,
    /// Promises kept or missed.
    pub checks: Vec<Check>,
}

/// Share of its depth by which the neutral layer may be missed: a quarter of the thickness where it lies in the middle.
const NEUTRAL: f64 = 0.5;

impl Section {
    /// One table and no checks: `Section::new("coarsen", json!({ "faces": 800 }))`.
    pub fn new(name: &str, table: Value) -> Self {
        Self::default().table(name, table)
    }
    /// Adds a table.
    pub fn table(mut self, name: &str, table: Value) -> Self {
        self.tables.insert(name.into(), table);
        self
    }
    /// Adds what the thickness of the material did to the surface, unless it lies `offset` = 0 mm off: the difference between
    /// how far planes moved and that, as `usual` on 99 % of the area and the `largest` one, mm, and the number of vertices that
    /// had no room to go so far.
    pub fn neutral_layer(self, offset: f64, [usual, largest]: [f64; 2], shortened: usize) -> Self {
        if offset == 0.0 {
            return self;
        }
        let table = json!({
            "offset_mm": offset,
            "p99_error_mm": usual,
            "max_error_mm": largest,
            "shortened_vertices": shortened,
        });
        let note = format!(
            "99 % of the area lies so near to the layer {:.2} mm under the surface that keeps its length; in needle points and pits \
             at most {largest:.2} mm off",
            -offset
        );
        let limit = NEUTRAL * offset.abs();
        self.table("neutral_layer", table).check(Check::at_most("neutral_layer", usual, limit, "mm", note))
    }
    /// Adds a check.
    pub fn check(mut self, check: Check) -> Self {
        self.checks.push(check);
        self
    }
}

/// A value of a table that has the right type but not a possible value.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("`{key}` {message}")]
pub struct KeyError {
    /// The key in the table.
    pub key: &'static str,
    /// What is wrong and what is possible: "must be between 3 and 10000000, not 2".
    pub message: String,
}

impl KeyError {
    /// `Err` unless `min <= value <= max` (so NaN is refused too).
    pub fn range(key: &'static str, value: f64, min: f64, max: f64) -> Result<(), Self> {
        if (min..=max).contains(&value) {
            return Ok(());
        }
        Err(Self { key, message: format!("must be between {min} and {max}, not {value}") })
    }
}

/// What a stage reads: one noun or a tuple of nouns.
pub trait Inputs {
    /// The borrowed form handed to `run`.
    type Refs<'a>: Copy;
    /// Kinds read.
    const KINDS: &'static [Kind];
    /// Kinds read where an earlier stage makes them.
    const WANTS: &'static [Kind] = &[];
    /// Fetches them; `None` if one is missing, which the plan has excluded.
    fn fetch(store: &Store) -> Option<Self::Refs<'_>>;
}

impl<A: Noun> Inputs for A {
    type Refs<'a> = &'a A;
    const KINDS: &'static [Kind] = &[A::KIND];
    fn fetch(store: &Store) -> Option<&A> {
        store.get()
    }
}

impl<A: Noun, B: Noun> Inputs for (A, Option<B>) {
    type Refs<'a> = (&'a A, Option<&'a B>);
    const KINDS: &'static [Kind] = &[A::KIND];
    const WANTS: &'static [Kind] = &[B::KIND];
    fn fetch(store: &Store) -> Option<Self::Refs<'_>> {
        Some((store.get()?, store.get()))
    }
}

impl<A: Noun, B: Noun> Inputs for (A, B) {
    type Refs<'a> = (&'a A, &'a B);
    const KINDS: &'static [Kind] = &[A::KIND, B::KIND];
    fn fetch(store: &Store) -> Option<(&A, &B)> {
        Some((store.get()?, store.get()?))
    }
}

impl<A: Noun, B: Noun, C: Noun> Inputs for (A, B, C) {
    type Refs<'a> = (&'a A, &'a B, &'a C);
    const KINDS: &'static [Kind] = &[A::KIND, B::KIND, C::KIND];
    fn fetch(store: &Store) -> Option<(&A, &B, &C)> {
        Some((store.get()?, store.get()?, store.get()?))
    }
}

impl<A: Noun, B: Noun, C: Noun> Inputs for (A, B, Option<C>) {
    type Refs<'a> = (&'a A, &'a B, Option<&'a C>);
    const KINDS: &'static [Kind] = &[A::KIND, B::KIND];
    const WANTS: &'static [Kind] = &[C::KIND];
    fn fetch(store: &Store) -> Option<(&A, &B, Option<&C>)> {
        Some((store.get()?, store.get()?, store.get()))
    }
}

impl<A: Noun, B: Noun, C: Noun, D: Noun> Inputs for (A, B, Option<C>, Option<D>) {
    type Refs<'a> = (&'a A, &'a B, Option<&'a C>, Option<&'a D>);
    const KINDS: &'static [Kind] = &[A::KIND, B::KIND];
    const WANTS: &'static [Kind] = &[C::KIND, D::KIND];
    fn fetch(store: &Store) -> Option<Self::Refs<'_>> {
        Some((store.get()?, store.get()?, store.get(), store.get()))
    }
}

impl<A: Noun, B: Noun, C: Noun, D: Noun, E: Noun> Inputs for (A, B, Option<C>, Option<D>, Option<E>) {
    type Refs<'a> = (&'a A, &'a B, Option<&'a C>, Option<&'a D>, Option<&'a E>);
    const KINDS: &'static [Kind] = &[A::KIND, B::KIND];
    const WANTS: &'static [Kind] = &[C::KIND, D::KIND, E::KIND];
    fn fetch(store: &Store) -> Option<Self::Refs<'_>> {
        Some((store.get()?, store.get()?, store.get(), store.get(), store.get()))
    }
}

/// What a stage makes: one noun or a few.
pub trait Outputs: Sized + Send + Sync + 'static {
    /// Kinds made.
    const KINDS: &'static [Kind];
    /// The nouns, in the order of their kinds.
    fn artifacts(self) -> Vec<Artifact>;
}

impl<A: Noun> Outputs for A {
    const KINDS: &'static [Kind] = &[A::KIND];
    fn artifacts(self) -> Vec<Artifact> {
        vec![self.wrap()]
    }
}

impl<A: Noun, B: Noun> Outputs for (A, B) {
    const KINDS: &'static [Kind] = &[A::KIND, B::KIND];
    fn artifacts(self) -> Vec<Artifact> {
        vec![self.0.wrap(), self.1.wrap()]
    }
}

impl<A: Noun, B: Noun, C: Noun> Outputs for (A, B, C) {
    const KINDS: &'static [Kind] = &[A::KIND, B::KIND, C::KIND];
    fn artifacts(self) -> Vec<Artifact> {
        vec![self.0.wrap(), self.1.wrap(), self.2.wrap()]
    }
}

impl<A: Noun, B: Noun, C: Noun, D: Noun> Outputs for (A, B, C, D) {
    const KINDS: &'static [Kind] = &[A::KIND, B::KIND, C::KIND, D::KIND];
    fn artifacts(self) -> Vec<Artifact> {
        vec![self.0.wrap(), self.1.wrap(), self.2.wrap(), self.3.wrap()]
    }
}

/// One step of a pipeline; `self` is its config table, the only home of its defaults and units.
pub trait Stage: Serialize + DeserializeOwned + Send + Sync + 'static {
    /// Name of the config table.
    const NAME: &'static str;
    /// Raise when the same input may give another output.
    const VERSION: u32;
    /// Whether the result depends on the seed.
    const DRAWS: bool = false;
    /// Nouns read.
    type Input: Inputs;
    /// Nouns made.
    type Output: Outputs;
    /// The profile values that it reads; they are part of the cache key. `()` for none.
    type Profile: Serialize + Send + Sync + 'static;
    /// What can go wrong.
    type Error: StdError + Send + Sync + 'static;

    /// Picks the profile values that the stage reads.
    fn profile(profiles: &Profiles) -> Self::Profile;
    /// Refuses values out of range, before anything runs.
    fn check(&self) -> Result<(), KeyError> {
        Ok(())
    }
    /// Converts the table to kernel options and calls the kernel.
    fn run(
        &self,
        input: <Self::Input as Inputs>::Refs<'_>,
        profile: &Self::Profile,
        cx: &Cx,
    ) -> Result<Self::Output, Self::Error>;
    /// Measures the result for the report. Cached with it.
    fn section(
        &self,
        input: <Self::Input as Inputs>::Refs<'_>,
        profile: &Self::Profile,
        output: &Self::Output,
    ) -> Section;
}

/// A cache key: a BLAKE3 hash.
pub type Key = [u8; 32];

/// The artifacts made so far, the latest of each kind, with the key of how each was made.
#[derive(Debug, Default)]
pub struct Store(BTreeMap<Kind, (Arc<Artifact>, Key)>);

impl Store {
    /// Puts an artifact.
    pub fn put(&mut self, artifact: Artifact, key: Key) {
        self.0.insert(artifact.kind(), (Arc::new(artifact), key));
    }
    /// Typed look-up.
    pub fn get<N: Noun>(&self) -> Option<&N> {
        self.0.get(&N::KIND).and_then(|(it, _)| N::peek(it))
    }
    /// Key of the latest of that kind.
    pub fn key(&self, kind: Kind) -> Option<Key> {
        self.0.get(&kind).map(|it| it.1)
    }
}

/// Why a table does not become a stage.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// Unknown key, wrong type or variant; the error carries its span.
    #[error(transparent)]
    Shape(#[from] toml::de::Error),
    /// A value out of range.
    #[error(transparent)]
    Value(#[from] KeyError),
}

type RunError = Box<dyn StdError + Send + Sync>;
type Run = Box<dyn Fn(&Store, &Cx) -> Result<(Vec<Artifact>, Section), RunError> + Send + Sync>;

/// A parsed stage, ready to run.
pub struct Ready {
    /// Options with all defaults, for the report.
    pub options: Value,
    /// Hash of name, version, options, profile values and (where it draws) the seed; the keys of the inputs come on top.
    pub options_key: Key,
    /// The call.
    pub run: Run,
}

/// A stage with its types erased: one row of the registry.
#[derive(Clone, Copy)]
pub struct StageDef {
    /// Config table name.
    pub name: &'static str,
    /// Kinds read.
    pub needs: &'static [Kind],
    /// Kinds read where they are made.
    pub wants: &'static [Kind],
    /// Kinds made.
    pub makes: &'static [Kind],
    /// Parses the table.
    pub prepare: for<'t> fn(Spanned<DeTable<'t>>, &Profiles, u64) -> Result<Ready, TableError>,
    /// JSON schema of the table.
    pub shape: fn() -> Value,
}

impl StageDef {
    /// Erases `S`.
    pub const fn of<S: Stage>() -> Self {
        Self {
            name: S::NAME,
            needs: <S::Input as Inputs>::KINDS,
            wants: <S::Input as Inputs>::WANTS,
            makes: <S::Output as Outputs>::KINDS,
            prepare: prepare::<S>,
            shape: shape::<S>,
        }
    }
}

fn prepare<S: Stage>(table: Spanned<DeTable<'_>>, profiles: &Profiles, seed: u64) -> Result<Ready, TableError> {
    let stage = S::deserialize(toml::de::Deserializer::from(table))?;
    stage.check()?;
    let profile = S::profile(profiles);
    let json =
        |it: Result<Value, serde_json::Error>| it.expect("config tables and profiles are plain data with string keys");
    let options = json(serde_json::to_value(&stage));
    let mut hasher = blake3::Hasher::new();
    let drawn = if S::DRAWS { seed.to_string() } else { String::new() };
    let values = json(serde_json::to_value(&profile)).to_string();
    for field in [S::NAME, &S::VERSION.to_string(), &options.to_string(), &values, &drawn] {
        hasher.update(&(field.len() as u64).to_le_bytes());
        hasher.update(field.as_bytes());
    }
    let run: Run = Box::new(move |store, cx| {
        let input = S::Input::fetch(store).expect("the plan proved that every input is made");
        let output = stage.run(input, &profile, cx).map_err(Box::new)?;
        let section = stage.section(input, &profile, &output);
        Ok((output.artifacts(), section))
    });
    Ok(Ready { options, options_key: *hasher.finalize().as_bytes(), run })
}
