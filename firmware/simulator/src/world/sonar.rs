//! The HC-SR04's electrical side: TRIG, a lag, ECHO high for the time of flight.

use crate::time::{NEVER, TICKS_PER_MS, TICKS_PER_US, Tick};

/// TRIG must be high that long (HC-SR04 user guide).
const SHORTEST_TRIGGER: Tick = 10 * TICKS_PER_US;
/// From the end of the trigger to ECHO high: the burst and some more. Measured by a prototype.
const ECHO_LAG: Tick = 450 * TICKS_PER_US;
/// ECHO's length when nothing is heard (HC-SR04 user guide: 38 ms).
const NO_ECHO: Tick = 38 * TICKS_PER_MS;

enum State {
    Idle,
    /// A ping is under way: ECHO rises and falls then.
    Busy {
        rises_at: Tick,
        falls_at: Tick,
        echo: bool,
    },
}

pub struct Sonar {
    state: State,
    trigger_since: Option<Tick>,
}

impl Sonar {
    pub fn new() -> Self {
        Self { state: State::Idle, trigger_since: None }
    }

    /// TRIG is now `high`. Tells whether this begins a ping; if so, call [`Sonar::ping`].
    pub fn trigger(&mut self, high: bool, now: Tick) -> bool {
        match (high, self.trigger_since) {
            (true, None) => {
                self.trigger_since = Some(now);
                false
            }
            (false, Some(since)) => {
                self.trigger_since = None;
                now - since >= SHORTEST_TRIGGER && matches!(self.state, State::Idle)
            }
            _ => false,
        }
    }

    /// Sends the ping; `flight` is its time of flight, or `None` if nothing is heard.
    pub fn ping(&mut self, flight: Option<Tick>, now: Tick) {
        let rises_at = now + ECHO_LAG;
        self.state = State::Busy { rises_at, falls_at: rises_at + flight.unwrap_or(NO_ECHO), echo: false };
    }

    pub fn next_event(&self) -> Tick {
        match self.state {
            State::Idle => NEVER,
            State::Busy { rises_at, echo: false, .. } => rises_at,
            State::Busy { falls_at, .. } => falls_at,
        }
    }

    /// The edge of ECHO that is due at `next_event`: whether it rises.
    pub fn take_edge(&mut self) -> bool {
        match &mut self.state {
            State::Busy { echo, .. } if !*echo => {
                *echo = true;
                true
            }
            _ => {
                self.state = State::Idle;
                false
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trigger_shorter_than_10_us_gives_no_ping() {
        let mut sonar = Sonar::new();
        assert!(!sonar.trigger(true, 0));
        assert!(!sonar.trigger(false, SHORTEST_TRIGGER - 1));
        assert!(!sonar.trigger(true, 1000));
        assert!(sonar.trigger(false, 1000 + SHORTEST_TRIGGER));
    }

    #[test]
    fn echo_is_high_for_the_time_of_flight_or_for_38_ms() {
        for (flight, width) in [(Some(1234), 1234), (None, 38 * 48_000)] {
            let mut sonar = Sonar::new();
            sonar.ping(flight, 0);
            let rise = sonar.next_event();
            assert!(sonar.take_edge());
            assert_eq!(sonar.next_event() - rise, width);
            assert!(!sonar.take_edge());
            assert_eq!(sonar.next_event(), NEVER);
        }
    }

    #[test]
    fn a_busy_sensor_ignores_triggers() {
        let mut sonar = Sonar::new();
        sonar.ping(None, 0);
        sonar.trigger(true, 100);
        assert!(!sonar.trigger(false, 100 + SHORTEST_TRIGGER));
    }
}
