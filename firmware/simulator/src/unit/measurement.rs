//! What a firmware asks of its chip: how deep its stack goes, how long its interrupts wait, how much it sleeps.

use crate::chip::interrupts::{NAMES, SOURCES};
use crate::time::{TICKS_PER_US, Tick};
use std::str::FromStr;

/// A part of the program that is timed: from its first instruction until it returns, or until another instruction.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Routine {
    pub name: String,
    pub begin: u16,
    pub end: Option<u16>,
}

impl FromStr for Routine {
    type Err = &'static str;

    /// NAME=BEGIN or NAME=BEGIN-END, addresses in hex.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        const WRONG: &str = "neither NAME=BEGIN nor NAME=BEGIN-END, addresses in hex";
        let address = |text: &str| u16::from_str_radix(text, 16).map_err(|_| WRONG);
        let (name, span) = text.split_once('=').ok_or(WRONG)?;
        let (begin, end) = match span.split_once('-') {
            Some((begin, end)) => (address(begin)?, Some(address(end)?)),
            None => (address(span)?, None),
        };
        Ok(Self { name: name.to_owned(), begin, end })
    }
}

struct Timed {
    routine: Routine,
    /// When it was entered, and the stack pointer then.
    entered: Option<(Tick, u8)>,
    longest: Tick,
}

#[derive(Default)]
pub struct Measurement {
    routines: Vec<Timed>,
    greatest_sp: u8,
    idle: Tick,
    /// Interrupts whose flag is up and whose own enable bit is set, one bit each; EA may be clear.
    ready: u32,
    ready_since: [Tick; SOURCES],
    worst_latency: [Option<Tick>; SOURCES],
}

impl Measurement {
    pub fn of(routines: &[Routine]) -> Self {
        let timed = |routine: &Routine| Timed { routine: routine.clone(), entered: None, longest: 0 };
        Self { routines: routines.iter().map(timed).collect(), ..Self::default() }
    }

    /// The instruction at `pc` is next.
    pub fn see_instruction(&mut self, pc: u16, sp: u8, now: Tick) {
        for timed in &mut self.routines {
            let over = |entry_sp: u8| timed.routine.end.map_or(sp < entry_sp, |end| pc == end);
            if let Some((since, _)) = timed.entered.take_if(|(_, entry_sp)| over(*entry_sp)) {
                timed.longest = timed.longest.max(now - since);
            }
            if pc == timed.routine.begin && timed.entered.is_none() {
                timed.entered = Some((now, sp));
            }
        }
    }

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
        let rounds: Vec<String> = self
            .routines
            .iter()
            .map(|timed| {
                format!(", {} {:.0} us", timed.routine.name, timed.longest as f64 / TICKS_PER_US as f64)
            })
            .collect();
        let rounds =
            if rounds.is_empty() { String::new() } else { format!(", longest of{}", rounds.concat()) };
        format!(
            "stack to 0x{:02X}, idle {idle_percent:.1} % of the time, worst interrupt latency: {}{rounds}",
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
        unit.measure(&[]);
        unit.run_until(2 * 0x1_0000 * 12 * TICKS_PER_CLOCK).unwrap();
        let report = unit.measured().unwrap();
        // Asleep it waits for the six clocks of the entry alone: 6 * 32 ticks of 48 MHz. The stack takes two bytes more.
        let expected = "stack to 0x0B, idle 50.0 % of the time, worst interrupt latency: Timer 2 4.0 us";
        assert_eq!(report, expected);
    }

    #[test]
    fn the_longest_run_of_a_routine_is_measured_to_its_return() {
        let program = [
            0x53, 0xD9, 0xBF, // ANL PCA0MD,#0xBF
            0x12, 0x00, 0x20, // LCALL 0x0020
            0x80, 0xFE, // SJMP $
        ];
        // 0x2B: behind the 11 NOPs from 0x20 on lies RET
        let mut unit = unit(&program, &[0x22]);
        unit.measure(&["task=20".parse().unwrap(), "span=3-6".parse().unwrap()]);
        unit.run_until(200 * TICKS_PER_CLOCK).unwrap();
        // 11 NOPs and RET in 6 clocks of 1.5 MHz: 11.3 us; with LCALL in 5: 14.7.
        assert!(
            unit.measured().unwrap().ends_with(", longest of, task 11 us, span 15 us"),
            "{:?}",
            unit.measured()
        );
        for wrong in ["task", "task=xyz", "task=1-"] {
            assert!(wrong.parse::<super::Routine>().is_err());
        }
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
        unit.measure(&[]);
        unit.run_until(100 * TICKS_PER_CLOCK).unwrap();
        // 4 NOPs, SETB in 2 clocks, NOP, entry in 6: 13 clocks of 1.5 MHz.
        assert!(unit.measured().unwrap().ends_with("Timer 2 8.7 us"), "{:?}", unit.measured());
    }
}
