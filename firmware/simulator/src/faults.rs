//! What can go wrong with a unit on demand: its parts, its cable, its supply. By a schedule, or when a test says so.

use crate::chip::memory::XRAM_SIZE;
use crate::time::{NEVER, Tick, from_seconds};
use serde::Deserialize;
use std::collections::VecDeque;
use std::path::Path;
use thiserror::Error;

const XRAM_END: u16 = XRAM_SIZE as u16;

/// A fault, told apart by its `kind` in TOML and JSON.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Fault {
    /// ECHO goes high and stays so.
    SensorStuckHigh {},
    /// ECHO never rises.
    SensorMissing {},
    /// The sensor hears nothing.
    SensorDeaf {},
    /// ECHO is high for 50 us, shorter than any echo.
    SensorShortPulse {},
    /// ECHO rises before the trigger is over.
    SensorTooEarly {},
    /// ECHO is high for so long at every ping, whatever is before the sensor.
    SensorRepeats {
        echo_ms: f64,
    },
    MotorStuck {},
    /// Each half step slips a magnetic period with that probability.
    MotorLosesSteps {
        probability: f64,
    },
    /// Someone turns the sensor by hand. At once, and not undone.
    SensorTurned {
        by_deg: f64,
    },
    /// The home switch's line is wrong that often at each look.
    HomeNoisy {
        probability: f64,
    },
    HomeStuckOpen {},
    HomeStuckClosed {},
    ButtonHeld {},
    /// Nothing passes either way; the socket or terminal stays open.
    CablePulled {},
    /// A bit of a byte is wrong with that probability, by direction.
    CableCorrupts {
        #[serde(default)]
        to_unit: f64,
        #[serde(default)]
        to_host: f64,
    },
    /// The supply is gone; says for how long.
    PowerCut {},
    /// The supply dips below what the chip runs at.
    BrownOut {},
    /// The supply goes and comes back, rising from nothing in that time, with so many dips of any depth.
    PowerRamp {
        rise_ms: f64,
        #[serde(default)]
        dips: u32,
    },
    /// /RST is pulled low for a moment.
    ResetPin {},
    /// The supply fails at the n-th flash operation from now, counted from 1.
    PowerCutAtFlashOperation {
        number: u32,
    },
    /// A flag of the PCA is lost if it goes up while an instruction reads, changes and writes PCA0CN.
    PcaLosesFlags {},
    /// All bits of a byte of XRAM flip.
    MemorySpoiled {
        address: u16,
    },
    /// All that lasts is mended.
    Mended {},
}

impl Fault {
    /// It is over as soon as it has happened.
    fn is_momentary(&self) -> bool {
        matches!(
            self,
            Self::SensorTurned { .. }
                | Self::BrownOut {}
                | Self::PowerRamp { .. }
                | Self::ResetPin {}
                | Self::MemorySpoiled { .. }
                | Self::PowerCutAtFlashOperation { .. }
                | Self::Mended {}
        )
    }
}

/// A fault, the unit that it happens to, and how long it lasts.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct Injection {
    /// The unit's serial number; all units without it.
    pub unit: Option<u32>,
    /// Until the end without it.
    pub for_s: Option<f64>,
    #[serde(flatten)]
    pub fault: Fault,
}

impl Injection {
    /// When it is over, if it begins now.
    pub fn until(&self, now: Tick) -> Tick {
        self.for_s.map_or(NEVER, |seconds| now.saturating_add(from_seconds(seconds)))
    }

    pub fn strikes(&self, serial: u32) -> bool {
        self.unit.is_none_or(|unit| unit == serial)
    }

    /// What is wrong with the figures in a fleet of so many units: field and problem.
    pub fn problem(&self, units: usize) -> Option<(&'static str, &'static str)> {
        let chance =
            |field, value: f64| (!(0.0..=1.0).contains(&value)).then_some((field, "is outside 0 to 1"));
        if self.for_s.is_some_and(|seconds| seconds.is_nan() || seconds <= 0.0) {
            return Some(("for_s", "is not positive"));
        }
        if self.unit.is_some_and(|unit| !(1..=units).contains(&(unit as usize))) {
            return Some(("unit", "is none of the units"));
        }
        match self.fault {
            Fault::MotorLosesSteps { probability } | Fault::HomeNoisy { probability } => {
                chance("probability", probability)
            }
            Fault::CableCorrupts { to_unit, to_host } => {
                chance("to_unit", to_unit).or(chance("to_host", to_host))
            }
            Fault::PowerCut {} if self.for_s.is_none() => Some(("for_s", "is missing: how long is the cut?")),
            Fault::PowerRamp { rise_ms, .. } if !(0.001..=10_000.0).contains(&rise_ms) => {
                Some(("rise_ms", "is outside 0.001 to 10000"))
            }
            Fault::PowerRamp { dips: 1001.., .. } => Some(("dips", "is more than 1000")),
            Fault::PowerCutAtFlashOperation { number: 0 } => Some(("number", "counts from 1")),
            Fault::MemorySpoiled { address: XRAM_END.. } => {
                Some(("address", "is outside the 4096 bytes of XRAM"))
            }
            Fault::SensorRepeats { echo_ms } if !(0.001..=1000.0).contains(&echo_ms) => {
                Some(("echo_ms", "is outside 0.001 to 1000"))
            }
            Fault::SensorTurned { by_deg } if !by_deg.is_finite() => Some(("by_deg", "is no angle")),
            _ if self.for_s.is_some() && self.fault.is_momentary() => {
                Some(("for_s", "means nothing here: it happens at once"))
            }
            _ => None,
        }
    }
}

#[derive(Debug, Error)]
pub enum FaultError {
    #[error("faults {file}: {source}")]
    Unreadable { file: String, source: std::io::Error },
    #[error("faults {file}: {source}")]
    Malformed { file: String, source: Box<toml::de::Error> },
    #[error("faults {file}: fault {number}: {field} {problem}")]
    Wrong { file: String, number: usize, field: &'static str, problem: &'static str },
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Schedule {
    #[serde(rename = "fault")]
    faults: Vec<Scheduled>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
struct Scheduled {
    at_s: f64,
    #[serde(flatten)]
    injection: Injection,
}

/// Faults to come, soonest first.
#[derive(Debug, Default)]
pub struct FaultSchedule(VecDeque<Scheduled>);

impl FaultSchedule {
    /// The schedule in a file, for a fleet of so many units.
    ///
    /// # Errors
    /// A [`FaultError`] naming the file, and the fault and its field if they are not as they should be.
    pub fn load(path: &Path, units: usize) -> Result<Self, FaultError> {
        let file = path.display().to_string();
        match std::fs::read_to_string(path) {
            Ok(text) => Self::parse(&file, &text, units),
            Err(source) => Err(FaultError::Unreadable { file, source }),
        }
    }

    fn parse(file: &str, text: &str, units: usize) -> Result<Self, FaultError> {
        let file = file.to_owned();
        let mut faults = match toml::from_str::<Schedule>(text) {
            Ok(schedule) => schedule.faults,
            Err(source) => return Err(FaultError::Malformed { file, source: Box::new(source) }),
        };
        for (index, fault) in faults.iter().enumerate() {
            let early = (fault.at_s.is_nan() || fault.at_s < 0.0).then_some(("at_s", "is negative"));
            if let Some((field, problem)) = early.or_else(|| fault.injection.problem(units)) {
                return Err(FaultError::Wrong { file, number: index + 1, field, problem });
            }
        }
        faults.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        Ok(Self(faults.into()))
    }

    pub fn len(&self) -> usize {
        self.0.len()
    }

    pub fn next_at(&self) -> Tick {
        self.0.front().map_or(NEVER, |fault| from_seconds(fault.at_s))
    }

    /// What is due by `now`, one at a time.
    pub fn take(&mut self, now: Tick) -> Option<Injection> {
        if self.next_at() > now { None } else { self.0.pop_front().map(|fault| fault.injection) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        FaultSchedule::parse("faults.toml", text, 2).unwrap_err().to_string()
    }

    #[test]
    fn faults_come_in_the_order_of_their_times() {
        let text = "[[fault]]\nat_s = 3.5\nunit = 2\nkind = 'cable_pulled'\nfor_s = 10\n\
                    [[fault]]\nat_s = 1\nkind = 'motor_loses_steps'\nprobability = 0.1\n";
        let mut faults = FaultSchedule::parse("faults.toml", text, 2).unwrap();
        assert_eq!(faults.len(), 2);
        assert_eq!(faults.next_at(), from_seconds(1.0));
        assert_eq!(faults.take(from_seconds(0.9)), None);
        let first = faults.take(from_seconds(9.0)).unwrap();
        assert_eq!(first.fault, Fault::MotorLosesSteps { probability: 0.1 });
        assert!(first.strikes(1) && first.until(7) == NEVER);
        let second = faults.take(from_seconds(9.0)).unwrap();
        assert_eq!(second.fault, Fault::CablePulled {});
        assert!(second.strikes(2) && !second.strikes(1));
        assert_eq!(second.until(0), from_seconds(10.0));
    }

    #[test]
    fn what_lasts_longer_than_time_can_be_told_lasts_for_good() {
        let text = "[[fault]]\nat_s = 1.0\nkind = 'button_held'\nfor_s = 1e15\n";
        let mut faults = FaultSchedule::parse("faults.toml", text, 1).unwrap();
        assert_eq!(faults.take(from_seconds(2.0)).unwrap().until(7), NEVER);
    }

    #[test]
    fn an_unknown_kind_and_an_unknown_field_are_named_with_the_file() {
        let unknown_kind = error("[[fault]]\nat_s = 1.0\nkind = 'gremlin'\n");
        assert!(unknown_kind.contains("faults.toml") && unknown_kind.contains("gremlin"), "{unknown_kind}");
        for kind in ["cable_pulled", "motor_loses_steps"] {
            let text = format!("[[fault]]\nat_s = 1.0\nkind = '{kind}'\nprobability = 0.5\ncolour = 'red'\n");
            let unknown_field = error(&text);
            assert!(
                unknown_field.contains("faults.toml") && unknown_field.contains("unknown field"),
                "{unknown_field}"
            );
        }
        assert!(error("[[gremlin]]\nat_s = 1.0\nkind = 'cable_pulled'\n").contains("gremlin"));
    }

    #[test]
    fn figures_that_cannot_be_are_named_with_the_fault() {
        for (fields, field) in [
            ("kind = 'motor_loses_steps'\nprobability = 2.0", "probability"),
            ("kind = 'cable_corrupts'\nto_host = -0.1", "to_host"),
            ("kind = 'power_cut'", "for_s"),
            ("kind = 'power_cut_at_flash_operation'\nnumber = 0", "number"),
            ("kind = 'power_ramp'\nrise_ms = 0.0", "rise_ms"),
            ("kind = 'memory_spoiled'\naddress = 4096", "address"),
            ("kind = 'sensor_repeats'\necho_ms = 0.0", "echo_ms"),
            ("kind = 'button_held'\nfor_s = 0.0", "for_s"),
            ("kind = 'button_held'\nunit = 3", "unit"),
            ("kind = 'sensor_turned'\nby_deg = nan", "by_deg"),
            ("kind = 'brown_out'\nfor_s = 1.0", "for_s"),
        ] {
            let found = error(&format!("[[fault]]\nat_s = 1.0\n{fields}\n"));
            assert!(found.contains("fault 1") && found.contains(field), "{found}");
        }
    }
}
