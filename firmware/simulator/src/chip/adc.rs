//! ADC0 as far as the on-chip temperature sensor needs it (datasheet chapters "10-Bit ADC", "Voltage Reference").
//!
//! AD0BUSY begins a conversion of the sensor against ground, with the internal reference. What breaks a rule of the
//! chapter (sensor or reference off or not yet settled, SAR clock too fast, too short a tracking) gets a result, as
//! on the chip, but one that means nothing.

use super::analog::Analog;
use crate::chip::sfr;
use crate::chip::violation::Violation;
use crate::time::{TICKS_PER_MS, TICKS_PER_SECOND, TICKS_PER_US, Tick};

const AD0EN: u8 = 0x80;
const AD0TM: u8 = 0x40;
const AD0INT: u8 = 0x20;
const AD0BUSY: u8 = 0x10;
const AD0SC_SHIFT: u32 = 3;
const AD0LJST: u8 = 0x04;
const TEMPE: u8 = 0x04;
const REFBE: u8 = 0x01;
const TEMPERATURE_SENSOR: u8 = 0x1E;
const GROUND: u8 = 0x1F;
const SUPPLY: u8 = 0x1F;
const REFERENCE: u8 = 0x1E;
/// Of SYSCLK / (AD0SC + 1). This and the times below are from memory of the datasheet.
const FASTEST_SAR_CLOCK: Tick = TICKS_PER_SECOND / 3_000_000;
const CONVERSION_SAR_CLOCKS: Tick = 10;
/// With AD0TM set every conversion begins with so much tracking.
const TRACKING_SAR_CLOCKS: Tick = 3;
const SHORTEST_TRACKING: Tick = 3 * TICKS_PER_US / 10;
/// System clocks from the write of AD0BUSY until it reads 1: a poll of the very next instruction may find 0. Assumed, from
/// Silicon Labs' advice to poll AD0INT.
const BUSY_SHOWS_AFTER: Tick = 4;
/// The reference is settled to half a code 2 ms after REFBE, with 4.7 uF at its pin (assumed to be on the board).
const REFERENCE_SETTLE: Tick = 2 * TICKS_PER_MS;

struct Conversion {
    code: u16,
    done_at: Tick,
    /// AD0BUSY reads 1 from then on: a clock after it was written.
    shows_at: Tick,
}

pub struct Adc {
    pub analog: Analog,
    control: u8,
    config: u8,
    positive: u8,
    negative: u8,
    reference: u8,
    result: u16,
    conversion: Option<Conversion>,
    /// Since when the sampling capacitor has followed the input.
    tracking_since: Tick,
    reference_since: Tick,
    /// VREF's pin is analog and skipped by the crossbar: else the port's driver fights the reference.
    pub vref_is_analog: bool,
}

impl Adc {
    pub fn new(analog: Analog) -> Self {
        Self {
            analog,
            control: 0,
            config: 0x1F << AD0SC_SHIFT,
            positive: 0,
            negative: 0,
            reference: 0,
            result: 0,
            conversion: None,
            tracking_since: 0,
            reference_since: 0,
            vref_is_analog: false,
        }
    }

    /// A reset of the chip: what is analog stays as it is made.
    pub fn reset(&mut self) {
        *self = Self::new(self.analog.clone());
    }

    /// Ends a conversion that is over by `now`.
    pub fn sync(&mut self, now: Tick) {
        if let Some(conversion) = self.conversion.take_if(|conversion| conversion.done_at <= now) {
            self.result = if self.config & AD0LJST != 0 { conversion.code << 6 } else { conversion.code };
            self.control |= AD0INT;
            self.tracking_since = conversion.done_at;
        }
    }

    /// Call after `sync`.
    pub fn read(&self, address: u8, now: Tick) -> u8 {
        let shows = |conversion: &Conversion| now >= conversion.shows_at;
        match address {
            sfr::ADC0CN => {
                self.control | if self.conversion.as_ref().is_some_and(shows) { AD0BUSY } else { 0 }
            }
            sfr::ADC0CF => self.config,
            sfr::AMX0P => self.positive,
            sfr::AMX0N => self.negative,
            sfr::REF0CN => self.reference,
            _ => self.result.to_le_bytes()[usize::from(address == sfr::ADC0H)],
        }
    }

    /// Call after `sync`.
    ///
    /// # Errors
    /// A [`Violation`] for a conversion of another input than the temperature sensor and the supply.
    pub fn write(
        &mut self,
        address: u8,
        value: u8,
        now: Tick,
        ticks_per_sysclk: Tick,
    ) -> Result<(), Violation> {
        match address {
            sfr::ADC0CN => return self.write_control(value, now, ticks_per_sysclk),
            sfr::ADC0CF => self.config = value,
            sfr::AMX0P | sfr::AMX0N => {
                let input = if address == sfr::AMX0P { &mut self.positive } else { &mut self.negative };
                *input = value;
                self.tracking_since = now;
            }
            sfr::REF0CN => {
                if value & !self.reference & REFBE != 0 {
                    self.reference_since = now;
                }
                self.reference = value;
            }
            _ => {
                let mut bytes = self.result.to_le_bytes();
                bytes[usize::from(address == sfr::ADC0H)] = value;
                self.result = u16::from_le_bytes(bytes);
            }
        }
        Ok(())
    }

    fn write_control(&mut self, value: u8, now: Tick, ticks_per_sysclk: Tick) -> Result<(), Violation> {
        if value & !self.control & AD0EN != 0 {
            self.tracking_since = now;
        }
        self.control = value & (AD0EN | AD0TM | AD0INT);
        if value & AD0EN == 0 {
            self.conversion = None;
        } else if value & AD0BUSY != 0 && self.conversion.is_none() {
            self.conversion = Some(self.convert(now, ticks_per_sysclk)?);
        }
        Ok(())
    }

    fn convert(&mut self, now: Tick, ticks_per_sysclk: Tick) -> Result<Conversion, Violation> {
        let of_supply = (self.positive, self.negative) == (SUPPLY, REFERENCE);
        if !of_supply && (self.positive, self.negative) != (TEMPERATURE_SENSOR, GROUND) {
            return Err(Violation::rule(format!(
                "ADC0 converts AMX0P 0x{:02X} against AMX0N 0x{:02X}: only the temperature sensor (0x1E) against ground (0x1F), and VDD (0x1F) against VREF (0x1E), are modelled",
                self.positive, self.negative
            )));
        }
        let sar_clock = ticks_per_sysclk * (Tick::from(self.config >> AD0SC_SHIFT) + 1);
        let tracking = if self.control & AD0TM != 0 { TRACKING_SAR_CLOCKS * sar_clock } else { 0 };
        let sampled_at = now + tracking;
        let tracked = if tracking > 0 { tracking } else { now - self.tracking_since };
        let means_something = self.reference & (TEMPE | REFBE) == TEMPE | REFBE
            && self.vref_is_analog
            && sar_clock >= FASTEST_SAR_CLOCK
            && tracked >= SHORTEST_TRACKING;
        let code = if means_something && of_supply {
            self.analog.convert_supply(self.reference_settled(sampled_at))
        } else if means_something {
            self.analog.convert_temperature(self.reference_settled(sampled_at))
        } else {
            self.analog.convert_nothing()
        };
        let done_at = sampled_at + CONVERSION_SAR_CLOCKS * sar_clock;
        Ok(Conversion { code, done_at, shows_at: now + BUSY_SHOWS_AFTER * ticks_per_sysclk })
    }

    /// The part of the reference's voltage that has built up, by the charging of its capacitor.
    fn reference_settled(&self, at: Tick) -> f64 {
        let half_codes = f64::from(2 * super::analog::CODES);
        let share = (at - self.reference_since) as f64 / REFERENCE_SETTLE as f64;
        1.0 - half_codes.powf(-share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::NEVER;

    /// Of no consequence: the bias generator is on whenever the ADC or the sensor is.
    const BIASE: u8 = 0x02;
    const READY: Tick = 100 * TICKS_PER_MS;
    /// SYSCLK / 16 of 48 MHz: 3 MHz.
    const AT_3_MHZ: u8 = 15 << AD0SC_SHIFT;
    const SAR: Tick = 16;

    fn adc() -> Adc {
        let mut adc = Adc::new(Analog::of_chip(1));
        adc.analog.die_temperature_c = 25.0;
        adc.vref_is_analog = true;
        for (address, value) in [
            (sfr::REF0CN, TEMPE | BIASE | REFBE),
            (sfr::AMX0P, TEMPERATURE_SENSOR),
            (sfr::AMX0N, GROUND),
            (sfr::ADC0CF, AT_3_MHZ),
            (sfr::ADC0CN, AD0EN),
        ] {
            adc.write(address, value, 0, 1).unwrap();
        }
        adc
    }

    fn convert(adc: &mut Adc, at: Tick) -> u16 {
        let control = adc.read(sfr::ADC0CN, NEVER) & !AD0INT;
        adc.write(sfr::ADC0CN, control | AD0BUSY, at, 1).unwrap();
        adc.sync(at + 1000 * SAR);
        assert_eq!(adc.read(sfr::ADC0CN, NEVER) & (AD0INT | AD0BUSY), AD0INT);
        u16::from_le_bytes([adc.read(sfr::ADC0H - 1, NEVER), adc.read(sfr::ADC0H, NEVER)])
    }

    /// Whether ten conversions lie within 8 codes, as those of a quiet input do and random ones (p < 1e-15) do not.
    fn agree(adc: &mut Adc, spacing: Tick) -> bool {
        let codes: Vec<u16> = (1..=10).map(|round| convert(adc, READY + round * spacing)).collect();
        codes.iter().max().unwrap() - codes.iter().min().unwrap() <= 8
    }

    #[test]
    fn a_conversion_takes_ten_sar_clocks_and_three_more_with_ad0tm() {
        for (mode, clocks) in [(0, 10), (AD0TM, 13)] {
            let mut adc = adc();
            adc.write(sfr::ADC0CN, AD0EN | mode, READY, 1).unwrap();
            adc.write(sfr::ADC0CN, AD0EN | mode | AD0BUSY, 2 * READY, 1).unwrap();
            adc.sync(2 * READY + clocks * SAR - 1);
            assert_eq!(adc.read(sfr::ADC0CN, NEVER) & (AD0INT | AD0BUSY), AD0BUSY);
            adc.sync(2 * READY + clocks * SAR);
            assert_eq!(adc.read(sfr::ADC0CN, NEVER) & (AD0INT | AD0BUSY), AD0INT);
        }
    }

    #[test]
    fn a_result_is_right_or_left_justified() {
        let mut adc = adc();
        let right = convert(&mut adc, READY);
        adc.write(sfr::ADC0CF, AT_3_MHZ | AD0LJST, READY, 1).unwrap();
        let left = convert(&mut adc, 2 * READY);
        // (776 + 2.86 * 25) mV / 2.44 V * 1024 = 356, within the chip's error of 6 %.
        assert!((335..377).contains(&right), "{right}");
        assert_eq!(left & 0x3F, 0);
        assert!((left >> 6).abs_diff(right) <= 8);
    }

    #[test]
    fn the_sensor_is_quiet_if_every_rule_is_kept() {
        assert!(agree(&mut adc(), READY));
    }

    #[test]
    fn without_sensor_reference_slow_enough_a_clock_or_tracking_a_result_means_nothing() {
        for (address, value) in
            [(sfr::REF0CN, BIASE | REFBE), (sfr::REF0CN, TEMPE | BIASE), (sfr::ADC0CF, 14 << AD0SC_SHIFT)]
        {
            let mut adc = adc();
            adc.write(address, value, 0, 1).unwrap();
            assert!(!agree(&mut adc, READY), "SFR 0x{address:02X}");
        }
        let mut adc = adc();
        let codes: Vec<u16> = (1..=10)
            .map(|round| {
                adc.write(sfr::AMX0P, TEMPERATURE_SENSOR, round * READY, 1).unwrap();
                convert(&mut adc, round * READY + SHORTEST_TRACKING - 1)
            })
            .collect();
        assert!(codes.iter().max().unwrap() - codes.iter().min().unwrap() > 8);
    }

    #[test]
    fn a_reference_that_has_not_settled_gives_too_high_a_code() {
        let code = |after: Tick| {
            let mut adc = adc();
            adc.write(sfr::REF0CN, TEMPE, READY, 1).unwrap();
            adc.write(sfr::REF0CN, TEMPE | REFBE, READY, 1).unwrap();
            convert(&mut adc, READY + after)
        };
        assert!(code(REFERENCE_SETTLE / 5) > code(REFERENCE_SETTLE) + 50);
        assert!(code(REFERENCE_SETTLE).abs_diff(code(10 * REFERENCE_SETTLE)) <= 2);
    }

    #[test]
    fn a_reference_on_a_digital_pin_means_nothing() {
        let mut adc = adc();
        adc.vref_is_analog = false;
        assert!(!agree(&mut adc, READY));
    }

    #[test]
    fn ad0busy_may_read_0_right_after_it_was_written() {
        let mut adc = adc();
        adc.write(sfr::ADC0CN, AD0EN | AD0BUSY, READY, 1).unwrap();
        assert_eq!(adc.read(sfr::ADC0CN, READY + BUSY_SHOWS_AFTER - 1) & AD0BUSY, 0);
        assert_eq!(adc.read(sfr::ADC0CN, READY + BUSY_SHOWS_AFTER) & AD0BUSY, AD0BUSY);
    }

    #[test]
    fn nothing_is_converted_while_ad0en_is_clear() {
        let mut adc = adc();
        adc.write(sfr::ADC0CN, AD0BUSY, READY, 1).unwrap();
        adc.sync(2 * READY);
        assert_eq!(adc.read(sfr::ADC0CN, NEVER), 0);
    }

    #[test]
    fn the_supply_is_told_by_how_much_it_exceeds_the_reference() {
        let mut adc = adc();
        adc.write(sfr::AMX0P, SUPPLY, READY, 1).unwrap();
        adc.write(sfr::AMX0N, REFERENCE, READY, 1).unwrap();
        let codes = convert(&mut adc, 2 * READY);
        // (3.3 / 2.44 - 1) * 512 = 180, and 164 to 198 by the limits of the reference.
        assert!((162..200).contains(&codes), "{codes}");
        adc.analog.supply_v = 2.0;
        assert!((convert(&mut adc, 3 * READY) as i16) < -80);
    }

    #[test]
    fn another_input_is_refused() {
        let mut adc = adc();
        adc.write(sfr::AMX0P, 0, READY, 1).unwrap();
        assert!(adc.write(sfr::ADC0CN, AD0EN | AD0BUSY, 2 * READY, 1).is_err());
    }
}
