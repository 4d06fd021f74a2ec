//! The places of a room's units in its TOML file: `[unit]` is one, `[[unit]]` any number.

use crate::room::gear::Gear;
use crate::room::geometry::Point;
use serde::Deserialize;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserializer, MapAccess, SeqAccess, Visitor};
use std::fmt;

/// Where a unit stands, and what is different about its motor.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    pub position_m: Point,
    #[serde(default)]
    pub heading_deg: f64,
    pub motor: Option<Gear>,
    /// The share by which its clock is fast; else it is drawn.
    pub oscillator_error: Option<f64>,
}

/// # Errors
/// Those of the deserializer, and its own if there is neither a table nor a list of them.
pub fn one_or_several<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Place>, D::Error> {
    deserializer.deserialize_any(Places)
}

struct Places;

impl<'de> Visitor<'de> for Places {
    type Value = Vec<Place>;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("a table [unit] or tables [[unit]]")
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        Place::deserialize(MapAccessDeserializer::new(map)).map(|place| vec![place])
    }

    fn visit_seq<A: SeqAccess<'de>>(self, sequence: A) -> Result<Self::Value, A::Error> {
        Vec::deserialize(SeqAccessDeserializer::new(sequence))
    }
}
