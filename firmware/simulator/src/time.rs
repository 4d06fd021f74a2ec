//! Simulated time: ticks of 48 MHz, of which every SYSCLK and every peripheral clock of the chip is a whole number.

/// A point in time, or a duration, in units of 1/48 MHz since power-up.
pub type Tick = u64;

pub const TICKS_PER_SECOND: Tick = 48_000_000;
pub const TICKS_PER_MS: Tick = TICKS_PER_SECOND / 1_000;
pub const TICKS_PER_US: Tick = TICKS_PER_SECOND / 1_000_000;

/// "Nothing is due": later than any other time.
pub const NEVER: Tick = Tick::MAX;

pub fn from_seconds(seconds: f64) -> Tick {
    (seconds * TICKS_PER_SECOND as f64).round() as Tick
}

pub fn to_seconds(ticks: Tick) -> f64 {
    ticks as f64 / TICKS_PER_SECOND as f64
}
