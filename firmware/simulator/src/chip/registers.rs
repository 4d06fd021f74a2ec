//! Accesses to special function registers go to the peripheral that answers for them; one without is a violation.

use super::Chip;
use super::sfr::{self, Owner};
use crate::chip::violation::Violation;
use crate::time::Tick;

const PCON_IDLE: u8 = 0x01;
/// The voltage reference's pin on the chip of 48 pins.
const VREF: (usize, u8) = (1, 5);
const CKCON_EXTERNAL_CLOCK: u8 = 0x03;
const CKCON_T2ML: u8 = 0x10;
const CKCON_T3ML: u8 = 0x40;

/// Who answers for a register, if it has a model.
fn owner(address: u8, access: &'static str) -> Result<Owner, Violation> {
    sfr::OWNERS[address as usize].ok_or(Violation::UnmodelledSfr { address, access })
}

/// Refuses bits that have no model.
fn check_bits(address: u8, value: u8) -> Result<(), Violation> {
    match value & !sfr::MODELLED[address as usize] {
        0 => Ok(()),
        bits => Err(Violation::UnmodelledBits { address, value, bits }),
    }
}

impl Chip {
    /// Announces the access of the current instruction, which takes `clocks`; counters are brought up to date before it.
    /// The instruction `modifies` what it reads, or it only reads or only writes.
    pub fn prepare_access(&mut self, address: u8, modifies: bool, clocks: u8) {
        self.reads_latch = modifies;
        match sfr::OWNERS[address as usize] {
            Some(Owner::Timers) => self.timers.sync(self.now),
            Some(Owner::Timer2Control | Owner::Timer2(_)) => self.timer2.sync(self.now),
            Some(Owner::Timer3Control | Owner::Timer3(_)) => self.timer3.sync(self.now),
            Some(Owner::Pca) => {
                self.pca.sync(self.now);
                if modifies && address == sfr::PCA0CN {
                    let duration = Tick::from(clocks) * self.clock.ticks_per_sysclk();
                    self.pca.change_control_until(self.now + duration);
                }
            }
            Some(Owner::Adc) => {
                self.adc.vref_is_analog = self.ports.is_analog(VREF);
                self.adc.sync(self.now);
            }
            _ => {}
        }
    }

    /// What a register gives; those that live in the core never come here.
    pub(super) fn read_sfr(&self, address: u8) -> Result<u8, Violation> {
        Ok(match owner(address, "read")? {
            Owner::Ports => self.ports.read(address, self.reads_latch),
            Owner::Core => 0,
            Owner::Power => self.general_flags,
            Owner::Timers => self.timers.read(address),
            Owner::TimerClocks => self.ckcon,
            Owner::Flash => self.flash.read(address),
            Owner::Timer2Control => self.timer2.control(),
            Owner::Timer2(register) => self.timer2.read(register),
            Owner::Timer3Control => self.timer3.control(),
            Owner::Timer3(register) => self.timer3.read(register),
            Owner::Uart => self.uart.read(address),
            Owner::Clock => self.clock.read(address, self.now),
            Owner::MovxPage => self.emi0cn,
            Owner::Pca => self.pca.read(address),
            Owner::Interrupts => self.interrupts.read(address),
            Owner::Resets => self.resets.read(address),
            Owner::Adc => self.adc.read(address, self.now),
        })
    }

    pub(super) fn write_sfr(&mut self, address: u8, value: u8) -> Result<(), Violation> {
        let owner = owner(address, "write")?;
        check_bits(address, value)?;
        self.touched.set(true);
        self.rescheduled |= owner != Owner::Ports;
        match owner {
            Owner::Core => {}
            Owner::Ports => self.ports.write(address, value),
            Owner::Power => self.write_pcon(value),
            Owner::Timers => self.timers.write(address, value)?,
            Owner::TimerClocks => self.write_ckcon(value)?,
            Owner::Flash => self.flash.write(address, value),
            Owner::Timer2Control => self.timer2.write_control(value),
            Owner::Timer2(register) => self.timer2.write(register, value),
            Owner::Timer3Control => self.timer3.write_control(value),
            Owner::Timer3(register) => self.timer3.write(register, value),
            Owner::Uart if address == sfr::SCON0 => self.uart.write_control(value),
            Owner::Uart => self.uart.send(value, self.now, self.timers.timer1_reload_period())?,
            Owner::Clock => {
                self.clock.write(address, value, self.now)?;
                self.apply_clocks();
                self.flash.set_outrun(self.clock.outruns_flash());
            }
            Owner::MovxPage => self.emi0cn = value,
            Owner::Pca => self.pca.write(address, value)?,
            Owner::Interrupts => self.interrupts.write(address, value),
            Owner::Resets => {
                let cause = self.resets.write(address, value, self.now);
                self.reset_request.set(self.reset_request.get().or(cause));
            }
            Owner::Adc => self.adc.write(address, value, self.now, self.clock.ticks_per_sysclk())?,
        }
        Ok(())
    }

    fn write_pcon(&mut self, value: u8) {
        self.general_flags = value & !PCON_IDLE;
        if value & PCON_IDLE != 0 {
            self.pca.sync(self.now);
            self.pca.set_idle(true);
            self.idle = true;
        }
    }

    fn write_ckcon(&mut self, value: u8) -> Result<(), Violation> {
        if value & CKCON_EXTERNAL_CLOCK == CKCON_EXTERNAL_CLOCK {
            return Err(Violation::rule("CKCON.SCA = 3 is not modelled: the board has no external clock"));
        }
        self.ckcon = value;
        self.apply_clocks();
        Ok(())
    }

    /// Every counter goes on from its present value at the new rates.
    fn apply_clocks(&mut self) {
        let ticks = self.clock.ticks_per_sysclk();
        self.timers.sync(self.now);
        self.timers.set_clock(self.ckcon, ticks);
        self.timer2.sync(self.now);
        self.timer2.set_clock(self.ckcon & CKCON_T2ML != 0, ticks);
        self.timer3.sync(self.now);
        self.timer3.set_clock(self.ckcon & CKCON_T3ML != 0, ticks);
        self.pca.sync(self.now);
        self.pca.set_clock(ticks);
    }
}

#[cfg(test)]
mod tests {
    use super::super::analog::Analog;
    use super::super::flash::{FLASH_SIZE, Flash};
    use super::*;

    fn chip() -> Chip {
        Chip::new(Flash::new(Box::new([0; FLASH_SIZE]), 1), Box::new([0; 4096]), Analog::of_chip(1))
    }

    #[test]
    fn what_the_table_does_not_name_is_refused_and_named() {
        for register in sfr::TABLE {
            for bit in (0..8).map(|shift| 1 << shift).filter(|bit| register.modelled() & bit == 0) {
                let words = chip().write_sfr(register.address, bit).unwrap_err().to_string();
                assert!(words.contains(register.name), "{words}");
            }
            if register.owner.is_none() {
                assert!(chip().read_sfr(register.address).unwrap_err().to_string().contains(register.name));
            }
        }
    }

    #[test]
    fn functions_without_a_model_are_refused() {
        let functions = [
            (sfr::XBR0, 0x02, "SMBus"),
            (sfr::XBR2, 0x01, "UART1"),
            (sfr::IE, 0x01, "INT0"),
            (sfr::EIE1, 0x08, "end of conversion"),
            (sfr::TMOD, 0x08, "a gate"),
            (sfr::TMR3CN, 0x08, "split mode"),
            (sfr::PCA0CPM0, 0x4C, "toggle output"),
            (sfr::PCON, 0x02, "STOP"),
            (sfr::ADC0CN, 0x82, "a start by Timer 2"),
            (sfr::REF0CN, 0x0E, "VDD as reference"),
            (sfr::SCON0, 0x80, "9-bit mode"),
            (sfr::RSTSRC, 0x04, "missing clock detector"),
        ];
        for (address, value, function) in functions {
            assert!(chip().write_sfr(address, value).is_err(), "{function}");
        }
    }
}
