//! Running a fleet step by step, on simulated time alone, for the program at the other end of two pipes.
//!
//! A request is a line of JSON, and so is its answer. The request may feed bytes to the units' lines and says until when
//! to run; the answer has what the units have sent meanwhile. Nothing depends on real time.

use crate::fleet::{FREE_SLICE, FleetError, Member};
use crate::time::{Tick, from_seconds, to_seconds};
use serde::{Deserialize, Serialize};
use std::io::{self, BufRead, Write};
use thiserror::Error;

#[derive(Debug, Error)]
pub enum ControlError {
    #[error("request {line} of --control: {source}")]
    Request { line: usize, source: serde_json::Error },
    #[error("request {line} of --control feeds {given} units where there are {units}")]
    NoSuchUnit { line: usize, given: usize, units: usize },
    #[error(transparent)]
    Fleet(#[from] FleetError),
    #[error("--control: {0}")]
    Io(#[from] io::Error),
}

/// Bytes on a unit's line, as hex.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(transparent)]
struct Bytes(#[serde(with = "hex")] Vec<u8>);

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Request {
    /// To the line of unit 1, unit 2 and so on, from now on at the line's own pace.
    #[serde(default)]
    feed: Vec<Bytes>,
    /// Run until this simulated time; without it, no time passes.
    until_s: Option<f64>,
    /// Stop as soon as a unit has ended a frame. With several units that is seen every 5 ms.
    #[serde(default)]
    stop_at_frame: bool,
}

#[derive(Debug, Serialize)]
struct Answer {
    now_s: f64,
    /// What each unit has sent since the last answer.
    sent: Vec<Bytes>,
}

/// Answers requests until there are no more.
///
/// # Errors
/// A [`ControlError`] for a request that can't be read, and for the first unit that fails.
pub fn run(
    fleet: &mut [Member],
    requests: impl BufRead,
    mut answers: impl Write,
) -> Result<(), ControlError> {
    let mut now = 0;
    for (index, text) in requests.lines().enumerate() {
        let line = index + 1;
        let request: Request =
            serde_json::from_str(&text?).map_err(|source| ControlError::Request { line, source })?;
        if request.feed.len() > fleet.len() {
            return Err(ControlError::NoSuchUnit { line, given: request.feed.len(), units: fleet.len() });
        }
        for (member, Bytes(bytes)) in fleet.iter_mut().zip(&request.feed) {
            member.unit.feed(bytes);
        }
        if let Some(until_s) = request.until_s {
            now = advance(fleet, now, from_seconds(until_s), request.stop_at_frame)?;
        }
        let sent = fleet.iter_mut().map(|member| Bytes(std::mem::take(member.unit.sent()))).collect();
        serde_json::to_writer(&mut answers, &Answer { now_s: to_seconds(now), sent })
            .map_err(io::Error::from)?;
        answers.write_all(b"\n")?;
        answers.flush()?;
    }
    Ok(())
}

/// Runs all units from `now` to `end`, or to a frame's end; gives the time that it is then.
fn advance(fleet: &mut [Member], now: Tick, end: Tick, stop_at_frame: bool) -> Result<Tick, FleetError> {
    if let ([member], true) = (&mut *fleet, stop_at_frame) {
        member.run_until_frame(end)?;
        return Ok(member.unit.now().max(now));
    }
    let mut now = now;
    while now < end {
        now = (now + FREE_SLICE).min(end);
        for member in fleet.iter_mut() {
            member.run_until(now)?;
        }
        if stop_at_frame && fleet.iter_mut().any(|member| member.unit.sent().contains(&0)) {
            break;
        }
    }
    Ok(now)
}
