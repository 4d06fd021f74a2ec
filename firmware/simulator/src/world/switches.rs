//! Switches that someone holds, that stick, bounce or pick up noise: the button, the home switch.

use crate::time::{NEVER, Tick, from_seconds};
use rand::{Rng, RngExt};

#[derive(Default)]
pub struct Switches {
    button_held_until: Option<Tick>,
    home_stuck: Option<Stuck>,
    /// How long the contact of the home switch bounces after it has closed or opened.
    bounce: Tick,
    bounces_until: Tick,
    was_closed: bool,
    noise: Option<Noise>,
    /// The line of the home switch is wrong just now.
    home_is_wrong: bool,
}

/// A switch that doesn't switch until then.
#[derive(Debug, Clone, Copy)]
struct Stuck {
    closed: bool,
    until: Tick,
}

/// A line that is wrong with that probability, until then.
#[derive(Debug, Clone, Copy)]
struct Noise {
    probability: f64,
    until: Tick,
}

impl Switches {
    pub fn with_bounce(bounce_ms: f64) -> Self {
        Self { bounce: from_seconds(bounce_ms / 1e3), ..Self::default() }
    }

    /// Nothing is held, sticks or disturbs any more; a contact that bounces goes on doing so.
    pub fn mend(&mut self) {
        *self = Self { bounce: self.bounce, was_closed: self.was_closed, ..Self::default() };
    }

    pub fn hold_button(&mut self, until: Tick) {
        self.button_held_until = Some(until);
    }

    pub fn stick_home(&mut self, closed: bool, until: Tick) {
        self.home_stuck = Some(Stuck { closed, until });
    }

    pub fn be_noisy(&mut self, probability: f64, until: Tick) {
        self.noise = Some(Noise { probability, until });
    }

    /// The motor has moved, or may have: the line of the home switch bounces or is disturbed.
    pub fn disturb(&mut self, closed: bool, now: Tick, rng: &mut impl Rng) {
        if closed != self.was_closed {
            self.was_closed = closed;
            self.bounces_until = now + self.bounce;
        }
        let noise = self.noise.filter(|noise| now < noise.until).map_or(0.0, |noise| noise.probability);
        let probability = if now < self.bounces_until { 0.5 } else { noise };
        self.home_is_wrong = probability > 0.0 && rng.random_bool(probability);
    }

    pub fn button_is_held(&self) -> bool {
        self.button_held_until.is_some()
    }

    /// Whether the home switch is closed, if a sound one would be.
    pub fn home_is_closed(&self, closed: bool) -> bool {
        self.home_stuck.map_or(closed != self.home_is_wrong, |stuck| stuck.closed)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::TICKS_PER_MS;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// How often the line is wrong in 1000 looks of 1 us from a change of the contact on.
    fn wrong(switches: &mut Switches, from: Tick) -> usize {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        (0..1000)
            .filter(|look| {
                switches.disturb(true, from + look * TICKS_PER_MS / 1000, &mut rng);
                !switches.home_is_closed(true)
            })
            .count()
    }

    #[test]
    fn a_contact_bounces_for_its_time_and_then_rests() {
        let mut switches = Switches::with_bounce(1.0);
        assert!((400..600).contains(&wrong(&mut switches, 0)));
        assert_eq!(wrong(&mut switches, 2 * TICKS_PER_MS), 0);
    }

    #[test]
    fn a_noisy_line_is_wrong_as_often_as_asked_for() {
        let mut switches = Switches::default();
        switches.be_noisy(0.1, NEVER);
        assert!((60..140).contains(&wrong(&mut switches, 0)));
        switches.mend();
        assert_eq!(wrong(&mut switches, 0), 0);
    }
}
