//! The PCA's 16-bit counter, brought up to date when it is looked at.

use crate::time::{NEVER, Tick};

pub struct Counter {
    /// Counts made since the reset: this never wraps.
    total: u64,
    /// What the value is ahead of the total's low 16 bits, by writes to it.
    ahead: u16,
    /// Ticks of 48 MHz a count, or `None` while it stands still.
    period: Option<Tick>,
    /// Until when `total` is right, in ticks and in whole periods since time 0 (a division saved).
    synced: Tick,
    periods: u64,
}

impl Counter {
    /// A counter that stands still at 0.
    pub fn new(now: Tick) -> Self {
        Self { total: 0, ahead: 0, period: None, synced: now, periods: 0 }
    }

    pub fn value(&self) -> u16 {
        (self.total as u16).wrapping_add(self.ahead)
    }

    pub fn total(&self) -> u64 {
        self.total
    }

    pub fn write(&mut self, high: bool, byte: u8) {
        let mut bytes = self.value().to_le_bytes();
        bytes[usize::from(high)] = byte;
        self.ahead = u16::from_le_bytes(bytes).wrapping_sub(self.total as u16);
    }

    /// Counts from now on at another rate: call after `sync`.
    pub fn set_rate(&mut self, period: Option<Tick>) {
        if period != self.period {
            self.period = period;
            self.periods = period.map_or(0, |period| self.synced / period);
        }
    }

    /// Brings the value up to `now`; tells whether it has wrapped.
    pub fn sync(&mut self, now: Tick) -> bool {
        let counts = self.counts_to(now);
        self.periods += counts;
        let wrapped = u64::from(self.value()) + counts > 0xFFFF;
        self.total += counts;
        self.synced = now;
        wrapped
    }

    pub fn value_at(&self, at: Tick) -> u16 {
        self.value().wrapping_add(self.counts_to(at) as u16)
    }

    fn counts_to(&self, at: Tick) -> u64 {
        self.period.map_or(0, |period| at / period - self.periods)
    }

    /// When so many more counts will have been made.
    pub fn after(&self, counts: u64) -> Tick {
        self.period.map_or(NEVER, |period| (self.periods + counts) * period)
    }

    pub fn wraps_at(&self) -> Tick {
        self.after(0x1_0000 - u64::from(self.value()))
    }

    /// When the counter will next come to `value`; a whole wrap later if it is there now.
    pub fn reaches(&self, value: u16) -> Tick {
        self.after(u64::from(value.wrapping_sub(self.value()).wrapping_sub(1)) + 1)
    }
}
