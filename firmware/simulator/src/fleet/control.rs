//! Running a fleet step by step, on simulated time alone, for the program at the other end of two pipes.
//!
//! A request is a line of JSON, and so is its answer. The request may feed bytes to the units' lines, let something go
//! wrong, and says until when to run; the answer has what the units have sent meanwhile and how things truly are.
//! Nothing depends on real time.

use crate::faults::Injection;
use crate::fleet::Fleet;
use crate::fleet::member::MemberError;
use crate::time::{from_seconds, to_seconds};
use crate::unit::Truth;
use serde::{Deserialize, Serialize};
use std::io::{self, BufRead, Write};
use thiserror::Error;

#[derive(Debug, Error)]
pub enum ControlError {
    #[error("request {line} of --control: {source}")]
    Request { line: usize, source: serde_json::Error },
    #[error("request {line} of --control feeds {given} units where there are {units}")]
    NoSuchUnit { line: usize, given: usize, units: usize },
    #[error("request {line} of --control: fault: {field} {problem}")]
    Injection { line: usize, field: &'static str, problem: &'static str },
    #[error(transparent)]
    Member(#[from] MemberError),
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
    /// What goes wrong, now.
    fault: Option<Injection>,
    /// Run until this simulated time; without it, no time passes.
    until_s: Option<f64>,
    /// Stop as soon as a unit has ended a frame. With several units that is seen by the slice.
    #[serde(default)]
    stop_at_frame: bool,
}

#[derive(Debug, Serialize)]
struct Answer {
    now_s: f64,
    /// What each unit has sent since the last answer.
    sent: Vec<Bytes>,
    /// How things are with each unit.
    truth: Vec<Truth>,
    /// What has been measured of each, for people; nothing without `--measure`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    measured: Vec<String>,
}

/// Answers requests until there are no more.
///
/// # Errors
/// A [`ControlError`] for a request that can't be read, and for the first unit that fails.
pub fn run(fleet: &mut Fleet, requests: impl BufRead, mut answers: impl Write) -> Result<(), ControlError> {
    for (index, text) in requests.lines().enumerate() {
        let line = index + 1;
        let request: Request =
            serde_json::from_str(&text?).map_err(|source| ControlError::Request { line, source })?;
        check(&request, fleet, line)?;
        if let Some(injection) = &request.fault {
            fleet.inject(injection);
        }
        let now = fleet.now;
        for (member, Bytes(bytes)) in fleet.members.iter_mut().zip(request.feed) {
            member.feed(bytes, now);
        }
        match request.until_s.map(from_seconds) {
            Some(end) if request.stop_at_frame => fleet.run_until_frame(end)?,
            Some(end) => fleet.run_until(end)?,
            None => {}
        }
        serde_json::to_writer(&mut answers, &answer(fleet)).map_err(io::Error::from)?;
        answers.write_all(b"\n")?;
        answers.flush()?;
    }
    Ok(())
}

fn check(request: &Request, fleet: &Fleet, line: usize) -> Result<(), ControlError> {
    let units = fleet.members.len();
    if request.feed.len() > units {
        return Err(ControlError::NoSuchUnit { line, given: request.feed.len(), units });
    }
    match request.fault.and_then(|injection| injection.problem(units)) {
        Some((field, problem)) => Err(ControlError::Injection { line, field, problem }),
        None => Ok(()),
    }
}

fn answer(fleet: &mut Fleet) -> Answer {
    let truth = fleet.members.iter().map(|member| member.unit.truth()).collect();
    let sent = fleet.members.iter_mut().map(|member| Bytes(std::mem::take(&mut member.outbox))).collect();
    let measured = fleet.members.iter().filter_map(|member| member.unit.measured()).collect();
    Answer { now_s: to_seconds(fleet.now), sent, truth, measured }
}
