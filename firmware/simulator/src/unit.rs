//! A scanner unit: chip, CPU and world, run from event to event.

pub mod measurement;
mod power;
mod supply;

use crate::chip::Chip;
use crate::chip::analog::Analog;
use crate::chip::flash::{FLASH_SIZE, Flash};
use crate::chip::interrupts::vector;
use crate::chip::memory::XRAM_SIZE;
use crate::chip::reset::Cause;
use crate::chip::violation::{Breach, Violation};
use crate::cpu::{Cpu, IRAM_SIZE};
use crate::faults::Fault;
use crate::random::{Part, stream};
use crate::time::{TICKS_PER_US, Tick};
use crate::world::{self, ECHO, World};
use measurement::{Measurement, Routine};
use power::Dark;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use supply::{Level, Supply};

/// What is true of a unit, for tests to compare with.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Truth {
    #[serde(flatten)]
    pub world: world::Truth,
    pub resets: u32,
    /// Bytes written and pages erased.
    pub flash_operations: u64,
    /// The longest that the program has worked between two feedings of the watchdog, since the last reset.
    pub longest_work_us: f64,
}

/// By how much the die is warmer than the air around the board. Assumed.
const SELF_HEATING_K: f64 = 3.0;

pub struct Unit {
    cpu: Cpu,
    chip: Chip,
    world: World,
    rng: ChaCha8Rng,
    next_event: Tick,
    /// An interrupt may be waiting: something has changed since the last look.
    look_for_interrupt: bool,
    /// RETI and writes to the interrupt registers let one more instruction run.
    one_more: bool,
    /// The last instruction that accessed a register.
    accessed_at: u16,
    dark: Option<Dark>,
    supply: Supply,
    level: Level,
    /// When the chip came to run unguarded on too low a supply.
    unguarded_since: Option<Tick>,
    cut_at_flash_operation: Option<u64>,
    measurement: Option<Box<Measurement>>,
    /// Jumps miss the prefetch engine's bytes.
    misses: bool,
    instructions: u64,
    resets: u32,
}

impl Unit {
    /// A unit at power-up, with arbitrary contents in its memories; those of XRAM are drawn from `noise_of_xram`.
    pub fn power_up(
        flash: Box<[u8; FLASH_SIZE]>,
        world: World,
        seed: u64,
        noise_of_xram: &mut dyn Rng,
    ) -> Self {
        let mut rng = stream(seed, Part::Memories);
        let mut xram = Box::new([0; XRAM_SIZE]);
        noise_of_xram.fill_bytes(xram.as_mut_slice());
        let cpu = Cpu::new(noise(&mut rng));
        let analog = Analog::of_chip(seed);
        let mut chip = Chip::new(Flash::new(flash, seed), xram, analog);
        chip.ports.pulls = world.pulls();
        Self {
            cpu,
            chip,
            world,
            rng,
            next_event: 0,
            look_for_interrupt: true,
            one_more: false,
            accessed_at: 0,
            dark: None,
            supply: Supply::default(),
            level: Level::Sound,
            unguarded_since: None,
            cut_at_flash_operation: None,
            measurement: None,
            misses: false,
            instructions: 0,
            resets: 0,
        }
    }

    /// Instructions run since power-up.
    pub fn instructions(&self) -> u64 {
        self.instructions
    }

    /// Resets since power-up.
    pub fn resets(&self) -> u32 {
        self.resets
    }

    /// How things are with this unit, whatever its firmware makes of them.
    pub fn truth(&self) -> Truth {
        Truth {
            world: self.world.truth(self.chip.now),
            resets: self.resets,
            flash_operations: self.flash_operations(),
            longest_work_us: self.chip.pca.longest_work() as f64 / TICKS_PER_US as f64,
        }
    }

    /// Something happens to a part of the unit, until then if it lasts.
    pub fn inject(&mut self, fault: &Fault, until: Tick) {
        match fault {
            Fault::PcaLosesFlags {} => self.chip.pca.loses_flags_until = until,
            Fault::MemorySpoiled { address } => self.chip.xram[usize::from(*address)] ^= 0xFF,
            Fault::Mended {} => self.chip.pca.loses_flags_until = 0,
            _ => {}
        }
        self.world.apply(fault, until, self.chip.now);
        self.next_event = self.next_event.min(self.chip.now);
    }

    /// Makes the chip slow: its jumps miss the prefetch engine, flash takes the longest that the datasheet allows.
    pub fn slow_down(&mut self) {
        self.misses = true;
        self.chip.flash.is_slowest = true;
    }

    /// Measures from now on, and times these routines.
    pub fn measure(&mut self, routines: &[Routine]) {
        self.measurement = Some(Box::new(Measurement::of(routines)));
    }

    /// What has been measured, for people.
    pub fn measured(&self) -> Option<String> {
        self.measurement.as_ref().map(|measurement| measurement.report(self.chip.now))
    }

    pub fn path_is_done(&self) -> bool {
        self.world.path_is_done()
    }

    /// The flash memory, if it has changed since this was last asked.
    pub fn changed_flash(&mut self) -> Option<&[u8; FLASH_SIZE]> {
        std::mem::take(&mut self.chip.flash.changed).then(|| self.chip.flash.bytes())
    }

    /// What the unit has sent since it was last cleared.
    pub fn sent(&mut self) -> &mut Vec<u8> {
        &mut self.chip.uart.outgoing
    }

    /// Puts bytes on the wire to the unit.
    pub fn feed(&mut self, bytes: &[u8]) {
        self.chip.uart.feed(bytes, self.chip.now);
        self.next_event = self.next_event.min(self.chip.now);
    }

    /// How many bytes are on the wire to the unit.
    pub fn incoming_len(&self) -> usize {
        self.chip.uart.incoming_len()
    }

    /// Runs until the simulated time `end`, or an instruction past it.
    ///
    /// # Errors
    /// A [`Breach`] if the firmware does what the chip forbids or what is not modelled.
    pub fn run_until(&mut self, end: Tick) -> Result<(), Breach> {
        // Other units may have sent sound on its way here since.
        self.next_event = self.next_event.min(self.world.next_event());
        while self.chip.now < end {
            self.advance(end).map_err(|violation| self.breach(violation))?;
        }
        Ok(())
    }

    /// As `run_until`, but stops as soon as a 0x00 has been sent: the end of a frame.
    ///
    /// # Errors
    /// As `run_until`.
    pub fn run_until_frame(&mut self, end: Tick) -> Result<(), Breach> {
        let before = self.chip.uart.outgoing.len();
        while self.chip.now < end {
            self.advance(end).map_err(|violation| self.breach(violation))?;
            let sent = &self.chip.uart.outgoing;
            if sent.len() > before && sent.last() == Some(&0) {
                break;
            }
        }
        Ok(())
    }

    fn breach(&self, violation: Violation) -> Breach {
        let flash_outrun = self.chip.flash.is_outrun();
        Breach { violation, pc: self.accessed_at, tick: self.chip.now, flash_outrun }
    }

    /// Simulated time since power-up.
    pub fn now(&self) -> Tick {
        self.chip.now
    }

    fn advance(&mut self, end: Tick) -> Result<(), Violation> {
        if self.chip.now >= self.supply.next_event() {
            self.follow_supply();
        }
        if let Some(dark) = self.dark {
            return self.stay_dark(dark, end);
        }
        if self.chip.now >= self.next_event {
            self.service()?;
        }
        if self.chip.now < self.chip.stalled_until {
            if self.cut_power_if_due() {
                return Ok(());
            }
            self.skip_to(self.chip.stalled_until.min(end));
            return Ok(());
        }
        if self.look_for_interrupt && !std::mem::take(&mut self.one_more) {
            self.look_for_interrupt = false;
            if let Some(interrupt) = self.chip.interrupts.select(self.chip.pending()) {
                self.chip.wake();
                self.chip.enter_interrupt(interrupt);
                let clocks = self.cpu.interrupt(vector(interrupt), self.misses);
                self.chip.now += clocks * self.chip.ticks_per_sysclk();
                if let Some(measurement) = &mut self.measurement {
                    measurement.see_entry(interrupt, self.chip.now);
                    measurement.see_stack(self.cpu.sp());
                }
                return self.after_access(self.chip.now);
            }
        }
        if self.chip.idle {
            let asleep_at = self.chip.now;
            self.skip_to(end);
            if let Some(measurement) = &mut self.measurement {
                measurement.see_idle(self.chip.now - asleep_at);
            }
            return Ok(());
        }
        match (self.measurement.is_some(), self.misses) {
            (false, false) => self.execute::<false, false>(end),
            (true, false) => self.execute::<true, false>(end),
            (false, true) => self.execute::<false, true>(end),
            (true, true) => self.execute::<true, true>(end),
        }
    }

    /// Runs instructions until one touches a register or something is due; only one if an interrupt must wait for it.
    fn execute<const MEASURED: bool, const MISSES: bool>(&mut self, end: Tick) -> Result<(), Violation> {
        let limit = if self.look_for_interrupt { self.chip.now } else { self.next_event.min(end) };
        let ticks_per_sysclk = self.chip.ticks_per_sysclk();
        loop {
            let pc = self.cpu.pc();
            if MEASURED && let Some(measurement) = &mut self.measurement {
                measurement.see_instruction(pc, self.cpu.sp(), self.chip.now);
            }
            self.chip.now += self.cpu.step::<MISSES>(&mut self.chip) * ticks_per_sysclk;
            self.instructions += 1;
            if MEASURED && let Some(measurement) = &mut self.measurement {
                measurement.see_stack(self.cpu.sp());
            }
            if self.chip.touched.get() {
                self.accessed_at = pc;
                self.one_more = self.cpu.take_deferral();
                return self.after_access(self.chip.now);
            }
            if self.chip.now >= limit {
                return Ok(());
            }
        }
    }

    fn skip_to(&mut self, end: Tick) {
        self.chip.now = self.next_event.min(end).max(self.chip.now);
    }

    /// Does what is due by now, in the world first: edges are captured at their own time.
    fn service(&mut self) -> Result<(), Violation> {
        while let Some(edge) = self.world.service(self.chip.now) {
            for module in 0..5 {
                if self.chip.ports.cex_pin(module) == Some(ECHO) {
                    self.chip.pca.edge(usize::from(module), edge.rising, edge.at);
                }
            }
        }
        self.chip.ports.pulls = self.world.pulls();
        self.chip.set_die_temperature_c(self.world.air_temperature_c(self.chip.now) + SELF_HEATING_K);
        self.chip.service();
        self.after_access(self.next_event)
    }

    /// Registers were written or flags went up: pins, resets, interrupts and the next event may have changed.
    /// Flags that are up now are so since `since`.
    fn after_access(&mut self, since: Tick) -> Result<(), Violation> {
        self.chip.touched.set(false);
        if let Some(violation) = self.chip.violation.take() {
            return Err(violation);
        }
        if let Some(cause) = self.chip.reset_request.get() {
            self.reset(cause);
        }
        if std::mem::take(&mut self.chip.ports.changed) {
            self.world.watch(&self.chip.ports, self.chip.now)?;
            self.chip.ports.pulls = self.world.pulls();
            self.chip.rescheduled = true;
        }
        if let Some(measurement) = &mut self.measurement {
            measurement.see_ready(self.chip.pending() & self.chip.interrupts.enabled(), since);
        }
        self.look_for_interrupt = true;
        if std::mem::take(&mut self.chip.rescheduled) {
            let supply = self.supply.next_event();
            self.next_event = self.chip.next_event().min(self.world.next_event()).min(supply);
        }
        Ok(())
    }

    /// A flash operation under way is left half done, whatever resets the chip.
    fn reset(&mut self, cause: Cause) {
        self.resets += 1;
        self.leave_flash_half_done();
        if cause == Cause::PowerUp {
            self.scramble_memories();
        } else {
            self.cpu.reset();
        }
        self.chip.reset(cause);
        self.hold_if_low();
    }
}

fn noise(rng: &mut ChaCha8Rng) -> [u8; IRAM_SIZE] {
    let mut bytes = [0; IRAM_SIZE];
    rng.fill_bytes(&mut bytes);
    bytes
}

#[cfg(test)]
mod tests;
