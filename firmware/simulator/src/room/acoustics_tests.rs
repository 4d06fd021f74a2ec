//! Tests of the echoes against what is known of the HC-SR04 and of mirrors.

use crate::room::Room;
use crate::room::acoustics::{Echo, Look, Scene};
use crate::room::geometry::Point;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

const BEAM: &str = "[sensor]\nlobe = [{ range_m = 0.0, half_angle_deg = 11.25 }]\n";

fn scene(objects: &str) -> Scene {
    let text = format!("name = 'x'\n{BEAM}{objects}\n[unit]\nposition_m = [0.0, 0.0]\n");
    Scene::new(Room::parse("x", &text).unwrap())
}

/// A look from the origin.
fn look(axis_deg: f64) -> Look {
    Look { from: Point::default(), axis_rad: axis_deg.to_radians(), at_s: 0.0 }
}

fn wall(from: [f64; 2], to: [f64; 2]) -> String {
    format!("[[wall]]\nfrom_m = {from:?}\nto_m = {to:?}\n")
}

fn ranges(scene: &Scene, axis_deg: f64) -> Vec<f64> {
    scene.echoes(&look(axis_deg)).iter().map(|echo| echo.range_m).collect()
}

fn nearest(scene: &Scene, axis_deg: f64) -> Option<Echo> {
    scene.echoes(&look(axis_deg)).first().copied()
}

fn assert_close(actual: f64, expected: f64) {
    assert!((actual - expected).abs() < 1e-9, "{actual} instead of {expected}");
}

#[test]
fn a_wall_answers_from_its_perpendicular_while_that_is_in_the_beam() {
    let scene = scene(&wall([2.0, -2.0], [2.0, 2.0]));
    for axis_deg in [0.0, 11.0, -11.0] {
        assert_close(nearest(&scene, axis_deg).unwrap().range_m, 2.0);
    }
    assert_eq!(nearest(&scene, 12.0), None);
}

#[test]
fn a_wall_whose_perpendicular_misses_it_does_not_answer() {
    assert!(ranges(&scene(&wall([2.0, 1.0], [2.0, 3.0])), 0.0).is_empty());
}

#[test]
fn a_wall_further_than_4_m_does_not_answer() {
    assert_eq!(nearest(&scene(&wall([4.1, -2.0], [4.1, 2.0])), 0.0), None);
}

#[test]
fn a_right_angled_corner_answers_at_its_distance() {
    let scene = scene(&(wall([-3.0, 1.5], [1.5, 1.5]) + &wall([1.5, 1.5], [1.5, -3.0])));
    let echo = nearest(&scene, 45.0).unwrap();
    assert_close(echo.range_m, 1.5 * 2f64.sqrt());
    assert_close(echo.chance, 1.0);
}

#[test]
fn a_sharp_corner_answers_at_its_distance_times_the_sine_of_its_angle() {
    let angle = 84f64.to_radians();
    let tip = [2.0, 0.0];
    let arm = |side: f64| [2.0 - 1.5 * (angle / 2.0).cos(), side * 1.5 * (angle / 2.0).sin()];
    let scene = scene(&(wall(arm(1.0), tip) + &wall(tip, arm(-1.0))));
    assert_close(nearest(&scene, 0.0).unwrap().range_m, 2.0 * angle.sin());
    assert_eq!(nearest(&scene, 11.25 - 5.0), None);
}

#[test]
fn an_obtuse_corner_answers_ever_more_rarely() {
    let chance = |angle_deg: f64| {
        let half = (angle_deg / 2.0).to_radians();
        let arm = |side: f64| [2.0 - 0.9 * half.cos(), side * 0.9 * half.sin()];
        let scene = scene(&(wall(arm(1.0), [2.0, 0.0]) + &wall([2.0, 0.0], arm(-1.0))));
        let echo = scene.echoes(&look(0.0)).into_iter().find(|echo| echo.range_m == 2.0);
        echo.unwrap().chance
    };
    assert!(chance(92.0) > 0.7);
    assert!(chance(111.0) < 0.2);
    assert!(chance(160.0) < 0.01);
}

#[test]
fn a_reflex_edge_answers_weakly_and_only_close_by() {
    let edge = |x: f64| scene(&(wall([x, 0.0], [x + 1.0, 1.0]) + &wall([x, 0.0], [x + 1.0, -1.0])));
    assert!(nearest(&edge(0.3), 0.0).unwrap().chance < 0.5);
    assert_eq!(nearest(&edge(1.0), 0.0), None);
}

#[test]
fn a_cylinder_of_9_cm_answers_from_its_nearest_point_out_to_2_m() {
    let cylinder = |x: f64| scene(&format!("[[cylinder]]\ncenter_m = [{x:?}, 0.0]\nradius_m = 0.09\n"));
    assert_close(nearest(&cylinder(1.5), 0.0).unwrap().range_m, 1.41);
    assert!(nearest(&cylinder(2.05), 0.0).is_some());
    assert_eq!(nearest(&cylinder(2.15), 0.0), None);
}

#[test]
fn what_stands_in_front_hides_what_is_behind_even_if_it_does_not_answer_itself() {
    let behind = wall([3.0, -2.0], [3.0, 2.0]);
    let slanted = wall([1.0, -0.5], [1.6, 0.5]);
    assert_eq!(ranges(&scene(&behind), 0.0), [3.0]);
    assert!(ranges(&scene(&(behind.clone() + &slanted)), 0.0).is_empty());
    let pipe = "[[cylinder]]\ncenter_m = [2.2, 0.0]\nradius_m = 0.01\n";
    assert!(ranges(&scene(&(behind + pipe)), 0.0).is_empty());
}

#[test]
fn about_a_third_of_the_papers_readings_get_an_echo() {
    let scene = Scene::new(Room::load("paper").unwrap());
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut heard = 0;
    let poses = scene.room().waypoints();
    for pose in &poses {
        for reading in 0..13 {
            let axis_rad = pose.heading_rad + (-135.0 + 22.5 * f64::from(reading)) / 180.0 * PI;
            heard += i32::from(
                scene.ping(&Look { from: pose.position_m, axis_rad, at_s: 0.0 }, &mut rng).is_some(),
            );
        }
    }
    let share = f64::from(heard) / (13.0 * poses.len() as f64);
    assert!((0.28..0.42).contains(&share), "{share}");
}

#[test]
fn the_rooms_noise_is_what_is_measured() {
    let mut room = Room::parse("x", &format!("name = 'x'\n{BEAM}range_bias_m = 0.0023\nrange_sigma_m = 0.0032\n{}\n[unit]\nposition_m = [0.0, 0.0]\n", wall([2.0, -1.0], [2.0, 1.0]))).unwrap();
    room.sensor.lost_echo_probability = 0.1;
    let scene = Scene::new(room);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let readings: Vec<f64> = (0..20_000).filter_map(|_| scene.ping(&look(0.0), &mut rng)).collect();
    let count = readings.len() as f64;
    let mean = readings.iter().sum::<f64>() / count;
    let sigma = (readings.iter().map(|range_m| (range_m - mean).powi(2)).sum::<f64>() / count).sqrt();
    assert!((count / 20_000.0 - 0.9).abs() < 0.01, "{count}");
    assert!((mean - 2.0023).abs() < 1e-4, "{mean}");
    assert!((sigma - 0.0032).abs() < 1e-4, "{sigma}");
}

#[test]
fn late_echoes_are_whole_cycles_late() {
    let mut room = Room::parse(
        "x",
        &format!("name = 'x'\n{BEAM}{}\n[unit]\nposition_m = [0.0, 0.0]\n", wall([2.0, -1.0], [2.0, 1.0])),
    )
    .unwrap();
    room.sensor.late_echo_probability = 1.0;
    let scene = Scene::new(room);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    for _ in 0..20 {
        let cycles = (scene.ping(&look(0.0), &mut rng).unwrap() - 2.0) / 0.0043;
        assert!((cycles - 1.0).abs() < 1e-6 || (cycles - 2.0).abs() < 1e-6, "{cycles}");
    }
}

#[test]
fn a_curtain_answers_less_far_and_less_often_than_a_wall() {
    let curtain = |x: f64| scene(&(wall([x, -2.0], [x, 2.0]) + "absorption = 0.75\n"));
    // A quarter of the energy is half the amplitude, and a mirror's echo falls in amplitude as its range grows.
    let near = nearest(&curtain(1.9), 0.0).unwrap();
    assert_close(near.chance, 0.25);
    assert_eq!(nearest(&curtain(2.1), 0.0), None);
}

#[test]
fn a_curtain_hides_what_is_behind_it() {
    let behind = wall([3.0, -2.0], [3.0, 2.0]);
    assert_eq!(
        ranges(&scene(&(wall([2.5, -2.0], [2.5, 2.0]) + "absorption = 0.9\n" + &behind)), 0.0),
        [0.0; 0]
    );
}

#[test]
fn a_corner_with_one_soft_wall_answers_as_often_as_that_wall() {
    let soft = wall([-3.0, 1.5], [1.5, 1.5]) + "absorption = 0.25\n";
    let scene = scene(&(soft + &wall([1.5, 1.5], [1.5, -3.0])));
    assert_close(nearest(&scene, 45.0).unwrap().chance, 0.75);
}

#[test]
fn a_cylinder_wrapped_in_felt_is_heard_half_as_far() {
    let felt = |x: f64| {
        scene(&format!("[[cylinder]]\ncenter_m = [{x:?}, 0.0]\nradius_m = 0.09\nabsorption = 0.75\n"))
    };
    assert!(nearest(&felt(1.05), 0.0).is_some());
    assert_eq!(nearest(&felt(1.15), 0.0), None);
}

#[test]
fn a_cylinder_on_its_way_answers_from_where_it_is() {
    let path = "path = [{ at_s = 0.0, center_m = [1.0, 0.0] }, { at_s = 10.0, center_m = [2.0, 0.0] }]";
    let scene = scene(&format!("[[cylinder]]\nradius_m = 0.1\n{path}\n"));
    for (at_s, range_m) in [(0.0, 0.9), (5.0, 1.4), (10.0, 1.9), (99.0, 1.9)] {
        assert_close(scene.echoes(&Look { at_s, ..look(0.0) })[0].range_m, range_m);
    }
}

#[test]
fn a_pings_sound_goes_to_and_fro_until_the_room_has_swallowed_it() {
    let scene = scene(&wall([1.0, -2.0], [1.0, 2.0]));
    let late = scene.reverberation(&look(0.0), 7.0);
    let heard: Vec<(f64, f64)> = late.iter().map(|echo| (echo.range_m, echo.chance)).collect();
    assert_eq!(heard, [(1.0, 1.0), (2.0, 0.5), (3.0, 0.25)]);
}
