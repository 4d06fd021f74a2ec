//! The chip's analog side: what the temperature sensor and the voltage reference of this very chip give, and what a
//! conversion makes of it (datasheet chapters "10-Bit ADC", "Voltage Reference", tables of characteristics).

use crate::random::{Part, stream};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

const SENSOR_GAIN_V_PER_K: f64 = 2.86e-3;
const SENSOR_OFFSET_V: f64 = 0.776;
/// One standard deviation of either, from memory of the datasheet; chips further off than two are taken to be sorted out.
const SENSOR_GAIN_SIGMA_V_PER_K: f64 = 33.5e-6;
const SENSOR_OFFSET_SIGMA_V: f64 = 8.51e-3;
const WORST_SIGMAS: f64 = 2.0;
/// 2.38 to 2.50 V, typically 2.44 V: from memory of the datasheet.
const REFERENCE_V: f64 = 2.44;
const REFERENCE_LIMIT_V: f64 = 0.06;
/// Of one conversion. Assumed.
const NOISE_LSB: f64 = 0.6;
/// Until the world says otherwise.
const ROOM_TEMPERATURE_C: f64 = 20.0;
const SUPPLY_V: f64 = 3.3;
pub const CODES: u16 = 1024;

#[derive(Clone)]
pub struct Analog {
    pub die_temperature_c: f64,
    pub supply_v: f64,
    sensor_gain_v_per_k: f64,
    sensor_offset_v: f64,
    reference_v: f64,
    rng: ChaCha8Rng,
}

impl Analog {
    /// The analog side of the chip with that seed: its errors are its own and stay.
    pub fn of_chip(seed: u64) -> Self {
        let mut rng = stream(seed, Part::Analog);
        let error = |rng: &mut ChaCha8Rng, sigma: f64, limit: f64| {
            (sigma * standard_normal(rng)).clamp(-limit, limit)
        };
        let of_sensor = |rng: &mut ChaCha8Rng, sigma| error(rng, sigma, WORST_SIGMAS * sigma);
        Self {
            die_temperature_c: ROOM_TEMPERATURE_C,
            supply_v: SUPPLY_V,
            sensor_gain_v_per_k: SENSOR_GAIN_V_PER_K + of_sensor(&mut rng, SENSOR_GAIN_SIGMA_V_PER_K),
            sensor_offset_v: SENSOR_OFFSET_V + of_sensor(&mut rng, SENSOR_OFFSET_SIGMA_V),
            reference_v: REFERENCE_V + error(&mut rng, REFERENCE_LIMIT_V / 3.0, REFERENCE_LIMIT_V),
            rng,
        }
    }

    /// The code of the temperature sensor against the reference, of which `settled` (0 to 1) has built up.
    pub fn convert_temperature(&mut self, settled: f64) -> u16 {
        let sensor_v = self.sensor_offset_v + self.sensor_gain_v_per_k * self.die_temperature_c;
        let code = sensor_v / (self.reference_v * settled) * f64::from(CODES);
        (code + NOISE_LSB * standard_normal(&mut self.rng)).clamp(0.0, f64::from(CODES - 1)) as u16
    }

    /// The signed code of the supply against the reference, of which `settled` has built up, in differential mode.
    pub fn convert_supply(&mut self, settled: f64) -> u16 {
        let half = f64::from(CODES / 2);
        let code = (self.supply_v / (self.reference_v * settled) - 1.0) * half;
        (code + NOISE_LSB * standard_normal(&mut self.rng)).clamp(-half, half - 1.0).floor() as i16 as u16
    }

    /// The code of an input that nothing drives.
    pub fn convert_nothing(&mut self) -> u16 {
        self.rng.random_range(0..CODES)
    }
}

fn standard_normal(rng: &mut ChaCha8Rng) -> f64 {
    Normal::new(0.0, 1.0).expect("1 is a standard deviation").sample(rng)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean_code(analog: &mut Analog) -> f64 {
        (0..400).map(|_| f64::from(analog.convert_temperature(1.0))).sum::<f64>() / 400.0
    }

    #[test]
    fn a_degree_is_2_86_mv_and_zero_776_mv_on_the_average_chip() {
        let codes = |temperature_c| {
            (0..200)
                .map(|seed| {
                    mean_code(&mut Analog { die_temperature_c: temperature_c, ..Analog::of_chip(seed) })
                })
                .sum::<f64>()
                / 200.0
        };
        // A code is truncated: half a code below the exact value on average.
        let exact = |temperature_c: f64| (0.776 + 0.00286 * temperature_c) / 2.44 * 1024.0 - 0.5;
        assert!((codes(0.0) - exact(0.0)).abs() < 1.0, "{} {}", codes(0.0), exact(0.0));
        assert!((codes(50.0) - exact(50.0)).abs() < 1.0, "{} {}", codes(50.0), exact(50.0));
    }

    #[test]
    fn every_chip_has_errors_of_its_own_within_the_datasheets_limits() {
        let chips: Vec<Analog> = (0..200).map(Analog::of_chip).collect();
        for chip in &chips {
            assert!((chip.sensor_gain_v_per_k - 2.86e-3).abs() <= 67.01e-6);
            assert!((chip.sensor_offset_v - 0.776).abs() <= 17.03e-3);
            assert!((chip.reference_v - 2.44).abs() <= 0.0601);
        }
        assert!(chips.windows(2).all(|pair| pair[0].sensor_offset_v != pair[1].sensor_offset_v));
    }
}
