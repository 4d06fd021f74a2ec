//! The shapes of what stands and moves in a room, its path and its units.

use super::paper::Paper;
use crate::room::geometry::{Point, Segment};
use crate::room::scenery::{Cylinder, Wall};
use crate::room::{Pose, Room};
use std::f64::consts::PI;
use std::fmt::Write;

/// Every so many waypoints bear their number.
const NUMBERED: usize = 5;
/// From the middle of a wall to the figure of what it absorbs.
const ABSORPTION_PX: f64 = 24.0;

/// White where the walls, each beginning where the one before ends, go all the way round.
pub fn write_floor(svg: &mut String, paper: &Paper, room: &Room) {
    let walls: Vec<Segment> = room.walls.iter().map(|wall| wall.segment(0.0)).collect();
    let round = |index: usize| walls[index].to.distance(walls[(index + 1) % walls.len()].from) < 1e-3;
    if walls.len() > 2 && (0..walls.len()).all(round) {
        let corners: Vec<Point> = walls.iter().map(|wall| wall.from).collect();
        let _ = writeln!(svg, r#"<path class="floor" d="{}"/>"#, paper.polyline(&corners, true));
    }
}

/// The ways of what moves, and where it will be when.
pub fn write_tracks(svg: &mut String, paper: &Paper, room: &Room) {
    for wall in room.walls.iter().filter(|wall| wall.moves()) {
        let ghosts = wall.places().into_iter().map(|(at_s, place)| {
            (at_s, place.from.toward(place.to, 0.5), line(wall_class(wall), paper, &place))
        });
        write_track(svg, paper, ghosts.collect());
    }
    for cylinder in room.cylinders.iter().filter(|cylinder| cylinder.moves()) {
        let ghosts = cylinder.places().into_iter().map(|(at_s, place)| {
            (at_s, place, circle(cylinder_class(cylinder), paper, place, cylinder.radius_m))
        });
        write_track(svg, paper, ghosts.collect());
    }
}

/// Time, place and look of something that moves.
fn write_track(svg: &mut String, paper: &Paper, ghosts: Vec<(f64, Point, String)>) {
    for (_, _, shape) in &ghosts[1..] {
        let _ = writeln!(svg, r#"<g class="ghost">{shape}</g>"#);
    }
    let places: Vec<Point> = ghosts.iter().map(|(_, place, _)| *place).collect();
    let _ = writeln!(svg, r#"<path class="track" d="{}"/>"#, paper.polyline(&places, false));
    for (at_s, place, _) in &ghosts[1..] {
        let (x, y) = paper.at(*place);
        let _ = writeln!(svg, r#"<text class="time" x="{x:.1}" y="{y:.1}">{at_s} s</text>"#);
    }
}

/// Those who walk through, behind each of their doors.
pub fn write_people(svg: &mut String, paper: &Paper, room: &Room) {
    for person in &room.people {
        for &door in &person.doors_m {
            let shape = circle("cylinder", paper, door, person.radius_m);
            let _ = writeln!(svg, r#"<g class="ghost">{shape}</g>"#);
            let (x, y) = paper.at(door);
            let _ = writeln!(svg, r#"<text class="time" x="{x:.1}" y="{y:.1}">person</text>"#);
        }
    }
}

pub fn write_wall(svg: &mut String, paper: &Paper, wall: &Wall) {
    let segment = wall.segment(0.0);
    let _ = writeln!(svg, "{}", line(wall_class(wall), paper, &segment));
    // Beside the wall: on its left, where the room is if the walls go round it anticlockwise.
    let middle = paper.at(segment.from.toward(segment.to, 0.5));
    let across_rad = segment.from.bearing_to(segment.to) + PI / 2.0;
    write_absorption(svg, moved(middle, across_rad, ABSORPTION_PX), wall.absorption);
}

pub fn write_cylinder(svg: &mut String, paper: &Paper, cylinder: &Cylinder) {
    let center = cylinder.center_m(0.0);
    let _ = writeln!(svg, "{}", circle(cylinder_class(cylinder), paper, center, cylinder.radius_m));
    write_absorption(svg, paper.at(center), cylinder.absorption);
}

fn write_absorption(svg: &mut String, (x, y): (f64, f64), absorption: f64) {
    if absorption > 0.0 {
        let share = 100.0 * absorption;
        let _ = writeln!(svg, r#"<text class="share" x="{x:.1}" y="{y:.1}">{share:.0} %</text>"#);
    }
}

fn wall_class(wall: &Wall) -> &'static str {
    if wall.absorption > 0.0 { "soft-wall" } else { "wall" }
}

fn cylinder_class(cylinder: &Cylinder) -> &'static str {
    if cylinder.absorption > 0.0 { "soft-cylinder" } else { "cylinder" }
}

pub fn write_path(svg: &mut String, paper: &Paper, waypoints: &[Pose], closed: bool) {
    if waypoints.is_empty() {
        return;
    }
    let places: Vec<Point> = waypoints.iter().map(|pose| pose.position_m).collect();
    let _ = writeln!(svg, r#"<path class="path" d="{}"/>"#, paper.polyline(&places, closed));
    for (number, pose) in waypoints.iter().enumerate() {
        let (x, y) = paper.at(pose.position_m);
        let arrow = arrow((x, y), pose.heading_rad, 8.0);
        let _ = writeln!(svg, r#"<polygon class="waypoint" points="{arrow}"/>"#);
        if number % NUMBERED == 0 {
            // To the right of the way, clear of the arrow.
            let (x, y) = moved((x, y), pose.heading_rad - PI / 2.0, 14.0);
            let _ = writeln!(
                svg,
                r#"<text class="number" x="{x:.1}" y="{y:.1}" text-anchor="middle" dominant-baseline="central">{number}</text>"#
            );
        }
    }
}

pub fn write_units(svg: &mut String, paper: &Paper, room: &Room) {
    for (index, pose) in room.places().into_iter().enumerate() {
        let center = paper.at(pose.position_m);
        let arrow = arrow(center, pose.heading_rad, 17.0);
        let _ = writeln!(svg, r#"<polygon class="unit" points="{arrow}"/>"#);
        let (x, y) = (center.0, center.1 + 30.0);
        let name = format!("unit {}", index + 1);
        let _ = writeln!(
            svg,
            r#"<text class="unit-name" x="{x:.1}" y="{y:.1}" text-anchor="middle">{name}</text>"#
        );
    }
}

fn line(class: &str, paper: &Paper, segment: &Segment) -> String {
    format!(r#"<path class="{class}" d="{}"/>"#, paper.polyline(&[segment.from, segment.to], false))
}

fn circle(class: &str, paper: &Paper, center: Point, radius_m: f64) -> String {
    let (x, y) = paper.at(center);
    let radius_px = paper.length(radius_m);
    format!(r#"<circle class="{class}" cx="{x:.1}" cy="{y:.1}" r="{radius_px:.1}"/>"#)
}

/// The corners of an arrow's head around a point.
fn arrow(center: (f64, f64), heading_rad: f64, length_px: f64) -> String {
    let corner = |turn_rad: f64, share: f64| moved(center, heading_rad + turn_rad, share * length_px);
    let corners = [corner(0.0, 1.0), corner(2.5, 0.8), corner(PI, 0.3), corner(-2.5, 0.8)];
    corners.map(|(x, y)| format!("{x:.1},{y:.1}")).join(" ")
}

/// The point on paper so many pixels away in a direction of the room.
fn moved((x, y): (f64, f64), bearing_rad: f64, length_px: f64) -> (f64, f64) {
    (x + length_px * bearing_rad.cos(), y - length_px * bearing_rad.sin())
}
