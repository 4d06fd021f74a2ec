//! Rooms: the TOML format, its checks, and the rooms that come with the simulator.

pub mod acoustics;
#[cfg(test)]
mod acoustics_tests;
pub mod gear;
pub mod geometry;
pub mod interpolation;
pub mod path;
pub mod person;
pub mod places;
pub mod scenery;
pub mod sensor;

use crate::room::gear::Gear;
use crate::room::geometry::Point;
use crate::room::interpolation::{between, bracket, rises};
use crate::room::path::{Path, waypoints};
use crate::room::person::Person;
use crate::room::places::{Place, one_or_several};
use crate::room::scenery::{Cylinder, Scenery, Wall};
use crate::room::sensor::Sensor;
use crate::time::Oscillator;
use serde::Deserialize;
use thiserror::Error;

const BUILT_IN: [(&str, &str); 3] = [
    ("paper", include_str!("../../rooms/paper.toml")),
    ("l-shaped", include_str!("../../rooms/l-shaped.toml")),
    ("lounge", include_str!("../../rooms/lounge.toml")),
];
/// Twice what the chip's data sheet allows its internal oscillator.
const WORST_OSCILLATOR: f64 = 0.03;
/// A unit nearer than that to anything does not stand in the room.
const CLEARANCE_M: f64 = 0.02;
const USUAL_AIR_C: f64 = 20.0;
/// The air that the law of the speed of sound is taken to hold for.
pub const COLDEST_AIR_C: f64 = -40.0;
pub const WARMEST_AIR_C: f64 = 60.0;

#[derive(Debug, Error)]
pub enum RoomError {
    #[error("room {name}: {source}; rooms that come with the simulator: {}", built_in())]
    Unreadable { name: String, source: std::io::Error },
    #[error("room {name}: {source}")]
    Malformed { name: String, source: Box<toml::de::Error> },
    #[error("room {name}: {field} {problem}")]
    Wrong { name: String, field: String, problem: String },
}

fn built_in() -> String {
    BUILT_IN.map(|(name, _)| name).join(", ")
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
    air_temperature_c: Option<f64>,
    #[serde(default)]
    air_temperature_schedule: Vec<AirTemperature>,
    #[serde(default)]
    pub sensor: Sensor,
    #[serde(default)]
    motor: Gear,
    #[serde(default, rename = "wall")]
    pub walls: Vec<Wall>,
    #[serde(default, rename = "cylinder")]
    pub cylinders: Vec<Cylinder>,
    #[serde(default, rename = "person")]
    pub people: Vec<Person>,
    pub path: Option<Path>,
    #[serde(default, rename = "unit", deserialize_with = "one_or_several")]
    units: Vec<Place>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct AirTemperature {
    at_s: f64,
    temperature_c: f64,
}

/// The usual linear law.
pub const fn speed_of_sound_m_s(air_temperature_c: f64) -> f64 {
    331.3 + 0.606 * air_temperature_c
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

    /// The places that the room names for its units; none if they are carried along its path.
    pub fn places(&self) -> Vec<Pose> {
        (0..self.units.len()).map(|index| self.standing(index)).collect()
    }

    /// Where unit `index`, counted from 0, stands when nobody carries it.
    pub fn standing(&self, index: usize) -> Pose {
        match self.place(index) {
            Some(place) => Pose { position_m: place.position_m, heading_rad: place.heading_deg.to_radians() },
            None => self.waypoints()[0],
        }
    }

    /// The motor of unit `index`, counted from 0.
    pub fn gear(&self, index: usize) -> Gear {
        self.place(index).and_then(|place| place.motor).unwrap_or(self.motor)
    }

    /// The oscillator of unit `index`, counted from 0, if the room says how far it is off.
    pub fn oscillator(&self, index: usize) -> Option<Oscillator> {
        self.place(index).and_then(|place| place.oscillator_error).map(Oscillator::off_by)
    }

    /// How many units the room has places for, if they share it; `None` if each unit has the room to itself.
    pub fn shared_by(&self) -> Option<usize> {
        (self.units.len() > 1).then_some(self.units.len())
    }

    /// Those who walk through the room, each as a cylinder on its ways, drawn from the seed.
    ///
    /// # Errors
    /// A [`RoomError`] if someone finds no way through the room.
    pub fn walks(&self, seed: u64) -> Result<Vec<Cylinder>, RoomError> {
        let walk = |(index, person): (usize, &Person)| {
            person.walk(self, index, seed).ok_or_else(|| RoomError::Wrong {
                name: self.name.clone(),
                field: format!("person {}", index + 1),
                problem: "finds no way through the room from doors_m".into(),
            })
        };
        self.people.iter().enumerate().map(walk).collect()
    }

    pub fn air_temperature_c(&self, at_s: f64) -> f64 {
        if self.air_temperature_schedule.is_empty() {
            return self.air_temperature_c.unwrap_or(USUAL_AIR_C);
        }
        let (before, after, share) = bracket(&self.air_temperature_schedule, |point| point.at_s, at_s);
        between(before.temperature_c, after.temperature_c, share)
    }

    /// m/s.
    pub fn speed_of_sound(&self, at_s: f64) -> f64 {
        speed_of_sound_m_s(self.air_temperature_c(at_s))
    }

    /// A room with one place gives it to each unit; a unit that shares the room has its own.
    fn place(&self, index: usize) -> Option<&Place> {
        if self.units.len() > 1 { self.units.get(index) } else { self.units.first() }
    }

    /// The first thing wrong with the room: field and problem.
    fn problem(&self) -> Option<(String, &'static str)> {
        let numbered = |what: &str, index: usize, problem| (format!("{what} {}", index + 1), problem);
        let gears = self.units.iter().filter_map(|place| place.motor).chain([self.motor]);
        let walls = self.walls.iter().map(Wall::problem).enumerate();
        let cylinders = self.cylinders.iter().map(Cylinder::problem).enumerate();
        let people = self.people.iter().map(Person::problem).enumerate();
        let of_tables = self.sensor.problem().or_else(|| gears.into_iter().find_map(|gear| gear.problem()));
        of_tables
            .map(|(field, problem)| (field.to_owned(), problem))
            .or_else(|| walls.into_iter().find_map(|(i, found)| Some(numbered("wall", i, found?))))
            .or_else(|| cylinders.into_iter().find_map(|(i, found)| Some(numbered("cylinder", i, found?))))
            .or_else(|| people.into_iter().find_map(|(i, found)| Some(numbered("person", i, found?))))
            .or_else(|| self.problem_of_air())
            .or_else(|| self.problem_of_path())
            .or_else(|| self.problem_of_places())
    }

    fn problem_of_air(&self) -> Option<(String, &'static str)> {
        let schedule = &self.air_temperature_schedule;
        let field = "air_temperature_schedule".to_owned();
        if !schedule.is_empty() && self.air_temperature_c.is_some() {
            return Some((field, "and air_temperature_c exclude each other"));
        }
        if !schedule.is_empty() && !rises(schedule, |point| point.at_s) {
            return Some((field, "needs rising at_s"));
        }
        let sound = COLDEST_AIR_C..=WARMEST_AIR_C;
        let mut temperatures =
            self.air_temperature_c.into_iter().chain(schedule.iter().map(|point| point.temperature_c));
        (!temperatures.all(|temperature_c| sound.contains(&temperature_c)))
            .then_some(("air temperature".to_owned(), "is outside -40 to 60 degrees C"))
    }

    fn problem_of_path(&self) -> Option<(String, &'static str)> {
        match &self.path {
            None if self.units.is_empty() => {
                Some(("path".to_owned(), "is missing, and so is unit: say where the unit is"))
            }
            Some(_) if !self.units.is_empty() => Some(("unit".to_owned(), "and path exclude each other")),
            Some(path) if path.spacing_m <= 0.0 || path.corners_m.len() < 2 => {
                Some(("path".to_owned(), "needs two corners and a positive spacing_m"))
            }
            _ => None,
        }
    }

    /// Whether the units can stand where they are at the beginning, before anything moves.
    fn problem_of_places(&self) -> Option<(String, &'static str)> {
        let scenery = Scenery::at(&self.walls, &self.cylinders, 0.0);
        let on_path = self.waypoints();
        let standing: Vec<Point> = self.units.iter().map(|place| place.position_m).collect();
        let hit = |points: &[Point]| points.iter().position(|&point| scenery.touches(point, CLEARANCE_M));
        if let Some(index) = hit(&on_path.iter().map(|pose| pose.position_m).collect::<Vec<_>>()) {
            return Some((format!("waypoint {index}"), "is inside a cylinder or on a wall"));
        }
        if let Some(index) = hit(&standing) {
            return Some((format!("unit {}", index + 1), "is inside a cylinder or on a wall"));
        }
        let sane = -WORST_OSCILLATOR..=WORST_OSCILLATOR;
        let off = |place: &Place| place.oscillator_error.is_some_and(|error| !sane.contains(&error));
        if let Some(index) = self.units.iter().position(off) {
            return Some((format!("unit {}: oscillator_error", index + 1), "is not from -0.03 to 0.03"));
        }
        let crowded = |(index, &place): (usize, &Point)| {
            standing[..index].iter().any(|&other| other.distance(place) < CLEARANCE_M)
        };
        let second = standing.iter().enumerate().position(crowded)?;
        Some((format!("unit {}", second + 1), "stands where another unit stands"))
    }
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
        assert!(Room::parse("x", &text).unwrap_err().to_string().contains("unit 1"));
    }

    #[test]
    fn a_room_without_a_place_for_the_unit_is_refused() {
        assert!(Room::parse("x", "name = 'x'").unwrap_err().to_string().contains("path"));
    }

    #[test]
    fn sound_travels_at_344_m_s_in_the_papers_room() {
        assert!((Room::load("paper").unwrap().speed_of_sound(0.0) - 344.026).abs() < 1e-9);
    }
    #[test]
    fn several_units_share_a_room_and_may_differ_in_their_motors() {
        let text = "name = 'x'\n[motor]\nbacklash_deg = 0.5\n[[unit]]\nposition_m = [0.0, 0.0]\n\
                    [[unit]]\nposition_m = [1.0, 0.0]\nheading_deg = 90.0\nmotor = { home = 'none' }\n";
        let room = Room::parse("x", text).unwrap();
        assert_eq!(room.shared_by(), Some(2));
        assert_eq!(room.standing(1).position_m, Point::new(1.0, 0.0));
        assert_eq!((room.gear(0).backlash_deg, room.gear(1).backlash_deg), (0.5, 0.0));
        assert_eq!(Room::parse("x", STANDING).unwrap().shared_by(), None);
    }

    #[test]
    fn two_units_in_one_place_are_refused() {
        let text = "name = 'x'\n[[unit]]\nposition_m = [0.0, 0.0]\n[[unit]]\nposition_m = [0.0, 0.01]\n";
        assert!(Room::parse("x", text).unwrap_err().to_string().contains("unit 2"));
    }

    #[test]
    fn an_oscillator_that_no_chip_has_is_refused() {
        let of_error = |error: f64| Room::parse("x", &format!("{STANDING}oscillator_error = {error}\n"));
        assert!(of_error(-0.015).is_ok());
        assert!(of_error(0.031).unwrap_err().to_string().contains("oscillator_error"));
    }

    #[test]
    fn air_that_warms_up_carries_sound_faster() {
        let schedule = "[{ at_s = 0.0, temperature_c = 10.0 }, { at_s = 100.0, temperature_c = 20.0 }]";
        let room = Room::parse("x", &format!("air_temperature_schedule = {schedule}\n{STANDING}")).unwrap();
        assert_eq!(room.air_temperature_c(50.0), 15.0);
        // 10 K is 1.8 % of the speed of sound.
        let ratio = room.speed_of_sound(100.0) / room.speed_of_sound(0.0);
        assert!((ratio - 1.018).abs() < 0.0005, "{ratio}");
    }

    #[test]
    fn air_that_is_colder_or_warmer_than_rooms_are_is_refused() {
        for air in [
            "air_temperature_c = -60.0",
            "air_temperature_c = nan",
            "air_temperature_schedule = [{ at_s = 0.0, temperature_c = 99.0 }]",
        ] {
            let error = Room::parse("x", &format!("{air}\n{STANDING}")).unwrap_err().to_string();
            assert!(error.contains("air temperature"), "{error}");
        }
    }

    #[test]
    fn two_temperatures_of_the_air_are_refused() {
        let text = format!(
            "air_temperature_c = 20.0\nair_temperature_schedule = [{{ at_s = 0.0, temperature_c = 10.0 }}]\n{STANDING}"
        );
        assert!(Room::parse("x", &text).unwrap_err().to_string().contains("air_temperature_schedule"));
    }
}
