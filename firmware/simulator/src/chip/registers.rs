//! Which peripheral answers for which special function register; an address without one is a violation.

use super::reload_timer::Register;
use super::{Chip, sfr};
use crate::fault::{Violation, only_bits};

const PCON_IDLE: u8 = 0x01;
const PCON_STOP: u8 = 0x02;
const CKCON_EXTERNAL_CLOCK: u8 = 0x03;
const CKCON_T2ML: u8 = 0x10;
const CKCON_T3ML: u8 = 0x40;

#[derive(Clone, Copy)]
enum Owner {
    Ports,
    Power,
    Timers,
    TimerClocks,
    Flash,
    Timer2Control,
    Timer2(Register),
    Timer3Control,
    Timer3(Register),
    UartControl,
    UartData,
    Clock,
    MovxPage,
    Pca,
    Interrupts,
    Resets,
    Adc,
}

fn owner(address: u8) -> Option<Owner> {
    Some(match address {
        sfr::P0 | sfr::P1 | sfr::P2 | sfr::P3 | sfr::P4 => Owner::Ports,
        sfr::P0MDOUT..=sfr::P3MDOUT | sfr::P4MDOUT | sfr::P0MDIN..=sfr::P4MDIN => Owner::Ports,
        sfr::P0SKIP..=sfr::P2SKIP | sfr::P3SKIP | sfr::XBR0..=sfr::XBR2 => Owner::Ports,
        sfr::PCON => Owner::Power,
        sfr::TCON..=sfr::TH1 => Owner::Timers,
        sfr::CKCON => Owner::TimerClocks,
        sfr::PSCTL | sfr::FLKEY => Owner::Flash,
        sfr::TMR2CN => Owner::Timer2Control,
        sfr::TMR2RLL..=sfr::TMR2H => Owner::Timer2(Register::from_offset(address - sfr::TMR2RLL)),
        sfr::TMR3CN => Owner::Timer3Control,
        sfr::TMR3RLL..=sfr::TMR3H => Owner::Timer3(Register::from_offset(address - sfr::TMR3RLL)),
        sfr::SCON0 => Owner::UartControl,
        sfr::SBUF0 => Owner::UartData,
        sfr::CLKSEL | sfr::PFE0CN | sfr::OSCICN | sfr::FLSCL | sfr::CLKMUL => Owner::Clock,
        sfr::EMI0CN => Owner::MovxPage,
        sfr::PCA0CN..=sfr::PCA0CPM4 | sfr::PCA0CPL1..=sfr::PCA0CPH3 | sfr::PCA0L..=sfr::PCA0CPH4 => {
            Owner::Pca
        }
        sfr::EIE1 | sfr::EIE2 | sfr::EIP1 | sfr::EIP2 => Owner::Interrupts,
        sfr::RSTSRC | sfr::VDM0CN => Owner::Resets,
        sfr::AMX0N..=sfr::ADC0H | sfr::REF0CN | sfr::ADC0CN => Owner::Adc,
        _ => return None,
    })
}

impl Chip {
    /// Tells what the instruction under way is about to access, before it does: counters are brought up to date.
    pub fn prepare_access(&mut self, address: u8, reads_latch: bool) {
        self.reads_latch = reads_latch;
        match owner(address) {
            Some(Owner::Timers) => self.timers.sync(self.now),
            Some(Owner::Timer2Control | Owner::Timer2(_)) => self.timer2.sync(self.now),
            Some(Owner::Timer3Control | Owner::Timer3(_)) => self.timer3.sync(self.now),
            Some(Owner::Pca) => self.pca.sync(self.now),
            Some(Owner::Adc) => self.adc.sync(self.now),
            _ => {}
        }
    }

    pub(super) fn read_sfr(&self, address: u8) -> Result<u8, Violation> {
        let owner = owner(address).ok_or(Violation::UnmodelledSfr { address, access: "read" })?;
        Ok(match owner {
            Owner::Ports => self.ports.read(address, self.reads_latch),
            Owner::Power => self.general_flags,
            Owner::Timers => self.timers.read(address),
            Owner::TimerClocks => self.ckcon,
            Owner::Flash => self.flash.read(address),
            Owner::Timer2Control => self.timer2.control(),
            Owner::Timer2(register) => self.timer2.read(register),
            Owner::Timer3Control => self.timer3.control(),
            Owner::Timer3(register) => self.timer3.read(register),
            Owner::UartControl | Owner::UartData => self.uart.read(address),
            Owner::Clock => self.clock.read(address, self.now),
            Owner::MovxPage => self.emi0cn,
            Owner::Pca => self.pca.read(address),
            Owner::Interrupts => self.interrupts.read(address),
            Owner::Resets => self.resets.read(address),
            Owner::Adc => self.adc.read(address),
        })
    }

    pub(super) fn write_sfr(&mut self, address: u8, value: u8) -> Result<(), Violation> {
        let owner = owner(address).ok_or(Violation::UnmodelledSfr { address, access: "write" })?;
        self.touched.set(true);
        match owner {
            Owner::Ports => self.ports.write(address, value)?,
            Owner::Power => self.write_pcon(value)?,
            Owner::Timers => self.timers.write(address, value)?,
            Owner::TimerClocks => self.write_ckcon(value)?,
            Owner::Flash => self.flash.write(address, value)?,
            Owner::Timer2Control => self.timer2.write_control(address, value)?,
            Owner::Timer2(register) => self.timer2.write(register, value),
            Owner::Timer3Control => self.timer3.write_control(address, value)?,
            Owner::Timer3(register) => self.timer3.write(register, value),
            Owner::UartControl => self.uart.write_control(value)?,
            Owner::UartData => self.uart.send(value, self.now, self.timers.timer1_reload_period())?,
            Owner::Clock => {
                self.clock.write(address, value, self.now)?;
                self.apply_clocks();
                self.flash.set_outrun(self.clock.outruns_flash());
            }
            Owner::MovxPage => self.emi0cn = value,
            Owner::Pca => self.pca.write(address, value)?,
            Owner::Interrupts => self.interrupts.write(address, value)?,
            Owner::Resets => {
                let cause = self.resets.write(address, value, self.now)?;
                self.reset_request.set(self.reset_request.get().or(cause));
            }
            Owner::Adc => self.adc.write(address, value, self.now, self.clock.ticks_per_sysclk())?,
        }
        Ok(())
    }

    fn write_pcon(&mut self, value: u8) -> Result<(), Violation> {
        if value & PCON_STOP != 0 {
            return Err(Violation::rule("PCON.STOP set: only a reset would wake the chip"));
        }
        self.general_flags = value & !PCON_IDLE;
        if value & PCON_IDLE != 0 {
            self.pca.sync(self.now);
            self.pca.set_idle(true);
            self.idle = true;
        }
        Ok(())
    }

    fn write_ckcon(&mut self, value: u8) -> Result<(), Violation> {
        if value & CKCON_EXTERNAL_CLOCK == CKCON_EXTERNAL_CLOCK {
            return only_bits(sfr::CKCON, value, !CKCON_EXTERNAL_CLOCK);
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
