//! The serial cable between a unit and its line: whole, pulled, or one that garbles bytes.

use crate::random::{Part, stream};
use crate::time::{NEVER, Tick};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

pub struct Cable {
    pulled_until: Tick,
    noise: Option<Noise>,
    rng: ChaCha8Rng,
}

/// A bit of a byte is wrong with that probability until then.
#[derive(Clone, Copy)]
struct Noise {
    to_unit: f64,
    to_host: f64,
    until: Tick,
}

impl Cable {
    pub fn new(seed: u64) -> Self {
        Self { pulled_until: 0, noise: None, rng: stream(seed, Part::Cable) }
    }

    pub fn pull(&mut self, until: Tick) {
        self.pulled_until = until;
    }

    pub fn garble(&mut self, to_unit: f64, to_host: f64, until: Tick) {
        self.noise = Some(Noise { to_unit, to_host, until });
    }

    pub fn mend(&mut self) {
        self.pulled_until = 0;
        self.noise = None;
    }

    /// When what is wrong with the cable after `now` will next be over by itself.
    pub fn mends_at(&self, now: Tick) -> Tick {
        let ends = [self.pulled_until, self.noise.map_or(NEVER, |noise| noise.until)];
        ends.into_iter().filter(|at| *at > now).fold(NEVER, Tick::min)
    }

    /// What arrives at the unit of bytes that the host sends now.
    pub fn deliver_to_unit(&mut self, bytes: &mut Vec<u8>, now: Tick) {
        let probability = self.noise.filter(|noise| now < noise.until).map_or(0.0, |noise| noise.to_unit);
        self.pass(bytes, probability, now);
    }

    /// What arrives at the host of bytes that the unit has sent since then; nothing has broken or mended in between.
    pub fn deliver_to_host(&mut self, bytes: &mut Vec<u8>, since: Tick) {
        let probability = self.noise.filter(|noise| since < noise.until).map_or(0.0, |noise| noise.to_host);
        self.pass(bytes, probability, since);
    }

    fn pass(&mut self, bytes: &mut Vec<u8>, probability: f64, now: Tick) {
        if now < self.pulled_until {
            bytes.clear();
        }
        if probability > 0.0 {
            for byte in bytes.iter_mut() {
                if self.rng.random_bool(probability) {
                    *byte ^= 1 << self.rng.random_range(0..8);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sent_to_host(cable: &mut Cable, now: Tick) -> Vec<u8> {
        let mut bytes = vec![0x55; 10_000];
        cable.deliver_to_host(&mut bytes, now);
        bytes
    }

    #[test]
    fn a_pulled_cable_passes_nothing_until_it_is_plugged_in_again() {
        let mut cable = Cable::new(1);
        cable.pull(100);
        assert!(sent_to_host(&mut cable, 99).is_empty());
        assert_eq!(sent_to_host(&mut cable, 100), [0x55; 10_000]);
    }

    #[test]
    fn a_noisy_cable_flips_one_bit_of_as_many_bytes_as_it_should_and_only_one_way() {
        let mut cable = Cable::new(1);
        cable.garble(0.0, 0.01, 100);
        let wrong: Vec<u8> = sent_to_host(&mut cable, 0).into_iter().filter(|byte| *byte != 0x55).collect();
        // 100 of 10000 are expected, with a standard deviation of 10.
        assert!((60..140).contains(&wrong.len()), "{}", wrong.len());
        assert!(wrong.iter().all(|byte| (byte ^ 0x55).count_ones() == 1));
        let mut other_way = vec![0x55; 10_000];
        cable.deliver_to_unit(&mut other_way, 0);
        assert_eq!(other_way, [0x55; 10_000]);
        assert_eq!(sent_to_host(&mut cable, 100), [0x55; 10_000]);
    }

    #[test]
    fn the_same_seed_garbles_the_same_bytes() {
        let garbled = |seed| {
            let mut cable = Cable::new(seed);
            cable.garble(0.1, 0.1, 100);
            sent_to_host(&mut cable, 0)
        };
        assert_eq!(garbled(1), garbled(1));
        assert_ne!(garbled(1), garbled(2));
    }
}
