//! Reset sources and the supply monitor: RSTSRC, VDM0CN (datasheet chapter "Reset Sources").

use crate::chip::sfr;
use crate::time::{TICKS_PER_US, Tick};

const VDMEN: u8 = 0x80;
const VDDSTAT: u8 = 0x40;
const PINRSF: u8 = 0x01;
const PORSF: u8 = 0x02;
const WDTRSF: u8 = 0x08;
const SWRSF: u8 = 0x10;
const FERROR: u8 = 0x40;
/// Selected sooner after it was enabled, the supply monitor resets the chip.
const MONITOR_SETTLE: Tick = 100 * TICKS_PER_US;

/// Causes of a reset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    PowerUp,
    SupplyMonitor,
    /// /RST was pulled low from outside.
    Pin,
    Watchdog,
    Software,
    FlashError,
}

impl Cause {
    /// Its bit in RSTSRC.
    fn flag(self) -> u8 {
        match self {
            Self::PowerUp | Self::SupplyMonitor => PORSF,
            Self::Pin => PINRSF,
            Self::Watchdog => WDTRSF,
            Self::Software => SWRSF,
            Self::FlashError => FERROR,
        }
    }
}

pub struct Resets {
    cause: Cause,
    monitor_enabled_at: Option<Tick>,
    monitor_resets: bool,
    supply_is_low: bool,
}

impl Resets {
    pub fn power_up() -> Self {
        Self { cause: Cause::PowerUp, monitor_enabled_at: None, monitor_resets: false, supply_is_low: false }
    }

    /// A reset by `cause`; only a power-up changes the supply monitor.
    pub fn reset(&mut self, cause: Cause) {
        if cause == Cause::PowerUp {
            *self = Self { supply_is_low: self.supply_is_low, ..Self::power_up() };
        }
        self.cause = cause;
    }

    pub fn read(&self, address: u8) -> u8 {
        if address == sfr::RSTSRC {
            return self.cause.flag() | self.meaningless();
        }
        let vddstat = if self.supply_is_low { 0 } else { VDDSTAT };
        vddstat | if self.monitor_enabled_at.is_some() { VDMEN } else { 0 }
    }

    /// Beside PORSF the other flags mean nothing (datasheet, RSTSRC): here they are up.
    fn meaningless(&self) -> u8 {
        if self.cause.flag() == PORSF { PINRSF | WDTRSF | SWRSF } else { 0 }
    }

    pub fn set_supply_low(&mut self, low: bool) {
        self.supply_is_low = low;
    }

    /// Gives the reset that the write causes, if any.
    pub fn write(&mut self, address: u8, value: u8, now: Tick) -> Option<Cause> {
        if address == sfr::VDM0CN {
            self.monitor_enabled_at = (value & VDMEN != 0).then(|| self.monitor_enabled_at.unwrap_or(now));
            return None;
        }
        self.monitor_resets = value & PORSF != 0;
        let settled = self.monitor_enabled_at.is_some_and(|at| now >= at + MONITOR_SETTLE);
        if self.monitor_resets && (!settled || self.supply_is_low) {
            return Some(Cause::SupplyMonitor);
        }
        (value & SWRSF != 0).then_some(Cause::Software)
    }

    /// Whether flash may be written: the supply monitor is on and resets the chip.
    pub fn supply_monitored(&self) -> bool {
        self.monitor_resets && self.monitor_enabled_at.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_supply_monitor_guards_flash_once_it_is_on_and_selected() {
        let mut resets = Resets::power_up();
        resets.write(sfr::VDM0CN, VDMEN, 0);
        assert!(!resets.supply_monitored());
        assert_eq!(resets.write(sfr::RSTSRC, PORSF, MONITOR_SETTLE), None);
        assert!(resets.supply_monitored());
        resets.reset(Cause::Software);
        assert!(resets.supply_monitored());
    }

    #[test]
    fn selecting_the_monitor_before_it_is_stable_resets_the_chip() {
        let mut resets = Resets::power_up();
        resets.write(sfr::VDM0CN, VDMEN, 0);
        assert_eq!(resets.write(sfr::RSTSRC, PORSF, MONITOR_SETTLE - 1), Some(Cause::SupplyMonitor));
    }

    #[test]
    fn vddstat_tells_a_low_supply_and_a_monitor_that_is_selected_then_resets_the_chip() {
        let mut resets = Resets::power_up();
        resets.write(sfr::VDM0CN, VDMEN, 0);
        assert_eq!(resets.read(sfr::VDM0CN), VDMEN | VDDSTAT);
        resets.set_supply_low(true);
        assert_eq!(resets.read(sfr::VDM0CN), VDMEN);
        assert_eq!(resets.write(sfr::RSTSRC, PORSF, MONITOR_SETTLE), Some(Cause::SupplyMonitor));
    }

    #[test]
    fn rstsrc_names_the_last_cause() {
        let mut resets = Resets::power_up();
        assert_eq!(resets.read(sfr::RSTSRC) & 0x02, 0x02);
        assert_eq!(resets.write(sfr::RSTSRC, SWRSF, 0), Some(Cause::Software));
        resets.reset(Cause::Watchdog);
        assert_eq!(resets.read(sfr::RSTSRC), 0x08);
    }
}
