//! A unit of a fleet with all that is its own: its cable, what that ends in, the file that keeps its flash.

use crate::cable::Cable;
use crate::chip::violation::Breach;
use crate::faults::{Fault, Injection};
use crate::fleet::flash_store::FlashStore;
use crate::fleet::host::Host;
use crate::fleet::line::Line;
use crate::time::{Oscillator, Tick, from_seconds};
use crate::unit::Unit;
use std::io;
use thiserror::Error;

/// What may wait on the wire to a unit before its client is left to wait itself.
const WIRE: usize = 512;

#[derive(Debug, Error)]
pub enum MemberError {
    #[error("unit {serial}: {breach}")]
    Breach { serial: u32, breach: Breach },
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
    /// The unit's times are those of its own oscillator; all others here are shared.
    pub oscillator: Oscillator,
    pub cable: Cable,
    pub peer: Peer,
    pub store: Option<FlashStore>,
    /// What has come through the cable from the unit and is yet to be handed on.
    pub outbox: Vec<u8>,
    /// Frames that the unit has ended so far.
    pub frames: u64,
}

impl Member {
    /// Runs the unit from `now` until `end`, then hands over what the cable and the flash's file are to have.
    ///
    /// # Errors
    /// A [`MemberError`] if the firmware does what it must not, or the file can't be written.
    pub fn run_until(&mut self, now: Tick, end: Tick) -> Result<(), MemberError> {
        let outcome = self.unit.run_until(self.oscillator.own(end));
        self.settle(outcome, now)
    }

    /// As `run_until`, but stops at the end of a frame of the unit's.
    ///
    /// # Errors
    /// As `run_until`.
    pub fn run_until_frame(&mut self, now: Tick, end: Tick) -> Result<(), MemberError> {
        let outcome = self.unit.run_until_frame(self.oscillator.own(end));
        self.settle(outcome, now)
    }

    /// How far the unit has been run.
    pub fn now(&self) -> Tick {
        self.oscillator.shared(self.unit.now())
    }

    /// Puts bytes on the cable to the unit.
    pub fn feed(&mut self, mut bytes: Vec<u8>, now: Tick) {
        self.cable.deliver_to_unit(&mut bytes, now);
        self.unit.feed(&bytes);
    }

    /// Something goes wrong with this unit, from now on.
    pub fn inject(&mut self, injection: &Injection, now: Tick) {
        let until = injection.until(now);
        match injection.fault {
            Fault::CablePulled {} => self.cable.pull(until),
            Fault::CableCorrupts { to_unit, to_host } => self.cable.garble(to_unit, to_host, until),
            Fault::PowerCut {} => self.unit.power_cut(until - now),
            Fault::BrownOut {} => self.unit.brown_out(),
            Fault::PowerRamp { rise_ms, dips } => self.unit.ramp_power(from_seconds(rise_ms / 1e3), dips),
            Fault::ResetPin {} => self.unit.pull_reset_pin(),
            Fault::PowerCutAtFlashOperation { number } => {
                self.unit.cut_power_at_flash_operation(number.into());
            }
            Fault::Mended {} => self.cable.mend(),
            _ => {}
        }
        self.unit.inject(&injection.fault, self.oscillator.own(until));
    }

    fn settle(&mut self, outcome: Result<(), Breach>, since: Tick) -> Result<(), MemberError> {
        let serial = self.serial;
        outcome.map_err(|breach| MemberError::Breach { serial, breach })?;
        if let (Some(store), Some(flash)) = (&self.store, self.unit.changed_flash()) {
            store.save(flash).map_err(|source| MemberError::Store { serial, source })?;
        }
        self.frames += self.unit.sent().iter().filter(|byte| **byte == 0).count() as u64;
        self.cable.deliver_to_host(self.unit.sent(), since);
        self.outbox.append(self.unit.sent());
        Ok(())
    }

    pub fn line(&self) -> Option<&Line> {
        match &self.peer {
            Peer::Line(line) => Some(line),
            Peer::Host(_) | Peer::Control => None,
        }
    }

    /// Hands on what has come from the unit and what has come for it; `ready` tells of its line whether there is
    /// anything.
    pub fn exchange(&mut self, ready: bool, now: Tick) {
        match &mut self.peer {
            Peer::Line(line) if !ready && self.outbox.is_empty() && !line.is_behind() => {}
            Peer::Line(line) => {
                let mut buffer = [0; WIRE];
                let room = WIRE - self.unit.incoming_len().min(WIRE);
                let received = line.exchange(&self.outbox, ready, &mut buffer[..room]);
                self.outbox.clear();
                if received > 0 {
                    self.feed(buffer[..received].to_vec(), now);
                }
            }
            Peer::Control => {}
            Peer::Host(host) => {
                if !self.outbox.is_empty() {
                    let answer = host.answer(&self.outbox);
                    self.outbox.clear();
                    self.feed(answer, now);
                }
            }
        }
    }
}
