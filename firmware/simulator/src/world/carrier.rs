//! Who carries the unit along the room's path: waits for the LED, walks to the next waypoint, presses the button.

use crate::room::Pose;
use crate::time::{NEVER, TICKS_PER_MS, Tick, from_seconds};

/// A person who steps aside, turns and sets a stand down. Assumed.
const WALKING_SPEED_M_S: f64 = 0.5;
const PRESS: Tick = 150 * TICKS_PER_MS;
/// From seeing the LED, or setting the unit down, to doing something about it.
const REACTION: Tick = 300 * TICKS_PER_MS;
/// An LED that is still lit so long after a press: the press did not count, press again.
const PATIENCE: Tick = 2_000 * TICKS_PER_MS;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Until the LED says that the unit is ready.
    Waiting,
    /// Until then, with the unit in hand.
    Walking(Tick),
    Pressing(Tick),
    /// The button is released; the LED must go out before then.
    Watching(Tick),
    Done,
}

pub struct Carrier {
    path: Vec<Pose>,
    presses_left: usize,
    waypoint: usize,
    swept_here: bool,
    lit: bool,
    state: State,
}

impl Carrier {
    /// Someone who carries the unit `laps` times along `path`; an empty path stays where it is, and nothing is pressed.
    pub fn new(path: Vec<Pose>, laps: usize) -> Self {
        let presses_left = path.len() * laps;
        let state = if presses_left == 0 { State::Done } else { State::Waiting };
        Self { path, presses_left, waypoint: 0, swept_here: false, lit: false, state }
    }

    /// Where the unit stands, if it is carried at all.
    pub fn pose(&self) -> Option<Pose> {
        self.path.get(self.waypoint).copied()
    }

    pub fn presses(&self) -> bool {
        matches!(self.state, State::Pressing(_))
    }

    pub fn is_done(&self) -> bool {
        self.state == State::Done
    }

    pub fn next_event(&self) -> Tick {
        match self.state {
            State::Walking(at) | State::Pressing(at) | State::Watching(at) => at,
            State::Waiting | State::Done => NEVER,
        }
    }

    /// The LED is now `lit`.
    pub fn see_led(&mut self, lit: bool, now: Tick) {
        if lit == self.lit {
            return;
        }
        self.lit = lit;
        match self.state {
            State::Waiting if lit => self.state = self.go_on(now),
            State::Watching(_) if !lit => {
                self.presses_left -= 1;
                self.swept_here = true;
                self.state = State::Waiting;
            }
            _ => {}
        }
    }

    /// Does what is due at `next_event`.
    pub fn act(&mut self, now: Tick) {
        self.state = match self.state {
            State::Walking(_) if self.lit => State::Pressing(now + PRESS),
            State::Walking(_) => State::Waiting,
            State::Pressing(_) => State::Watching(now + PATIENCE),
            State::Watching(_) => State::Pressing(now + PRESS),
            state => state,
        };
    }

    fn go_on(&mut self, now: Tick) -> State {
        if self.presses_left == 0 {
            return State::Done;
        }
        let mut arrival = now + REACTION;
        if self.swept_here {
            let from = self.path[self.waypoint];
            self.waypoint = (self.waypoint + 1) % self.path.len();
            let to = self.path[self.waypoint];
            arrival += from_seconds(from.position_m.distance(to.position_m) / WALKING_SPEED_M_S);
            self.swept_here = false;
        }
        State::Walking(arrival)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::room::geometry::Point;

    fn path() -> Vec<Pose> {
        [0.0, 1.0].map(|x| Pose { position_m: Point::new(x, 0.0), heading_rad: 0.0 }).to_vec()
    }

    /// Plays the unit: each press puts the LED out, and a sweep later on again. Gives when and where it was pressed.
    fn walk(laps: usize) -> Vec<(Tick, f64)> {
        let mut carrier = Carrier::new(path(), laps);
        let mut presses = Vec::new();
        carrier.see_led(true, 0);
        while carrier.next_event() != NEVER {
            let now = carrier.next_event();
            carrier.act(now);
            if carrier.presses() {
                presses.push((now, carrier.pose().unwrap().position_m.x));
            } else if matches!(carrier.state, State::Watching(_)) {
                carrier.see_led(false, now);
                carrier.see_led(true, now + TICKS_PER_MS);
            }
        }
        assert!(carrier.is_done());
        presses
    }

    #[test]
    fn the_first_press_is_where_the_unit_stands_and_each_waypoint_gets_one() {
        let places: Vec<f64> = walk(1).iter().map(|press| press.1).collect();
        assert_eq!(places, [0.0, 1.0]);
        assert_eq!(walk(2).len(), 4);
    }

    #[test]
    fn walking_a_metre_takes_two_seconds() {
        let presses = walk(1);
        let pause = presses[1].0 - presses[0].0;
        assert_eq!(pause, PRESS + TICKS_PER_MS + REACTION + from_seconds(2.0));
    }

    #[test]
    fn a_press_that_did_not_count_is_repeated_on_the_spot() {
        let mut carrier = Carrier::new(path(), 1);
        carrier.see_led(true, 0);
        let mut presses = 0;
        for _ in 0..6 {
            carrier.act(carrier.next_event());
            presses += usize::from(carrier.presses());
            assert_eq!(carrier.pose().unwrap().position_m.x, 0.0);
        }
        assert_eq!(presses, 3);
    }

    #[test]
    fn without_a_path_nothing_is_pressed() {
        let mut carrier = Carrier::new(Vec::new(), 1);
        carrier.see_led(true, 0);
        assert!(carrier.is_done() && carrier.next_event() == NEVER && carrier.pose().is_none());
    }
}
