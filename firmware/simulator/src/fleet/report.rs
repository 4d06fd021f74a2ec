//! What the operator is told: what runs, how it gets on, what has become of it.

use crate::fleet::Fleet;
use crate::fleet::member::{Member, Peer};
use crate::image::{self, Record};
use crate::room::Room;
use crate::time::to_seconds;
use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

/// How often the line on a terminal is renewed.
const RENEWAL: Duration = Duration::from_millis(500);

/// The lines that say what runs: first one for each unit with its address, then what they have in common.
pub fn beginning(fleet: &Fleet, room: &Room, firmware: &str, records: &[Record], run: &str) -> Vec<String> {
    let waypoints = room.waypoints().len();
    let carried = match (room.shared_by(), waypoints) {
        (Some(_), _) => "sharing the room".to_owned(),
        (None, 0) => "standing still".to_owned(),
        (None, _) => format!("carried to {waypoints} waypoints"),
    };
    let unit = |member: &Member| {
        let address = match &member.peer {
            Peer::Line(line) => line.address(),
            Peer::Host(_) => "acknowledged by the simulator".to_owned(),
            Peer::Control => "run step by step".to_owned(),
        };
        let fast_percent = 100.0 * member.oscillator.error();
        let clock = if fast_percent == 0.0 { String::new() } else { format!(", clock {fast_percent:+.2} %") };
        format!("unit {}: {address}, {firmware} in room {}, {carried}{clock}", member.serial, room.name)
    };
    let mut lines: Vec<String> = fleet.members.iter().map(unit).collect();
    let (bytes, crc) = image::sum(records);
    lines.push(format!("firmware {firmware}: {bytes} bytes, CRC-32 {crc:08X}"));
    let people = match room.people.len() {
        0 => String::new(),
        1 => " 1 person,".to_owned(),
        several => format!(" {several} people,"),
    };
    lines.push(format!(
        "room {}: {}, {},{people} air at {:.1} degrees C",
        room.name,
        counted(room.walls.len(), "wall"),
        counted(room.cylinders.len(), "cylinder"),
        room.air_temperature_c(0.0)
    ));
    lines.push(format!("{run}, {}", counted(fleet.faults_to_come(), "fault")));
    lines
}

/// The lines that say what has become of each unit and how fast it all was.
pub fn end(fleet: &Fleet, real: Duration) -> Vec<String> {
    let simulated_s = to_seconds(fleet.now);
    let unit = |member: &Member| {
        let swept = match &member.peer {
            Peer::Line(_) if member.unit.path_is_done() => ", path done".to_owned(),
            Peer::Line(_) | Peer::Control => String::new(),
            Peer::Host(host) => format!(
                ", {} sweeps acknowledged, {} resent, {} missed, {} bad frames",
                host.sweeps, host.resent, host.missed, host.bad_frames
            ),
        };
        let mips = member.unit.instructions() as f64 / simulated_s / 1e6;
        let resets = member.unit.resets();
        let serial = member.serial;
        let whole = format!("unit {serial}: {mips:.5} million instructions/s, {resets} resets{swept}");
        let measured = member.unit.measured().map(|measured| format!("unit {serial}: {measured}"));
        [Some(whole), measured].into_iter().flatten()
    };
    let mut lines: Vec<String> = fleet.members.iter().flat_map(unit).collect();
    let real_s = real.as_secs_f64();
    let ratio = simulated_s / real_s;
    let all = ratio * fleet.members.len() as f64;
    lines.push(format!(
        "{simulated_s:.1} s simulated in {real_s:.2} s: {ratio:.1} times real time, {all:.0} in all units"
    ));
    lines
}

/// A line on a terminal that says how far it has got; nothing where there is no terminal.
pub struct Progress {
    began: Instant,
    renewed: Instant,
    on_terminal: bool,
}

impl Progress {
    pub fn begin() -> Self {
        let now = Instant::now();
        Self { began: now, renewed: now, on_terminal: io::stderr().is_terminal() }
    }

    pub fn elapsed(&self) -> Duration {
        self.began.elapsed()
    }

    /// Renews the line if it is time to.
    pub fn show(&mut self, fleet: &Fleet) {
        if !self.on_terminal || self.renewed.elapsed() < RENEWAL {
            return;
        }
        self.renewed = Instant::now();
        let simulated_s = to_seconds(fleet.now);
        let ratio = simulated_s / self.elapsed().as_secs_f64();
        self.write(&format!(
            "{simulated_s:.1} s simulated, {ratio:.1} times real time, {} frames",
            fleet.frames()
        ));
    }

    /// Wipes the line away.
    pub fn end(&self) {
        if self.on_terminal {
            self.write("");
        }
    }

    /// Replaces the line: to its beginning, and what is there erased.
    fn write(&self, text: &str) {
        // A closed terminal is no reason to stop.
        let _ = write!(io::stderr(), "\r\x1b[K{text}");
    }
}

/// A number with its noun.
pub fn counted(count: usize, what: &str) -> String {
    match count {
        0 => format!("no {what}s"),
        1 => format!("1 {what}"),
        _ => format!("{count} {what}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_in_words() {
        assert_eq!([0, 1, 2].map(|count| counted(count, "wall")), ["no walls", "1 wall", "2 walls"]);
    }
}
