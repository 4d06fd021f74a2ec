//! Paths: from the corners of a path to the waypoints that the unit is set down at.

use crate::room::Pose;
use crate::room::geometry::Point;
use serde::Deserialize;

/// A side's end that rounding puts this much before a step is not a step of its own.
const ROUNDING: f64 = 1e-9;

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Path {
    pub corners_m: Vec<Point>,
    pub spacing_m: f64,
    #[serde(default)]
    pub closed: bool,
}

/// Each side is walked in steps of the spacing, the last one shorter; a corner belongs to the side that begins there,
/// the end of an open path to its last side. The unit looks along the side.
pub fn waypoints(path: &Path) -> Vec<Pose> {
    let corners = &path.corners_m;
    let sides = if path.closed { corners.len() } else { corners.len() - 1 };
    let mut poses: Vec<Pose> = (0..sides)
        .flat_map(|side| {
            let (from, to) = (corners[side], corners[(side + 1) % corners.len()]);
            let steps = (from.distance(to) / path.spacing_m - ROUNDING).ceil() as usize;
            let spacing_m = path.spacing_m;
            (0..steps).map(move |step| Pose {
                position_m: from.along(from.direction_to(to), step as f64 * spacing_m),
                heading_rad: from.bearing_to(to),
            })
        })
        .collect();
    if let (false, Some(&last)) = (path.closed, poses.last()) {
        poses.push(Pose { position_m: corners[corners.len() - 1], ..last });
    }
    poses
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::room::Room;
    use std::f64::consts::PI;

    #[test]
    fn the_papers_path_has_44_waypoints_that_look_along_their_side() {
        let poses = Room::load("paper").unwrap().waypoints();
        assert_eq!(poses.len(), 14 + 8 + 14 + 8);
        assert_eq!((poses[0].position_m, poses[0].heading_rad), (Point::new(-0.70, -0.45), 0.0));
        assert_eq!((poses[14].position_m, poses[14].heading_rad), (Point::new(2.0, -0.45), PI / 2.0));
        assert!((poses[13].position_m.x - 1.90).abs() < 1e-9);
    }

    #[test]
    fn an_open_path_ends_at_its_last_corner() {
        let path = Path {
            corners_m: vec![Point::new(0.0, 0.0), Point::new(0.4, 0.0)],
            spacing_m: 0.2,
            closed: false,
        };
        let places: Vec<f64> = waypoints(&path).iter().map(|pose| pose.position_m.x).collect();
        assert_eq!(places, [0.0, 0.2, 0.4]);
    }
}
