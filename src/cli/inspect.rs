//! `fabricate inspect`: what is in a file, with the same checks as our own files get.
use std::path::Path;

use super::Exit;

/// x
pub(super) fn inspect(_: &Path, _: bool) -> Exit { Exit::Done }
