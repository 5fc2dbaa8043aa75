//! Lengths and angles as people write them; inside everything is millimetres and radians.
use std::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// Millimetres per unit.
const UNITS: &[(&str, f64)] =
    &[("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("um", 1e-3), ("µm", 1e-3), ("in", 25.4), ("ft", 304.8)];

/// A length, written as a number of millimetres or as a string with a unit: `3`, `"3 mm"`, `"0.5 in"`.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
pub struct Length {
    /// Millimetres.
    pub mm: f64,
}

/// A length, or a share of the diagonal of the input's bounding box: `"2 mm"` or `"1 %"`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Extent {
    /// Millimetres.
    Length(Length),
    /// Percent of the diagonal.
    Percent(f64),
}

/// An angle, written in degrees.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct Angle {
    /// Radians.
    pub radians: f64,
}

impl Length {
    /// From millimetres.
    pub const fn mm(mm: f64) -> Self {
        Self { mm }
    }
}

impl Extent {
    /// Millimetres, given the diagonal that percentages refer to.
    pub fn resolve(self, diagonal: f64) -> f64 {
        match self {
            Self::Length(length) => length.mm,
            Self::Percent(percent) => percent / 100.0 * diagonal,
        }
    }
}

impl Angle {
    /// From degrees.
    pub const fn degrees(degrees: f64) -> Self {
        Self { radians: degrees.to_radians() }
    }
}

/// Splits "12.5 mm" into number and unit.
fn quantity(text: &str) -> Option<(f64, &str)> {
    let text = text.trim();
    // `e` belongs to the number only when digits follow ("1e3 mm"), so try the longest prefix that parses.
    let cut = (1..=text.len())
        .rev()
        .filter(|&i| text.is_char_boundary(i))
        .find(|&i| text[..i].trim().parse::<f64>().is_ok())?;
    Some((text[..cut].trim().parse().ok()?, text[cut..].trim()))
}

/// Millimetres of "12.5 mm"; the unit may be missing.
fn length(text: &str) -> Option<Length> {
    let (value, unit) = quantity(text)?;
    let factor = if unit.is_empty() { 1.0 } else { UNITS.iter().find(|it| it.0 == unit)?.1 };
    Some(Length::mm(value * factor))
}

struct LengthVisitor;

impl de::Visitor<'_> for LengthVisitor {
    type Value = Length;
    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a length: a number of millimetres, or a string with a unit (mm, cm, m, um, in, ft) like \"2 mm\"")
    }
    fn visit_f64<E: de::Error>(self, mm: f64) -> Result<Length, E> {
        Ok(Length::mm(mm))
    }
    fn visit_i64<E: de::Error>(self, mm: i64) -> Result<Length, E> {
        Ok(Length::mm(mm as f64))
    }
    fn visit_str<E: de::Error>(self, text: &str) -> Result<Length, E> {
        length(text).ok_or_else(|| E::invalid_value(de::Unexpected::Str(text), &self))
    }
}

impl<'de> Deserialize<'de> for Length {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(LengthVisitor)
    }
}

impl Serialize for Length {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_f64(self.mm)
    }
}

struct ExtentVisitor;

impl de::Visitor<'_> for ExtentVisitor {
    type Value = Extent;
    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a length like \"2 mm\" or a share of the diagonal like \"1 %\"")
    }
    fn visit_f64<E: de::Error>(self, mm: f64) -> Result<Extent, E> {
        Ok(Extent::Length(Length::mm(mm)))
    }
    fn visit_i64<E: de::Error>(self, mm: i64) -> Result<Extent, E> {
        Ok(Extent::Length(Length::mm(mm as f64)))
    }
    fn visit_str<E: de::Error>(self, text: &str) -> Result<Extent, E> {
        match quantity(text) {
            Some((value, "%")) => Ok(Extent::Percent(value)),
            _ => length(text).map(Extent::Length).ok_or_else(|| E::invalid_value(de::Unexpected::Str(text), &self)),
        }
    }
}

impl<'de> Deserialize<'de> for Extent {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ExtentVisitor)
    }
}

impl Serialize for Extent {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Length(length) => length.serialize(serializer),
            Self::Percent(percent) => serializer.serialize_str(&format!("{percent} %")),
        }
    }
}

impl<'de> Deserialize<'de> for Angle {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        f64::deserialize(deserializer).map(Self::degrees)
    }
}

impl Serialize for Angle {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_f64(self.radians.to_degrees())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_as_people_write_them() {
        for (text, mm) in
            [("2 mm", 2.0), ("2mm", 2.0), ("0.5 in", 12.7), ("1e2 cm", 1000.0), ("-3", -3.0), ("1 m", 1000.0)]
        {
            assert_eq!(length(text).map(|it| it.mm), Some(mm), "{text}");
        }
        for text in ["", "mm", "2 miles", "2 m m", "two mm"] {
            assert_eq!(length(text), None, "{text}");
        }
    }

    #[test]
    fn extents_in_percent() {
        let extent: Extent = serde_json::from_str("\"1 %\"").unwrap();
        assert_eq!(extent, Extent::Percent(1.0));
        assert_eq!(extent.resolve(300.0), 3.0);
        assert_eq!(serde_json::to_string(&extent).unwrap(), "\"1 %\"");
    }
}
