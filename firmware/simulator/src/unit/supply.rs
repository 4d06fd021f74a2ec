//! The supply over time: a voltage that rises, dips and falls, and what the chip makes of each level.
//!
//! Three levels matter. Below the power-on reset's voltage the chip is dead and its memories are lost. Between that and
//! the supply monitor's threshold it runs if nothing holds it: a rise that is slower than the power-on reset's delay lets
//! the chip start too early. Above the threshold all is well.

use crate::time::{NEVER, TICKS_PER_MS, TICKS_PER_US, Tick};
use rand::{Rng, RngExt};
use std::collections::VecDeque;

/// What VDD is good for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    Dead,
    /// The chip runs, but reads and writes flash wrong.
    Low,
    Sound,
}

/// VDD when all is well.
const FULL_V: f64 = 3.3;
/// The datasheet's limits of the monitor's threshold (from memory); each chip has its own.
const THRESHOLD_V: std::ops::Range<f64> = 2.40..2.70;
/// Where the power-on reset lets go. Assumed.
const POWER_ON_V: std::ops::Range<f64> = 1.4..2.2;
/// From there to the first instruction, for a rise within 1 ms (from memory of the datasheet).
pub const POWER_ON_DELAY: Tick = 300 * TICKS_PER_US;
/// How long the supply is off before it rises again: long enough to drain.
const OFF: Tick = 100 * TICKS_PER_MS;
/// After the rise dips come for so long: the whole start of a unit lies in it.
const UNSTEADY: Tick = 600 * TICKS_PER_MS;
const LONGEST_DIP: Tick = 30 * TICKS_PER_MS;

/// A rise of VDD: how long it takes from nothing to full, and how many dips of any depth come with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ramp {
    pub rise: Tick,
    pub dips: u32,
}

/// Changes of level to come.
#[derive(Debug, Default)]
pub struct Supply {
    ahead: VecDeque<(Tick, Level)>,
}

impl Supply {
    /// The supply falls at `now`, and comes back with this ramp.
    pub fn fall_and_rise(ramp: Ramp, now: Tick, rng: &mut impl Rng) -> Self {
        let begin = now + OFF;
        let (power_on_v, threshold_v) = (rng.random_range(POWER_ON_V), rng.random_range(THRESHOLD_V));
        let rises_to = |volts: f64| begin + (ramp.rise as f64 * volts / FULL_V) as Tick;
        let mut ahead = vec![
            (now, Level::Dead),
            (rises_to(power_on_v), Level::Low),
            (rises_to(threshold_v), Level::Sound),
        ];
        let full = rises_to(FULL_V);
        for _ in 0..ramp.dips {
            let from = rng.random_range(begin..full + UNSTEADY);
            let until = from + rng.random_range(1..LONGEST_DIP);
            let depth_v = rng.random_range(0.0..FULL_V);
            let level = match depth_v {
                depth_v if depth_v < power_on_v => Level::Dead,
                depth_v if depth_v < threshold_v => Level::Low,
                _ => continue,
            };
            dip(&mut ahead, from, until, level);
        }
        Self { ahead: ahead.into() }
    }

    pub fn next_event(&self) -> Tick {
        self.ahead.front().map_or(NEVER, |(at, _)| *at)
    }

    /// The level that holds from `next_event` on.
    pub fn take(&mut self) -> Option<Level> {
        self.ahead.pop_front().map(|(_, level)| level)
    }
}

/// Takes the level down to `level` from one moment until another, wherever it is higher.
fn dip(ahead: &mut Vec<(Tick, Level)>, from: Tick, until: Tick, level: Level) {
    let at = |moment: Tick| {
        ahead.iter().rev().find(|(at, _)| *at <= moment).map_or(Level::Sound, |(_, level)| *level)
    };
    let lower = |a: Level, b: Level| if (a as u8) < (b as u8) { a } else { b };
    let (before, after) = (at(from), at(until));
    let mut dipped: Vec<(Tick, Level)> = ahead.iter().filter(|(at, _)| *at < from).copied().collect();
    dipped.push((from, lower(before, level)));
    dipped.extend(
        ahead
            .iter()
            .filter(|(at, _)| (from + 1..until).contains(at))
            .map(|(at, there)| (*at, lower(*there, level))),
    );
    dipped.push((until, after));
    dipped.extend(ahead.iter().filter(|(at, _)| *at > until));
    *ahead = dipped;
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn levels(ramp: Ramp, seed: u64) -> Vec<(Tick, Level)> {
        Supply::fall_and_rise(ramp, 1000, &mut ChaCha8Rng::seed_from_u64(seed)).ahead.into()
    }

    #[test]
    fn a_clean_rise_passes_through_the_low_level_in_a_share_of_its_time() {
        for seed in 0..20 {
            let rise = 100 * TICKS_PER_MS;
            let found = levels(Ramp { rise, dips: 0 }, seed);
            assert_eq!(
                found.iter().map(|(_, level)| *level).collect::<Vec<_>>(),
                [Level::Dead, Level::Low, Level::Sound]
            );
            let low = found[2].0 - found[1].0;
            // From 1.4 to 2.2 V up to 2.4 to 2.7 V, of 3.3 V: 6 to 40 % of the rise.
            assert!((rise * 6 / 100..rise * 40 / 100).contains(&low), "{low}");
        }
    }

    #[test]
    fn dips_only_lower_the_level_and_the_supply_ends_sound() {
        for seed in 0..200 {
            let found = levels(Ramp { rise: 20 * TICKS_PER_MS, dips: 8 }, seed);
            assert!(found.windows(2).all(|pair| pair[0].0 <= pair[1].0), "{found:?}");
            assert_eq!(found[0], (1000, Level::Dead));
            assert_eq!(found.last().unwrap().1, Level::Sound);
        }
    }

    #[test]
    fn a_dip_in_the_midst_ends_where_the_level_would_have_been() {
        let mut ahead = vec![(0, Level::Dead), (100, Level::Low), (200, Level::Sound)];
        dip(&mut ahead, 150, 300, Level::Dead);
        assert_eq!(
            ahead,
            [
                (0, Level::Dead),
                (100, Level::Low),
                (150, Level::Dead),
                (200, Level::Dead),
                (300, Level::Sound)
            ]
        );
    }
}
