//! The motor of a room's units as it was built: its gear, its slack, its stops, its home switch.

use serde::Deserialize;

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Gear {
    /// Half steps of a turn of the sensor.
    pub half_steps_per_turn: f64,
    /// How far the sensor can be turned with the motor at rest.
    pub backlash_deg: f64,
    /// How often a half step slips a whole magnetic period, eight half steps.
    pub lost_step_probability: f64,
    pub home: Home,
    /// How long the home switch's contact bounces.
    pub home_bounce_ms: f64,
    /// From rest the motor follows no more half steps a second than that at once; faster only by a ramp.
    pub pull_in_per_s: f64,
    /// The end stops, either side of forward.
    pub stop_deg: f64,
    /// Over how much of a turn below -150 degrees the switch is at home, in every turn; without it all the way down.
    pub home_arc_deg: Option<f64>,
}

/// What tells a unit where its motor stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Home {
    /// A switch, closed at and below -150 degrees.
    Switch,
    /// A normally-closed switch, open at and below -150 degrees.
    OpeningSwitch,
    /// Nothing but the end stops.
    None,
}

impl Default for Gear {
    /// A 28BYJ-48 without slack, pulled in at 600 half steps a second (of a motor without load, from memory): 64 half steps times 283712/4455 (the gear train, its teeth counted by many; not 4096).
    fn default() -> Self {
        Self {
            half_steps_per_turn: 4075.7728,
            backlash_deg: 0.0,
            lost_step_probability: 0.0,
            home: Home::Switch,
            home_bounce_ms: 0.0,
            pull_in_per_s: 600.0,
            stop_deg: 165.0,
            home_arc_deg: None,
        }
    }
}

impl Gear {
    /// The first thing wrong: field and problem.
    pub fn problem(&self) -> Option<(&'static str, &'static str)> {
        if !(8.0..=1e6).contains(&self.half_steps_per_turn) {
            return Some(("motor.half_steps_per_turn", "is outside 8, a magnetic period, to a million"));
        }
        if !(0.0..=10.0).contains(&self.backlash_deg) {
            return Some(("motor.backlash_deg", "is outside 0 to 10"));
        }
        if !(0.0..=1.0).contains(&self.lost_step_probability) {
            return Some(("motor.lost_step_probability", "is outside 0 to 1"));
        }
        if !(0.0..=100.0).contains(&self.home_bounce_ms) {
            return Some(("motor.home_bounce_ms", "is outside 0 to 100"));
        }
        if !(1.0..=1e6).contains(&self.pull_in_per_s) {
            return Some(("motor.pull_in_per_s", "is outside 1 to a million"));
        }
        if self.home_arc_deg.is_some_and(|arc| !(1.0..=180.0).contains(&arc)) {
            return Some(("motor.home_arc_deg", "is outside 1 to 180"));
        }
        (!(1.0..=720.0).contains(&self.stop_deg)).then_some(("motor.stop_deg", "is outside 1 to 720"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motor_that_cannot_be_is_refused_by_its_field() {
        let sound = Gear::default();
        assert_eq!(sound.problem(), None);
        for (gear, field) in [
            (Gear { half_steps_per_turn: 0.0, ..sound }, "motor.half_steps_per_turn"),
            (Gear { half_steps_per_turn: f64::NAN, ..sound }, "motor.half_steps_per_turn"),
            (Gear { backlash_deg: -1.0, ..sound }, "motor.backlash_deg"),
            (Gear { lost_step_probability: 1.1, ..sound }, "motor.lost_step_probability"),
            (Gear { home_bounce_ms: -1.0, ..sound }, "motor.home_bounce_ms"),
            (Gear { pull_in_per_s: 0.0, ..sound }, "motor.pull_in_per_s"),
            (Gear { stop_deg: 0.0, ..sound }, "motor.stop_deg"),
            (Gear { home_arc_deg: Some(0.0), ..sound }, "motor.home_arc_deg"),
        ] {
            assert_eq!(gear.problem().unwrap().0, field);
        }
    }
}
