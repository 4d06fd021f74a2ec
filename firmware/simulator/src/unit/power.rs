//! What a supply does to a unit: cuts, dips, and a cut during a flash operation.

use super::supply::{Level, POWER_ON_DELAY, Ramp, Supply};
use super::{Unit, noise};
use crate::chip::memory::XRAM_SIZE;
use crate::chip::reset::Cause;
use crate::chip::violation::Violation;
use crate::cpu::{Cpu, IRAM_SIZE};
use crate::time::{NEVER, TICKS_PER_MS, Tick};
use rand::{Rng, RngExt};

/// From a cut at a flash operation to power-up: long enough for the supply to drain.
const CUT_AT_FLASH_OPERATION: Tick = 100 * TICKS_PER_MS;
/// Bytes of memory that a dip may change. Assumed.
const MOST_DECAYED_BYTES: usize = 8;
/// A chip that runs for longer than this below the monitor's threshold with nothing to hold it spoils a byte of its flash:
/// its program reads wrong and runs wild. Assumed; the times are unknown, that it happens is not (Silicon Labs' advice on
/// flash that is written by an unintended access).
const WILD_AFTER: Tick = 2 * TICKS_PER_MS;

/// The chip doesn't run until then, and then comes out of this reset.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dark {
    until: Tick,
    cause: Cause,
}

impl Unit {
    /// Takes the power away for `duration`: nothing sent, nothing received, coils off, and then a power-up. A flash
    /// operation under way is left half done.
    pub fn power_cut(&mut self, duration: Tick) {
        self.go_dark(self.chip.now + duration, Cause::PowerUp);
    }

    /// Takes the power away, and has it come back with this ramp.
    pub fn ramp_power(&mut self, rise: Tick, dips: u32) {
        self.supply = Supply::fall_and_rise(Ramp { rise, dips }, self.chip.now, &mut self.rng);
        self.next_event = self.chip.now;
    }

    /// Lets VDD dip below the supply monitor's threshold for a moment: a few bytes of memory decay, and the monitor,
    /// if it is on and selected, resets the chip.
    pub fn brown_out(&mut self) {
        if self.dark.is_some() {
            return;
        }
        self.decay();
        if self.chip.resets.supply_monitored() {
            self.reset(Cause::SupplyMonitor);
            self.next_event = self.chip.now;
        }
    }

    /// Pulls /RST low for a moment.
    pub fn pull_reset_pin(&mut self) {
        if self.dark.is_none() {
            self.reset(Cause::Pin);
            self.next_event = self.chip.now;
        }
    }

    /// Cuts the power during the `count`-th flash operation from now on (1 is the next), for 100 ms.
    pub fn cut_power_at_flash_operation(&mut self, count: u64) {
        self.cut_at_flash_operation = Some(self.flash_operations() + count);
    }

    /// How many flash operations (bytes written, pages erased) there have been since the simulation began.
    pub fn flash_operations(&self) -> u64 {
        self.chip.flash.operations()
    }
}

impl Unit {
    /// A flash operation has begun: this may be the one at which the power goes.
    pub(super) fn cut_power_if_due(&mut self) -> bool {
        let due =
            self.cut_at_flash_operation.take_if(|count| self.chip.flash.operations() >= *count).is_some();
        if due {
            self.power_cut(CUT_AT_FLASH_OPERATION);
        }
        due
    }

    fn decay(&mut self) {
        for _ in 0..self.rng.random_range(1..=MOST_DECAYED_BYTES) {
            let byte = self.rng.random();
            match self.rng.random_range(0..IRAM_SIZE + XRAM_SIZE) {
                address if address < IRAM_SIZE => self.cpu.write_iram(address as u8, byte),
                address => self.chip.xram[address - IRAM_SIZE] = byte,
            }
        }
    }

    /// The chip stops, a flash operation under way being left half done, until then.
    fn go_dark(&mut self, until: Tick, cause: Cause) {
        self.leave_flash_half_done();
        self.cpu.reset();
        self.chip.reset(cause);
        self.dark = Some(Dark { until, cause });
    }

    /// The supply has come to another level.
    pub(super) fn follow_supply(&mut self) {
        let Some(level) = self.supply.take() else {
            return;
        };
        let before = std::mem::replace(&mut self.level, level);
        self.chip.resets.set_supply_low(level != Level::Sound);
        self.go_wild_if_unguarded_for_long();
        match (before, level) {
            (_, Level::Dead) => self.go_dark(NEVER, Cause::PowerUp),
            (Level::Dead, _) => {
                self.dark = Some(Dark { until: self.chip.now + POWER_ON_DELAY, cause: Cause::PowerUp });
            }
            (_, Level::Low) if self.dark.is_some() => {}
            (_, Level::Low) if self.chip.resets.supply_monitored() => {
                self.decay();
                self.go_dark(NEVER, Cause::SupplyMonitor);
            }
            (_, Level::Low) => self.unguarded_since = Some(self.chip.now),
            (_, Level::Sound) => {
                if let Some(dark) = self.dark.filter(|dark| dark.cause == Cause::SupplyMonitor) {
                    self.dark = Some(Dark { until: self.chip.now, ..dark });
                }
            }
        }
        self.next_event = self.chip.now;
    }

    /// After a reset: the monitor holds the chip as long as the supply is low, if it is on and selected.
    pub(super) fn hold_if_low(&mut self) {
        if self.level != Level::Low {
            return;
        }
        if self.chip.resets.supply_monitored() {
            self.go_wild_if_unguarded_for_long();
            self.dark = Some(Dark { until: NEVER, cause: Cause::SupplyMonitor });
        } else if self.unguarded_since.is_none() {
            self.unguarded_since = Some(self.chip.now);
        }
    }

    fn go_wild_if_unguarded_for_long(&mut self) {
        if self.unguarded_since.take().is_some_and(|since| self.chip.now - since > WILD_AFTER) {
            self.chip.flash.spoil_a_byte(&mut self.rng);
        }
    }

    /// Lets the world go on without the chip until power comes back, or until `end`.
    pub(super) fn stay_dark(&mut self, Dark { until, cause }: Dark, end: Tick) -> Result<(), Violation> {
        while self.world.service(self.chip.now).is_some() {}
        self.chip.uart.service(self.chip.now, false, false);
        self.world.watch(&self.chip.ports, self.chip.now)?;
        if self.chip.now < until {
            let event =
                self.world.next_event().min(self.chip.uart.next_event()).min(self.supply.next_event());
            self.chip.now = event.min(until).min(end).max(self.chip.now);
            return Ok(());
        }
        self.dark = None;
        self.reset(cause);
        self.next_event = self.chip.now;
        Ok(())
    }

    pub(super) fn leave_flash_half_done(&mut self) {
        if self.chip.now < self.chip.stalled_until {
            self.chip.flash.interrupt(&mut self.rng);
        }
    }

    /// The memories after a power-up hold anything.
    pub(super) fn scramble_memories(&mut self) {
        self.rng.fill_bytes(self.chip.xram.as_mut_slice());
        self.cpu = Cpu::new(noise(&mut self.rng));
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TICKS_PER_CLOCK, unit};
    use super::*;
    use crate::chip::sfr;

    /// ANL PCA0MD,#0xBF; MOV VDM0CN,#0x80; MOV R0,#80; DJNZ R0,$; MOV RSTSRC,#2: the supply monitor on and selected.
    const GUARDED: [u8; 13] = [0x53, 0xD9, 0xBF, 0x75, 0xFF, 0x80, 0x78, 0x50, 0xD8, 0xFE, 0x75, 0xEF, 0x02];
    /// MOV XBR1,#0x40; MOV P2MDOUT,#0x0F; SJMP $: P2 drives the coils.
    const COILS_ON: [u8; 8] = [0x75, 0xE2, 0x40, 0x75, 0xA6, 0x0F, 0x80, 0xFE];

    /// Keys, PSCTL, MOVX: one flash operation on the page at 0xF400.
    fn flash_operation(psctl: u8) -> Vec<u8> {
        vec![0x75, 0xB7, 0xA5, 0x75, 0xB7, 0xF1, 0x75, 0x8F, psctl, 0x90, 0xF4, 0x00, 0xF0, 0x75, 0x8F, 0x00]
    }

    fn running(parts: &[&[u8]]) -> Unit {
        let mut unit = unit(&parts.concat(), &[]);
        unit.run_until(2000 * TICKS_PER_CLOCK).unwrap();
        unit
    }

    #[test]
    fn a_power_cut_turns_the_coils_off_and_ends_in_a_power_up_with_other_memory() {
        let mut unit = running(&[&GUARDED, &COILS_ON]);
        assert_eq!(unit.chip.ports.driven_high(2), 0x0F);
        let (cut_at, run, memory) = (unit.chip.now, unit.instructions(), unit.chip.xram.clone());
        unit.power_cut(10 * TICKS_PER_MS);
        unit.run_until(cut_at + 10 * TICKS_PER_MS).unwrap();
        assert_eq!((unit.chip.ports.driven_high(2), unit.instructions()), (0, run));
        unit.run_until(cut_at + 11 * TICKS_PER_MS).unwrap();
        assert!(unit.instructions() > run);
        let kept = unit.chip.xram.iter().zip(memory.iter()).filter(|(now, then)| now == then).count();
        assert!(kept < XRAM_SIZE / 100, "{kept} bytes survived");
    }

    #[test]
    fn what_arrives_in_the_dark_is_lost() {
        let mut unit = running(&[&GUARDED, &COILS_ON]);
        unit.power_cut(10 * TICKS_PER_MS);
        unit.feed(b"abc");
        unit.run_until(unit.chip.now + 5 * TICKS_PER_MS).unwrap();
        assert_eq!(unit.incoming_len(), 0);
    }

    #[test]
    fn a_dip_resets_a_guarded_chip_and_harms_only_a_few_bytes() {
        let mut unit = running(&[&GUARDED, &COILS_ON]);
        let memory = unit.chip.xram.clone();
        unit.brown_out();
        assert_eq!(unit.resets(), 1);
        unit.run_until(unit.chip.now + TICKS_PER_CLOCK).unwrap();
        assert_eq!(unit.chip.resets.read(sfr::RSTSRC) & 0x02, 0x02);
        let harmed = unit.chip.xram.iter().zip(memory.iter()).filter(|(now, then)| now != then).count();
        assert!((1..=MOST_DECAYED_BYTES).contains(&harmed), "{harmed}");
    }

    #[test]
    fn a_dip_without_the_supply_monitor_goes_unnoticed() {
        let mut unit = running(&[&GUARDED[..3], &COILS_ON]);
        unit.brown_out();
        unit.run_until(unit.chip.now + 100 * TICKS_PER_CLOCK).unwrap();
        assert_eq!(unit.resets(), 0);
    }

    #[test]
    fn the_power_goes_in_the_midst_of_the_flash_operation_asked_for() {
        let mut outcomes = Vec::new();
        for seed in 0..20 {
            let mut unit =
                unit(&[&GUARDED[..], &flash_operation(1), &flash_operation(3), &COILS_ON].concat(), &[]);
            unit.rng = rand::SeedableRng::seed_from_u64(seed);
            unit.cut_power_at_flash_operation(2);
            unit.run_until(20 * TICKS_PER_MS).unwrap();
            assert_eq!((unit.flash_operations(), unit.resets()), (2, 0));
            assert!(unit.dark.is_some());
            outcomes.push(unit.chip.flash.bytes()[0xF400..0xF600].iter().map(|byte| byte.count_ones()).sum());
        }
        const ALL: u32 = 512 * 8;
        for outcome in [|ones| ones == 0, |ones| ones == ALL, |ones| (1..ALL).contains(&ones)] {
            assert!(outcomes.iter().any(|&ones: &u32| outcome(ones)), "{outcomes:?}");
        }
    }

    #[test]
    fn a_watchdog_that_bites_in_the_midst_of_an_erase_leaves_it_half_done_too() {
        // MOV PCA0CPL4,#1; MOV PCA0MD,#0x40: it bites after 512 counts of 12 clocks at 1.5 MHz, 4 ms.
        let watched = [0x75, 0xFD, 0x01, 0x75, 0xD9, 0x40];
        let half_done = (0..20).any(|seed| {
            let program =
                [&GUARDED[..], &flash_operation(1), &watched, &flash_operation(3), &COILS_ON].concat();
            let mut unit = unit(&program, &[]);
            unit.rng = rand::SeedableRng::seed_from_u64(seed);
            while unit.resets() == 0 {
                unit.run_until(unit.now() + TICKS_PER_CLOCK).unwrap();
            }
            assert_eq!((unit.flash_operations(), unit.chip.resets.read(sfr::RSTSRC)), (2, 0x08));
            unit.chip.flash.bytes()[0xF400..0xF600].iter().any(|byte| *byte != 0xFF)
        });
        assert!(half_done);
    }

    /// MOV P1,#0 and SJMP $: never turns the supply monitor on.
    const UNGUARDED: [u8; 8] = [0x53, 0xD9, 0xBF, 0x75, 0x90, 0x00, 0x80, 0xFE];

    fn flash_survives(program: &[&[u8]], rise: Tick, seed: u64) -> bool {
        let mut unit = running(program);
        unit.rng = rand::SeedableRng::seed_from_u64(seed);
        let before = *unit.chip.flash.bytes();
        unit.ramp_power(rise, 0);
        unit.run_until(unit.now() + CUT_AT_FLASH_OPERATION + 2 * rise + 10 * TICKS_PER_MS).unwrap();
        assert_eq!((unit.level, unit.dark.is_none()), (Level::Sound, true));
        *unit.chip.flash.bytes() == before
    }

    #[test]
    fn a_slow_rise_spoils_the_flash_of_a_chip_that_does_not_guard_itself() {
        for seed in 0..10 {
            assert!(flash_survives(&[&GUARDED, &COILS_ON], 100 * TICKS_PER_MS, seed));
            assert!(!flash_survives(&[&UNGUARDED], 100 * TICKS_PER_MS, seed));
            assert!(flash_survives(&[&UNGUARDED], TICKS_PER_MS / 2, seed));
        }
    }

    #[test]
    fn a_guarded_chip_is_held_in_reset_while_the_supply_is_low() {
        let mut unit = running(&[&GUARDED, &COILS_ON]);
        unit.ramp_power(1000 * TICKS_PER_MS, 0);
        let before = unit.instructions();
        unit.run_until(unit.now() + TICKS_PER_MS).unwrap();
        assert_eq!(unit.level, Level::Dead);
        while unit.level != Level::Sound {
            unit.run_until(unit.now() + TICKS_PER_MS).unwrap();
        }
        // Once to the selection of the monitor, GUARDED, of which the wait is 80 passes; and a millisecond with a sound supply.
        let ran = unit.instructions() - before;
        assert!((80..=80 + 1500).contains(&ran), "{ran}");
        unit.run_until(unit.now() + TICKS_PER_MS).unwrap();
        assert_eq!(unit.chip.resets.read(sfr::RSTSRC) & 0x02, 0x02);
        assert!(unit.chip.ports.driven_high(2) == 0x0F);
    }
}
