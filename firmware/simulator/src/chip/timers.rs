//! Timers 0 and 1 (datasheet chapter "Timers"): modes 0, 1 and 2 from the system clock or its prescaler.
//!
//! A timer is brought up to date when it is looked at; it costs nothing in between.

use crate::chip::sfr;
use crate::chip::violation::Violation;
use crate::time::{NEVER, Tick};

const TF0: u8 = 0x20;
const TR0: u8 = 0x10;
const T0M: u8 = 0x04;
const INT_EDGE_BITS: u8 = 0x0F;

#[derive(Clone, Copy)]
struct Timer {
    low: u8,
    high: u8,
    mode: u8,
    running: bool,
    overflowed: bool,
    /// Ticks of 48 MHz per count.
    period: Tick,
    /// Until when `low`, `high` and `overflowed` are right.
    synced: Tick,
}

impl Timer {
    fn new(period: Tick) -> Self {
        Self { low: 0, high: 0, mode: 0, running: false, overflowed: false, period, synced: 0 }
    }

    /// Value and number of values of the counter in this mode; mode 2 counts in the low byte from `high` on.
    fn span(&self) -> (u64, u64) {
        match self.mode {
            0 => (u64::from(self.high) << 5 | u64::from(self.low & 0x1F), 1 << 13),
            1 => (u64::from(self.high) << 8 | u64::from(self.low), 1 << 16),
            _ => (u64::from(self.low), 1 << 8),
        }
    }

    fn sync(&mut self, now: Tick) {
        if self.running {
            let (value, span) = self.span();
            let mut value = value + (now / self.period - self.synced / self.period);
            if value >= span {
                self.overflowed = true;
                let base = if self.mode == 2 { u64::from(self.high) } else { 0 };
                value = base + (value - span) % (span - base);
            }
            match self.mode {
                0 => (self.high, self.low) = ((value >> 5) as u8, (value & 0x1F) as u8),
                1 => (self.high, self.low) = ((value >> 8) as u8, value as u8),
                _ => self.low = value as u8,
            }
        }
        self.synced = now;
    }

    fn next_overflow(&self) -> Tick {
        if !self.running {
            return NEVER;
        }
        let (value, span) = self.span();
        (self.synced / self.period + span - value) * self.period
    }
}

pub struct Timers {
    timer: [Timer; 2],
    tmod: u8,
    edges: u8,
}

impl Timers {
    pub fn new(ticks_per_sysclk: Tick) -> Self {
        Self { timer: [Timer::new(12 * ticks_per_sysclk); 2], tmod: 0, edges: 0 }
    }

    pub fn sync(&mut self, now: Tick) {
        self.timer.iter_mut().for_each(|timer| timer.sync(now));
    }

    /// The clocks have changed: call after `sync`.
    pub fn set_clock(&mut self, ckcon: u8, ticks_per_sysclk: Tick) {
        let prescaler = match ckcon & 0x03 {
            0 => 12,
            1 => 4,
            _ => 48,
        };
        for (index, timer) in self.timer.iter_mut().enumerate() {
            timer.period = ticks_per_sysclk * if ckcon & (T0M << index) != 0 { 1 } else { prescaler };
        }
    }

    /// Call after `sync`.
    pub fn read(&self, address: u8) -> u8 {
        match address {
            sfr::TCON => {
                let bits = |index: usize| {
                    let timer = &self.timer[index];
                    ((u8::from(timer.overflowed) * TF0) | (u8::from(timer.running) * TR0)) << (2 * index)
                };
                bits(0) | bits(1) | self.edges
            }
            sfr::TMOD => self.tmod,
            sfr::TL0 | sfr::TL1 => self.timer[(address - sfr::TL0) as usize].low,
            _ => self.timer[(address - sfr::TH0) as usize].high,
        }
    }

    /// Call after `sync`.
    ///
    /// # Errors
    /// A [`Violation`] for mode 3, which is not modelled.
    pub fn write(&mut self, address: u8, value: u8) -> Result<(), Violation> {
        match address {
            sfr::TCON => {
                self.edges = value & INT_EDGE_BITS;
                for (index, timer) in self.timer.iter_mut().enumerate() {
                    timer.overflowed = value & (TF0 << (2 * index)) != 0;
                    timer.running = value & (TR0 << (2 * index)) != 0;
                }
            }
            sfr::TMOD => {
                for (index, timer) in self.timer.iter_mut().enumerate() {
                    timer.mode = value >> (4 * index) & 0x03;
                    if timer.mode == 3 {
                        return Err(Violation::rule(format!("mode 3 of Timer {index} is not modelled")));
                    }
                }
                self.tmod = value;
            }
            sfr::TL0 | sfr::TL1 => self.timer[(address - sfr::TL0) as usize].low = value,
            _ => self.timer[(address - sfr::TH0) as usize].high = value,
        }
        Ok(())
    }

    pub fn overflowed(&self, index: usize) -> bool {
        self.timer[index].overflowed
    }

    /// The flag goes down by itself when its interrupt is taken.
    pub fn acknowledge(&mut self, index: usize) {
        self.timer[index].overflowed = false;
    }

    /// When the next overflow raises a flag that is still down.
    pub fn next_event(&self, index: usize) -> Tick {
        if self.timer[index].overflowed { NEVER } else { self.timer[index].next_overflow() }
    }

    /// Ticks between two overflows of Timer 1, if it runs in mode 2: UART0's clock.
    pub fn timer1_reload_period(&self) -> Option<Tick> {
        let timer = &self.timer[1];
        (timer.running && timer.mode == 2).then(|| timer.period * (256 - Tick::from(timer.high)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timer_1_at_0x30_from_48_mhz_overflows_at_twice_115385_baud() {
        let mut timers = Timers::new(1);
        timers.set_clock(T0M << 1, 1);
        timers.write(sfr::TMOD, 0x20).unwrap();
        timers.write(sfr::TH1, 0x30).unwrap();
        timers.write(sfr::TCON, 0x40).unwrap();
        assert_eq!(timers.timer1_reload_period(), Some(208));
    }

    #[test]
    fn mode_1_counts_sixteen_bits_and_raises_its_flag() {
        let mut timers = Timers::new(1);
        timers.write(sfr::TMOD, 0x01).unwrap();
        timers.write(sfr::TH0, 0xFF).unwrap();
        timers.write(sfr::TL0, 0xF0).unwrap();
        timers.write(sfr::TCON, 0x10).unwrap();
        assert_eq!(timers.next_event(0), 16 * 12);
        timers.sync(16 * 12 - 1);
        assert!(!timers.overflowed(0));
        timers.sync(18 * 12);
        assert!(timers.overflowed(0));
        assert_eq!((timers.read(sfr::TH0), timers.read(sfr::TL0)), (0, 2));
    }

    #[test]
    fn mode_3_is_refused() {
        assert!(Timers::new(1).write(sfr::TMOD, 0x03).is_err());
    }
}
