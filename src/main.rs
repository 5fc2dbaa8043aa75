//! The `fabricate` command.

fn main() {}
