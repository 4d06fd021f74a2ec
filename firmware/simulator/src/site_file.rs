//! A site file for a room's units, as their gateway needs it: where each is reached, and its path or where it stands.

use crate::room::Room;
use crate::room::geometry::Point;

/// The units that are reached at `addresses`, numbered from 1. `keeps_up` says that simulated time is the host's.
pub fn site_file(room: &Room, addresses: &[String], keeps_up: bool) -> String {
    let mut lines = vec![
        format!("site = {:?}", site_name(&room.name)),
        format!("air_temperature_c = {}", room.air_temperature_c(0.0)),
    ];
    if !keeps_up {
        lines.push(
            "clock = \"unit\" # simulated time is not the host's: run noctule-sim with --exact-clocks"
                .to_owned(),
        );
    }
    for (index, address) in addresses.iter().enumerate() {
        let serial = index + 1;
        lines.push(format!("\n[[unit]]\nname = \"u{serial}\"\nserial = {serial}\naddress = {address:?}"));
        lines.push(whereabouts(room, index));
    }
    lines.join("\n") + "\n"
}

/// A room's name as a site may be called: lower-case letters, digits, - and _.
fn site_name(room: &str) -> String {
    let kept = |letter: char| if letter.is_ascii_alphanumeric() || letter == '_' { letter } else { '-' };
    let name: String = room.to_ascii_lowercase().chars().map(kept).collect();
    let name = name.trim_start_matches(['-', '_']);
    if name.is_empty() { "room".to_owned() } else { name.to_owned() }
}

fn whereabouts(room: &Room, index: usize) -> String {
    if let (Some(path), true) = (&room.path, room.places().is_empty()) {
        let corners: Vec<_> = path.corners_m.iter().map(pair).collect();
        return format!(
            "path = {{ corners_m = [{}], spacing_m = {}, closed = {} }}",
            corners.join(", "),
            path.spacing_m,
            path.closed
        );
    }
    let pose = room.standing(index);
    format!(
        "pose = {{ x_m = {}, y_m = {}, heading_deg = {:.3}, sigma_position_m = 0, sigma_heading_deg = 0 }}\n\
         sweep = {{ start = true, pause_s = 5 }}",
        pose.position_m.x,
        pose.position_m.y,
        pose.heading_rad.to_degrees()
    )
}

fn pair(point: &Point) -> String {
    format!("[{}, {}]", point.x, point.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_that_is_carried_has_the_rooms_path() {
        let room = Room::load("paper").expect("it comes with the simulator");
        let text = site_file(&room, &["socket://127.0.0.1:7001".into()], true);
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines[..2], ["site = \"paper\"", "air_temperature_c = 21"]);
        assert_eq!(
            lines[3..7],
            ["[[unit]]", "name = \"u1\"", "serial = 1", "address = \"socket://127.0.0.1:7001\""]
        );
        let path = "path = { corners_m = [[-0.7, -0.45], [2, -0.45], [2, 1.05], [-0.7, 1.05]], spacing_m = 0.2, closed = true }";
        assert_eq!(lines[7..], [path]);
    }

    #[test]
    fn a_site_has_a_name_that_a_site_may_have() {
        for (room, site) in [("My Lounge", "my-lounge"), ("_Küche 2", "k-che-2"), ("...", "room")] {
            assert_eq!(site_name(room), site);
        }
    }

    #[test]
    fn units_that_stand_have_their_places() {
        let room = Room::load("lounge").expect("it comes with the simulator");
        let text = site_file(&room, &["/a".into(), "/b".into()], false);
        assert!(text.contains("clock = \"unit\""));
        for pose in
            ["x_m = 0.8, y_m = 1.2, heading_deg = 45.000", "x_m = 3.6, y_m = 1.9, heading_deg = 180.000"]
        {
            assert!(text.contains(pose), "{text}");
        }
    }
}
