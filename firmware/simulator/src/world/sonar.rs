//! The HC-SR04's electrical side: TRIG, a lag, ECHO high for the time of flight; and what a broken one does.

use crate::room::sensor::Sensor;
use crate::time::{NEVER, TICKS_PER_MS, TICKS_PER_US, Tick, from_seconds};
use std::collections::VecDeque;

/// The shortest lag of ECHO (`room/sensor.rs`).
pub const ECHO_LAG: Tick = 450 * TICKS_PER_US;
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
    /// ECHO is always high for so long.
    Repeats(Tick),
}

/// An edge of ECHO.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Edge {
    pub rising: bool,
    pub at: Tick,
}

/// The times of a kind of sensor, as `room/sensor.rs` has them.
#[derive(Debug, Clone, Copy)]
struct Kind {
    lag: Tick,
    shortest_trigger: Tick,
    no_echo: Tick,
}

pub struct Sonar {
    kind: Kind,
    unpowered: bool,
    high: bool,
    /// What ECHO will do, in order; while there is anything the sensor is busy.
    edges: VecDeque<Edge>,
    /// When the last pulse began or will begin.
    rises_at: Tick,
    trigger_since: Option<Tick>,
    ailment: Option<(Ailment, Tick)>,
}

impl Sonar {
    pub fn of(sensor: &Sensor) -> Self {
        let kind = Kind {
            lag: from_seconds(sensor.echo_lag_ms / 1e3),
            shortest_trigger: from_seconds(sensor.shortest_trigger_us / 1e6),
            no_echo: from_seconds(sensor.no_echo_ms / 1e3),
        };
        Self {
            kind,
            unpowered: false,
            high: false,
            edges: VecDeque::new(),
            rises_at: 0,
            trigger_since: None,
            ailment: None,
        }
    }

    /// From the trigger's end to ECHO high.
    pub fn lag(&self) -> Tick {
        self.kind.lag
    }

    /// The sensor's supply: without it ECHO is low and whatever the sensor was at is forgotten.
    pub fn power(&mut self, on: bool, now: Tick) {
        let goes_off = !on && !self.unpowered;
        self.unpowered = !on;
        if goes_off {
            self.edges.clear();
            if self.high {
                self.edges.push_back(Edge { rising: false, at: now });
            }
        }
    }

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
                let sick = self.suffers(Ailment::StuckHigh, now) || self.suffers(Ailment::Missing, now);
                let dead = sick || self.unpowered;
                now - since >= self.kind.shortest_trigger && self.edges.is_empty() && !dead
            }
            _ => false,
        }
    }

    /// Sends the ping; `flight` is its time of flight, or `None` if nothing is heard.
    pub fn ping(&mut self, flight: Option<Tick>, now: Tick) {
        let length = match self.ailment_at(now) {
            Some(Ailment::Deaf) => self.kind.no_echo,
            Some(Ailment::ShortPulse) => SHORT_PULSE,
            Some(Ailment::Repeats(length)) => length,
            _ => flight.unwrap_or(self.kind.no_echo),
        };
        self.pulse(now + self.kind.lag, length);
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
    use crate::time::TICKS_PER_SECOND;

    const SHORTEST_TRIGGER: Tick = 10 * TICKS_PER_US;
    const NO_ECHO: Tick = 38 * TICKS_PER_MS;

    fn sonar_of(sensor: Sensor) -> Sonar {
        Sonar::of(&sensor)
    }

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
        let mut sonar = sonar_of(Sensor::default());
        assert!(!sonar.trigger(true, 0));
        assert!(!sonar.trigger(false, SHORTEST_TRIGGER - 1));
        assert!(!sonar.trigger(true, 1000));
        assert!(sonar.trigger(false, 1000 + SHORTEST_TRIGGER));
    }

    #[test]
    fn echo_is_high_for_the_time_of_flight_or_for_38_ms() {
        for (flight, width) in [(Some(1234), 1234), (None, 38 * 48_000)] {
            let mut sonar = sonar_of(Sensor::default());
            sonar.ping(flight, 0);
            let rise = sonar.take_edge().unwrap();
            let fall = sonar.take_edge().unwrap();
            assert_eq!((rise.rising, fall.rising, fall.at - rise.at), (true, false, width));
            assert_eq!(sonar.next_event(), NEVER);
        }
    }

    #[test]
    fn a_busy_sensor_ignores_triggers() {
        let mut sonar = sonar_of(Sensor::default());
        sonar.ping(None, 0);
        sonar.trigger(true, 100);
        assert!(!sonar.trigger(false, 100 + SHORTEST_TRIGGER));
    }

    #[test]
    fn sound_from_elsewhere_ends_the_pulse_unless_the_transmitter_still_rings_or_the_echo_was_sooner() {
        let fall_after_sound_at = |sound: Tick| {
            let mut sonar = sonar_of(Sensor::default());
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
            (Ailment::Repeats(777), vec![(true, RISE), (false, RISE + 777)]),
            (Ailment::Early, vec![(true, EARLY), (false, EARLY + TICKS_PER_MS)]),
        ] {
            let mut sonar = sonar_of(Sensor::default());
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
        let mut sonar = sonar_of(Sensor::default());
        sonar.fall_ill(Ailment::StuckHigh, 500, 100);
        let edges: Vec<Edge> = std::iter::from_fn(|| sonar.take_edge()).collect();
        assert_eq!(edges, [Edge { rising: true, at: 100 }, Edge { rising: false, at: 500 }]);
        assert!(!sonar.echo_is_high());
    }

    #[test]
    fn a_sensor_of_another_kind_has_its_own_lag_and_trigger() {
        let kind = Sensor { echo_lag_ms: 42.0, shortest_trigger_us: 20.0, ..Sensor::default() };
        let mut sonar = sonar_of(kind);
        assert_eq!(edges_after_a_trigger(&mut sonar, 0), []);
        sonar.trigger(true, TICKS_PER_MS);
        assert!(sonar.trigger(false, TICKS_PER_MS + 20 * TICKS_PER_US));
        sonar.ping(Some(TICKS_PER_MS), 0);
        assert_eq!(sonar.next_event(), 42 * TICKS_PER_MS);
    }

    #[test]
    fn a_sensor_that_latches_comes_down_only_without_power() {
        let mut sonar = sonar_of(Sensor { no_echo_ms: 1e9, ..Sensor::default() });
        sonar.ping(None, 0);
        sonar.take_edge();
        assert!(sonar.echo_is_high() && sonar.next_event() > 1000 * TICKS_PER_SECOND);
        sonar.power(false, TICKS_PER_MS);
        assert_eq!(sonar.take_edge(), Some(Edge { rising: false, at: TICKS_PER_MS }));
        assert_eq!(edges_after_a_trigger(&mut sonar, 2 * TICKS_PER_MS), []);
        sonar.power(true, 3 * TICKS_PER_MS);
        assert_eq!(edges_after_a_trigger(&mut sonar, 4 * TICKS_PER_MS).len(), 2);
    }
}
