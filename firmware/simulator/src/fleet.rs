//! A fleet of units on one thread: slices of simulated time in turn, serial lines in between, paced by a clock.

use crate::cli::Speed;
use crate::fault::Fault;
use crate::flash_store::FlashStore;
use crate::host::Host;
use crate::line::Line;
use crate::readiness;
use crate::time::{TICKS_PER_MS, Tick, from_seconds, to_seconds};
use crate::unit::Unit;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Simulated time between two looks at the serial lines when nothing is paced.
pub const FREE_SLICE: Tick = 5 * TICKS_PER_MS;
/// Real time between two looks at the serial lines when it is, as long as the machine keeps up.
const PACED_SLICE: Duration = Duration::from_millis(1);
/// Simulated time between two looks at most.
const LONGEST_SLICE: Tick = 20 * TICKS_PER_MS;
/// What may wait on the wire to a unit before its client is left to wait itself.
const WIRE: usize = 512;

#[derive(Debug, Error)]
pub enum FleetError {
    #[error("unit {serial}: {fault}")]
    Fault { serial: u32, fault: Fault },
    #[error("the serial lines can't be watched: {0}")]
    Lines(io::Error),
    #[error("unit {serial}: its flash can't be kept in --state: {source}")]
    Store { serial: u32, source: io::Error },
}

/// What a unit's serial line ends in.
pub enum Peer {
    Line(Line),
    Host(Host),
    /// The program that runs the simulation step by step takes and gives the bytes.
    Control,
}

pub struct Member {
    pub serial: u32,
    pub unit: Unit,
    pub peer: Peer,
    pub store: Option<FlashStore>,
}

/// How long to run, and how fast.
pub struct Schedule {
    pub speed: Speed,
    pub end: Option<Tick>,
}

impl Schedule {
    /// The end of the slice that begins at `now`. One that begins late is longer: that costs less a simulated second.
    fn slice_end(&self, now: Tick, elapsed: Duration) -> Tick {
        let end = match self.speed {
            Speed::Max => now + FREE_SLICE,
            Speed::Times(times) => {
                let due = from_seconds(times * elapsed.as_secs_f64());
                let slice = from_seconds(times * PACED_SLICE.as_secs_f64());
                due.max(now + slice).clamp(now + 1, now + LONGEST_SLICE)
            }
        };
        end.min(self.end.unwrap_or(Tick::MAX))
    }
}

/// Runs the fleet until its end or until `stop`; gives the simulated time that has passed.
///
/// # Errors
/// A [`FleetError`] for the first unit that fails.
pub fn run(fleet: &mut [Member], schedule: &Schedule, stop: &AtomicBool) -> Result<Tick, FleetError> {
    let began = Instant::now();
    let mut now = 0;
    while !stop.load(Ordering::Relaxed) && schedule.end.is_none_or(|end| now < end) {
        now = schedule.slice_end(now, began.elapsed());
        for member in fleet.iter_mut() {
            member.run_until(now)?;
        }
        let ready = readiness::ready(fleet.iter().map(Member::line)).map_err(FleetError::Lines)?;
        for (member, ready) in fleet.iter_mut().zip(ready) {
            member.exchange(ready);
        }
        if let Speed::Times(times) = schedule.speed {
            let due = began + Duration::from_secs_f64(to_seconds(now) / times);
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
        }
    }
    Ok(now)
}

impl Member {
    /// Runs the unit until `end`, then hands over what the flash's file is to have.
    pub fn run_until(&mut self, end: Tick) -> Result<(), FleetError> {
        let serial = self.serial;
        self.unit.run_until(end).map_err(|fault| FleetError::Fault { serial, fault })?;
        self.settle()
    }

    /// As `run_until`, but stops at the end of a frame of the unit's.
    pub fn run_until_frame(&mut self, end: Tick) -> Result<(), FleetError> {
        let serial = self.serial;
        self.unit.run_until_frame(end).map_err(|fault| FleetError::Fault { serial, fault })?;
        self.settle()
    }

    fn settle(&mut self) -> Result<(), FleetError> {
        let serial = self.serial;
        if let (Some(store), Some(flash)) = (&self.store, self.unit.changed_flash()) {
            store.save(flash).map_err(|source| FleetError::Store { serial, source })?;
        }
        Ok(())
    }

    fn line(&self) -> Option<&Line> {
        match &self.peer {
            Peer::Line(line) => Some(line),
            _ => None,
        }
    }

    /// Hands on what the unit has sent and what has come for it; `ready` tells of its line whether there is anything.
    fn exchange(&mut self, ready: bool) {
        match &mut self.peer {
            Peer::Line(line) if !ready && self.unit.sent().is_empty() && !line.is_behind() => {}
            Peer::Line(line) => {
                let mut buffer = [0; WIRE];
                let room = WIRE - self.unit.incoming_len().min(WIRE);
                let received = line.exchange(self.unit.sent(), ready, &mut buffer[..room]);
                self.unit.sent().clear();
                if received > 0 {
                    self.unit.feed(&buffer[..received]);
                }
            }
            Peer::Control => {}
            Peer::Host(host) => {
                if !self.unit.sent().is_empty() {
                    let answer = host.answer(self.unit.sent());
                    self.unit.sent().clear();
                    self.unit.feed(&answer);
                }
            }
        }
    }
}
