//! The system clock: OSCICN, CLKMUL, CLKSEL, and what must be set above 25 MHz (datasheet chapters "Oscillators", "Flash Memory").

use crate::chip::sfr;
use crate::chip::violation::Violation;
use crate::time::{TICKS_PER_US, Tick};

const IFCN: u8 = 0x03;
const IOSCEN: u8 = 0x80;
const IFRDY: u8 = 0x40;
const MULEN: u8 = 0x80;
const MULINIT: u8 = 0x40;
const MULRDY: u8 = 0x20;
const FOSE: u8 = 0x80;
const FLRT: u8 = 0x10;
const PFEN: u8 = 0x20;
/// CLKMUL may be initialised 5 us after it was enabled.
const MULTIPLIER_SETTLE: Tick = 5 * TICKS_PER_US;
/// Assumed: the datasheet says only to poll MULRDY.
const MULTIPLIER_LOCK: Tick = 10 * TICKS_PER_US;

pub struct Clock {
    oscicn: u8,
    clkmul: u8,
    clksel: u8,
    flscl: u8,
    pfe0cn: u8,
    multiplier_enabled_at: Tick,
    multiplier_ready_at: Tick,
}

impl Clock {
    /// The state after any reset: 12 MHz / 8, prefetch on.
    pub fn new() -> Self {
        Self {
            oscicn: IOSCEN | IFRDY,
            clkmul: 0,
            clksel: 0,
            flscl: FOSE,
            pfe0cn: PFEN,
            multiplier_enabled_at: 0,
            multiplier_ready_at: 0,
        }
    }

    /// Ticks of 48 MHz per SYSCLK.
    pub fn ticks_per_sysclk(&self) -> Tick {
        match self.clksel {
            2 => 2,
            3 => 1,
            _ => 4 << (3 - (self.oscicn & IFCN)),
        }
    }

    pub fn read(&self, address: u8, now: Tick) -> u8 {
        match address {
            sfr::OSCICN => self.oscicn,
            sfr::CLKMUL => self.clkmul | if self.multiplier_ready(now) { MULRDY } else { 0 },
            sfr::CLKSEL => self.clksel,
            sfr::FLSCL => self.flscl,
            _ => self.pfe0cn,
        }
    }

    /// # Errors
    /// A [`Violation`] if the new setting is one that the chip would not survive or that is not modelled.
    pub fn write(&mut self, address: u8, value: u8, now: Tick) -> Result<(), Violation> {
        match address {
            sfr::OSCICN => self.write_oscicn(value)?,
            sfr::CLKMUL => self.write_clkmul(value, now)?,
            sfr::CLKSEL => self.clksel = value,
            sfr::FLSCL => self.flscl = value,
            _ => self.pfe0cn = value,
        }
        self.check(now)
    }

    /// SYSCLK is above 25 MHz and FLSCL.FLRT is clear.
    pub fn outruns_flash(&self) -> bool {
        self.clksel == 3 && self.flscl & FLRT == 0
    }

    fn multiplier_ready(&self, now: Tick) -> bool {
        self.clkmul & MULINIT != 0 && now >= self.multiplier_ready_at
    }

    fn write_oscicn(&mut self, value: u8) -> Result<(), Violation> {
        if value & IOSCEN == 0 {
            return Err(Violation::rule("OSCICN stops the internal oscillator, the only clock there is"));
        }
        self.oscicn = value | IFRDY;
        Ok(())
    }

    fn write_clkmul(&mut self, value: u8, now: Tick) -> Result<(), Violation> {
        let rising = value & !self.clkmul;
        if rising & MULEN != 0 {
            self.multiplier_enabled_at = now;
        }
        if rising & MULINIT != 0 {
            if value & MULEN == 0 || now < self.multiplier_enabled_at + MULTIPLIER_SETTLE {
                return Err(Violation::rule("CLKMUL initialised less than 5 us after it was enabled"));
            }
            self.multiplier_ready_at = now + MULTIPLIER_LOCK;
        }
        self.clkmul = value & (MULEN | MULINIT);
        Ok(())
    }

    fn check(&self, now: Tick) -> Result<(), Violation> {
        let problem = match self.clksel {
            0 => return Ok(()),
            1 => "CLKSEL selects the external oscillator, of which the board has none",
            _ if self.clkmul & MULEN == 0 || !self.multiplier_ready(now) => {
                "CLKSEL selects the clock multiplier before MULRDY"
            }
            _ if self.oscicn & IFCN != IFCN => {
                "the clock multiplier is not fed with 12 MHz: OSCICN.IFCN is not 11"
            }
            3 if self.pfe0cn & PFEN == 0 => "SYSCLK above 25 MHz without PFE0CN.PFEN is not modelled",
            _ => return Ok(()),
        };
        Err(Violation::rule(problem))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn started() -> Clock {
        let mut clock = Clock::new();
        clock.write(sfr::OSCICN, 0x83, 0).unwrap();
        clock.write(sfr::CLKMUL, MULEN, 0).unwrap();
        clock.write(sfr::CLKMUL, MULEN | MULINIT, MULTIPLIER_SETTLE).unwrap();
        clock
    }

    #[test]
    fn a_reset_runs_at_an_eighth_of_12_mhz() {
        assert_eq!(Clock::new().ticks_per_sysclk(), 48 / 12 * 8);
    }

    #[test]
    fn the_full_start_up_reaches_48_mhz() {
        let mut clock = started();
        let ready = MULTIPLIER_SETTLE + MULTIPLIER_LOCK;
        assert_eq!(clock.read(sfr::CLKMUL, ready - 1) & MULRDY, 0);
        assert_eq!(clock.read(sfr::CLKMUL, ready) & MULRDY, MULRDY);
        clock.write(sfr::FLSCL, FOSE | FLRT, ready).unwrap();
        clock.write(sfr::CLKSEL, 3, ready).unwrap();
        assert_eq!(clock.ticks_per_sysclk(), 1);
    }

    #[test]
    fn selecting_the_multiplier_before_it_is_ready_is_a_fault() {
        let mut clock = started();
        clock.write(sfr::FLSCL, FOSE | FLRT, MULTIPLIER_SETTLE).unwrap();
        assert!(clock.write(sfr::CLKSEL, 3, MULTIPLIER_SETTLE).is_err());
    }

    #[test]
    fn initialising_the_multiplier_at_once_is_a_fault() {
        let mut clock = Clock::new();
        clock.write(sfr::CLKMUL, MULEN, 100).unwrap();
        assert!(clock.write(sfr::CLKMUL, MULEN | MULINIT, 100 + MULTIPLIER_SETTLE - 1).is_err());
    }

    #[test]
    fn more_than_25_mhz_without_flash_wait_states_outruns_flash() {
        let mut clock = started();
        let ready = MULTIPLIER_SETTLE + MULTIPLIER_LOCK;
        for (clksel, flscl, outruns) in [(2, FOSE, false), (3, FOSE, true), (3, FOSE | FLRT, false)] {
            clock.write(sfr::CLKSEL, clksel, ready).unwrap();
            clock.write(sfr::FLSCL, flscl, ready).unwrap();
            assert_eq!(clock.outruns_flash(), outruns);
        }
    }
}
