//! develop
