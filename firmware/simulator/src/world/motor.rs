//! The 28BYJ-48 behind its ULN2003: from coil patterns to the bearing of the sensor.
//!
//! The rotor follows the coils' magnetic phase, eight half steps a period, by the shorter way. It stays where it is
//! when the coils are off (the gear holds it), when the phase is opposite, against the end stops, and when asked to
//! move sooner than it can.

use crate::time::{TICKS_PER_SECOND, Tick};
use std::f64::consts::TAU;

/// Half steps of a turn of the output shaft: 64 * 63.68395 (the gear train, measured by many; not 4096).
pub const HALF_STEPS_PER_TURN: f64 = 4075.7728;
/// Faster half steps are lost. Assumed from the motor's usual pull-out rate, about 1000 half steps/s.
const SHORTEST_STEP: Tick = TICKS_PER_SECOND / 1050;
/// The cable's end stops, either side of forward.
const STOP_RAD: f64 = 165.0 / 360.0 * TAU;
/// The home switch is closed at or below this bearing.
const HOME_RAD: f64 = -150.0 / 360.0 * TAU;
/// Coils IN1 to IN4 on bits 0 to 3, in the order that turns the sensor anticlockwise.
const PHASES: [u8; 8] = [0x1, 0x3, 0x2, 0x6, 0x4, 0xC, 0x8, 0x9];

pub struct Motor {
    /// Rotor position in half steps; its remainder by 8 is its magnetic phase.
    position: i64,
    /// Bearing of position 0.
    zero_rad: f64,
    coils: u8,
    moved_at: Option<Tick>,
}

impl Motor {
    /// A motor at power-up, its coils off and its rotor at rest in any phase near `bearing_rad`.
    pub fn new(bearing_rad: f64, phase: u8) -> Self {
        let position = i64::from(phase % 8);
        Self { position, zero_rad: bearing_rad - angle_rad(position), coils: 0, moved_at: None }
    }

    /// The sensor's bearing, anticlockwise from the unit's forward direction.
    pub fn bearing_rad(&self) -> f64 {
        self.zero_rad + angle_rad(self.position)
    }

    pub fn at_home(&self) -> bool {
        self.bearing_rad() <= HOME_RAD
    }

    /// The ULN2003's inputs are now `coils`.
    pub fn drive(&mut self, coils: u8, now: Tick) {
        if coils == self.coils {
            return;
        }
        self.coils = coils;
        let Some(phase) = PHASES.iter().position(|&pattern| pattern == coils) else {
            return;
        };
        let way = (phase as i64 - self.position + 4).rem_euclid(8) - 4;
        let too_soon = self.moved_at.is_some_and(|at| now < at + SHORTEST_STEP * way.unsigned_abs());
        if way == 0 || way == -4 || too_soon {
            return;
        }
        let target = self.position + way;
        if (self.zero_rad + angle_rad(target)).abs() <= STOP_RAD {
            self.position = target;
            self.moved_at = Some(now);
        }
    }
}

fn angle_rad(half_steps: i64) -> f64 {
    half_steps as f64 / HALF_STEPS_PER_TURN * TAU
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: Tick = TICKS_PER_SECOND / 600;

    fn turn(motor: &mut Motor, half_steps: i64, interval: Tick) {
        let phase = PHASES.iter().position(|&pattern| pattern == motor.coils).unwrap_or(0) as i64;
        for step in 1..=half_steps.abs() {
            let pattern = PHASES[(phase + step * half_steps.signum()).rem_euclid(8) as usize];
            let now = motor.moved_at.unwrap_or(0) + interval;
            motor.drive(pattern, now);
        }
    }

    #[test]
    fn half_steps_turn_the_sensor_anticlockwise_in_the_order_of_the_coils() {
        let mut motor = Motor::new(0.0, 0);
        turn(&mut motor, 509, STEP);
        assert!((motor.bearing_rad() - 509.0 / 4075.7728 * TAU).abs() < 1e-12);
        turn(&mut motor, -509, STEP);
        assert!(motor.bearing_rad().abs() < 1e-12);
    }

    #[test]
    fn steps_faster_than_the_motor_can_are_lost() {
        let turned = |rate: Tick| {
            let mut motor = Motor::new(0.0, 0);
            for step in 1..=100 {
                motor.drive(PHASES[(step % 8) as usize], step * TICKS_PER_SECOND / rate);
            }
            motor.position
        };
        assert_eq!(turned(1000), 100);
        assert!(turned(1500) < 50);
        assert!(turned(3000) < 50);
    }

    #[test]
    fn the_first_pattern_pulls_the_rotor_in() {
        let mut motor = Motor::new(0.0, 2);
        motor.drive(PHASES[0], 0);
        assert_eq!(motor.position, 0);
    }

    #[test]
    fn the_end_stop_holds() {
        let mut motor = Motor::new(-2.8, 0);
        turn(&mut motor, -400, STEP);
        assert!(motor.bearing_rad() >= -STOP_RAD && motor.at_home());
    }

    #[test]
    fn coils_off_or_all_on_leave_the_rotor_alone() {
        let mut motor = Motor::new(0.0, 3);
        motor.drive(0xF, 0);
        motor.drive(0x0, 10);
        assert_eq!(motor.position, 3);
    }
}
