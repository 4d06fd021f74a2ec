//! The world around the chip: motor, sensor, LED, button and home switch on a board that someone carries in a room.

pub mod air;
pub mod carrier;
mod hearing;
pub mod motor;
pub mod sonar;
mod switches;
#[cfg(test)]
mod tests;

use crate::chip::ports::{Ports, Pulls};
use crate::chip::violation::Violation;
use crate::faults::Fault;
use crate::random::{Part, stream};
use crate::room::Pose;
use crate::room::acoustics::{Look, Scene};
use crate::room::geometry::Point;
use crate::time::{NEVER, Oscillator, Tick, from_seconds, to_seconds};
use air::{Air, Arrival};
use carrier::Carrier;
use hearing::Hearing;
use motor::Motor;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use sonar::{Ailment, Edge, Sonar};
use std::rc::Rc;
use switches::Switches;

/// The board's wiring (firmware/hardware/wiring.md).
pub const ECHO: (usize, u8) = (1, 0);
const PORT_1_TRIGGER: u8 = 0x02;
const PORT_1_LED: u8 = 0x04;
const PORT_1_BUTTON: u8 = 0x08;
const PORT_1_HOME: u8 = 0x10;
const PORT_1_ECHO: u8 = 0x01;
const PORT_1_SENSOR_POWER: u8 = 0x40;
const PORT_2_COILS: u8 = 0x0F;
/// Where the last power-off may have left the sensor.
const POWER_UP_RANGE_RAD: f64 = 2.8;

pub struct World {
    scene: Rc<Scene>,
    /// All times here are its own.
    oscillator: Oscillator,
    standing: Pose,
    motor: Motor,
    sonar: Sonar,
    hearing: Hearing,
    switches: Switches,
    carrier: Carrier,
    rng: ChaCha8Rng,
    led: bool,
    pinged_s: f64,
    echoes_of_others: u32,
}

/// What is true in the world, for tests to compare with.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Truth {
    pub x_m: f64,
    pub y_m: f64,
    pub heading_rad: f64,
    /// The sensor's, anticlockwise from the unit's forward direction.
    pub bearing_rad: f64,
    pub coils_on: bool,
    pub home_switch_closed: bool,
    pub button_pressed: bool,
    pub led_lit: bool,
    pub echo_high: bool,
    pub air_temperature_c: f64,
    /// When the latest ping began, in the time that all units share; 0 before the first.
    pub pinged_s: f64,
    /// How often it has taken the sound of another unit for its own echo.
    pub echoes_of_others: u32,
}

impl World {
    /// The world of unit `index`, counted from 0, at power-up: the sensor looks anywhere, by the seed.
    pub fn new(
        scene: Rc<Scene>,
        index: usize,
        oscillator: Oscillator,
        air: Option<Rc<Air>>,
        laps: usize,
        seed: u64,
    ) -> Self {
        let mut rng = stream(seed, Part::World);
        let gear = scene.room().gear(index);
        let reach_rad = POWER_UP_RANGE_RAD.min(gear.stop_deg.to_radians());
        let bearing_rad = rng.random_range(-reach_rad..reach_rad);
        let phase = rng.random_range(0..8);
        // Rooms without slack draw nothing for it.
        let ahead = if gear.backlash_deg > 0.0 { rng.random_range(-1.0..1.0) } else { 0.0 };
        let motor = Motor::new(gear, bearing_rad, phase, ahead);
        let sonar = Sonar::of(&scene.room().sensor);
        let carrier = Carrier::new(scene.room().waypoints(), laps);
        let standing = scene.room().standing(index);
        Self {
            hearing: Hearing::new(Rc::clone(&scene), air.map(|air| (air, index)), oscillator),
            scene,
            oscillator,
            standing,
            motor,
            sonar,
            switches: Switches::with_bounce(gear.home_bounce_ms),
            carrier,
            rng,
            led: false,
            pinged_s: 0.0,
            echoes_of_others: 0,
        }
    }

    pub fn oscillator(&self) -> Oscillator {
        self.oscillator
    }

    pub fn path_is_done(&self) -> bool {
        self.carrier.is_done()
    }

    pub fn truth(&self, now: Tick) -> Truth {
        let pose = self.pose();
        Truth {
            x_m: pose.position_m.x,
            y_m: pose.position_m.y,
            heading_rad: pose.heading_rad,
            bearing_rad: self.motor.bearing_rad(),
            coils_on: self.motor.is_powered(),
            home_switch_closed: self.home_is_closed(),
            button_pressed: self.button_is_pressed(),
            led_lit: self.led,
            echo_high: self.sonar.echo_is_high(),
            air_temperature_c: self.air_temperature_c(now),
            pinged_s: self.pinged_s,
            echoes_of_others: self.echoes_of_others,
        }
    }

    pub fn air_temperature_c(&self, now: Tick) -> f64 {
        self.scene.room().air_temperature_c(self.shared_s(now))
    }

    /// Injects a fault of one of the unit's parts, until then if it lasts; faults of cable and supply are handled elsewhere.
    pub fn apply(&mut self, fault: &Fault, until: Tick, now: Tick) {
        match *fault {
            Fault::SensorStuckHigh {} => self.sonar.fall_ill(Ailment::StuckHigh, until, now),
            Fault::SensorMissing {} => self.sonar.fall_ill(Ailment::Missing, until, now),
            Fault::SensorDeaf {} => self.sonar.fall_ill(Ailment::Deaf, until, now),
            Fault::SensorShortPulse {} => self.sonar.fall_ill(Ailment::ShortPulse, until, now),
            Fault::SensorTooEarly {} => self.sonar.fall_ill(Ailment::Early, until, now),
            Fault::SensorRepeats { echo_ms } => {
                self.sonar.fall_ill(Ailment::Repeats(from_seconds(echo_ms / 1e3)), until, now);
            }
            Fault::MotorStuck {} => self.motor.stick(until),
            Fault::MotorLosesSteps { probability } => self.motor.lose_steps(probability, until),
            Fault::SensorTurned { by_deg } => self.motor.turn_by_hand(by_deg.to_radians()),
            Fault::HomeNoisy { probability } => self.switches.be_noisy(probability, until),
            Fault::HomeStuckOpen {} => self.switches.stick_home(false, until),
            Fault::HomeStuckClosed {} => self.switches.stick_home(true, until),
            Fault::ButtonHeld {} => self.switches.hold_button(until),
            Fault::Mended {} => {
                self.sonar.mend(now);
                self.motor.mend();
                self.switches.mend();
            }
            Fault::CablePulled {}
            | Fault::CableCorrupts { .. }
            | Fault::PowerCut {}
            | Fault::BrownOut {}
            | Fault::PowerRamp { .. }
            | Fault::ResetPin {}
            | Fault::PowerCutAtFlashOperation { .. }
            | Fault::PcaLosesFlags {}
            | Fault::MemorySpoiled { .. } => {}
        }
    }

    pub fn next_event(&self) -> Tick {
        let sound = if self.sonar.is_busy() { self.hearing.next_arrival() } else { NEVER };
        self.sonar.next_event().min(self.carrier.next_event()).min(self.switches.next_event()).min(sound)
    }

    /// Does what is due by `now`; gives an edge of ECHO if there is one, at its own time. Call until it gives `None`.
    pub fn service(&mut self, now: Tick) -> Option<Edge> {
        while self.carrier.next_event() <= now {
            self.carrier.act(self.carrier.next_event());
        }
        self.switches.release(now);
        while let Some(arrival) = self.hearing.take(now.min(self.sonar.next_event())) {
            self.hear(&arrival);
        }
        if self.sonar.next_event() <= now { self.sonar.take_edge() } else { None }
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
        self.motor.drive(ports.driven_high(2) & PORT_2_COILS, now, &mut self.rng);
        self.switches.disturb(self.motor.home_is_closed(), now, &mut self.rng);
        if self.scene.room().sensor.power_switch {
            self.sonar.power(ports.driven_low(1) & PORT_1_SENSOR_POWER == 0, now);
        }
        self.led = port_1 & PORT_1_LED != 0;
        self.carrier.see_led(self.led, now);
        if self.sonar.trigger(port_1 & PORT_1_TRIGGER != 0, now) {
            self.ping(now);
        }
        Ok(())
    }

    /// What the world does to the chip's pins now.
    pub fn pulls(&self) -> Pulls {
        let mut pulls = Pulls::default();
        let switches = [(self.button_is_pressed(), PORT_1_BUTTON), (self.home_is_closed(), PORT_1_HOME)];
        pulls.low[1] = switches.iter().filter(|(closed, _)| *closed).map(|(_, bit)| bit).sum();
        let echo = if self.sonar.echo_is_high() { &mut pulls.high[1] } else { &mut pulls.low[1] };
        *echo |= PORT_1_ECHO;
        pulls
    }

    fn shared_s(&self, now: Tick) -> f64 {
        to_seconds(self.oscillator.shared(now))
    }

    fn pose(&self) -> Pose {
        self.carrier.pose().unwrap_or(self.standing)
    }

    fn axis_rad(&self) -> f64 {
        self.pose().heading_rad + self.motor.bearing_rad()
    }

    fn button_is_pressed(&self) -> bool {
        self.carrier.presses() || self.switches.button_is_held()
    }

    fn home_is_closed(&self) -> bool {
        self.switches.home_is_closed(self.motor.home_is_closed())
    }

    fn ping(&mut self, now: Tick) {
        let axis_rad = self.axis_rad();
        let offset_m = self.scene.room().sensor.face_offset_m;
        let axis_m = self.pose().position_m;
        let from = Point { x: axis_m.x + offset_m * axis_rad.cos(), y: axis_m.y + offset_m * axis_rad.sin() };
        let look = Look { from, axis_rad, at_s: self.shared_s(now) };
        self.pinged_s = look.at_s;
        let speed_m_s = self.scene.room().speed_of_sound(look.at_s);
        let range_m = self.scene.ping(&look, &mut self.rng);
        let flight = range_m.map(|range_m| from_seconds(2.0 * range_m / speed_m_s));
        self.sonar.ping(flight.map(|flight| self.oscillator.own(flight)), now);
        self.hearing.ping(look, now + self.sonar.lag());
    }

    /// Sound has come: the sensor takes it for its echo if it awaits one and looks there.
    fn hear(&mut self, arrival: &Arrival) {
        let looks_there = self.scene.in_lobe(self.axis_rad(), arrival.from_rad, arrival.range_m);
        if self.sonar.listens(arrival.at) && looks_there && self.rng.random_bool(arrival.chance) {
            self.sonar.hear(arrival.at);
            self.echoes_of_others += u32::from(arrival.of_another);
        }
    }
}
