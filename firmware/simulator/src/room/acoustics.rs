//! What an HC-SR04 hears in a room: smooth surfaces answer like mirrors, and the nearest answer wins.
//!
//! A wall answers from the foot of its perpendicular, a concave corner by double bounce, a cylinder from its nearest
//! point, an edge weakly and close by; each only inside the lobe and where nothing stands in between. What swallows a
//! share of the energy is heard less far, by the square root of what is left (the amplitude of a mirror's echo falls
//! with the range), and less often, by what is left (assumed).

use crate::room::Room;
use crate::room::geometry::{Point, wrap_rad};
use crate::room::scenery::{Cylinder, End, Pillar, Scenery, Surface};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};
use std::borrow::Cow;
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
/// How often each further bounce between a surface and the unit's own face is heard. Assumed.
const BOUNCE_CHANCE: f64 = 0.5;

/// An answer that the sensor may hear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Echo {
    pub range_m: f64,
    /// The direction it comes from, in the room.
    pub from_rad: f64,
    /// How often it is heard.
    pub chance: f64,
}

/// A sensor in the room: where it is, where it looks, when.
#[derive(Debug, Clone, Copy)]
pub struct Look {
    pub from: Point,
    pub axis_rad: f64,
    pub at_s: f64,
}

/// A room as the sensor sees it.
pub struct Scene {
    room: Room,
    /// The room's and those who walk through it.
    cylinders: Vec<Cylinder>,
    /// What stands in the room, if nothing moves.
    still: Option<Scenery>,
}

impl Scene {
    /// The room with nobody in it.
    #[cfg(test)]
    pub fn new(room: Room) -> Self {
        Self::with_people(room, Vec::new())
    }

    /// The room with those who walk through it.
    pub fn with_people(room: Room, walks: Vec<Cylinder>) -> Self {
        let cylinders = [room.cylinders.clone(), walks].concat();
        let moves = room.walls.iter().any(|wall| wall.moves()) || cylinders.iter().any(|c| c.moves());
        let still = (!moves).then(|| Scenery::at(&room.walls, &cylinders, 0.0));
        Self { room, cylinders, still }
    }

    pub fn room(&self) -> &Room {
        &self.room
    }

    pub fn scenery(&self, at_s: f64) -> Cow<'_, Scenery> {
        match &self.still {
            Some(scenery) => Cow::Borrowed(scenery),
            None => Cow::Owned(Scenery::at(&self.room.walls, &self.cylinders, at_s)),
        }
    }

    /// One ping: the measured range, or `None` if nothing is heard.
    pub fn ping(&self, look: &Look, rng: &mut impl Rng) -> Option<f64> {
        let sensor = &self.room.sensor;
        if rng.random_bool(sensor.false_echo_probability) {
            return Some(rng.random_range(SHORTEST_RANGE_M..LONGEST_RANGE_M));
        }
        let heard = self.echoes(look).into_iter().find(|echo| rng.random_bool(echo.chance))?;
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
    pub fn echoes(&self, look: &Look) -> Vec<Echo> {
        let mut echoes = self.answers(look);
        echoes.retain(|echo| (SHORTEST_RANGE_M..=LONGEST_RANGE_M).contains(&echo.range_m));
        echoes.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
        echoes
    }

    /// What is left of a ping: sound that goes to and fro between what answers and the unit's own face, each time more
    /// rarely heard, until it has gone `longest_m` there and back again. Ranges are half of the way.
    pub fn reverberation(&self, look: &Look, longest_m: f64) -> Vec<Echo> {
        let bounces = |echo: &Echo| {
            let Echo { range_m, from_rad, chance } = *echo;
            (1..).map(move |count| Echo {
                range_m: range_m * f64::from(count),
                from_rad,
                chance: chance.powi(count) * BOUNCE_CHANCE.powi(count - 1),
            })
        };
        let audible = |echo: &Echo| 2.0 * echo.range_m <= longest_m;
        let mut late: Vec<Echo> =
            self.echoes(look).iter().flat_map(|echo| bounces(echo).take_while(audible)).collect();
        late.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
        late
    }

    /// Whether a sensor that looks along `axis_rad` hears what comes from `from_rad` after a way of twice `range_m`.
    pub fn in_lobe(&self, axis_rad: f64, from_rad: f64, range_m: f64) -> bool {
        wrap_rad(from_rad - axis_rad).abs() <= self.room.sensor.half_beam_rad(range_m)
    }

    fn answers(&self, look: &Look) -> Vec<Echo> {
        let scenery = self.scenery(look.at_s);
        let walls = scenery.walls.iter().filter_map(|wall| self.wall_echo(&scenery, wall, look));
        let cylinders = scenery.cylinders.iter().filter_map(|c| self.cylinder_echo(&scenery, c, look));
        let ends = scenery.ends.iter().filter_map(|end| self.end_echo(&scenery, end, look));
        walls.chain(cylinders).chain(ends).collect()
    }

    fn wall_echo(&self, scenery: &Scenery, wall: &Surface, look: &Look) -> Option<Echo> {
        let foot = wall.segment.foot(look.from)?;
        let range_m = foot.distance(look.from);
        let from_rad = look.from.bearing_to(foot);
        let heard = range_m <= LONGEST_RANGE_M * wall.reflection.sqrt()
            && self.in_lobe(look.axis_rad, from_rad, range_m)
            && scenery.sees(look.from, foot);
        heard.then_some(Echo { range_m, from_rad, chance: wall.reflection })
    }

    fn cylinder_echo(&self, scenery: &Scenery, cylinder: &Pillar, look: &Look) -> Option<Echo> {
        let range_m = cylinder.center_m.distance(look.from) - cylinder.radius_m;
        let reach_m = CYLINDER_RANGE_M * (cylinder.reflection * cylinder.radius_m / CYLINDER_RADIUS_M).sqrt();
        let nearest = look.from.along(look.from.direction_to(cylinder.center_m), range_m);
        let from_rad = look.from.bearing_to(nearest);
        let heard = range_m <= reach_m
            && self.in_lobe(look.axis_rad, from_rad, range_m)
            && scenery.sees(look.from, nearest);
        heard.then_some(Echo { range_m, from_rad, chance: cylinder.reflection })
    }

    fn end_echo(&self, scenery: &Scenery, end: &End, look: &Look) -> Option<Echo> {
        let distance_m = end.at.distance(look.from);
        let (range_m, chance, spread_rad) = match concave_angle(end, look.from) {
            // The two ways round a sharp corner leave and return 90 deg - a to either side of its point.
            Some(angle) if angle < FRAC_PI_2 => (distance_m * angle.sin(), 1.0, FRAC_PI_2 - angle),
            Some(angle) => (distance_m, (-(angle - FRAC_PI_2) / OBTUSE_DECAY_RAD).exp(), 0.0),
            None => (distance_m, EDGE_CHANCE * (1.0 - distance_m / EDGE_RANGE_M), 0.0),
        };
        let from_rad = look.from.bearing_to(end.at);
        let off_axis = wrap_rad(from_rad - look.axis_rad).abs();
        let heard = chance > 0.0
            && range_m <= LONGEST_RANGE_M * end.reflection.sqrt()
            && off_axis + spread_rad <= self.room.sensor.half_beam_rad(range_m)
            && scenery.sees(look.from, end.at);
        heard.then_some(Echo { range_m, from_rad, chance: chance * end.reflection })
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
