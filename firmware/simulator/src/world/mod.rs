//! The world around the chip: motor, sensor, LED, button and home switch on a board that someone carries in a room.

pub mod carrier;
pub mod motor;
pub mod sonar;

use crate::chip::ports::{Ports, Pulls};
use crate::echo::Scene;
use crate::fault::Violation;
use crate::room::Pose;
use crate::time::{NEVER, Tick, from_seconds};
use carrier::Carrier;
use motor::Motor;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sonar::Sonar;
use std::rc::Rc;

/// The board's wiring (firmware/README.md).
pub const ECHO: (usize, u8) = (1, 0);
const PORT_1_TRIGGER: u8 = 0x02;
const PORT_1_LED: u8 = 0x04;
const PORT_1_BUTTON: u8 = 0x08;
const PORT_1_HOME: u8 = 0x10;
const PORT_1_ECHO: u8 = 0x01;
const PORT_2_COILS: u8 = 0x0F;
/// Where the last power-off may have left the sensor.
const POWER_UP_RANGE_RAD: f64 = 2.8;

pub struct World {
    scene: Rc<Scene>,
    standing: Pose,
    motor: Motor,
    sonar: Sonar,
    carrier: Carrier,
    rng: ChaCha8Rng,
    echo_high: bool,
}

/// An edge on the ECHO pin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Edge {
    pub rising: bool,
    pub at: Tick,
}

impl World {
    /// A world at power-up: the sensor looks anywhere, by the seed.
    pub fn new(scene: Rc<Scene>, laps: usize, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let bearing_rad = rng.random_range(-POWER_UP_RANGE_RAD..POWER_UP_RANGE_RAD);
        let motor = Motor::new(bearing_rad, rng.random_range(0..8));
        let carrier = Carrier::new(scene.room().waypoints(), laps);
        let standing = scene.room().standing();
        Self { scene, standing, motor, sonar: Sonar::new(), carrier, rng, echo_high: false }
    }

    pub fn air_temperature_c(&self) -> f64 {
        self.scene.room().air_temperature_c
    }

    pub fn path_is_done(&self) -> bool {
        self.carrier.is_done()
    }

    pub fn next_event(&self) -> Tick {
        self.sonar.next_event().min(self.carrier.next_event())
    }

    /// Does what is due by `now`; gives an edge of ECHO if there is one, at its own time. Call until it gives `None`.
    pub fn service(&mut self, now: Tick) -> Option<Edge> {
        while self.carrier.next_event() <= now {
            self.carrier.act(self.carrier.next_event());
        }
        let at = self.sonar.next_event();
        if at == NEVER || at > now {
            return None;
        }
        self.echo_high = self.sonar.take_edge();
        Some(Edge { rising: self.echo_high, at })
    }

    /// The chip's outputs may have changed.
    ///
    /// # Errors
    /// A [`Violation`] if the chip drives a pin that something else drives.
    pub fn watch(&mut self, ports: &Ports, now: Tick) -> Result<(), Violation> {
        let fights = ports.outputs(1) & (PORT_1_ECHO | PORT_1_BUTTON | PORT_1_HOME);
        if fights != 0 {
            return Err(Violation::rule(format!(
                "P1MDOUT makes inputs (0x{fights:02X}) push-pull: they fight the sensor or a switch"
            )));
        }
        let port_1 = ports.driven_high(1);
        self.motor.drive(ports.driven_high(2) & PORT_2_COILS, now);
        self.carrier.see_led(port_1 & PORT_1_LED != 0, now);
        if self.sonar.trigger(port_1 & PORT_1_TRIGGER != 0, now) {
            let flight = self.ping();
            self.sonar.ping(flight, now);
        }
        Ok(())
    }

    /// What the world does to the chip's pins now.
    pub fn pulls(&self) -> Pulls {
        let mut pulls = Pulls::default();
        let switches = [(self.carrier.presses(), PORT_1_BUTTON), (self.motor.at_home(), PORT_1_HOME)];
        pulls.low[1] = switches.iter().filter(|(closed, _)| *closed).map(|(_, bit)| bit).sum();
        let echo = if self.echo_high { &mut pulls.high[1] } else { &mut pulls.low[1] };
        *echo |= PORT_1_ECHO;
        pulls
    }

    /// Time of flight of a ping sent now.
    fn ping(&mut self) -> Option<Tick> {
        let pose = self.carrier.pose().unwrap_or(self.standing);
        let axis_rad = pose.heading_rad + self.motor.bearing_rad();
        let range_m = self.scene.ping(pose.position_m, axis_rad, &mut self.rng)?;
        Some(from_seconds(2.0 * range_m / self.scene.room().speed_of_sound()))
    }
}
