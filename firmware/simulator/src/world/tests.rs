//! Tests of what a unit's sensor and switches make of the world around them.

use super::*;
use crate::room::Room;
use crate::time::{TICKS_PER_MS, TICKS_PER_SECOND};
use rand::SeedableRng;

const FORWARD: &str = "lobe = [{ range_m = 0.0, half_angle_deg = 180.0 }]\n";
const WALL: &str = "[[wall]]\nfrom_m = [2.5, -3.0]\nto_m = [2.5, 3.0]\n";
const UNIT: &str = "[unit]\nposition_m = [0.0, 0.0]\n";
const SPEED_OF_SOUND_M_S: f64 = 331.3 + 0.606 * 20.0;

fn scene(sensor: &str, objects: &str) -> Rc<Scene> {
    let text = format!("name = 'x'\n[sensor]\n{FORWARD}{sensor}{objects}");
    Rc::new(Scene::new(Room::parse("x", &text).unwrap()))
}

fn world(sensor: &str, objects: &str) -> World {
    in_scene(&scene(sensor, &format!("{objects}{UNIT}")), 0, None)
}

/// A unit whose oscillator is exact, if the room does not say otherwise.
fn in_scene(scene: &Rc<Scene>, index: usize, air: Option<&Rc<Air>>) -> World {
    let oscillator = scene.room().oscillator(index).unwrap_or(Oscillator::off_by(0.0));
    World::new(Rc::clone(scene), index, oscillator, air.cloned(), 1, 1)
}

/// Sends a ping and gives the range that the pulse means.
fn range_of_ping(world: &mut World, at: Tick) -> f64 {
    world.ping(at);
    range_of_pulse(world)
}

fn range_of_pulse(world: &mut World) -> f64 {
    let mut edges = Vec::new();
    while world.next_event() != NEVER {
        edges.extend(world.service(world.next_event()));
    }
    let [rise, fall] = edges[..] else { panic!("{edges:?}") };
    to_seconds(fall.at - rise.at) * SPEED_OF_SOUND_M_S / 2.0
}

fn assert_close(actual: f64, expected: f64) {
    assert!((actual - expected).abs() < 1e-4, "{actual} instead of {expected}");
}

#[test]
fn a_ping_after_the_room_has_gone_quiet_hears_its_own_echo() {
    let mut world = world("", WALL);
    for count in 0..3 {
        assert_close(range_of_ping(&mut world, count * 29 * TICKS_PER_MS), 2.5);
    }
}

#[test]
fn a_face_off_the_axis_measures_from_where_it_stands() {
    let mut world = world("face_offset_m = 0.05\n", WALL);
    let range_m = range_of_ping(&mut world, 0);
    assert_close(range_m, 2.5 - 0.05 * world.axis_rad().cos());
    assert!((range_m - 2.5).abs() > 0.01);
}

#[test]
fn a_ping_that_follows_too_soon_may_take_the_last_ones_sound_for_its_echo() {
    // The second bounce of the first ping comes 5 m * 2 / c = 29.1 ms after it.
    let interval_s = 0.025;
    let mut readings: Vec<f64> = (0..100)
        .map(|second| {
            let mut world = world("reverberation_ms = 40.0\n", WALL);
            world.rng = ChaCha8Rng::seed_from_u64(second);
            range_of_ping(&mut world, 0);
            range_of_ping(&mut world, from_seconds(interval_s))
        })
        .collect();
    readings.sort_by(f64::total_cmp);
    assert_close(readings[0], 5.0 - interval_s * SPEED_OF_SOUND_M_S / 2.0);
    assert_close(readings[99], 2.5);
    let early = readings.iter().filter(|range_m| **range_m < 2.0).count();
    assert!((30..70).contains(&early), "{early}");
}

#[test]
fn a_unit_hears_the_burst_of_another_that_faces_it_before_its_own_echo() {
    let units = "[[unit]]\nposition_m = [0.0, 0.0]\n[[unit]]\nposition_m = [1.0, 0.0]\n";
    let scene = scene("", &format!("{WALL}{units}"));
    let air = Rc::new(Air::new(Rc::clone(&scene), vec![scene.room().standing(0), scene.room().standing(1)]));
    let unit = |index| in_scene(&scene, index, Some(&air));
    let (mut first, mut second) = (unit(0), unit(1));
    second.ping(TICKS_PER_MS);
    first.ping(0);
    // The second's burst leaves 1 ms after the first's and goes 1 m.
    assert_close(range_of_pulse(&mut first), (1.0 + 1e-3 * SPEED_OF_SOUND_M_S) / 2.0);
    assert_eq!(first.truth(0).echoes_of_others, 1);
    // And the first's arrives as much sooner at the second, which listens 1 ms later.
    assert_close(range_of_pulse(&mut second), (1.0 - 1e-3 * SPEED_OF_SOUND_M_S) / 2.0);
}

#[test]
fn a_fast_oscillator_counts_more_for_the_same_echo_and_is_heard_by_others_at_the_same_time() {
    let units =
        "[[unit]]\nposition_m = [0.0, 0.0]\noscillator_error = 0.015\n[[unit]]\nposition_m = [1.0, 0.0]\n";
    let scene = scene("", &format!("{WALL}{units}"));
    let air = Rc::new(Air::new(Rc::clone(&scene), vec![scene.room().standing(0), scene.room().standing(1)]));
    let unit = |index| in_scene(&scene, index, Some(&air));
    let (mut fast, mut right) = (unit(0), unit(1));
    assert_close(range_of_ping(&mut fast, 0), 2.5 * 1.015);
    // A second later by the true time, and 1 ms after the other's burst.
    let second = TICKS_PER_SECOND + TICKS_PER_SECOND * 15 / 1000;
    fast.ping(second);
    right.ping(TICKS_PER_SECOND - TICKS_PER_MS);
    let lag_s = 0.45e-3 * 0.015; // the sensor's lag is counted by the unit, too
    assert_close(range_of_pulse(&mut right), (1.0 + (1e-3 - lag_s) * SPEED_OF_SOUND_M_S) / 2.0);
    assert_close(range_of_pulse(&mut fast), (1.0 - (1e-3 - lag_s) * SPEED_OF_SOUND_M_S) / 2.0 * 1.015);
}

#[test]
fn warm_air_brings_the_echo_sooner() {
    let schedule = "air_temperature_schedule = [{ at_s = 0.0, temperature_c = 0.0 }, { at_s = 60.0, temperature_c = 30.0 }]";
    let text = format!("name = 'x'\n{schedule}\n[sensor]\n{FORWARD}{WALL}{UNIT}");
    let mut world = in_scene(&Rc::new(Scene::new(Room::parse("x", &text).unwrap())), 0, None);
    let speeds_m_s = [331.3, 331.3 + 0.606 * 30.0];
    for (at_s, speed_m_s) in [0.0, 60.0].into_iter().zip(speeds_m_s) {
        let range_m = range_of_ping(&mut world, from_seconds(at_s));
        assert_close(range_m, 2.5 * SPEED_OF_SOUND_M_S / speed_m_s);
    }
    assert_eq!(world.truth(from_seconds(30.0)).air_temperature_c, 15.0);
}

#[test]
fn a_held_button_and_a_stuck_home_switch_are_on_their_pins_until_their_time_is_over() {
    let mut world = world("", WALL);
    let at_rest = world.pulls().low[1] & PORT_1_HOME;
    world.apply(&Fault::ButtonHeld {}, TICKS_PER_SECOND, 0);
    world.apply(&Fault::HomeStuckClosed {}, 2 * TICKS_PER_SECOND, 0);
    assert_eq!(world.pulls().low[1] & (PORT_1_BUTTON | PORT_1_HOME), PORT_1_BUTTON | PORT_1_HOME);
    assert_eq!(world.next_event(), TICKS_PER_SECOND);
    world.service(TICKS_PER_SECOND);
    assert_eq!(world.pulls().low[1] & (PORT_1_BUTTON | PORT_1_HOME), PORT_1_HOME);
    world.service(2 * TICKS_PER_SECOND);
    assert_eq!(world.pulls().low[1] & PORT_1_HOME, at_rest);
    assert_eq!(world.next_event(), NEVER);
}

#[test]
fn a_home_switch_that_is_stuck_open_never_closes() {
    let mut world = world("", WALL);
    world.motor.turn_by_hand(-6.0);
    assert!(world.truth(0).home_switch_closed);
    world.apply(&Fault::HomeStuckOpen {}, NEVER, 0);
    assert!(!world.truth(0).home_switch_closed);
    world.apply(&Fault::Mended {}, NEVER, 0);
    assert!(world.truth(0).home_switch_closed);
}

#[test]
fn a_deaf_sensor_waits_38_ms_and_hears_again_when_it_is_mended() {
    let mut world = world("", WALL);
    world.apply(&Fault::SensorDeaf {}, NEVER, 0);
    assert_close(range_of_ping(&mut world, 0), 0.038 * SPEED_OF_SOUND_M_S / 2.0);
    world.apply(&Fault::Mended {}, NEVER, TICKS_PER_SECOND);
    assert_close(range_of_ping(&mut world, TICKS_PER_SECOND), 2.5);
}
