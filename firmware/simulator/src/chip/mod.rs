//! The C8051F340 around its CPU: peripherals behind their special function registers, memories, events, interrupts.

mod adc;
pub mod analog;
pub mod clock;
pub mod flash;
pub mod interrupts;
pub mod memory;
pub mod pca;
mod pca_counter;
#[cfg(test)]
mod pca_tests;
pub mod ports;
pub mod register_page;
mod registers;
pub mod reload_timer;
pub mod reset;
pub mod sfr;
pub mod timers;
pub mod uart;
pub mod violation;

use crate::chip::violation::Violation;
use crate::time::{NEVER, Tick};
use adc::Adc;
use analog::Analog;
use clock::Clock;
use flash::Flash;
use interrupts::Interrupts;
use memory::Xram;
use pca::Pca;
use ports::Ports;
use reload_timer::ReloadTimer;
use reset::{Cause, Resets};
use std::cell::{Cell, OnceCell};
use timers::Timers;
use uart::Uart;

pub struct Chip {
    pub now: Tick,
    pub ports: Ports,
    pub pca: Pca,
    pub uart: Uart,
    pub flash: Flash,
    pub interrupts: Interrupts,
    pub xram: Xram,
    adc: Adc,
    /// The CPU sleeps until an interrupt.
    pub idle: bool,
    /// A flash operation holds the CPU until then.
    pub stalled_until: Tick,
    pub reset_request: Cell<Option<Cause>>,
    /// A register was written, or refused, since this was last cleared: interrupts may have changed.
    pub touched: Cell<bool>,
    /// What is due next may have changed since this was last cleared.
    pub rescheduled: bool,
    clock: Clock,
    timers: Timers,
    timer2: ReloadTimer,
    timer3: ReloadTimer,
    pub resets: Resets,
    ckcon: u8,
    emi0cn: u8,
    general_flags: u8,
    /// The instruction under way reads port latches, not pins (read-modify-write).
    reads_latch: bool,
    /// The instruction under way is a MOVX @Ri.
    pages_movx: bool,
    /// The first thing that the firmware did wrong.
    pub violation: OnceCell<Violation>,
}

impl Chip {
    /// A chip at power-up.
    pub fn new(flash: Flash, xram: Xram, analog: Analog) -> Self {
        let clock = Clock::new();
        let ticks = clock.ticks_per_sysclk();
        Self {
            now: 0,
            ports: Ports::new(),
            pca: Pca::new(ticks, 0),
            uart: Uart::default(),
            flash,
            interrupts: Interrupts::default(),
            xram,
            adc: Adc::new(analog),
            idle: false,
            stalled_until: 0,
            reset_request: Cell::new(None),
            touched: Cell::new(true),
            rescheduled: true,
            timers: Timers::new(ticks),
            timer2: ReloadTimer::new(ticks),
            timer3: ReloadTimer::new(ticks),
            clock,
            resets: Resets::power_up(),
            ckcon: 0,
            emi0cn: 0,
            general_flags: 0,
            reads_latch: false,
            pages_movx: false,
            violation: OnceCell::new(),
        }
    }

    /// Puts everything but the memories, the supply monitor and the world outside into its reset state.
    pub fn reset(&mut self, cause: Cause) {
        self.clock = Clock::new();
        let ticks = self.clock.ticks_per_sysclk();
        let pulls = self.ports.pulls;
        self.ports = Ports::new();
        self.ports.pulls = pulls;
        let loses_flags_until = self.pca.loses_flags_until;
        self.pca = Pca::new(ticks, self.now);
        self.pca.loses_flags_until = loses_flags_until;
        self.timers = Timers::new(ticks);
        self.timer2 = ReloadTimer::new(ticks);
        self.timer3 = ReloadTimer::new(ticks);
        self.interrupts = Interrupts::default();
        self.uart.reset();
        self.flash.reset();
        self.adc.reset();
        self.resets.reset(cause);
        (self.ckcon, self.emi0cn, self.general_flags) = (0, 0, 0);
        (self.idle, self.stalled_until) = (false, 0);
        self.reset_request.set(None);
        self.touched.set(true);
        self.rescheduled = true;
    }

    pub fn set_die_temperature_c(&mut self, temperature_c: f64) {
        self.adc.analog.die_temperature_c = temperature_c;
    }

    pub fn ticks_per_sysclk(&self) -> Tick {
        self.clock.ticks_per_sysclk()
    }

    /// When a peripheral will next do something by itself.
    pub fn next_event(&self) -> Tick {
        let timer = |index, interrupt| {
            if self.interrupts.enables(interrupt) { self.timers.next_event(index) } else { NEVER }
        };
        self.pca
            .next_event()
            .min(self.uart.next_event())
            .min(self.timer2.next_event())
            .min(self.timer3.next_event())
            .min(timer(0, interrupts::TIMER0))
            .min(timer(1, interrupts::TIMER1))
    }

    /// Brings the peripherals up to now.
    pub fn service(&mut self) {
        if self.interrupts.enables(interrupts::TIMER0) || self.interrupts.enables(interrupts::TIMER1) {
            self.timers.sync(self.now);
        }
        self.timer2.sync(self.now);
        self.timer3.sync(self.now);
        self.pca.sync(self.now);
        if self.pca.watchdog_bites() {
            self.reset_request.set(Some(Cause::Watchdog));
        }
        self.uart.service(self.now, self.ports.uart0_transmits(), self.ports.uart0_receives());
        self.rescheduled = true;
    }

    /// The interrupts that are asked for, one bit each.
    pub fn pending(&self) -> u32 {
        u32::from(self.timers.overflowed(0)) << interrupts::TIMER0
            | u32::from(self.timers.overflowed(1)) << interrupts::TIMER1
            | u32::from(self.uart.pending()) << interrupts::UART0
            | u32::from(self.timer2.pending()) << interrupts::TIMER2
            | u32::from(self.pca.pending()) << interrupts::PCA0
            | u32::from(self.timer3.pending()) << interrupts::TIMER3
    }

    /// The CPU goes to an interrupt's vector.
    pub fn enter_interrupt(&mut self, interrupt: u8) {
        self.interrupts.enter(interrupt);
        match interrupt {
            interrupts::TIMER0 => self.timers.acknowledge(0),
            interrupts::TIMER1 => self.timers.acknowledge(1),
            _ => return,
        }
        self.rescheduled = true;
    }

    pub fn wake(&mut self) {
        if self.idle {
            self.pca.sync(self.now);
            self.pca.set_idle(false);
            self.idle = false;
            self.rescheduled = true;
        }
    }

    /// Tells whether the instruction under way is a MOVX @Ri.
    pub fn prepare_movx(&mut self, paged: bool) {
        self.pages_movx = paged;
    }

    /// Notes a violation; only the first counts.
    pub fn report(&self, violation: Violation) {
        let _ = self.violation.set(violation);
        self.touched.set(true);
    }

    /// IE and IP, after an instruction that worked on them.
    pub fn set_interrupt_registers(&mut self, ie: u8, ip: u8) {
        self.touched.set(true);
        for (address, value) in [(sfr::IE, ie), (sfr::IP, ip)] {
            if let Err(violation) = self.write_sfr(address, value) {
                self.report(violation);
            }
        }
    }

    pub fn leave_interrupt(&mut self) {
        self.interrupts.leave();
        self.touched.set(true);
    }
}
