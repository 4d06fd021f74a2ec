//! A room as a drawing: walls, cylinders, what swallows sound, what moves, the path and the units' places.

mod paper;
mod shapes;

use crate::fleet::report::counted;
use crate::room::Room;
use crate::room::geometry::Point;
use crate::room::scenery::{Cylinder, Wall};
use paper::{MARGIN_PX, Paper};
use std::fmt::Write;

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
    .floor { fill: #fff; stroke: none; }
    .share { font-size: 11px; fill: #c0722c; text-anchor: middle; dominant-baseline: central; }
    .time { font-size: 10px; fill: #6b7884; text-anchor: middle; dominant-baseline: central;
        paint-order: stroke; stroke: #fdfdfb; stroke-width: 3px; }
    .ghost { opacity: 0.3; }
    .track { stroke: #33414e; stroke-width: 1.5; stroke-dasharray: 2 5; fill: none; }
    .path { stroke: #8fb7dd; stroke-width: 2; stroke-linejoin: round; fill: none; }
    .waypoint { fill: #1f6fb5; stroke: #fff; stroke-width: 1; stroke-linejoin: round; }
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
    shapes::write_floor(&mut svg, &paper, room);
    paper.write_grid(&mut svg);
    shapes::write_tracks(&mut svg, &paper, room);
    shapes::write_people(&mut svg, &paper, room);
    room.walls.iter().for_each(|wall| shapes::write_wall(&mut svg, &paper, wall));
    room.cylinders.iter().for_each(|cylinder| shapes::write_cylinder(&mut svg, &paper, cylinder));
    shapes::write_path(
        &mut svg,
        &paper,
        &room.waypoints(),
        room.path.as_ref().is_some_and(|path| path.closed),
    );
    shapes::write_units(&mut svg, &paper, room);
    write_legend(&mut svg, &paper, room);
    svg + "</svg>\n"
}

/// Points that span the drawing.
fn everything(room: &Room) -> Vec<Point> {
    let walls = room
        .walls
        .iter()
        .flat_map(|wall| wall.places().into_iter().map(|(_, place)| place).chain([wall.segment(0.0)]));
    let cylinders = room.cylinders.iter().flat_map(|cylinder| {
        let places = cylinder.places().into_iter().map(|(_, place)| place);
        let radius_m = cylinder.radius_m;
        places.chain([cylinder.center_m(0.0)]).flat_map(move |center| {
            [radius_m, -radius_m].map(|reach_m| Point::new(center.x + reach_m, center.y + reach_m))
        })
    });
    let poses = room.waypoints().into_iter().chain(room.places());
    let doors = room.people.iter().flat_map(|person| person.doors_m.iter().copied());
    walls
        .flat_map(|wall| [wall.from, wall.to])
        .chain(cylinders)
        .chain(poses.map(|pose| pose.position_m))
        .chain(doors)
        .collect()
}

fn write_title(svg: &mut String, room: &Room) {
    let _ = writeln!(svg, r#"<text class="title" x="{MARGIN_PX}" y="32">{}</text>"#, escaped(&room.name));
    let _ = writeln!(svg, r#"<text class="words" x="{MARGIN_PX}" y="52">{}</text>"#, summary(room));
}

fn summary(room: &Room) -> String {
    let mut parts = vec![counted(room.walls.len(), "wall"), counted(room.cylinders.len(), "cylinder")];
    if room.path.is_some() {
        parts.push(counted(room.waypoints().len(), "waypoint"));
    }
    parts.push(format!("air at {:.1} °C", room.air_temperature_c(0.0)));
    parts.join(" · ")
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
        assert!(svg.contains(">paper</text>") && svg.contains(">1 m</text>"));
        assert_eq!(count(&svg, r#"class="floor""#), 1);
        assert_eq!(count(&svg, r#"class="soft"#), 0);
    }

    #[test]
    fn people_are_drawn_behind_their_doors() {
        let svg = drawing(&Room::load("lounge").unwrap());
        assert_eq!(count(&svg, r#"class="ghost""#), 2);
        assert_eq!(count(&svg, ">person</text>"), 2);
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
        assert!(
            svg.contains(">unit 2</text>") && svg.contains(">70 %</text>") && svg.contains(">9 s</text>")
        );
    }
}
