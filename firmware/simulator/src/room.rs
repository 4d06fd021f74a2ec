//! Rooms: the TOML format, its checks, and the rooms that come with the simulator.

use crate::geometry::{Point, Segment};
use crate::path::{Path, waypoints};
use crate::sensor::Sensor;
use serde::Deserialize;
use thiserror::Error;

const BUILT_IN: [(&str, &str); 2] =
    [("paper", include_str!("../rooms/paper.toml")), ("l-shaped", include_str!("../rooms/l-shaped.toml"))];
/// A unit nearer than that to anything does not stand in the room.
const CLEARANCE_M: f64 = 0.02;

#[derive(Debug, Error)]
pub enum RoomError {
    #[error("room {name}: {source}; rooms that come with the simulator: paper, l-shaped")]
    Unreadable { name: String, source: std::io::Error },
    #[error("room {name}: {source}")]
    Malformed { name: String, source: Box<toml::de::Error> },
    #[error("room {name}: {field} {problem}")]
    Wrong { name: String, field: String, problem: String },
}

/// A place and a direction: metres and radians, anticlockwise from the x axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    pub position_m: Point,
    pub heading_rad: f64,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Room {
    pub name: String,
    #[serde(default = "twenty")]
    pub air_temperature_c: f64,
    #[serde(default)]
    pub sensor: Sensor,
    #[serde(default, rename = "wall")]
    pub walls: Vec<Wall>,
    #[serde(default, rename = "cylinder")]
    pub cylinders: Vec<Cylinder>,
    path: Option<Path>,
    unit: Option<Unit>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wall {
    from_m: Point,
    to_m: Point,
}

impl Wall {
    pub fn segment(&self) -> Segment {
        Segment { from: self.from_m, to: self.to_m }
    }
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cylinder {
    pub center_m: Point,
    pub radius_m: f64,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct Unit {
    position_m: Point,
    #[serde(default)]
    heading_deg: f64,
}

impl Room {
    /// The built-in room of that name, or the room in that file.
    ///
    /// # Errors
    /// A [`RoomError`] naming the room, and the field if it is not as it should be.
    pub fn load(name: &str) -> Result<Self, RoomError> {
        if let Some((_, text)) = BUILT_IN.iter().find(|(built_in, _)| *built_in == name) {
            return Self::parse(name, text);
        }
        let text = std::fs::read_to_string(name)
            .map_err(|source| RoomError::Unreadable { name: name.into(), source })?;
        Self::parse(name, &text)
    }

    /// # Errors
    /// As [`Room::load`].
    pub fn parse(name: &str, text: &str) -> Result<Self, RoomError> {
        let room: Self = toml::from_str(text)
            .map_err(|source| RoomError::Malformed { name: name.into(), source: Box::new(source) })?;
        match room.problem() {
            None => Ok(room),
            Some((field, problem)) => {
                Err(RoomError::Wrong { name: name.into(), field, problem: problem.into() })
            }
        }
    }

    /// The poses that the unit is carried to; empty if it stands still.
    pub fn waypoints(&self) -> Vec<Pose> {
        self.path.as_ref().map(waypoints).unwrap_or_default()
    }

    /// Where the unit stands when nobody carries it.
    pub fn standing(&self) -> Pose {
        match self.unit {
            Some(unit) => Pose { position_m: unit.position_m, heading_rad: unit.heading_deg.to_radians() },
            None => self.waypoints()[0],
        }
    }

    /// m/s, by the usual linear law.
    pub fn speed_of_sound(&self) -> f64 {
        331.3 + 0.606 * self.air_temperature_c
    }

    /// The first thing wrong with the room: field and problem.
    fn problem(&self) -> Option<(String, &'static str)> {
        let found = |field: &str, problem| Some((field.to_owned(), problem));
        if let Some((field, problem)) = self.sensor.problem() {
            return found(field, problem);
        }
        if let Some(index) = self.walls.iter().position(|wall| wall.segment().length() < 0.01) {
            return Some((format!("wall {}", index + 1), "is shorter than 1 cm"));
        }
        if let Some(index) = self.cylinders.iter().position(|cylinder| cylinder.radius_m <= 0.0) {
            return Some((format!("cylinder {}", index + 1), "has no radius"));
        }
        match (&self.path, self.unit) {
            (None, None) => return found("path", "is missing, and so is unit: say where the unit is"),
            (Some(_), Some(_)) => return found("unit", "and path exclude each other"),
            (Some(path), None) if path.spacing_m <= 0.0 || path.corners_m.len() < 2 => {
                return found("path", "needs two corners and a positive spacing_m");
            }
            _ => {}
        }
        let poses = self.waypoints();
        let places = if poses.is_empty() { vec![self.standing()] } else { poses };
        let hit = places.iter().position(|pose| self.collides(pose.position_m))?;
        Some((format!("waypoint {hit}"), "is inside a cylinder or on a wall"))
    }

    fn collides(&self, point: Point) -> bool {
        self.walls.iter().any(|wall| wall.segment().distance(point) < CLEARANCE_M)
            || self.cylinders.iter().any(|c| c.center_m.distance(point) < c.radius_m + CLEARANCE_M)
    }
}

fn twenty() -> f64 {
    20.0
}

#[cfg(test)]
mod tests {
    use super::*;

    const STANDING: &str = "name = 'x'\n[unit]\nposition_m = [0.0, 0.0]\n";

    #[test]
    fn the_built_in_rooms_are_sound() {
        for (name, _) in BUILT_IN {
            assert_eq!(Room::load(name).unwrap().name, name);
        }
    }

    #[test]
    fn an_unknown_field_is_named_with_its_room() {
        let error =
            Room::parse("attic.toml", &format!("colour = 'red'\n{STANDING}")).unwrap_err().to_string();
        assert!(error.contains("attic.toml") && error.contains("colour"), "{error}");
    }

    #[test]
    fn a_unit_in_a_cylinder_is_refused() {
        let text = format!("{STANDING}[[cylinder]]\ncenter_m = [0.1, 0.0]\nradius_m = 0.2\n");
        assert!(Room::parse("x", &text).unwrap_err().to_string().contains("waypoint 0"));
    }

    #[test]
    fn a_room_without_a_place_for_the_unit_is_refused() {
        assert!(Room::parse("x", "name = 'x'").unwrap_err().to_string().contains("path"));
    }

    #[test]
    fn sound_travels_at_344_m_s_in_the_papers_room() {
        assert!((Room::load("paper").unwrap().speed_of_sound() - 344.026).abs() < 1e-9);
    }
}
