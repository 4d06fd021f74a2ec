//! The HC-SR04's electrical side: TRIG, a lag, ECHO high for the time of flight; and what a broken one does.

use crate::time::{NEVER, TICKS_PER_MS, TICKS_PER_US, Tick};
use std::collections::VecDeque;

/// TRIG must be high that long (HC-SR04 user guide).
const SHORTEST_TRIGGER: Tick = 10 * TICKS_PER_US;
/// From the end of the trigger to ECHO high: the burst and some more. Measured by a prototype.
pub const ECHO_LAG: Tick = 450 * TICKS_PER_US;
/// ECHO's length when nothing is heard (HC-SR04 user guide: 38 ms).
const NO_ECHO: Tick = 38 * TICKS_PER_MS;
/// The receiver is deaf while its own transmitter still rings: 2 cm there and back, the shortest range.
const RINGING: Tick = 116 * TICKS_PER_US;
/// ECHO of a sensor whose pulses are too short to be true.
const SHORT_PULSE: Tick = 50 * TICKS_PER_US;
/// How soon after TRIG goes high ECHO does, on a sensor that answers too early.
const EARLY: Tick = 2 * TICKS_PER_US;

/// What may be wrong with a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ailment {
    /// ECHO is high and stays so.
    StuckHigh,
    /// ECHO never rises: no sensor, no supply, a broken wire.
    Missing,
    /// Nothing is heard.
    Deaf,
    /// ECHO is high for 50 us.
    ShortPulse,
    /// ECHO rises before the trigger is over.
    Early,
}

/// An edge of ECHO.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Edge {
    pub rising: bool,
    pub at: Tick,
}

#[derive(Default)]
pub struct Sonar {
    high: bool,
    /// What ECHO will do, in order; while there is anything the sensor is busy.
    edges: VecDeque<Edge>,
    /// When the last pulse began or will begin.
    rises_at: Tick,
    trigger_since: Option<Tick>,
    ailment: Option<(Ailment, Tick)>,
}

impl Sonar {
    pub fn echo_is_high(&self) -> bool {
        self.high
    }

    /// TRIG is now `high`. Tells whether this begins a ping; if so, call [`Sonar::ping`].
    pub fn trigger(&mut self, high: bool, now: Tick) -> bool {
        match (high, self.trigger_since) {
            (true, None) => {
                self.trigger_since = Some(now);
                if self.suffers(Ailment::Early, now) && self.edges.is_empty() {
                    self.pulse(now + EARLY, TICKS_PER_MS);
                }
                false
            }
            (false, Some(since)) => {
                self.trigger_since = None;
                let dead = self.suffers(Ailment::StuckHigh, now) || self.suffers(Ailment::Missing, now);
                now - since >= SHORTEST_TRIGGER && self.edges.is_empty() && !dead
            }
            _ => false,
        }
    }

    /// Sends the ping; `flight` is its time of flight, or `None` if nothing is heard.
    pub fn ping(&mut self, flight: Option<Tick>, now: Tick) {
        let length = match self.ailment_at(now) {
            Some(Ailment::Deaf) => NO_ECHO,
            Some(Ailment::ShortPulse) => SHORT_PULSE,
            _ => flight.unwrap_or(NO_ECHO),
        };
        self.pulse(now + ECHO_LAG, length);
    }

    /// Sound from elsewhere is taken for the echo, if one is awaited.
    pub fn hear(&mut self, at: Tick) {
        if self.listens(at)
            && let Some(fall) = self.edges.back_mut()
        {
            fall.at = at;
        }
    }

    /// Whether sound that arrives then would be taken for the echo.
    pub fn listens(&self, at: Tick) -> bool {
        let fall = self.edges.back().filter(|edge| !edge.rising);
        let awaited = fall.is_some_and(|fall| (self.rises_at + RINGING..fall.at).contains(&at));
        awaited && self.ailment_at(at).is_none()
    }

    /// A ping is under way.
    pub fn is_busy(&self) -> bool {
        !self.edges.is_empty()
    }

    /// Something breaks, until then or for good.
    pub fn fall_ill(&mut self, ailment: Ailment, until: Tick, now: Tick) {
        self.ailment = Some((ailment, until));
        self.edges.clear();
        let stuck = ailment == Ailment::StuckHigh;
        if self.high != stuck {
            self.edges.push_back(Edge { rising: stuck, at: now });
        }
        if stuck && until != NEVER {
            self.edges.push_back(Edge { rising: false, at: until });
        }
    }

    pub fn mend(&mut self, now: Tick) {
        if self.suffers(Ailment::StuckHigh, now) {
            self.edges.clear();
            self.edges.push_back(Edge { rising: false, at: now });
        }
        self.ailment = None;
    }

    pub fn next_event(&self) -> Tick {
        self.edges.front().map_or(NEVER, |edge| edge.at)
    }

    /// The edge of ECHO that is due at `next_event`.
    pub fn take_edge(&mut self) -> Option<Edge> {
        let edge = self.edges.pop_front()?;
        self.high = edge.rising;
        Some(edge)
    }

    fn pulse(&mut self, rises_at: Tick, length: Tick) {
        self.rises_at = rises_at;
        self.edges.push_back(Edge { rising: true, at: rises_at });
        self.edges.push_back(Edge { rising: false, at: rises_at + length });
    }

    fn suffers(&self, ailment: Ailment, now: Tick) -> bool {
        self.ailment_at(now) == Some(ailment)
    }

    fn ailment_at(&self, now: Tick) -> Option<Ailment> {
        self.ailment.filter(|(_, until)| now < *until).map(|(ailment, _)| ailment)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The edges that a trigger of 10 us at `at` leads to, an echo being 1 ms away.
    fn edges_after_a_trigger(sonar: &mut Sonar, at: Tick) -> Vec<(bool, Tick)> {
        sonar.trigger(true, at);
        if sonar.trigger(false, at + SHORTEST_TRIGGER) {
            sonar.ping(Some(TICKS_PER_MS), at + SHORTEST_TRIGGER);
        }
        std::iter::from_fn(|| sonar.take_edge()).map(|edge| (edge.rising, edge.at - at)).collect()
    }

    const RISE: Tick = SHORTEST_TRIGGER + ECHO_LAG;

    #[test]
    fn a_trigger_shorter_than_10_us_gives_no_ping() {
        let mut sonar = Sonar::default();
        assert!(!sonar.trigger(true, 0));
        assert!(!sonar.trigger(false, SHORTEST_TRIGGER - 1));
        assert!(!sonar.trigger(true, 1000));
        assert!(sonar.trigger(false, 1000 + SHORTEST_TRIGGER));
    }

    #[test]
    fn echo_is_high_for_the_time_of_flight_or_for_38_ms() {
        for (flight, width) in [(Some(1234), 1234), (None, 38 * 48_000)] {
            let mut sonar = Sonar::default();
            sonar.ping(flight, 0);
            let rise = sonar.take_edge().unwrap();
            let fall = sonar.take_edge().unwrap();
            assert_eq!((rise.rising, fall.rising, fall.at - rise.at), (true, false, width));
            assert_eq!(sonar.next_event(), NEVER);
        }
    }

    #[test]
    fn a_busy_sensor_ignores_triggers() {
        let mut sonar = Sonar::default();
        sonar.ping(None, 0);
        sonar.trigger(true, 100);
        assert!(!sonar.trigger(false, 100 + SHORTEST_TRIGGER));
    }

    #[test]
    fn sound_from_elsewhere_ends_the_pulse_unless_the_transmitter_still_rings_or_the_echo_was_sooner() {
        let fall_after_sound_at = |sound: Tick| {
            let mut sonar = Sonar::default();
            sonar.ping(Some(10 * TICKS_PER_MS), 0);
            sonar.take_edge();
            sonar.hear(ECHO_LAG + sound);
            sonar.next_event() - ECHO_LAG
        };
        assert_eq!(fall_after_sound_at(4 * TICKS_PER_MS), 4 * TICKS_PER_MS);
        assert_eq!(fall_after_sound_at(RINGING - 1), 10 * TICKS_PER_MS);
        assert_eq!(fall_after_sound_at(11 * TICKS_PER_MS), 10 * TICKS_PER_MS);
    }

    #[test]
    fn each_ailment_has_its_own_pulse() {
        for (ailment, expected) in [
            (Ailment::StuckHigh, vec![]),
            (Ailment::Missing, vec![]),
            (Ailment::Deaf, vec![(true, RISE), (false, RISE + NO_ECHO)]),
            (Ailment::ShortPulse, vec![(true, RISE), (false, RISE + SHORT_PULSE)]),
            (Ailment::Early, vec![(true, EARLY), (false, EARLY + TICKS_PER_MS)]),
        ] {
            let mut sonar = Sonar::default();
            sonar.fall_ill(ailment, NEVER, 0);
            while sonar.take_edge().is_some() {}
            assert_eq!(edges_after_a_trigger(&mut sonar, TICKS_PER_MS), expected, "{ailment:?}");
            sonar.mend(50 * TICKS_PER_MS);
            while sonar.take_edge().is_some() {}
            let whole = [(true, RISE), (false, RISE + TICKS_PER_MS)];
            assert_eq!(edges_after_a_trigger(&mut sonar, 60 * TICKS_PER_MS), whole, "{ailment:?}");
        }
    }

    #[test]
    fn a_line_that_is_stuck_high_comes_down_when_its_time_is_over() {
        let mut sonar = Sonar::default();
        sonar.fall_ill(Ailment::StuckHigh, 500, 100);
        let edges: Vec<Edge> = std::iter::from_fn(|| sonar.take_edge()).collect();
        assert_eq!(edges, [Edge { rising: true, at: 100 }, Edge { rising: false, at: 500 }]);
        assert!(!sonar.echo_is_high());
    }
}
