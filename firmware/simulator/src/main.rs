//! noctule-sim: scanner units in a simulated room, running the firmware that is flashed into real ones.

mod chip;
mod cli;
mod control;
mod cpu;
mod cycles;
mod echo;
#[cfg(test)]
mod echo_tests;
mod fault;
mod flash_store;
mod fleet;
mod frame;
mod geometry;
mod host;
mod image;
mod line;
mod opcode;
mod path;
mod readiness;
mod room;
mod sensor;
mod time;
mod unit;
mod world;

use clap::Parser;
use cli::Arguments;
use control::ControlError;
use echo::Scene;
use flash_store::FlashStore;
use fleet::{FleetError, Member, Peer, Schedule};
use host::Host;
use image::{ImageError, Record};
use line::Line;
use room::{Room, RoomError};
use std::io::{self, Write};
use std::process::ExitCode;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;
use thiserror::Error;
use time::{from_seconds, to_seconds};
use unit::Unit;
use world::World;

#[derive(Debug, Error)]
enum SimulatorError {
    #[error(transparent)]
    Room(#[from] RoomError),
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error(transparent)]
    Fleet(#[from] FleetError),
    #[error(transparent)]
    Control(#[from] ControlError),
    #[error("{what}: {source}")]
    Io { what: String, source: io::Error },
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("noctule-sim: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), SimulatorError> {
    if arguments.registers {
        say(chip::register_page::markdown().trim_end());
        return Ok(());
    }
    let records = image::read_hex(&arguments.firmware)?;
    let scene = Rc::new(Scene::new(Room::load(&arguments.room)?));
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop))
            .map_err(io_error("signals can't be watched"))?;
    }
    let mut fleet = (1..=arguments.units)
        .map(|serial| member(arguments, serial, &records, &scene))
        .collect::<Result<Vec<_>, _>>()?;
    if arguments.control {
        return Ok(control::run(&mut fleet, io::stdin().lock(), io::stdout().lock())?);
    }
    announce(arguments, &scene, &fleet);

    let began = Instant::now();
    let schedule = Schedule { speed: arguments.speed, end: arguments.duration.map(from_seconds) };
    let simulated = fleet::run(&mut fleet, &schedule, &stop)?;
    summarise(&fleet, to_seconds(simulated), began.elapsed().as_secs_f64());
    Ok(())
}

/// A unit with its memory, its place in the world and its serial line.
fn member(
    arguments: &Arguments,
    serial: u32,
    records: &[Record],
    scene: &Rc<Scene>,
) -> Result<Member, SimulatorError> {
    let store = match &arguments.state {
        Some(directory) => Some(
            FlashStore::open(directory, serial)
                .map_err(io_error(format!("--state {}", directory.display())))?,
        ),
        None => None,
    };
    let kept = match &store {
        Some(store) => store.load().map_err(io_error(format!("the kept flash of unit {serial}")))?,
        None => None,
    };
    let mut flash = kept.unwrap_or_else(|| {
        let mut flash = image::erased();
        image::flash_settings(&mut flash, serial);
        flash
    });
    image::flash_firmware(&mut flash, records);
    let seed = arguments.seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(u64::from(serial));
    let world = World::new(Rc::clone(scene), arguments.laps, seed);
    let mut unit = Unit::power_up(flash, world, seed);
    if arguments.measure {
        unit.measure();
    }
    Ok(Member { serial, unit, peer: peer(arguments, serial)?, store })
}

fn peer(arguments: &Arguments, serial: u32) -> Result<Peer, SimulatorError> {
    if arguments.control {
        return Ok(Peer::Control);
    }
    if arguments.acknowledge {
        return Ok(Peer::Host(Host::default()));
    }
    let line = match &arguments.pty {
        Some(directory) => std::fs::create_dir_all(directory)
            .and_then(|()| Line::pty(&directory.join(format!("unit-{serial}"))))
            .map_err(io_error(format!("--pty {}", directory.display())))?,
        None => {
            let what = format!("--tcp {} for unit {serial}", arguments.tcp);
            let mut address = arguments.first_address().map_err(io_error(what.clone()))?;
            // Port 0 leaves the choice to the operating system, for each unit anew.
            let port = if address.port() == 0 { 0 } else { u32::from(address.port()) + serial - 1 };
            let too_high = |_| io::Error::new(io::ErrorKind::InvalidInput, "no port is higher than 65535");
            address.set_port(u16::try_from(port).map_err(too_high).map_err(io_error(what.clone()))?);
            Line::tcp(address).map_err(io_error(what))?
        }
    };
    Ok(Peer::Line(line))
}

fn announce(arguments: &Arguments, scene: &Scene, fleet: &[Member]) {
    let waypoints = scene.room().waypoints().len();
    let carried = if waypoints == 0 {
        "standing still".to_owned()
    } else {
        format!("carried to {waypoints} waypoints")
    };
    for member in fleet {
        let address = match &member.peer {
            Peer::Line(line) => line.address(),
            Peer::Host(_) => "acknowledged by the simulator".to_owned(),
            Peer::Control => "run step by step".to_owned(),
        };
        let firmware = arguments.firmware.display();
        say(&format!(
            "unit {}: {address}, {firmware} in room {}, {carried}",
            member.serial,
            scene.room().name
        ));
    }
}

fn summarise(fleet: &[Member], simulated_s: f64, real_s: f64) {
    for member in fleet {
        let unit = &member.unit;
        let swept = match &member.peer {
            Peer::Line(_) if unit.path_is_done() => ", path done".to_owned(),
            Peer::Line(_) | Peer::Control => String::new(),
            Peer::Host(host) => format!(
                ", {} sweeps acknowledged, {} resent, {} missed, {} bad frames",
                host.sweeps, host.resent, host.missed, host.bad_frames
            ),
        };
        let mips = unit.instructions() as f64 / simulated_s / 1e6;
        say(&format!(
            "unit {}: {mips:.3} million instructions/s, {} resets{swept}",
            member.serial,
            unit.resets()
        ));
        if let Some(measured) = unit.measured() {
            say(&format!("unit {}: {measured}", member.serial));
        }
    }
    let ratio = simulated_s / real_s;
    let all = ratio * fleet.len() as f64;
    say(&format!(
        "{simulated_s:.1} s simulated in {real_s:.2} s: {ratio:.1} times real time, {all:.0} in all units"
    ));
}

/// Tells the operator; a closed standard output is no reason to stop.
fn say(text: &str) {
    let _ = writeln!(io::stdout(), "{text}");
}

fn io_error(what: impl Into<String>) -> impl FnOnce(io::Error) -> SimulatorError {
    let what = what.into();
    move |source| SimulatorError::Io { what, source }
}
