//! Timers 2 and 3 as 16-bit timers with auto-reload (datasheet chapter "Timers").

use crate::time::{NEVER, Tick};

const TFH: u8 = 0x80;
const TFL: u8 = 0x40;
const TFLEN: u8 = 0x20;
const TR: u8 = 0x04;

/// The registers of a timer, in the order of their addresses: reload low and high, counter low and high.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Register {
    ReloadLow,
    ReloadHigh,
    Low,
    High,
}

pub struct ReloadTimer {
    control: u8,
    reload: u16,
    count: u16,
    period: Tick,
    /// Until when `count` is right, in ticks and in whole periods since time 0 (a division saved).
    synced: Tick,
    periods: u64,
}

impl ReloadTimer {
    pub fn new(ticks_per_sysclk: Tick) -> Self {
        Self { control: 0, reload: 0, count: 0, period: 12 * ticks_per_sysclk, synced: 0, periods: 0 }
    }

    pub fn sync(&mut self, now: Tick) {
        if self.control & TR != 0 {
            let elapsed = now / self.period - self.periods;
            self.periods += elapsed;
            if u64::from(self.count & 0xFF) + elapsed > 0xFF {
                self.control |= TFL;
            }
            let mut count = u64::from(self.count) + elapsed;
            if count > 0xFFFF {
                self.control |= TFH;
                count = u64::from(self.reload) + (count - 0x1_0000) % (0x1_0000 - u64::from(self.reload));
            }
            self.count = count as u16;
        }
        self.synced = now;
    }

    /// The clocks have changed: call after `sync`. `fast` is the timer's TnML bit.
    pub fn set_clock(&mut self, fast: bool, ticks_per_sysclk: Tick) {
        self.period = ticks_per_sysclk * if fast { 1 } else { 12 };
        self.periods = self.synced / self.period;
    }

    pub fn control(&self) -> u8 {
        self.control
    }

    pub fn write_control(&mut self, value: u8) {
        if value & !self.control & TR != 0 {
            self.periods = self.synced / self.period;
        }
        self.control = value;
    }

    pub fn read(&self, register: Register) -> u8 {
        let [reload_low, reload_high] = self.reload.to_le_bytes();
        let [low, high] = self.count.to_le_bytes();
        match register {
            Register::ReloadLow => reload_low,
            Register::ReloadHigh => reload_high,
            Register::Low => low,
            Register::High => high,
        }
    }

    pub fn write(&mut self, register: Register, value: u8) {
        let (word, byte) = match register {
            Register::ReloadLow => (&mut self.reload, 0),
            Register::ReloadHigh => (&mut self.reload, 1),
            Register::Low => (&mut self.count, 0),
            Register::High => (&mut self.count, 1),
        };
        let mut bytes = word.to_le_bytes();
        bytes[byte] = value;
        *word = u16::from_le_bytes(bytes);
    }

    /// Whether the timer asks for its interrupt.
    pub fn pending(&self) -> bool {
        self.control & TFH != 0 || self.control & (TFL | TFLEN) == (TFL | TFLEN)
    }

    /// When the timer will next ask for its interrupt.
    pub fn next_event(&self) -> Tick {
        if self.control & TR == 0 || self.pending() {
            return NEVER;
        }
        let low_only = self.control & TFLEN != 0;
        let counts =
            if low_only { 0x100 - u64::from(self.count & 0xFF) } else { 0x1_0000 - u64::from(self.count) };
        (self.periods + counts) * self.period
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reload_of_minus_4000_at_48_mhz_over_12_overflows_every_millisecond() {
        let mut timer = ReloadTimer::new(1);
        let [low, high] = 0u16.wrapping_sub(4000).to_le_bytes();
        for (register, value) in [
            (Register::ReloadLow, low),
            (Register::ReloadHigh, high),
            (Register::Low, low),
            (Register::High, high),
        ] {
            timer.write(register, value);
        }
        timer.write_control(TR);
        for millisecond in 1..4 {
            assert_eq!(timer.next_event(), millisecond * 48_000);
            timer.sync(millisecond * 48_000);
            assert!(timer.pending());
            timer.write_control(TR);
        }
    }
}
