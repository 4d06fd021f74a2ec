//! The air that units share in one room: a burst of one is heard by another that listens, straight or off a wall.
//!
//! A burst is heard like an echo that has come the same way: where the way leaves the one unit inside its lobe and
//! reaches the other inside its own, up to twice the longest range. It is taken from wall to wall by images, one wall
//! at most. Corners and cylinders pass on nothing to others: they scatter, and what is left is weak. Assumed.

use crate::room::acoustics::{LONGEST_RANGE_M, Look, Scene};
use crate::room::geometry::{Point, Segment};
use crate::room::scenery::Scenery;
use crate::room::{Pose, WARMEST_AIR_C, speed_of_sound_m_s};
use crate::time::{NEVER, TICKS_PER_MS, Tick, from_seconds};
use crate::world::sonar::ECHO_LAG;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// Faster than sound in the warmest air, by so much that it also covers the instruction by which a unit may run ahead.
const FASTEST_SOUND_M_S: f64 = 1.01 * speed_of_sound_m_s(WARMEST_AIR_C);
/// What arrived longer ago than any ping lasts has found nobody listening.
const FORGOTTEN: Tick = 100 * TICKS_PER_MS;

/// Sound on its way to a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrival {
    pub at: Tick,
    /// The direction that it comes from, in the room.
    pub from_rad: f64,
    /// Half of the way that it has come.
    pub range_m: f64,
    pub chance: f64,
    /// Another unit has sent it.
    pub of_another: bool,
}

pub struct Air {
    scene: Rc<Scene>,
    ears: Vec<Pose>,
    /// What is on its way to each unit, soonest first.
    on_the_way: RefCell<Vec<VecDeque<Arrival>>>,
}

impl Air {
    /// The air around units that stand in these places.
    pub fn new(scene: Rc<Scene>, ears: Vec<Pose>) -> Self {
        let on_the_way = RefCell::new(vec![VecDeque::new(); ears.len()]);
        Self { scene, ears, on_the_way }
    }

    /// How long after any moment nothing of what a unit does then can have reached another: so long may one unit be run
    /// ahead of the others. `None` if there is nobody else.
    pub fn lookahead(&self) -> Option<Tick> {
        let pairs = self.ears.iter().enumerate().flat_map(|(index, ear)| {
            self.ears[..index].iter().map(|other| other.position_m.distance(ear.position_m))
        });
        let nearest_m = pairs.min_by(f64::total_cmp)?;
        Some(ECHO_LAG + from_seconds(nearest_m / FASTEST_SOUND_M_S))
    }

    /// Unit `index` sends a burst along `axis_rad`, from which flights are counted as from `at`.
    pub fn burst(&self, index: usize, look: &Look, at: Tick) {
        let scenery = self.scene.scenery(look.at_s);
        for (other, ear) in self.ears.iter().enumerate().filter(|(other, _)| *other != index) {
            let arrivals = self.ways(&scenery, look, ear.position_m, at);
            let mut on_the_way = self.on_the_way.borrow_mut();
            let queue = &mut on_the_way[other];
            while queue.front().is_some_and(|first| first.at + FORGOTTEN < at) {
                queue.pop_front();
            }
            for arrival in arrivals {
                let place = queue.partition_point(|other| other.at <= arrival.at);
                queue.insert(place, arrival);
            }
        }
    }

    /// When the next sound reaches unit `index`.
    pub fn next_arrival(&self, index: usize) -> Tick {
        self.on_the_way.borrow()[index].front().map_or(NEVER, |arrival| arrival.at)
    }

    /// What has reached unit `index` by `now`, one at a time.
    pub fn take(&self, index: usize, now: Tick) -> Option<Arrival> {
        let queue = &mut self.on_the_way.borrow_mut()[index];
        if queue.front()?.at > now { None } else { queue.pop_front() }
    }

    fn ways(&self, scenery: &Scenery, look: &Look, ear: Point, at: Tick) -> Vec<Arrival> {
        let straight = scenery.sees(look.from, ear).then_some(Way {
            first: ear,
            last: look.from,
            image: look.from,
            chance: 1.0,
        });
        let mirrored = scenery.walls.iter().filter_map(|wall| {
            let image = wall.segment.image(look.from);
            let mirror = Segment { from: image, to: ear }.crossing(&wall.segment)?;
            let clear = scenery.sees(look.from, mirror) && scenery.sees(ear, mirror);
            clear.then_some(Way { first: mirror, last: mirror, image, chance: wall.reflection })
        });
        straight.into_iter().chain(mirrored).filter_map(|way| self.arrival(&way, look, ear, at)).collect()
    }

    fn arrival(&self, way: &Way, look: &Look, ear: Point, at: Tick) -> Option<Arrival> {
        let range_m = way.image.distance(ear) / 2.0;
        let leaves_rad = look.from.bearing_to(way.first);
        let heard = range_m <= LONGEST_RANGE_M * way.chance.sqrt()
            && self.scene.in_lobe(look.axis_rad, leaves_rad, range_m);
        let flight = from_seconds(2.0 * range_m / self.scene.room().speed_of_sound(look.at_s));
        let from_rad = ear.bearing_to(way.last);
        heard.then_some(Arrival { at: at + flight, from_rad, range_m, chance: way.chance, of_another: true })
    }
}

/// A way from a sender to a listener.
struct Way {
    /// Where it goes first, and where it comes from at last.
    first: Point,
    last: Point,
    /// Where the sender seems to be.
    image: Point,
    chance: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::room::Room;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

    /// Two units 2 m apart in what the text says.
    fn air(objects: &str) -> Air {
        let units = "[[unit]]\nposition_m = [0.0, 0.0]\n[[unit]]\nposition_m = [2.0, 0.0]\n";
        let room = Room::parse("x", &format!("name = 'x'\n{objects}{units}")).unwrap();
        let ears = vec![room.standing(0), room.standing(1)];
        Air::new(Rc::new(Scene::new(room)), ears)
    }

    const WALL: &str = "[[wall]]\nfrom_m = [-3.0, 1.0]\nto_m = [5.0, 1.0]\n";

    fn heard(air: &Air, axis_rad: f64) -> Vec<Arrival> {
        air.burst(0, &Look { from: Point::default(), axis_rad, at_s: 0.0 }, 1000);
        std::iter::from_fn(|| air.take(1, NEVER)).collect()
    }

    #[test]
    fn a_unit_that_is_looked_at_hears_the_burst_after_its_flight() {
        let arrivals = heard(&air(""), 0.0);
        assert_eq!(arrivals.len(), 1);
        assert_eq!(arrivals[0].at, 1000 + from_seconds(2.0 / (331.3 + 0.606 * 20.0)));
        assert!((arrivals[0].from_rad.abs() - PI).abs() < 1e-12);
        assert_eq!(heard(&air(""), FRAC_PI_2), []);
    }

    #[test]
    fn a_burst_comes_off_a_wall_from_where_the_wall_mirrors_it() {
        let arrivals = heard(&air(WALL), FRAC_PI_4);
        assert_eq!(arrivals.len(), 1);
        assert!((arrivals[0].range_m - 2f64.sqrt()).abs() < 1e-12);
        assert!((arrivals[0].from_rad - 3.0 * FRAC_PI_4).abs() < 1e-12);
    }

    #[test]
    fn what_stands_in_between_stops_the_burst() {
        assert_eq!(heard(&air("[[cylinder]]\ncenter_m = [1.0, 0.0]\nradius_m = 0.1\n"), 0.0), []);
    }

    #[test]
    fn in_the_warmest_air_nothing_arrives_within_the_lookahead() {
        let air = air("air_temperature_c = 60.0\n");
        assert!(heard(&air, 0.0)[0].at - 1000 + ECHO_LAG > air.lookahead().unwrap());
    }

    #[test]
    fn a_unit_may_run_ahead_as_long_as_sound_takes_to_the_nearest_other() {
        let lookahead = air("").lookahead().unwrap();
        assert!(lookahead > from_seconds(2.0 / 371.4) && lookahead < from_seconds(2.0 / 330.0));
    }

    #[test]
    fn sound_that_nobody_listened_to_is_forgotten() {
        let air = air("");
        for count in 0..1000 {
            air.burst(
                0,
                &Look { from: Point::default(), axis_rad: 0.0, at_s: 0.0 },
                count * 60 * TICKS_PER_MS,
            );
        }
        assert!(air.on_the_way.borrow()[1].len() < 5);
    }
}
