//! Rules for values that have the right type.

/// A value that no machine or material can have, at a dotted key.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fault {
    pub(super) key: String,
    pub(super) message: String,
}

impl Fault {
    pub(super) fn new(key: &str, message: impl Into<String>) -> Self {
        Self { key: key.into(), message: message.into() }
    }
}

/// A profile that can be checked once it has been read.
pub(super) trait Rule {
    /// The first fault.
    fn check(&self) -> Result<(), Fault>;
    /// Sets the name that it was asked for by.
    fn rename(&mut self, name: String);
}

pub(super) fn positive(key: &str, value: f64) -> Result<(), Fault> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(Fault::new(key, format!("must be a finite number above 0, not {value}")))
}

pub(super) fn at_least_zero(key: &str, value: f64) -> Result<(), Fault> {
    if value.is_finite() && value >= 0.0 {
        return Ok(());
    }
    Err(Fault::new(key, format!("must be a finite number, 0 or more, not {value}")))
}

pub(super) fn within(key: &str, value: f64, min: f64, max: f64) -> Result<(), Fault> {
    if (min..=max).contains(&value) {
        return Ok(());
    }
    Err(Fault::new(key, format!("must be between {min} and {max}, not {value}")))
}
