//! People who walk through a room now and then: in by a door, from place to place, out by a door, all drawn from the seed.

use crate::random::{Part, stream};
use crate::room::Room;
use crate::room::geometry::{Point, Segment};
use crate::room::interpolation::between;
use crate::room::scenery::{Cylinder, Scenery};
use rand::{Rng, RngExt};
use serde::Deserialize;

/// How long people come and go; later nobody comes any more.
const DAY_S: f64 = 86_400.0;
/// A leisurely walk indoors.
const PACE_M_S: f64 = 0.8;
/// Places where someone stops on the way, and for how long.
const STOPS: std::ops::RangeInclusive<usize> = 1..=3;
const STOP_S: std::ops::Range<f64> = 0.5..4.0;
/// What people keep free between themselves and what stands in the room.
const CLEARANCE_M: f64 = 0.1;
/// Ways through the room that are drawn before it counts as blocked.
const TRIES: usize = 20_000;

/// Someone as a room's file has them: a cylinder that waits behind one of its doors until it comes in.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Person {
    pub radius_m: f64,
    /// Places outside the room, from which one wall is walked through straight ahead.
    pub doors_m: Vec<Point>,
    /// From one visit to the next: at least and at most.
    away_s: [f64; 2],
    #[serde(default)]
    absorption: f64,
}

impl Person {
    /// The first thing wrong with it.
    pub fn problem(&self) -> Option<&'static str> {
        if self.doors_m.is_empty() {
            return Some("needs a place in doors_m");
        }
        let [least, most] = self.away_s;
        if !(least > 0.0 && least < most && most.is_finite()) {
            return Some("needs away_s as [least, most], both positive");
        }
        Cylinder::walking(self.radius_m, self.absorption, vec![(0.0, self.doors_m[0])]).problem()
    }

    /// Person `index` of the room, counted from 0, on its ways of a day; `None` if it finds no way through the room.
    pub fn walk(&self, room: &Room, index: usize, seed: u64) -> Option<Cylinder> {
        let mut rng = stream(seed.wrapping_add(index as u64), Part::People);
        let floor = Floor::of(room, self.radius_m);
        let mut door = self.doors_m[rng.random_range(..self.doors_m.len())];
        let mut places = vec![(0.0, door)];
        let mut at_s = 0.0;
        while at_s < DAY_S {
            at_s += rng.random_range(self.away_s[0]..self.away_s[1]);
            places.push((at_s, door));
            let way = self.way(&floor, door, &mut rng)?;
            for leg in way.windows(2) {
                at_s += leg[0].distance(leg[1]) / PACE_M_S;
                places.push((at_s, leg[1]));
                at_s += rng.random_range(STOP_S);
                places.push((at_s, leg[1]));
            }
            door = way[way.len() - 1];
        }
        Some(Cylinder::walking(self.radius_m, self.absorption, places))
    }

    /// One visit, from door to door.
    fn way(&self, floor: &Floor, door: Point, rng: &mut impl Rng) -> Option<Vec<Point>> {
        let stops = rng.random_range(STOPS);
        (0..TRIES).find_map(|_| {
            let out = self.doors_m[rng.random_range(..self.doors_m.len())];
            let mut way = vec![door];
            way.extend((0..stops).map(|_| floor.place(rng)));
            way.push(out);
            let last = way.len() - 2;
            let walls = |leg: usize| usize::from(leg == 0) + usize::from(leg == last);
            (0..=last).all(|leg| floor.is_free(way[leg], way[leg + 1], walls(leg))).then_some(way)
        })
    }
}

/// Where someone of that girth can walk: what stands in the room, and the box around it.
struct Floor {
    scenery: Scenery,
    units: Vec<Point>,
    radius_m: f64,
    least: Point,
    most: Point,
}

impl Floor {
    fn of(room: &Room, radius_m: f64) -> Self {
        let scenery = Scenery::at(&room.walls, &room.cylinders, 0.0);
        let ends = || scenery.walls.iter().flat_map(|wall| [wall.segment.from, wall.segment.to]);
        let least = ends().reduce(|a, b| Point::new(a.x.min(b.x), a.y.min(b.y))).unwrap_or_default();
        let most = ends().reduce(|a, b| Point::new(a.x.max(b.x), a.y.max(b.y))).unwrap_or_default();
        let units = room.places().into_iter().chain(room.waypoints()).map(|pose| pose.position_m).collect();
        Self { scenery, units, radius_m, least, most }
    }

    /// Anywhere in the box.
    fn place(&self, rng: &mut impl Rng) -> Point {
        let x = between(self.least.x, self.most.x, rng.random());
        Point::new(x, between(self.least.y, self.most.y, rng.random()))
    }

    /// Whether the straight way goes through so many walls, those of a door, and keeps clear of all else.
    fn is_free(&self, from: Point, to: Point, doors: usize) -> bool {
        let way = Segment { from, to };
        let room_m = self.radius_m + CLEARANCE_M;
        let walls = &self.scenery.walls;
        walls.iter().filter(|wall| wall.segment.crosses(&way)).count() == doors
            && walls.iter().all(|wall| [from, to].iter().all(|&end| wall.segment.distance(end) > room_m))
            && self.scenery.cylinders.iter().all(|c| way.distance(c.center_m) > c.radius_m + room_m)
            && self.units.iter().all(|&unit| way.distance(unit) > room_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR_S: f64 = 3600.0;
    const LOOK_EVERY_S: f64 = 0.1;

    fn looks() -> impl Iterator<Item = f64> {
        (0..(HOUR_S / LOOK_EVERY_S) as usize).map(|look| look as f64 * LOOK_EVERY_S)
    }

    fn lounge() -> (Room, Cylinder) {
        let room = Room::load("lounge").unwrap();
        let walk = room.walks(1).unwrap().remove(0);
        (room, walk)
    }

    #[test]
    fn the_same_seed_gives_the_same_ways_and_another_one_others() {
        let room = Room::load("lounge").unwrap();
        let ways = |seed| room.walks(seed).unwrap()[0].places();
        assert_eq!(ways(1), ways(1));
        assert_ne!(ways(1), ways(2));
    }

    #[test]
    fn someone_comes_again_and_again_and_is_outside_for_most_of_the_time() {
        let (_, walk) = lounge();
        let inside = |at_s: f64| {
            let Point { x, y } = walk.center_m(at_s);
            (0.0..5.0).contains(&x) && (0.0..3.5).contains(&y)
        };
        let seen: Vec<bool> = looks().map(inside).collect();
        let visits = seen.windows(2).filter(|pair| !pair[0] && pair[1]).count();
        let share = seen.iter().filter(|inside| **inside).count() as f64 / seen.len() as f64;
        // Away for 40 to 100 s: an hour has no more than 90 visits, and not less than 36 unless one takes over 30 s.
        assert!((30..=90).contains(&visits), "{visits} visits");
        assert!((0.05..0.5).contains(&share), "{share}");
    }

    #[test]
    fn people_run_into_nothing_and_no_unit_and_come_no_faster_than_they_walk() {
        let (room, walk) = lounge();
        let standing = Scenery::at(&[], &room.cylinders, 0.0);
        for at_s in looks() {
            let place = walk.center_m(at_s);
            assert!(!standing.touches(place, walk.radius_m), "{place:?}");
            assert!(room.places().iter().all(|unit| unit.position_m.distance(place) > walk.radius_m));
            let gone_m = place.distance(walk.center_m(at_s + LOOK_EVERY_S));
            assert!(gone_m < PACE_M_S * LOOK_EVERY_S + 1e-9);
        }
    }

    #[test]
    fn who_finds_no_way_in_is_refused_with_room_and_person() {
        let lounge = include_str!("../../rooms/lounge.toml");
        let inside = lounge.replace("[[-0.6, 2.6], [5.6, 1.6]]", "[[2.0, 1.0]]");
        let error = Room::parse("x", &inside).unwrap().walks(1).unwrap_err().to_string();
        assert!(
            error.contains("lounge") && error.contains("person 1") && error.contains("doors_m"),
            "{error}"
        );
    }

    #[test]
    fn what_can_not_be_a_person_is_refused() {
        let lounge = include_str!("../../rooms/lounge.toml");
        for (sound, wrong, field) in [
            ("[[-0.6, 2.6], [5.6, 1.6]]", "[]", "doors_m"),
            ("[40.0, 100.0]", "[100.0, 40.0]", "away_s"),
            ("radius_m = 0.22", "radius_m = -0.22", "radius"),
        ] {
            let error = Room::parse("x", &lounge.replace(sound, wrong)).unwrap_err().to_string();
            assert!(error.contains("person 1") && error.contains(field), "{error}");
        }
    }
}
