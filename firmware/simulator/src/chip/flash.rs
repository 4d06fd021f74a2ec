//! Flash memory and how it is written (datasheet chapter "Flash Memory"): keys, lock, supply monitor, stall.

use crate::chip::sfr;
use crate::chip::violation::Violation;
use crate::random::{Part, stream};
use crate::time::{TICKS_PER_MS, TICKS_PER_US, Tick};
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use std::ops::RangeInclusive;

pub const FLASH_SIZE: usize = 0x1_0000;
pub const PAGE_SIZE: u16 = 512;
/// From here on flash is reserved: reading, executing or writing it is a flash-error reset.
pub const RESERVED: u16 = 0xFC00;
/// The page of the lock byte at 0xFBFF.
const LOCK_PAGE: u16 = 0xFA00;
const PSWE: u8 = 0x01;
const PSEE: u8 = 0x02;
/// Assumed.
const WRONG_BITS: usize = 100;
/// The datasheet's limits, from memory (typically 55 us and 15 ms); that each operation draws its own, evenly, is assumed.
const WRITE_TIME: RangeInclusive<Tick> = 40 * TICKS_PER_US..=70 * TICKS_PER_US;
const ERASE_TIME: RangeInclusive<Tick> = 10 * TICKS_PER_MS..=20 * TICKS_PER_MS;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Lock {
    Locked,
    FirstKey,
    Unlocked,
    /// Until the next reset.
    Disabled,
}

/// What a MOVX to flash did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operation {
    /// The CPU stalls for that many ticks.
    Done(Tick),
    /// The lock or the reserved area forbade it.
    Refused,
    FlashError,
}

/// What a flash operation works on, and what was there before.
struct Span {
    start: usize,
    before: Vec<u8>,
}

pub struct Flash {
    /// What is read.
    bytes: Box<[u8; FLASH_SIZE]>,
    /// What is stored, while what is read is something else: flash is read faster than it can be.
    stored: Option<Box<[u8; FLASH_SIZE]>>,
    seed: u64,
    times: ChaCha8Rng,
    /// Each operation takes the longest time that the datasheet allows.
    pub is_slowest: bool,
    /// Of the last operation.
    span: Option<Span>,
    operations: u64,
    lock: Lock,
    psctl: u8,
    pub changed: bool,
}

impl Flash {
    /// A memory with these contents; the seed decides how long operations take, and which bits fail when it is
    /// read too fast.
    pub fn new(bytes: Box<[u8; FLASH_SIZE]>, seed: u64) -> Self {
        Self {
            bytes,
            stored: None,
            seed,
            times: stream(seed, Part::FlashTimes),
            is_slowest: false,
            span: None,
            operations: 0,
            lock: Lock::Locked,
            psctl: 0,
            changed: false,
        }
    }

    pub fn reset(&mut self) {
        self.lock = Lock::Locked;
        self.psctl = 0;
        self.set_outrun(false);
    }

    /// The system clock is too fast for flash without wait states, or no longer: while it is, one bit in
    /// `WRONG_BITS` reads wrong. Real errors change from read to read; these stay as they are.
    pub fn set_outrun(&mut self, outrun: bool) {
        match self.stored.take() {
            Some(stored) if outrun => self.stored = Some(stored),
            Some(stored) => self.bytes = stored,
            None if outrun => {
                self.stored = Some(self.bytes.clone());
                let mut rng = stream(self.seed, Part::FlashReads);
                for _ in 0..FLASH_SIZE * 8 / WRONG_BITS {
                    self.bytes[rng.random_range(0..FLASH_SIZE)] ^= 1 << rng.random_range(0..8);
                }
            }
            None => {}
        }
    }

    /// Whether reads go wrong.
    pub fn is_outrun(&self) -> bool {
        self.stored.is_some()
    }

    /// What is stored.
    pub fn bytes(&self) -> &[u8; FLASH_SIZE] {
        self.stored.as_ref().unwrap_or(&self.bytes)
    }

    /// What a read of this address gives.
    #[inline]
    pub fn byte(&self, address: u16) -> u8 {
        self.bytes[address as usize]
    }

    pub fn read(&self, address: u8) -> u8 {
        if address == sfr::PSCTL { self.psctl } else { self.lock as u8 }
    }

    pub fn write(&mut self, address: u8, value: u8) {
        if address == sfr::PSCTL {
            self.psctl = value;
        } else {
            self.lock = match (self.lock, value) {
                (Lock::Locked, 0xA5) => Lock::FirstKey,
                (Lock::FirstKey, 0xF1) => Lock::Unlocked,
                _ => Lock::Disabled,
            };
        }
    }

    /// Whether MOVX writes go to flash.
    pub fn takes_movx(&self) -> bool {
        self.psctl & PSWE != 0
    }

    /// A MOVX write while PSWE is set: erases the page if PSEE is set, else clears bits of the byte.
    ///
    /// # Errors
    /// A [`Violation`] for the page of the lock byte, where a real chip would be locked for good.
    pub fn movx(&mut self, address: u16, value: u8, supply_monitored: bool) -> Result<Operation, Violation> {
        if !supply_monitored || address >= RESERVED {
            return Ok(Operation::FlashError);
        }
        if self.lock != Lock::Unlocked {
            self.lock = Lock::Disabled;
            return Ok(Operation::Refused);
        }
        if address >= LOCK_PAGE {
            return Err(Violation::rule(format!(
                "flash 0x{address:04X} written: this can lock the chip for good"
            )));
        }
        self.lock = Lock::Locked;
        if self.psctl & PSEE != 0 {
            self.begin((address & !(PAGE_SIZE - 1)).into(), PAGE_SIZE.into()).fill(0xFF);
            return Ok(Operation::Done(self.time_within(ERASE_TIME)));
        }
        self.begin(address.into(), 1)[0] &= value;
        Ok(Operation::Done(self.time_within(WRITE_TIME)))
    }

    fn time_within(&mut self, limits: RangeInclusive<Tick>) -> Tick {
        if self.is_slowest { *limits.end() } else { self.times.random_range(limits) }
    }

    /// Bytes written and pages erased so far.
    pub fn operations(&self) -> u64 {
        self.operations
    }

    /// The power went during the last operation: of the bits that it changes none, all, or a random part have changed.
    pub fn interrupt(&mut self, rng: &mut impl Rng) {
        let Some(Span { start, before }) = self.span.take() else {
            return;
        };
        let share = [0.0, 1.0, rng.random()][rng.random_range(0..3)];
        for (byte, before) in self.cells()[start..].iter_mut().zip(before) {
            for bit in (0..8).map(|shift| 1 << shift) {
                if (*byte ^ before) & bit != 0 && !rng.random_bool(share) {
                    *byte ^= bit;
                }
            }
        }
    }

    /// A program that runs wild has cleared bits of some byte below the page of the lock byte.
    pub fn spoil_a_byte(&mut self, rng: &mut impl Rng) {
        self.changed = true;
        let address = rng.random_range(0..usize::from(LOCK_PAGE));
        let bit = 1 << rng.random_range(0..8);
        let byte = &mut self.cells()[address];
        *byte = if *byte & bit != 0 { *byte & !bit } else { *byte ^ 0xFF };
    }

    fn begin(&mut self, start: usize, length: usize) -> &mut [u8] {
        self.changed = true;
        self.operations += 1;
        self.span = Some(Span { start, before: self.bytes()[start..start + length].to_vec() });
        &mut self.cells()[start..start + length]
    }

    fn cells(&mut self) -> &mut [u8; FLASH_SIZE] {
        self.stored.as_mut().unwrap_or(&mut self.bytes)
    }
}

#[cfg(test)]
mod tests;
