//! What an HC-SR04 hears in a room: smooth surfaces answer like mirrors, and the nearest answer wins.
//!
//! A wall answers from the foot of its perpendicular, a concave corner by double bounce, a cylinder from its nearest
//! point, an edge weakly and close by; each only inside the lobe and where nothing stands in between.

use crate::geometry::{Point, Segment, wrap_rad};
use crate::room::{Cylinder, Room};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::FRAC_PI_2;

pub const SHORTEST_RANGE_M: f64 = 0.02;
pub const LONGEST_RANGE_M: f64 = 4.0;
/// Above a right angle a corner answers ever more rarely: by 1/e every so many radians. Assumed.
const OBTUSE_DECAY_RAD: f64 = 10.0 / 180.0 * std::f64::consts::PI;
/// An edge answers every other time right in front of it, and never from there on. Assumed.
const EDGE_CHANCE: f64 = 0.5;
const EDGE_RANGE_M: f64 = 0.8;
/// A cylinder of 9 cm is heard out to 2 m; others by the square root of their radius (a curved mirror's echo).
const CYLINDER_RANGE_M: f64 = 2.0;
const CYLINDER_RADIUS_M: f64 = 0.09;
/// A receiver that misses a cycle of 40 kHz finds the echo 25 us late, that is 4.3 mm further.
const LATE_CYCLE_M: f64 = 0.0043;
/// Walls whose ends are nearer than that meet in a corner.
const JOIN_M: f64 = 1e-3;

/// An answer that the sensor may hear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Echo {
    pub range_m: f64,
    /// How often it is heard.
    pub chance: f64,
}

/// A wall's end: alone, or where it meets another wall.
#[derive(Debug, Clone, Copy)]
struct End {
    at: Point,
    /// Unit vectors along the walls that meet there, away from it.
    walls: Option<(Point, Point)>,
}

/// A room as the sensor sees it.
pub struct Scene {
    room: Room,
    walls: Vec<Segment>,
    ends: Vec<End>,
}

impl Scene {
    pub fn new(room: Room) -> Self {
        let walls: Vec<Segment> = room.walls.iter().map(|wall| wall.segment()).collect();
        let ends = ends_of(&walls);
        Self { room, walls, ends }
    }

    pub fn room(&self) -> &Room {
        &self.room
    }

    /// One ping from `from` along `axis_rad`: the measured range, or `None` if nothing is heard.
    pub fn ping(&self, from: Point, axis_rad: f64, rng: &mut impl Rng) -> Option<f64> {
        let sensor = &self.room.sensor;
        if rng.random_bool(sensor.false_echo_probability) {
            return Some(rng.random_range(SHORTEST_RANGE_M..LONGEST_RANGE_M));
        }
        let heard = self.echoes(from, axis_rad).into_iter().find(|echo| rng.random_bool(echo.chance))?;
        if rng.random_bool(sensor.lost_echo_probability) {
            return None;
        }
        let noise: f64 = StandardNormal.sample(rng);
        let late = if rng.random_bool(sensor.late_echo_probability) { rng.random_range(1..=2) } else { 0 };
        let range_m = heard.range_m
            + sensor.range_bias_m
            + sensor.range_sigma_m * noise
            + f64::from(late) * LATE_CYCLE_M;
        Some(range_m.max(SHORTEST_RANGE_M))
    }

    /// What may answer, nearest first.
    pub fn echoes(&self, from: Point, axis_rad: f64) -> Vec<Echo> {
        let walls = self.walls.iter().filter_map(|wall| self.wall_echo(wall, from, axis_rad));
        let cylinders = self.room.cylinders.iter().filter_map(|c| self.cylinder_echo(c, from, axis_rad));
        let ends = self.ends.iter().filter_map(|end| self.end_echo(end, from, axis_rad));
        let mut echoes: Vec<Echo> = walls
            .chain(cylinders)
            .chain(ends)
            .filter(|echo| (SHORTEST_RANGE_M..=LONGEST_RANGE_M).contains(&echo.range_m))
            .collect();
        echoes.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
        echoes
    }

    fn wall_echo(&self, wall: &Segment, from: Point, axis_rad: f64) -> Option<Echo> {
        let foot = wall.foot(from)?;
        let range_m = foot.distance(from);
        let heard = self.in_lobe(from, axis_rad, foot, range_m, 0.0) && self.sees(from, foot);
        heard.then_some(Echo { range_m, chance: 1.0 })
    }

    fn cylinder_echo(&self, cylinder: &Cylinder, from: Point, axis_rad: f64) -> Option<Echo> {
        let range_m = cylinder.center_m.distance(from) - cylinder.radius_m;
        let reach_m = CYLINDER_RANGE_M * (cylinder.radius_m / CYLINDER_RADIUS_M).sqrt();
        let nearest = from.along(from.direction_to(cylinder.center_m), range_m);
        let heard = range_m <= reach_m
            && self.in_lobe(from, axis_rad, nearest, range_m, 0.0)
            && self.sees(from, nearest);
        heard.then_some(Echo { range_m, chance: 1.0 })
    }

    fn end_echo(&self, end: &End, from: Point, axis_rad: f64) -> Option<Echo> {
        let distance_m = end.at.distance(from);
        let (range_m, chance, spread_rad) = match concave_angle(end, from) {
            // The two ways round a sharp corner leave and return 90 deg - a to either side of its point.
            Some(angle) if angle < FRAC_PI_2 => (distance_m * angle.sin(), 1.0, FRAC_PI_2 - angle),
            Some(angle) => (distance_m, (-(angle - FRAC_PI_2) / OBTUSE_DECAY_RAD).exp(), 0.0),
            None => (distance_m, EDGE_CHANCE * (1.0 - distance_m / EDGE_RANGE_M), 0.0),
        };
        let heard = chance > 0.0
            && self.in_lobe(from, axis_rad, end.at, range_m, spread_rad)
            && self.sees(from, end.at);
        heard.then_some(Echo { range_m, chance })
    }

    fn in_lobe(&self, from: Point, axis_rad: f64, target: Point, range_m: f64, spread_rad: f64) -> bool {
        let off_axis = wrap_rad(from.bearing_to(target) - axis_rad).abs();
        off_axis + spread_rad <= self.room.sensor.half_beam_rad(range_m)
    }

    /// Whether nothing stands between the sensor and the point that answers.
    fn sees(&self, from: Point, target: Point) -> bool {
        let way = Segment { from, to: target };
        let clear_of = |cylinder: &Cylinder| way.distance(cylinder.center_m) >= cylinder.radius_m - JOIN_M;
        !self.walls.iter().any(|wall| wall.crosses(&way)) && self.room.cylinders.iter().all(clear_of)
    }
}

/// The interior angle of the corner on the sensor's side if it is concave there, else `None`.
fn concave_angle(end: &End, from: Point) -> Option<f64> {
    let (first, second) = end.walls?;
    let turn = first.cross(second);
    let sensor = end.at.direction_to(from);
    let between = first.cross(sensor) * turn > 0.0 && sensor.cross(second) * turn > 0.0;
    between.then(|| first.dot(second).clamp(-1.0, 1.0).acos())
}

fn ends_of(walls: &[Segment]) -> Vec<End> {
    let tips: Vec<(Point, Point)> = walls
        .iter()
        .flat_map(|wall| {
            [(wall.from, wall.from.direction_to(wall.to)), (wall.to, wall.to.direction_to(wall.from))]
        })
        .collect();
    let mut ends = Vec::new();
    for (index, &(at, direction)) in tips.iter().enumerate() {
        let mut meeting = tips.iter().enumerate().filter(|(_, tip)| tip.0.distance(at) < JOIN_M);
        match meeting.find(|&(other, _)| other != index) {
            Some((other, &(_, second))) if other > index => {
                ends.push(End { at, walls: Some((direction, second)) })
            }
            Some(_) => {}
            None => ends.push(End { at, walls: None }),
        }
    }
    ends
}
