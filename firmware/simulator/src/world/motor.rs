//! The 28BYJ-48 behind its ULN2003: from coil patterns to the bearing of the sensor.
//!
//! The rotor follows the coils' magnetic phase, eight half steps a period, by the shorter way. It stays where it is
//! when the coils are off (the gear holds it), when the phase is opposite, against the end stops, and when asked to
//! move sooner than it can, from rest or at all. A half step that is lost is a slip: the rotor falls back into step a whole period behind.
//! The sensor stays where it is until the rotor has taken up the gear's slack.

use crate::room::gear::{Gear, Home};
use crate::time::{TICKS_PER_SECOND, Tick};
use rand::{Rng, RngExt};
use std::f64::consts::TAU;

/// Faster half steps are lost (28BYJ-48 data sheet: pull-out above 1000 half steps/s).
const SHORTEST_STEP: Tick = TICKS_PER_SECOND / 1050;
/// The home switch is closed at or below this bearing.
const HOME_RAD: f64 = -150.0 / 360.0 * TAU;
/// Coils IN1 to IN4 on bits 0 to 3, in the order that turns the sensor anticlockwise.
const PHASES: [u8; 8] = [0x1, 0x3, 0x2, 0x6, 0x4, 0xC, 0x8, 0x9];
/// Half steps of a magnetic period.
const PERIOD: i64 = PHASES.len() as i64;

pub struct Motor {
    gear: Gear,
    /// Rotor position in half steps; its remainder by 8 is its magnetic phase.
    position: i64,
    /// Where position 0 would have the sensor in the middle of the slack.
    zero_rad: f64,
    sensor_rad: f64,
    coils: u8,
    moved_at: Option<Tick>,
    /// Between its last two half steps, if it moves.
    interval: Tick,
    stuck_until: Tick,
    slips: Option<Slips>,
}

/// Half steps are lost that often until then.
#[derive(Clone, Copy)]
struct Slips {
    probability: f64,
    until: Tick,
}

impl Motor {
    /// A motor at power-up: its coils off, its sensor at `bearing_rad`, its rotor at rest in any phase and `ahead` of the
    /// sensor by that share of half the slack, -1 to 1.
    pub fn new(gear: Gear, bearing_rad: f64, phase: u8, ahead: f64) -> Self {
        let position = i64::from(phase) % PERIOD;
        let ahead_rad = ahead * gear.backlash_deg.to_radians() / 2.0;
        let zero_rad = bearing_rad + ahead_rad - position as f64 * TAU / gear.half_steps_per_turn;
        Self {
            gear,
            position,
            zero_rad,
            sensor_rad: bearing_rad,
            coils: 0,
            moved_at: None,
            interval: Tick::MAX,
            stuck_until: 0,
            slips: None,
        }
    }

    /// The sensor's bearing, anticlockwise from the unit's forward direction.
    pub fn bearing_rad(&self) -> f64 {
        self.sensor_rad
    }

    /// Whether any coil carries current.
    pub fn is_powered(&self) -> bool {
        self.coils != 0
    }

    /// Whether the contact of the home switch is closed, if there is one.
    pub fn home_is_closed(&self) -> bool {
        match self.gear.home {
            Home::Switch => self.is_at_home(),
            Home::OpeningSwitch => !self.is_at_home(),
            Home::None => false,
        }
    }

    fn is_at_home(&self) -> bool {
        match self.gear.home_arc_deg {
            Some(arc) => (HOME_RAD - self.sensor_rad).rem_euclid(TAU) <= arc.to_radians(),
            None => self.sensor_rad <= HOME_RAD,
        }
    }

    /// The rotor doesn't turn until then.
    pub fn stick(&mut self, until: Tick) {
        self.stuck_until = until;
    }

    /// A half step is lost with that probability until then.
    pub fn lose_steps(&mut self, probability: f64, until: Tick) {
        self.slips = Some(Slips { probability, until });
    }

    /// Someone turns the sensor by hand, and the rotor with it.
    pub fn turn_by_hand(&mut self, by_rad: f64) {
        let stop_rad = self.gear.stop_deg.to_radians();
        let turned_rad = (self.sensor_rad + by_rad).clamp(-stop_rad, stop_rad);
        self.zero_rad += turned_rad - self.sensor_rad;
        self.sensor_rad = turned_rad;
    }

    pub fn mend(&mut self) {
        self.stuck_until = 0;
        self.slips = None;
    }

    /// The ULN2003's inputs are now `coils`.
    pub fn drive(&mut self, coils: u8, now: Tick, rng: &mut impl Rng) {
        if coils == self.coils {
            return;
        }
        self.coils = coils;
        let Some(phase) = PHASES.iter().position(|&pattern| pattern == coils) else {
            return;
        };
        let way = (phase as i64 - self.position + PERIOD / 2).rem_euclid(PERIOD) - PERIOD / 2;
        if way == 0 || way == -PERIOD / 2 || now < self.stuck_until {
            return;
        }
        let interval = self.moved_at.map_or(Tick::MAX, |at| (now - at) / way.unsigned_abs());
        if !self.follows(interval) {
            return;
        }
        self.interval = interval;
        let slip = if self.slips(now, rng) { PERIOD * way.signum() } else { 0 };
        self.turn_to(self.position + way - slip, now);
    }

    /// Whether the rotor follows a half step so soon after the last: faster than it pulls in only if it is fast already.
    fn follows(&self, interval: Tick) -> bool {
        let pull_in = (TICKS_PER_SECOND as f64 / self.gear.pull_in_per_s) as Tick;
        interval >= SHORTEST_STEP && (interval >= pull_in || interval >= self.interval / 4 * 3)
    }

    fn slips(&mut self, now: Tick, rng: &mut impl Rng) -> bool {
        let probability = match self.slips {
            Some(slips) if now < slips.until => slips.probability,
            _ => self.gear.lost_step_probability,
        };
        probability > 0.0 && rng.random_bool(probability)
    }

    /// Turns the rotor, unless the sensor would have to go past an end stop, and takes the sensor along.
    fn turn_to(&mut self, position: i64, now: Tick) {
        let slack_rad = self.gear.backlash_deg.to_radians() / 2.0;
        let middle_rad = self.zero_rad + position as f64 * TAU / self.gear.half_steps_per_turn;
        let sensor_rad = self.sensor_rad.clamp(middle_rad - slack_rad, middle_rad + slack_rad);
        if sensor_rad == self.sensor_rad || sensor_rad.abs() <= self.gear.stop_deg.to_radians() {
            self.position = position;
            self.sensor_rad = sensor_rad;
            self.moved_at = Some(now);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    const STEP: Tick = TICKS_PER_SECOND / 600;

    fn rng() -> ChaCha8Rng {
        ChaCha8Rng::seed_from_u64(1)
    }

    fn motor(bearing_rad: f64, phase: u8) -> Motor {
        Motor::new(Gear::default(), bearing_rad, phase, 0.0)
    }

    fn turn(motor: &mut Motor, half_steps: i64, interval: Tick) {
        let phase = PHASES.iter().position(|&pattern| pattern == motor.coils).unwrap_or(0) as i64;
        let mut now = motor.moved_at.unwrap_or(0);
        for step in 1..=half_steps.abs() {
            let pattern = PHASES[(phase + step * half_steps.signum()).rem_euclid(8) as usize];
            now += interval;
            motor.drive(pattern, now, &mut rng());
        }
    }

    #[test]
    fn half_steps_turn_the_sensor_anticlockwise_in_the_order_of_the_coils() {
        let mut motor = motor(0.0, 0);
        turn(&mut motor, 509, STEP);
        assert!((motor.bearing_rad() - 509.0 / 4075.7728 * TAU).abs() < 1e-12);
        turn(&mut motor, -509, STEP);
        assert!(motor.bearing_rad().abs() < 1e-12);
    }

    #[test]
    fn steps_faster_than_the_motor_can_are_lost() {
        let turned = |rate: Tick| {
            let mut motor = motor(0.0, 0);
            for step in 1..=100 {
                motor.drive(PHASES[(step % 8) as usize], step * TICKS_PER_SECOND / rate, &mut rng());
            }
            motor.position
        };
        assert_eq!(turned(600), 100);
        assert!(turned(700) < 50); // past the pull-in limit, from rest
        assert!(turned(1500) < 50);
        assert!(turned(3000) < 50);
    }

    #[test]
    fn a_ramp_takes_the_motor_past_its_pull_in_limit() {
        let mut motor = motor(0.0, 0);
        let mut now = TICKS_PER_SECOND;
        for step in 1..=400u64 {
            let per_second = (200 + 10 * step).min(1000);
            now += TICKS_PER_SECOND / per_second;
            motor.drive(PHASES[(step % 8) as usize], now, &mut rng());
        }
        assert_eq!(motor.position, 400);
    }

    #[test]
    fn the_first_pattern_pulls_the_rotor_in() {
        let mut motor = motor(0.0, 2);
        motor.drive(PHASES[0], 0, &mut rng());
        assert_eq!(motor.position, 0);
    }

    #[test]
    fn the_end_stop_holds() {
        let mut motor = motor(-2.8, 0);
        turn(&mut motor, -400, STEP);
        assert!(motor.bearing_rad() >= -165f64.to_radians() && motor.home_is_closed());
    }

    #[test]
    fn coils_off_or_all_on_leave_the_rotor_alone() {
        let mut motor = motor(0.0, 3);
        motor.drive(0xF, 0, &mut rng());
        motor.drive(0x0, 10, &mut rng());
        assert_eq!(motor.position, 3);
    }

    #[test]
    fn a_stop_of_ones_own_holds_and_a_motor_without_a_switch_is_never_home() {
        let gear = Gear { stop_deg: 10.0, home: Home::None, ..Gear::default() };
        let mut motor = Motor::new(gear, 0.0, 0, 0.0);
        turn(&mut motor, -400, STEP);
        // A stalled rotor hops back by up to half a period and comes again.
        let short_rad = motor.bearing_rad() + 10f64.to_radians();
        assert!((0.0..5.0 / 4075.7728 * TAU).contains(&short_rad), "{short_rad}");
        assert!(!motor.home_is_closed());
    }

    #[test]
    fn a_sensor_that_turns_freely_comes_home_once_a_turn() {
        let gear = Gear { stop_deg: 720.0, home_arc_deg: Some(20.0), ..Gear::default() };
        let mut motor = Motor::new(gear, 0.0, 0, 0.0);
        let mut found = vec![];
        for half_step in 1..=2 * 4076 {
            let before = motor.home_is_closed();
            turn(&mut motor, 1, STEP);
            if motor.home_is_closed() != before {
                found.push(half_step);
            }
        }
        // 190 degrees up it closes from the other side, at 210 it opens, and so again a turn later.
        let degrees: Vec<i64> = found.iter().map(|at| (f64::from(*at) * 360.0 / 4075.7728) as i64).collect();
        assert_eq!(degrees, [190, 210, 550, 570]);
    }

    #[test]
    fn the_sensor_stays_until_the_slack_is_taken_up() {
        let half_step_deg = 360.0 / 4075.7728;
        let gear = Gear { backlash_deg: 8.0 * half_step_deg, ..Gear::default() };
        let mut motor = Motor::new(gear, 0.0, 0, 0.0);
        let bearing_deg = |motor: &Motor| motor.bearing_rad().to_degrees() / half_step_deg;
        turn(&mut motor, 4, STEP);
        assert!(bearing_deg(&motor).abs() < 1e-9);
        turn(&mut motor, 16, STEP);
        assert!((bearing_deg(&motor) - 16.0).abs() < 1e-9);
        turn(&mut motor, -8, STEP);
        assert!((bearing_deg(&motor) - 16.0).abs() < 1e-9);
        turn(&mut motor, -8, STEP);
        assert!((bearing_deg(&motor) - 8.0).abs() < 1e-9);
    }

    #[test]
    fn a_lost_step_costs_a_whole_magnetic_period() {
        let gear = Gear { lost_step_probability: 0.01, ..Gear::default() };
        let mut motor = Motor::new(gear, -2.0, 0, 0.0);
        let mut rng = rng();
        for step in 1..=2000 {
            motor.drive(PHASES[(step % 8) as usize], step * STEP, &mut rng);
        }
        let lost = 2000 - motor.position;
        assert_eq!(lost % 8, 0);
        // 20 slips of 2000 are expected, with a standard deviation of 4.4.
        assert!((7..=33).contains(&(lost / 8)), "{lost}");
    }

    #[test]
    fn a_stuck_motor_turns_again_when_it_is_mended() {
        let mut motor = motor(0.0, 0);
        motor.stick(Tick::MAX);
        turn(&mut motor, 100, STEP);
        assert_eq!(motor.position, 0);
        motor.mend();
        turn(&mut motor, 12, STEP);
        assert_eq!(motor.position, 8);
    }

    #[test]
    fn a_sensor_turned_by_hand_is_not_where_the_rotor_would_have_it() {
        let mut motor = motor(0.0, 0);
        motor.turn_by_hand(0.5);
        turn(&mut motor, 8, STEP);
        assert!((motor.bearing_rad() - 0.5 - 8.0 / 4075.7728 * TAU).abs() < 1e-9);
        motor.turn_by_hand(9.0);
        assert_eq!(motor.bearing_rad(), 165f64.to_radians());
    }
}
