//! A fleet of units on one thread: slices of simulated time in turn, faults in between, paced by a clock.

pub mod control;
pub mod flash_store;
mod frame;
pub mod host;
pub mod line;
pub mod member;
mod readiness;
pub mod report;

use crate::cli::Speed;
use crate::faults::{FaultSchedule, Injection};
use crate::fleet::member::{Member, MemberError};
use crate::time::{TICKS_PER_MS, Tick, from_seconds, to_seconds};
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Simulated time between two looks at the serial lines when nothing is paced.
const FREE_SLICE: Tick = 5 * TICKS_PER_MS;
/// Real time between two looks at the serial lines when it is, as long as the machine keeps up.
const PACED_SLICE: Duration = Duration::from_millis(1);
/// Simulated time between two looks at most.
const LONGEST_SLICE: Tick = 20 * TICKS_PER_MS;

#[derive(Debug, Error)]
pub enum FleetError {
    #[error(transparent)]
    Member(#[from] MemberError),
    #[error("the serial lines can't be watched: {0}")]
    Lines(io::Error),
}

pub struct Fleet {
    pub members: Vec<Member>,
    pub now: Tick,
    faults: FaultSchedule,
    /// How far one unit may be run ahead of the others.
    slice: Tick,
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

impl Fleet {
    /// Units at power-up; `lookahead` is how far one may be run ahead of the others if they share a room.
    pub fn new(members: Vec<Member>, faults: FaultSchedule, lookahead: Option<Tick>) -> Self {
        let slice = lookahead.map_or(LONGEST_SLICE, |lookahead| lookahead.min(LONGEST_SLICE));
        Self { members, now: 0, faults, slice }
    }

    /// Frames that the units have ended so far.
    pub fn frames(&self) -> u64 {
        self.members.iter().map(|member| member.frames).sum()
    }

    /// FaultSchedule that are yet to come.
    pub fn faults_to_come(&self) -> usize {
        self.faults.len()
    }

    /// Runs the fleet until the schedule's end or until `stop`, and tells `watch` how it gets on.
    ///
    /// # Errors
    /// A [`FleetError`] for the first unit that fails, or if the lines can't be watched.
    pub fn run(
        &mut self,
        schedule: &Schedule,
        stop: &AtomicBool,
        mut watch: impl FnMut(&Self),
    ) -> Result<(), FleetError> {
        let began = Instant::now();
        while !stop.load(Ordering::Relaxed) && schedule.end.is_none_or(|end| self.now < end) {
            self.run_until(schedule.slice_end(self.now, began.elapsed()))?;
            self.exchange()?;
            watch(self);
            if let Speed::Times(times) = schedule.speed {
                let due = began + Duration::from_secs_f64(to_seconds(self.now) / times);
                std::thread::sleep(due.saturating_duration_since(Instant::now()));
            }
        }
        Ok(())
    }

    /// Runs all units until `end`.
    ///
    /// # Errors
    /// A [`MemberError`] for the first unit that fails.
    pub fn run_until(&mut self, end: Tick) -> Result<(), MemberError> {
        while self.now < end {
            let stop = self.begin_slice(end);
            for member in &mut self.members {
                member.run_until(self.now, stop)?;
            }
            self.now = stop;
        }
        Ok(())
    }

    /// As `run_until`, but stops as soon as a unit has ended a frame. With several units that is seen by the slice.
    ///
    /// # Errors
    /// As `run_until`.
    pub fn run_until_frame(&mut self, end: Tick) -> Result<(), MemberError> {
        let before = self.frames();
        while self.now < end && self.frames() == before {
            let stop = self.begin_slice(end.min(self.now + FREE_SLICE));
            self.now = if let [member] = &mut self.members[..] {
                member.run_until_frame(self.now, stop)?;
                member.now()
            } else {
                self.members.iter_mut().try_for_each(|member| member.run_until(self.now, stop))?;
                stop
            };
        }
        Ok(())
    }

    /// Hands on what has come from the units and what has come for them.
    fn exchange(&mut self) -> Result<(), FleetError> {
        let ready = readiness::ready(self.members.iter().map(Member::line)).map_err(FleetError::Lines)?;
        for (member, ready) in self.members.iter_mut().zip(ready) {
            member.exchange(ready, self.now);
        }
        Ok(())
    }

    /// Something goes wrong, now.
    pub fn inject(&mut self, injection: &Injection) {
        for member in self.members.iter_mut().filter(|member| injection.strikes(member.serial)) {
            member.inject(injection, self.now);
        }
    }

    /// Lets what is due go wrong; gives the end of a slice that nothing interrupts, and in which no cable mends.
    fn begin_slice(&mut self, end: Tick) -> Tick {
        while let Some(injection) = self.faults.take(self.now) {
            self.inject(&injection);
        }
        let cables = self.members.iter().map(|member| member.cable.mends_at(self.now));
        cables.fold(end.min(self.now + self.slice).min(self.faults.next_at()), Tick::min)
    }
}
