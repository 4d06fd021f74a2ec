//! Simulated time: ticks of 48 MHz, of which every SYSCLK and every peripheral clock of the chip is a whole number.

use crate::random::{Part, stream};
use rand::RngExt;

/// A point in time, or a duration, in units of 1/48 MHz since power-up.
pub type Tick = u64;

pub const TICKS_PER_SECOND: Tick = 48_000_000;
pub const TICKS_PER_MS: Tick = TICKS_PER_SECOND / 1_000;
pub const TICKS_PER_US: Tick = TICKS_PER_SECOND / 1_000_000;

/// "Nothing is due": later than any other time.
pub const NEVER: Tick = Tick::MAX;

/// The share by which a chip's internal oscillator may be off (datasheet).
const OSCILLATOR_TOLERANCE: f64 = 0.015;

/// A unit's own oscillator: it counts its ticks faster or slower than those that all units share.
#[derive(Debug, Clone, Copy)]
pub struct Oscillator {
    rate: f64,
}

impl Oscillator {
    /// That of a chip, by its seed.
    pub fn of_chip(seed: u64) -> Self {
        let error = stream(seed, Part::Oscillator).random_range(-OSCILLATOR_TOLERANCE..=OSCILLATOR_TOLERANCE);
        Self::off_by(error)
    }

    /// The share by which it is fast.
    pub fn error(self) -> f64 {
        self.rate - 1.0
    }

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
    fn the_oscillators_of_many_chips_fill_what_the_datasheet_allows() {
        let errors = (0..1000).map(|seed| Oscillator::of_chip(seed).error());
        let (least, most) =
            errors.fold((0.0, 0.0), |(least, most), error| (error.min(least), error.max(most)));
        // The chance that none of 1000 is within 2 % of a limit is 0.99^1000 = 4e-5.
        assert!((-0.015..=-0.0147).contains(&least) && (0.0147..=0.015).contains(&most), "{least} {most}");
    }

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
