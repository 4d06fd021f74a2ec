//! What stands in a room, and where it stands at a given time: walls, cylinders, and the ends where walls meet.

use crate::room::geometry::{Point, Segment};
use crate::room::interpolation::{bracket, rises};
use serde::Deserialize;

/// Walls whose ends are nearer than that meet in a corner.
const JOIN_M: f64 = 1e-3;
const SHORTEST_WALL_M: f64 = 0.01;

/// A wall as a room's file has it: in one place, or on its way from place to place.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wall {
    from_m: Option<Point>,
    to_m: Option<Point>,
    #[serde(default)]
    path: Vec<WallPlace>,
    /// The share of the sound's energy that it swallows.
    #[serde(default)]
    pub absorption: f64,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct WallPlace {
    at_s: f64,
    from_m: Point,
    to_m: Point,
}

impl Wall {
    pub fn segment(&self, at_s: f64) -> Segment {
        if let (Some(from), Some(to)) = (self.from_m, self.to_m) {
            return Segment { from, to };
        }
        let (before, after, share) = bracket(&self.path, |place| place.at_s, at_s);
        Segment { from: before.from_m.toward(after.from_m, share), to: before.to_m.toward(after.to_m, share) }
    }

    pub fn moves(&self) -> bool {
        self.path.len() > 1
    }

    /// Where it is when, in order; nothing if it stands.
    pub fn places(&self) -> Vec<(f64, Segment)> {
        self.path.iter().map(|place| (place.at_s, Segment { from: place.from_m, to: place.to_m })).collect()
    }

    /// The first thing wrong with it.
    pub fn problem(&self) -> Option<&'static str> {
        let standing = self.from_m.is_some() && self.to_m.is_some();
        let neither = self.from_m.is_none() && self.to_m.is_none();
        if standing != self.path.is_empty() || !(standing || neither) {
            return Some("needs from_m and to_m, or else a path");
        }
        if !standing && !rises(&self.path, |place| place.at_s) {
            return Some("has a path without rising at_s");
        }
        let times = self.path.iter().map(|place| place.at_s).chain([0.0]);
        if times.into_iter().any(|at_s| self.segment(at_s).length() < SHORTEST_WALL_M) {
            return Some("is shorter than 1 cm");
        }
        (!(0.0..1.0).contains(&self.absorption)).then_some("has an absorption outside 0 to 1")
    }
}

/// A cylinder as a room's file has it: in one place, or on its way from place to place.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cylinder {
    center_m: Option<Point>,
    #[serde(default)]
    path: Vec<CylinderPlace>,
    pub radius_m: f64,
    /// The share of the sound's energy that it swallows.
    #[serde(default)]
    pub absorption: f64,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct CylinderPlace {
    at_s: f64,
    center_m: Point,
}

impl Cylinder {
    /// One that is where it is at each of those times, which rise.
    pub fn walking(radius_m: f64, absorption: f64, places: Vec<(f64, Point)>) -> Self {
        let path = places.into_iter().map(|(at_s, center_m)| CylinderPlace { at_s, center_m }).collect();
        Self { center_m: None, path, radius_m, absorption }
    }

    pub fn center_m(&self, at_s: f64) -> Point {
        self.center_m.unwrap_or_else(|| {
            let (before, after, share) = bracket(&self.path, |place| place.at_s, at_s);
            before.center_m.toward(after.center_m, share)
        })
    }

    pub fn moves(&self) -> bool {
        self.path.len() > 1
    }

    /// Where it is when, in order; nothing if it stands.
    pub fn places(&self) -> Vec<(f64, Point)> {
        self.path.iter().map(|place| (place.at_s, place.center_m)).collect()
    }

    /// The first thing wrong with it.
    pub fn problem(&self) -> Option<&'static str> {
        if self.center_m.is_some() != self.path.is_empty() {
            return Some("needs center_m, or else a path");
        }
        if self.center_m.is_none() && !rises(&self.path, |place| place.at_s) {
            return Some("has a path without rising at_s");
        }
        if self.radius_m <= 0.0 {
            return Some("has no radius");
        }
        (!(0.0..1.0).contains(&self.absorption)).then_some("has an absorption outside 0 to 1")
    }
}

/// A wall at a point in time.
#[derive(Debug, Clone, Copy)]
pub struct Surface {
    pub segment: Segment,
    /// The share of the sound's energy that it gives back.
    pub reflection: f64,
}

/// A cylinder at a point in time.
#[derive(Debug, Clone, Copy)]
pub struct Pillar {
    pub center_m: Point,
    pub radius_m: f64,
    pub reflection: f64,
}

/// A wall's end: alone, or where it meets another wall.
#[derive(Debug, Clone, Copy)]
pub struct End {
    pub at: Point,
    /// Unit vectors along the walls that meet there, away from it.
    pub walls: Option<(Point, Point)>,
    pub reflection: f64,
}

/// All that stands in a room at a point in time.
#[derive(Debug, Clone)]
pub struct Scenery {
    pub walls: Vec<Surface>,
    pub cylinders: Vec<Pillar>,
    pub ends: Vec<End>,
}

impl Scenery {
    pub fn at(walls: &[Wall], cylinders: &[Cylinder], at_s: f64) -> Self {
        let walls: Vec<Surface> = walls
            .iter()
            .map(|wall| Surface { segment: wall.segment(at_s), reflection: 1.0 - wall.absorption })
            .collect();
        let cylinders = cylinders
            .iter()
            .map(|cylinder| Pillar {
                center_m: cylinder.center_m(at_s),
                radius_m: cylinder.radius_m,
                reflection: 1.0 - cylinder.absorption,
            })
            .collect();
        let ends = ends_of(&walls);
        Self { walls, cylinders, ends }
    }

    /// Whether nothing stands between two points, of which the second may lie on what stands there.
    pub fn sees(&self, from: Point, target: Point) -> bool {
        let way = Segment { from, to: target };
        let clear_of = |pillar: &Pillar| way.distance(pillar.center_m) >= pillar.radius_m - JOIN_M;
        !self.walls.iter().any(|wall| wall.segment.crosses(&way)) && self.cylinders.iter().all(clear_of)
    }

    /// Whether a point is nearer than `clearance_m` to something, or inside of it.
    pub fn touches(&self, point: Point, clearance_m: f64) -> bool {
        self.walls.iter().any(|wall| wall.segment.distance(point) < clearance_m)
            || self.cylinders.iter().any(|c| c.center_m.distance(point) < c.radius_m + clearance_m)
    }
}

/// A wall's end on its own.
struct Tip {
    at: Point,
    direction: Point,
    reflection: f64,
}

fn ends_of(walls: &[Surface]) -> Vec<End> {
    let tips: Vec<Tip> = walls
        .iter()
        .flat_map(|&Surface { segment: Segment { from, to }, reflection }| {
            [(from, to), (to, from)].map(|(at, other)| Tip {
                at,
                direction: at.direction_to(other),
                reflection,
            })
        })
        .collect();
    let mut ends = Vec::new();
    for (index, tip) in tips.iter().enumerate() {
        let mut meeting = tips.iter().enumerate().filter(|(_, other)| other.at.distance(tip.at) < JOIN_M);
        let (walls, reflection) = match meeting.find(|&(other, _)| other != index) {
            Some((other, second)) if other > index => {
                (Some((tip.direction, second.direction)), tip.reflection * second.reflection)
            }
            Some(_) => continue,
            None => (None, tip.reflection),
        };
        ends.push(End { at: tip.at, walls, reflection });
    }
    ends
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cylinder(text: &str) -> Cylinder {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn a_cylinder_with_a_path_is_where_the_path_says_at_every_time() {
        let moving = cylinder(
            "radius_m = 0.1\npath = [{ at_s = 10.0, center_m = [0.0, 0.0] }, { at_s = 20.0, center_m = [2.0, 1.0] }]",
        );
        assert_eq!(moving.problem(), None);
        assert!(moving.moves());
        let places = [0.0, 10.0, 15.0, 30.0].map(|at_s| moving.center_m(at_s));
        assert_eq!(places, [(0.0, 0.0), (0.0, 0.0), (1.0, 0.5), (2.0, 1.0)].map(|(x, y)| Point::new(x, y)));
    }

    #[test]
    fn a_wall_may_swing_like_a_door() {
        let door: Wall = toml::from_str(
            "path = [{ at_s = 0.0, from_m = [0.0, 0.0], to_m = [1.0, 0.0] }, { at_s = 2.0, from_m = [0.0, 0.0], to_m = [0.0, 1.0] }]",
        )
        .unwrap();
        assert_eq!(door.problem(), None);
        assert_eq!(door.segment(1.0).to, Point::new(0.5, 0.5));
    }

    #[test]
    fn what_has_two_places_or_none_is_refused() {
        for text in [
            "radius_m = 0.1",
            "radius_m = 0.1\ncenter_m = [0.0, 0.0]\npath = [{ at_s = 0.0, center_m = [0.0, 0.0] }]",
        ] {
            assert!(cylinder(text).problem().unwrap().contains("center_m"), "{text}");
        }
        let half: Wall = toml::from_str("from_m = [0.0, 0.0]").unwrap();
        assert!(half.problem().is_some());
    }

    #[test]
    fn a_path_that_goes_back_in_time_and_an_absorption_of_1_are_refused() {
        let back = cylinder(
            "radius_m = 0.1\npath = [{ at_s = 1.0, center_m = [0.0, 0.0] }, { at_s = 0.0, center_m = [1.0, 0.0] }]",
        );
        assert!(back.problem().unwrap().contains("at_s"));
        let black = cylinder("radius_m = 0.1\ncenter_m = [0.0, 0.0]\nabsorption = 1.0");
        assert!(black.problem().unwrap().contains("absorption"));
    }
}
