//! Randomness: every part of a unit draws from a stream of its own, all of them from the unit's seed.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Parts that draw. What one draws tells nothing of what another does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    World,
    /// What a bad supply does to the chip's memories, and what they hold at a power-up; of XRAM from the second on.
    Memories,
    Cable,
    Analog,
    FlashTimes,
    /// Bits of flash that are read wrong.
    FlashReads,
    /// Those who walk through the room; no unit's.
    People,
    /// XRAM at the first power-up.
    FirstMemories,
    Oscillator,
}

/// The stream of a part of the unit with that seed.
pub fn stream(seed: u64, part: Part) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(part as u64);
    rng
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    #[test]
    fn no_two_parts_of_a_unit_draw_the_same() {
        let parts = [
            Part::World,
            Part::Memories,
            Part::Cable,
            Part::Analog,
            Part::FlashTimes,
            Part::FlashReads,
            Part::People,
            Part::FirstMemories,
            Part::Oscillator,
        ];
        let mut drawn = parts.map(|part| stream(1, part).random::<u64>());
        drawn.sort_unstable();
        assert!(drawn.windows(2).all(|pair| pair[0] != pair[1]));
    }
}
