//! Switches that someone holds or that stick: the button, the home switch.

use crate::time::{NEVER, Tick};

#[derive(Default)]
pub struct Switches {
    button_held_until: Option<Tick>,
    home_stuck: Option<Stuck>,
}

/// A switch that doesn't switch until then.
#[derive(Debug, Clone, Copy)]
struct Stuck {
    closed: bool,
    until: Tick,
}

impl Switches {
    pub fn hold_button(&mut self, until: Tick) {
        self.button_held_until = Some(until);
    }

    pub fn stick_home(&mut self, closed: bool, until: Tick) {
        self.home_stuck = Some(Stuck { closed, until });
    }

    pub fn button_is_held(&self) -> bool {
        self.button_held_until.is_some()
    }

    /// Whether the home switch is closed, if a sound one would be `at_home`.
    pub fn home_is_closed(&self, at_home: bool) -> bool {
        self.home_stuck.map_or(at_home, |stuck| stuck.closed)
    }

    pub fn next_event(&self) -> Tick {
        let held = self.button_held_until.unwrap_or(NEVER);
        self.home_stuck.map_or(held, |stuck| stuck.until.min(held))
    }

    /// Lets go of what is held or stuck until now.
    pub fn release(&mut self, now: Tick) {
        self.button_held_until = self.button_held_until.filter(|until| now < *until);
        self.home_stuck = self.home_stuck.filter(|stuck| now < stuck.until);
    }
}
