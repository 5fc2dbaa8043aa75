//! `fabricate inspect`: what is in a file, with the same checks as our own files get.
use std::path::Path;

use serde_json::{Value, json};

use super::{Exit, show};
use crate::{import::mesh as reader, mesh::{RepairOptions, repair, Component}};
