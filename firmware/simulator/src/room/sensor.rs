//! The sensor of a room's units: its noise, its faults, its lobe.

use crate::room::interpolation::{between, bracket, rises};
use serde::Deserialize;

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Sensor {
    pub range_bias_m: f64,
    pub range_sigma_m: f64,
    /// Half the beam's width, linear between the given ranges and constant beyond them.
    pub lobe: Vec<LobePoint>,
    /// An echo found one or two cycles of 40 kHz late.
    pub late_echo_probability: f64,
    /// An echo that is not heard.
    pub lost_echo_probability: f64,
    /// A range from nowhere in place of the reading.
    pub false_echo_probability: f64,
    /// How long the room keeps a ping's sound: a ping that follows sooner may hear it.
    pub reverberation_ms: f64,
    /// From the end of the trigger to ECHO high. The kinds that people buy: 0.45 to 2.3, 12.3 and 42 ms.
    pub echo_lag_ms: f64,
    /// TRIG must be high for so long: 10 us (HC-SR04), 20 and more (JSN-SR04T).
    pub shortest_trigger_us: f64,
    /// How long ECHO is high when nothing is heard: 38 ms; kinds without a time-out, and those that latch, never come down.
    pub no_echo_ms: f64,
    /// A transistor in the sensor's supply, at P1.6: low cuts it.
    pub power_switch: bool,
    /// How far the sensor's face stands off the motor's axis, towards where it looks.
    pub face_offset_m: f64,
}

/// The shortest lag of ECHO: the burst and some more. Measured by a prototype.
pub const ECHO_LAG_MS: f64 = 0.45;
/// Longer than any run.
const FOR_EVER_MS: f64 = 1e9;

/// The rule of thumb for pings of an HC-SR04: not less than 29 ms apart.
const REVERBERATION_MS: f64 = 29.0;

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LobePoint {
    pub range_m: f64,
    pub half_angle_deg: f64,
}

impl Default for Sensor {
    /// No noise, and the HC-SR04's lobe as measured by many: wide close by, 9 to 10 deg from 0.5 to 1.5 m.
    fn default() -> Self {
        let lobe = [(0.3, 20.0), (0.5, 10.0), (1.5, 9.0), (4.0, 6.0)];
        Self {
            range_bias_m: 0.0,
            range_sigma_m: 0.0,
            lobe: lobe.map(|(range_m, half_angle_deg)| LobePoint { range_m, half_angle_deg }).to_vec(),
            late_echo_probability: 0.0,
            lost_echo_probability: 0.0,
            false_echo_probability: 0.0,
            reverberation_ms: REVERBERATION_MS,
            echo_lag_ms: ECHO_LAG_MS,
            shortest_trigger_us: 10.0,
            no_echo_ms: 38.0,
            power_switch: false,
            face_offset_m: 0.0,
        }
    }
}

impl Sensor {
    /// Half the beam's width at a range.
    pub fn half_beam_rad(&self, range_m: f64) -> f64 {
        let (near, far, share) = bracket(&self.lobe, |point| point.range_m, range_m);
        between(near.half_angle_deg, far.half_angle_deg, share).to_radians()
    }

    /// The first thing wrong: field and problem.
    pub fn problem(&self) -> Option<(&'static str, &'static str)> {
        let probabilities =
            [self.late_echo_probability, self.lost_echo_probability, self.false_echo_probability];
        if !rises(&self.lobe, |point| point.range_m) {
            return Some(("sensor.lobe", "must have rising range_m"));
        }
        if !probabilities.iter().all(|probability| (0.0..=1.0).contains(probability)) {
            return Some(("sensor", "has a probability outside 0 to 1"));
        }
        if !self.lobe.iter().all(|point| (0.0..=180.0).contains(&point.half_angle_deg)) {
            return Some(("sensor.lobe", "has a half_angle_deg outside 0 to 180"));
        }
        if !(0.0..=1000.0).contains(&self.reverberation_ms) {
            return Some(("sensor.reverberation_ms", "is outside 0 to 1000"));
        }
        if !(ECHO_LAG_MS..=100.0).contains(&self.echo_lag_ms) {
            return Some(("sensor.echo_lag_ms", "is outside 0.45 to 100"));
        }
        if !(1.0..=1000.0).contains(&self.shortest_trigger_us) {
            return Some(("sensor.shortest_trigger_us", "is outside 1 to 1000"));
        }
        if !(1.0..=FOR_EVER_MS).contains(&self.no_echo_ms) {
            return Some(("sensor.no_echo_ms", "is outside 1 to 1e9"));
        }
        if !(0.0..=0.2).contains(&self.face_offset_m) {
            return Some(("sensor.face_offset_m", "is outside 0 to 0.2"));
        }
        if !(-1.0..=1.0).contains(&self.range_bias_m) {
            return Some(("sensor.range_bias_m", "is outside -1 to 1"));
        }
        (!(0.0..=1.0).contains(&self.range_sigma_m)).then_some(("sensor.range_sigma_m", "is outside 0 to 1"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_lobe_is_20_deg_close_by_and_9_to_10_deg_from_half_a_metre_on() {
        let sensor = Sensor::default();
        for (range_m, half_deg) in [(0.1, 20.0), (0.5, 10.0), (1.0, 9.5), (1.5, 9.0), (9.0, 6.0)] {
            assert!((sensor.half_beam_rad(range_m).to_degrees() - half_deg).abs() < 1e-9, "{range_m}");
        }
    }

    #[test]
    fn a_sensor_that_cannot_be_is_refused_by_its_field() {
        let sound = Sensor::default;
        assert_eq!(sound().problem(), None);
        let wide = vec![LobePoint { range_m: 1.0, half_angle_deg: 200.0 }];
        for (sensor, field) in [
            (Sensor { lost_echo_probability: 1.5, ..sound() }, "sensor"),
            (Sensor { lobe: wide, ..sound() }, "sensor.lobe"),
            (Sensor { reverberation_ms: f64::INFINITY, ..sound() }, "sensor.reverberation_ms"),
            (Sensor { range_bias_m: f64::NAN, ..sound() }, "sensor.range_bias_m"),
            (Sensor { echo_lag_ms: 0.1, ..sound() }, "sensor.echo_lag_ms"),
            (Sensor { shortest_trigger_us: 0.0, ..sound() }, "sensor.shortest_trigger_us"),
            (Sensor { no_echo_ms: f64::INFINITY, ..sound() }, "sensor.no_echo_ms"),
            (Sensor { face_offset_m: -0.1, ..sound() }, "sensor.face_offset_m"),
            (Sensor { range_sigma_m: -0.1, ..sound() }, "sensor.range_sigma_m"),
        ] {
            assert_eq!(sensor.problem().map(|problem| problem.0), Some(field));
        }
    }
}
