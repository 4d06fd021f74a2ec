//! The command line.

use crate::unit::measurement::Routine;
use clap::Parser;
use clap_complete::Shell;
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;
use std::str::FromStr;

/// Runs scanner units' firmware, byte for byte as it is flashed, on simulated boards in a simulated room.
#[derive(Debug, Parser)]
#[command(name = "noctule-sim", version)]
pub struct Arguments {
    /// The firmware, an Intel hex file
    #[arg(long, value_name = "FILE.ihx", default_value = "firmware/build/noctule.ihx")]
    pub firmware: PathBuf,

    /// The room: paper, l-shaped, lounge, or a TOML file
    #[arg(long, value_name = "ROOM", default_value = "paper")]
    pub room: String,

    /// How many units, with serial numbers from 1: one, or as many as the room has places for
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub units: Option<u32>,

    /// What goes wrong and when, a TOML file
    #[arg(long, value_name = "FILE.toml")]
    pub faults: Option<PathBuf>,

    /// Draw the room and do nothing else
    #[arg(long, value_name = "FILE.svg")]
    pub svg: Option<PathBuf>,

    /// Write a site file with the units, for their gateway, and do nothing else; a file that is there stays
    #[arg(long, value_name = "SITE.toml")]
    pub site: Option<PathBuf>,

    /// Simulated seconds per second, or max
    #[arg(long, value_name = "N|max", default_value = "1")]
    pub speed: Speed,

    /// Where unit 1 listens; each further unit on the next port
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:7001", conflicts_with = "pty", value_parser = host_and_port)]
    pub tcp: String,

    /// Give pseudo-terminals in place of TCP ports, linked as DIR/unit-1 and so on
    #[arg(long, value_name = "DIR")]
    pub pty: Option<PathBuf>,

    /// Measure: a host inside the simulator has the units sweep without end and acknowledges each sweep
    #[arg(long, conflicts_with_all = ["tcp", "pty"])]
    pub acknowledge: bool,

    /// Run in step with the program at standard input and output: one request a line, as JSON, and its answer
    #[arg(long, conflicts_with_all = ["tcp", "pty", "acknowledge", "duration", "speed"])]
    pub control: bool,

    /// Where randomness comes from: noise, power-up states; without --control, what XRAM holds at the first power-up does
    /// not, so that no two runs share a life
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,

    /// How often each unit is carried along the room's path
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub laps: usize,

    /// Simulated seconds until the end; without it, until SIGINT or SIGTERM
    #[arg(long, value_name = "SECONDS", value_parser = duration_s)]
    pub duration: Option<f64>,

    /// Tell at the end how deep each unit's stack went, how long its interrupts waited, how much it slept
    #[arg(long)]
    pub measure: bool,

    /// Time a part of the program for --measure: from BEGIN to its return, or to END; addresses in hex; any number
    #[arg(long, value_name = "NAME=BEGIN[-END]", requires = "measure")]
    pub routine: Vec<Routine>,

    /// Each unit's oscillator exact, where the room does not say otherwise, for a host that does not keep simulated time;
    /// else it is off by up to 1.5 %
    #[arg(long)]
    pub exact_clocks: bool,

    /// A slow chip: each jump waits for the prefetch engine, and flash takes the longest that the datasheet allows
    #[arg(long)]
    pub slowest_chip: bool,

    /// Print the chip's modelled registers as Markdown, and end
    #[arg(long)]
    pub registers: bool,

    /// Print what completes this command line in a shell, and end
    #[arg(long, value_name = "SHELL")]
    pub completion: Option<Shell>,

    /// Keep the units' flash memories here from run to run
    #[arg(long, value_name = "DIR")]
    pub state: Option<PathBuf>,
}

impl Arguments {
    /// How the run goes on, in words.
    pub fn pace(&self) -> String {
        let speed = match self.speed {
            Speed::Max => "as fast as it can".to_owned(),
            Speed::Times(times) => format!("{times} simulated seconds a second"),
        };
        let end = self.duration.map_or_else(String::new, |seconds| format!(" for {seconds} s"));
        format!("seed {}, {speed}{end}", self.seed)
    }

    /// The address that the unit of this number, from 1, listens on.
    ///
    /// # Errors
    /// If the host has no address, the text is not HOST:PORT, or no port is that high.
    pub fn address(&self, serial: u32) -> std::io::Result<SocketAddr> {
        let none = || std::io::Error::new(std::io::ErrorKind::NotFound, "no such host");
        let mut address = self.tcp.to_socket_addrs()?.next().ok_or_else(none)?;
        // With port 0 the operating system chooses a port for each unit.
        let port = if address.port() == 0 { 0 } else { u32::from(address.port()) + serial - 1 };
        let too_high =
            |_| std::io::Error::new(std::io::ErrorKind::InvalidInput, "no port is higher than 65535");
        address.set_port(u16::try_from(port).map_err(too_high)?);
        Ok(address)
    }
}

/// Simulated seconds per second that a clock can pace.
const SLOWEST: f64 = 1e-3;
const FASTEST: f64 = 1e6;

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Speed {
    /// Simulated seconds per second.
    Times(f64),
    Max,
}

impl FromStr for Speed {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text.parse::<f64>() {
            _ if text == "max" => Ok(Self::Max),
            Ok(times) if (SLOWEST..=FASTEST).contains(&times) => Ok(Self::Times(times)),
            _ => Err("neither max nor a number from 0.001 to 1000000"),
        }
    }
}

fn host_and_port(text: &str) -> Result<String, &'static str> {
    match text.rsplit_once(':') {
        Some((host, port)) if !host.is_empty() && port.parse::<u16>().is_ok() => Ok(text.to_owned()),
        _ => Err("give HOST:PORT, as 127.0.0.1:7001"),
    }
}

fn duration_s(text: &str) -> Result<f64, &'static str> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds.is_finite() => Ok(seconds),
        _ => Err("not a positive number"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pace_or_a_duration_that_no_clock_can_keep_is_refused() {
        for text in ["0", "-1", "nan", "inf", "1e-30", "1e300", "fast"] {
            assert!(text.parse::<Speed>().is_err(), "{text}");
        }
        assert_eq!("0.5".parse(), Ok(Speed::Times(0.5)));
        assert_eq!("max".parse(), Ok(Speed::Max));
        for text in ["0", "-1", "nan", "inf", "long"] {
            assert!(duration_s(text).is_err(), "{text}");
        }
        assert_eq!(duration_s("0.1"), Ok(0.1));
    }
}
