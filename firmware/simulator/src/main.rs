//! noctule-sim: scanner units in a simulated room, running the firmware that is flashed into real ones.

mod cable;
mod chip;
mod cli;
mod cpu;
mod faults;
mod fleet;
mod image;
mod random;
mod room;
mod site_file;
mod svg;
mod time;
mod unit;
mod world;

use cable::Cable;
use clap::{CommandFactory, Parser};
use cli::{Arguments, Speed};
use faults::{FaultError, FaultSchedule};
use fleet::control::ControlError;
use fleet::flash_store::FlashStore;
use fleet::host::Host;
use fleet::line::Line;
use fleet::member::{Member, Peer};
use fleet::report::Progress;
use fleet::{Fleet, FleetError, Schedule};
use image::{ImageError, Record};
use rand::Rng;
use random::{Part, stream};
use room::acoustics::Scene;
use room::{Room, RoomError};
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use thiserror::Error;
use time::{Oscillator, from_seconds};
use unit::Unit;
use world::World;
use world::air::Air;

#[derive(Debug, Error)]
enum SimulatorError {
    #[error(transparent)]
    Room(#[from] RoomError),
    #[error("room {room} has places for {places} units, and --units wants {units}")]
    Crowded { room: String, places: usize, units: usize },
    #[error(transparent)]
    FaultSchedule(#[from] FaultError),
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error(transparent)]
    Fleet(#[from] FleetError),
    #[error(transparent)]
    Control(#[from] ControlError),
    #[error(
        "port {port} is taken, where unit {serial} would listen (--tcp {tcp}): end the program that listens there, \
             or give another port; with port 0 each unit takes a free one"
    )]
    PortTaken { tcp: String, serial: u32, port: u16 },
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
        say(&[chip::register_page::markdown().trim_end().to_owned()]);
        return Ok(());
    }
    if let Some(shell) = arguments.completion {
        let mut script = Vec::new(); // the generator panics where what it writes to is closed or full
        clap_complete::generate(shell, &mut Arguments::command(), "noctule-sim", &mut script);
        say(&[String::from_utf8_lossy(&script).trim_end().to_owned()]);
        return Ok(());
    }
    let room = Room::load(&arguments.room)?;
    if let Some(file) = &arguments.svg {
        return std::fs::write(file, svg::drawing(&room))
            .map_err(io_error(format!("--svg {}", file.display())));
    }
    if let Some(file) = &arguments.site {
        return write_site_file(arguments, &room, file);
    }
    let walks = room.walks(arguments.seed)?;
    let scene = Rc::new(Scene::with_people(room, walks));
    let records = image::read_hex(&arguments.firmware)?;
    let mut fleet = fleet(arguments, &scene, &records)?;
    if arguments.control {
        return Ok(fleet::control::run(&mut fleet, io::stdin().lock(), io::stdout().lock())?);
    }
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop))
            .map_err(io_error("signals can't be watched"))?;
    }
    let firmware = arguments.firmware.display().to_string();
    say(&fleet::report::beginning(&fleet, scene.room(), &firmware, &records, &arguments.pace()));

    let schedule = Schedule { speed: arguments.speed, end: arguments.duration.map(from_seconds) };
    let mut progress = Progress::begin();
    let outcome = fleet.run(&schedule, &stop, |fleet| progress.show(fleet));
    progress.end();
    outcome?;
    say(&fleet::report::end(&fleet, progress.elapsed()));
    Ok(())
}

fn write_site_file(arguments: &Arguments, room: &Room, file: &Path) -> Result<(), SimulatorError> {
    let address = |serial: u32| match &arguments.pty {
        Some(directory) => Ok(format!("{}/unit-{serial}", std::path::absolute(directory)?.display())),
        None => Ok(format!("socket://{}", arguments.address(serial)?)),
    };
    let numbers = 1..=units(arguments, room)? as u32;
    let write = || {
        let addresses: Vec<_> = numbers.map(address).collect::<io::Result<_>>()?;
        let text = site_file::site_file(room, &addresses, arguments.speed == Speed::Times(1.0));
        File::create_new(file)?.write_all(text.as_bytes())
    };
    write().map_err(io_error(format!("--site {}", file.display())))
}

fn units(arguments: &Arguments, room: &Room) -> Result<usize, SimulatorError> {
    let places = room.shared_by();
    let units = arguments.units.map_or(places.unwrap_or(1), |units| units as usize);
    match places {
        Some(places) if units > places => {
            Err(SimulatorError::Crowded { room: room.name.clone(), places, units })
        }
        _ => Ok(units),
    }
}

/// The units in their room or rooms, and the faults to inject.
fn fleet(arguments: &Arguments, scene: &Rc<Scene>, records: &[Record]) -> Result<Fleet, SimulatorError> {
    let room = scene.room();
    let units = units(arguments, room)?;
    let faults = match &arguments.faults {
        Some(file) => FaultSchedule::load(file, units)?,
        None => FaultSchedule::default(),
    };
    let air = match room.shared_by() {
        Some(_) => {
            let ears = (0..units).map(|index| room.standing(index)).collect();
            Some(Rc::new(Air::new(Rc::clone(scene), ears)))
        }
        None => None,
    };
    let members = (0..units)
        .map(|index| {
            let (laps, seed) = (arguments.laps, seed(arguments, index));
            let oscillator = oscillator(arguments, room, index);
            let world = World::new(Rc::clone(scene), index, oscillator, air.clone(), laps, seed);
            member(arguments, index, records, world)
        })
        .collect::<Result<Vec<_>, _>>()?;
    Ok(Fleet::new(members, faults, air.and_then(|air| air.lookahead())))
}

/// A unit's own seed, by its number from 0.
fn seed(arguments: &Arguments, index: usize) -> u64 {
    arguments.seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(index as u64 + 1)
}

fn oscillator(arguments: &Arguments, room: &Room, index: usize) -> Oscillator {
    let usual = if arguments.exact_clocks {
        Oscillator::off_by(0.0)
    } else {
        Oscillator::of_chip(seed(arguments, index))
    };
    room.oscillator(index).unwrap_or(usual)
}

/// A unit with its memory, its place in the world and its serial line.
fn member(
    arguments: &Arguments,
    index: usize,
    records: &[Record],
    world: World,
) -> Result<Member, SimulatorError> {
    let serial = index as u32 + 1;
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
    let seed = seed(arguments, index);
    let oscillator = world.oscillator();
    let mut unit = Unit::power_up(flash, world, seed, &mut *noise_of_xram(arguments, seed));
    if arguments.slowest_chip {
        unit.slow_down();
    }
    if arguments.measure {
        unit.measure(&arguments.routine);
    }
    Ok(Member {
        serial,
        unit,
        oscillator,
        cable: Cable::new(seed),
        peer: peer(arguments, serial)?,
        store,
        outbox: Vec::new(),
        frames: 0,
    })
}

/// What the memory of a chip holds at its first power-up no seed may repeat: a unit draws its life from it. A program that
/// controls the run is the exception, since it repeats all of it.
fn noise_of_xram(arguments: &Arguments, seed: u64) -> Box<dyn Rng> {
    if arguments.control { Box::new(stream(seed, Part::FirstMemories)) } else { Box::new(rand::rng()) }
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
            let what = || format!("--tcp {} for unit {serial}", arguments.tcp);
            let address = arguments.address(serial).map_err(io_error(what()))?;
            Line::tcp(address).map_err(|error| match error.kind() {
                io::ErrorKind::AddrInUse => {
                    SimulatorError::PortTaken { tcp: arguments.tcp.clone(), serial, port: address.port() }
                }
                _ => io_error(what())(error),
            })?
        }
    };
    Ok(Peer::Line(line))
}

/// Tells the operator; a closed standard output is no reason to stop.
fn say(lines: &[String]) {
    for line in lines {
        let _ = writeln!(io::stdout(), "{line}");
    }
}

fn io_error(what: impl Into<String>) -> impl FnOnce(io::Error) -> SimulatorError {
    let what = what.into();
    move |source| SimulatorError::Io { what, source }
}
