//! Simulated time: ticks of 48 MHz, of which every SYSCLK and every peripheral clock of the chip is a whole number.

/// A point in time, or a duration, in units of 1/48 MHz since power-up.
pub type Tick = u64;

pub const TICKS_PER_SECOND: Tick = 48_000_000;
pub const TICKS_PER_MS: Tick = TICKS_PER_SECOND / 1_000;
pub const TICKS_PER_US: Tick = TICKS_PER_SECOND / 1_000_000;

/// "Nothing is due": later than any other time.
pub const NEVER: Tick = Tick::MAX;

/// A unit's own oscillator: it counts its ticks faster or slower than those that all units share.
#[derive(Debug, Clone, Copy)]
pub struct Oscillator {
    rate: f64,
}

impl Oscillator {
    /// One that is fast by this share.
    pub const fn off_by(error: f64) -> Self {
        Self { rate: 1.0 + error }
    }

    /// What it counts at a shared time, or in a shared duration.
    pub fn own(self, shared: Tick) -> Tick {
        if shared == NEVER { NEVER } else { (shared as f64 * self.rate).round() as Tick }
    }

    /// The first shared time at which it counts `own`: never sooner than what `own` was made of.
    pub fn shared(self, own: Tick) -> Tick {
        if own == NEVER { NEVER } else { (own as f64 / self.rate).ceil() as Tick }
    }
}

pub fn from_seconds(seconds: f64) -> Tick {
    (seconds * TICKS_PER_SECOND as f64).round() as Tick
}

pub fn to_seconds(ticks: Tick) -> f64 {
    ticks as f64 / TICKS_PER_SECOND as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_oscillator_counts_by_its_error_and_no_time_that_it_was_given_comes_back_sooner() {
        for error in [-0.03, -0.015, 0.0, 0.004, 0.03] {
            let oscillator = Oscillator::off_by(error);
            let counted = to_seconds(oscillator.own(1000 * TICKS_PER_SECOND));
            assert!((counted - 1000.0 * (1.0 + error)).abs() < 1e-6);
            for shared in (0..10_000).chain([NEVER, 86_400 * TICKS_PER_SECOND + 7]) {
                let back = oscillator.shared(oscillator.own(shared));
                assert!((shared..=shared.saturating_add(1)).contains(&back), "{error} {shared} {back}");
            }
        }
    }
}
