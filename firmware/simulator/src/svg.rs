//! A room as a drawing: walls, cylinders, what swallows sound, what moves, the path and the units' places.

mod paper;

use crate::geometry::{Point, Segment};
use crate::room::{Pose, Room};
use crate::scenery::{Cylinder, Wall};
use paper::{MARGIN_PX, Paper};
use std::f64::consts::PI;
use std::fmt::Write;

/// Every so many waypoints bear their number.
const NUMBERED: usize = 5;
const HEADING_PX: f64 = 9.0;
const STYLE: &str = "
    text { font-family: 'Helvetica Neue', Helvetica, Arial, 'Liberation Sans', sans-serif; fill: #33414e; }
    .title { font-size: 20px; font-weight: 600; }
    .words { font-size: 12px; fill: #6b7884; }
    .figure { font-size: 10px; fill: #93a0ab; }
    .grid { stroke: #e6e9ec; stroke-width: 1; }
    .wall { stroke: #33414e; stroke-width: 5; stroke-linecap: round; fill: none; }
    .cylinder { stroke: #33414e; stroke-width: 2; fill: #c9d2da; }
    .soft-wall { stroke: #c0722c; stroke-width: 7; stroke-dasharray: 3 3; fill: none; }
    .soft-cylinder { stroke: #c0722c; stroke-width: 3; stroke-dasharray: 3 3; fill: #f3dcc6; }
    .ghost { opacity: 0.3; }
    .track { stroke: #33414e; stroke-width: 1.5; stroke-dasharray: 2 5; fill: none; }
    .path { stroke: #8fb7dd; stroke-width: 2; stroke-linejoin: round; fill: none; }
    .heading { stroke: #1f6fb5; stroke-width: 1.5; stroke-linecap: round; }
    .waypoint { fill: #1f6fb5; stroke: #fff; stroke-width: 1; }
    .number { font-size: 10px; fill: #1f6fb5; }
    .unit { fill: #b3263c; stroke: #fff; stroke-width: 1.5; stroke-linejoin: round; }
    .unit-name { font-size: 12px; font-weight: 600; fill: #b3263c; }
    .scale { stroke: #33414e; stroke-width: 2; fill: none; }
";

/// The room as an SVG document.
pub fn drawing(room: &Room) -> String {
    let paper = Paper::around(&everything(room));
    let mut svg = paper.begin(&format!("Room {}", room.name), STYLE);
    write_title(&mut svg, room);
    paper.write_grid(&mut svg);
    write_tracks(&mut svg, &paper, room);
    room.walls.iter().for_each(|wall| write_wall(&mut svg, &paper, wall));
    room.cylinders.iter().for_each(|cylinder| write_cylinder(&mut svg, &paper, cylinder));
    write_path(&mut svg, &paper, &room.waypoints(), room.path.as_ref().is_some_and(|path| path.closed));
    write_units(&mut svg, &paper, room);
    write_legend(&mut svg, &paper, room);
    svg + "</svg>\n"
}

/// Points that span the drawing.
fn everything(room: &Room) -> Vec<Point> {
    let walls = room.walls.iter().flat_map(|wall| wall.places().into_iter().chain([wall.segment(0.0)]));
    let cylinders = room.cylinders.iter().flat_map(|cylinder| {
        let centers = cylinder.places_m().into_iter().chain([cylinder.center_m(0.0)]);
        centers.flat_map(|center| {
            [1.0, -1.0].map(|side| {
                Point::new(center.x + side * cylinder.radius_m, center.y + side * cylinder.radius_m)
            })
        })
    });
    let poses = room.waypoints().into_iter().chain(room.places());
    walls
        .flat_map(|wall| [wall.from, wall.to])
        .chain(cylinders)
        .chain(poses.map(|pose| pose.position_m))
        .collect()
}

fn write_title(svg: &mut String, room: &Room) {
    let _ = writeln!(svg, r#"<text class="title" x="{MARGIN_PX}" y="32">{}</text>"#, escaped(&room.name));
    let _ = writeln!(svg, r#"<text class="words" x="{MARGIN_PX}" y="52">{}</text>"#, summary(room));
}

fn summary(room: &Room) -> String {
    let mut parts =
        vec![format!("{} walls", room.walls.len()), format!("{} cylinders", room.cylinders.len())];
    match room.waypoints().len() {
        0 => {}
        waypoints => parts.push(format!("{waypoints} waypoints")),
    }
    parts.push(format!("air at {:.1} °C", room.air_temperature_c(0.0)));
    parts.join(" · ")
}

/// The ways of what moves, and where it will be.
fn write_tracks(svg: &mut String, paper: &Paper, room: &Room) {
    for wall in room.walls.iter().filter(|wall| wall.moves()) {
        let places = wall.places();
        for place in &places[1..] {
            let _ = writeln!(svg, r#"<g class="ghost">{}</g>"#, line("wall", paper, place));
        }
        let middles: Vec<Point> = places.iter().map(|place| place.from.toward(place.to, 0.5)).collect();
        let _ = writeln!(svg, r#"<path class="track" d="{}"/>"#, paper.polyline(&middles, false));
    }
    for cylinder in room.cylinders.iter().filter(|cylinder| cylinder.moves()) {
        let places = cylinder.places_m();
        for &place in &places[1..] {
            let _ = writeln!(
                svg,
                r#"<g class="ghost">{}</g>"#,
                circle("cylinder", paper, place, cylinder.radius_m)
            );
        }
        let _ = writeln!(svg, r#"<path class="track" d="{}"/>"#, paper.polyline(&places, false));
    }
}

fn write_wall(svg: &mut String, paper: &Paper, wall: &Wall) {
    let class = if wall.absorption > 0.0 { "soft-wall" } else { "wall" };
    let _ = writeln!(svg, "{}", line(class, paper, &wall.segment(0.0)));
}

fn write_cylinder(svg: &mut String, paper: &Paper, cylinder: &Cylinder) {
    let class = if cylinder.absorption > 0.0 { "soft-cylinder" } else { "cylinder" };
    let _ = writeln!(svg, "{}", circle(class, paper, cylinder.center_m(0.0), cylinder.radius_m));
}

fn write_path(svg: &mut String, paper: &Paper, waypoints: &[Pose], closed: bool) {
    if waypoints.is_empty() {
        return;
    }
    let places: Vec<Point> = waypoints.iter().map(|pose| pose.position_m).collect();
    let _ = writeln!(svg, r#"<path class="path" d="{}"/>"#, paper.polyline(&places, closed));
    for (number, pose) in waypoints.iter().enumerate() {
        let (x, y) = paper.at(pose.position_m);
        let (tip_x, tip_y) = moved((x, y), pose.heading_rad, HEADING_PX);
        let _ = writeln!(svg, r#"<path class="heading" d="M{x:.1} {y:.1}L{tip_x:.1} {tip_y:.1}"/>"#);
        let _ = writeln!(svg, r#"<circle class="waypoint" cx="{x:.1}" cy="{y:.1}" r="3.2"/>"#);
        if number % NUMBERED == 0 {
            // To the right of the way, clear of the arrow.
            let (x, y) = moved((x, y), pose.heading_rad - PI / 2.0, 12.0);
            let _ = writeln!(
                svg,
                r#"<text class="number" x="{x:.1}" y="{y:.1}" text-anchor="middle" dominant-baseline="central">{number}</text>"#
            );
        }
    }
}

fn write_units(svg: &mut String, paper: &Paper, room: &Room) {
    for (index, pose) in room.places().into_iter().enumerate() {
        let center = paper.at(pose.position_m);
        let corner = |turn_rad: f64, length: f64| moved(center, pose.heading_rad + turn_rad, length);
        let corners = [corner(0.0, 14.0), corner(2.5, 10.0), corner(PI, 4.0), corner(-2.5, 10.0)];
        let points: Vec<String> = corners.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        let _ = writeln!(svg, r#"<polygon class="unit" points="{}"/>"#, points.join(" "));
        let (x, y) = (center.0, center.1 + 26.0);
        let name = format!("unit {}", index + 1);
        let _ = writeln!(
            svg,
            r#"<text class="unit-name" x="{x:.1}" y="{y:.1}" text-anchor="middle">{name}</text>"#
        );
    }
}

/// The scale, and what the signs mean of which there are any.
fn write_legend(svg: &mut String, paper: &Paper, room: &Room) {
    let y = paper.height_px() - MARGIN_PX / 2.0;
    let after_scale = paper.write_scale(svg, y);
    let soft = room.walls.iter().any(|wall| wall.absorption > 0.0)
        || room.cylinders.iter().any(|cylinder| cylinder.absorption > 0.0);
    let moving = room.walls.iter().any(Wall::moves) || room.cylinders.iter().any(Cylinder::moves);
    let signs = [
        (true, "wall", "wall"),
        (soft, "soft-wall", "absorber"),
        (moving, "track", "moves"),
        (!room.waypoints().is_empty(), "path", "path, with headings"),
    ];
    let mut x = after_scale + 36.0;
    for (_, class, words) in signs.into_iter().filter(|(there, ..)| *there) {
        let _ = writeln!(svg, r#"<path class="{class}" d="M{x:.1} {y:.1}h28"/>"#);
        let _ = writeln!(svg, r#"<text class="words" x="{:.1}" y="{:.1}">{words}</text>"#, x + 38.0, y + 4.0);
        x += 38.0 + 7.0 * words.len() as f64 + 24.0;
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

/// The point on paper so many pixels away in a direction of the room.
fn moved((x, y): (f64, f64), bearing_rad: f64, length_px: f64) -> (f64, f64) {
    (x + length_px * bearing_rad.cos(), y - length_px * bearing_rad.sin())
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(svg: &str, what: &str) -> usize {
        svg.matches(what).count()
    }

    #[test]
    fn the_papers_room_is_drawn_with_all_that_is_in_it() {
        let svg = drawing(&Room::load("paper").unwrap());
        // Five walls and one sign in the legend.
        assert_eq!(count(&svg, r#"class="wall""#), 6);
        assert_eq!(count(&svg, r#"class="cylinder""#), 1);
        assert_eq!(count(&svg, r#"class="waypoint""#), 44);
        assert_eq!(count(&svg, r#"class="heading""#), 44);
        assert!(svg.contains(">paper</text>") && svg.contains(">1 m</text>"));
        assert!(!svg.contains("soft"));
    }

    #[test]
    fn absorbers_units_and_what_moves_are_told_apart() {
        let text = "name = 'a <b> & c'\n[[wall]]\nfrom_m = [0.0, 0.0]\nto_m = [3.0, 0.0]\nabsorption = 0.7\n\
            [[cylinder]]\nradius_m = 0.2\npath = [{ at_s = 0.0, center_m = [1.0, 2.0] }, { at_s = 9.0, center_m = [2.0, 2.0] }]\n\
            [[unit]]\nposition_m = [1.0, 1.0]\n[[unit]]\nposition_m = [2.0, 1.0]\n";
        let svg = drawing(&Room::parse("x", text).unwrap());
        assert!(svg.contains("a &lt;b&gt; &amp; c"));
        assert_eq!(count(&svg, r#"class="soft-wall""#), 2);
        assert_eq!(count(&svg, r#"class="ghost""#), 1);
        assert_eq!(count(&svg, r#"class="unit""#), 2);
        assert!(svg.contains(">unit 2</text>"));
    }
}
