//! What a firmware asks of its chip: how deep its stack goes, how long its interrupts wait, how much it sleeps.

use crate::chip::interrupts::{NAMES, SOURCES};
use crate::time::{TICKS_PER_US, Tick};

#[derive(Default)]
pub struct Measurement {
    greatest_sp: u8,
    idle: Tick,
    /// Interrupts whose flag is up and whose own enable bit is set, one bit each; EA may be clear.
    ready: u32,
    ready_since: [Tick; SOURCES],
    worst_latency: [Option<Tick>; SOURCES],
}

impl Measurement {
    pub fn see_stack(&mut self, sp: u8) {
        self.greatest_sp = self.greatest_sp.max(sp);
    }

    pub fn see_idle(&mut self, duration: Tick) {
        self.idle += duration;
    }

    /// These interrupts are asked for and enabled now; the new ones among them since `since`.
    pub fn see_ready(&mut self, ready: u32, since: Tick) {
        let new = ready & !self.ready;
        for (source, ready_since) in self.ready_since.iter_mut().enumerate() {
            if new >> source & 1 != 0 {
                *ready_since = since;
            }
        }
        self.ready = ready;
    }

    /// The first instruction at the interrupt's vector runs at `at`.
    pub fn see_entry(&mut self, interrupt: u8, at: Tick) {
        let latency = at - self.ready_since[usize::from(interrupt)];
        let worst = &mut self.worst_latency[usize::from(interrupt)];
        *worst = (*worst).max(Some(latency));
        self.ready &= !(1 << interrupt);
    }

    /// One line for people, over `duration` of simulated time.
    pub fn report(&self, duration: Tick) -> String {
        let idle_percent = 100.0 * self.idle as f64 / duration.max(1) as f64;
        let latencies: Vec<String> = NAMES
            .iter()
            .zip(self.worst_latency)
            .filter_map(|(name, worst)| Some(format!("{name} {:.1} us", worst? as f64 / TICKS_PER_US as f64)))
            .collect();
        format!(
            "stack to 0x{:02X}, idle {idle_percent:.1} % of the time, worst interrupt latency: {}",
            self.greatest_sp,
            if latencies.is_empty() { "none taken".to_owned() } else { latencies.join(", ") }
        )
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TICKS_PER_CLOCK, unit};

    #[test]
    fn stack_sleep_and_the_wait_for_an_interrupt_are_measured() {
        let program = [
            0x53, 0xD9, 0xBF, // ANL PCA0MD,#0xBF
            0xC0, 0x00, 0xC0, 0x00, // PUSH R0; PUSH R0: the stack pointer from 7 to 9
            0x75, 0xC8, 0x04, // MOV TMR2CN,#0x04: overflow after 65536 * 12 clocks
            0x75, 0xA8, 0xA0, // MOV IE,#0xA0
            0x43, 0x87, 0x01, // ORL PCON,#1
        ];
        let mut unit = unit(&program, &[0x80, 0xFE]);
        unit.measure();
        unit.run_until(2 * 0x1_0000 * 12 * TICKS_PER_CLOCK).unwrap();
        let report = unit.measured().unwrap();
        // Asleep it waits for the six clocks of the entry alone: 6 * 32 ticks of 48 MHz. The stack takes two bytes more.
        let expected = "stack to 0x0B, idle 50.0 % of the time, worst interrupt latency: Timer 2 4.0 us";
        assert_eq!(report, expected);
    }

    #[test]
    fn an_interrupt_that_a_higher_one_or_a_clear_ea_keeps_back_waits_longer() {
        let program = [
            0x53, 0xD9, 0xBF, // ANL PCA0MD,#0xBF
            0x75, 0xA8, 0x20, // MOV IE,#0x20: EA clear
            0x75, 0xC8, 0x80, // MOV TMR2CN,#0x80: the flag is up from here on
            0x00, 0x00, 0x00, 0x00, // NOP
            0xD2, 0xAF, // SETB EA
            0x00, // NOP: runs before any interrupt
        ];
        let mut unit = unit(&program, &[0x80, 0xFE]);
        unit.measure();
        unit.run_until(100 * TICKS_PER_CLOCK).unwrap();
        // 4 NOPs, SETB in 2 clocks, NOP, entry in 6: 13 clocks of 1.5 MHz.
        assert!(unit.measured().unwrap().ends_with("Timer 2 8.7 us"), "{:?}", unit.measured());
    }
}
