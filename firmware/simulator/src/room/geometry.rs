//! Plane geometry: points, and what lies between them. Metres and radians.

use crate::room::interpolation::between;
use serde::Deserialize;

#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(from = "[f64; 2]")]
pub struct Point {
    pub x: f64,
    pub y: f64,
}

impl From<[f64; 2]> for Point {
    fn from([x, y]: [f64; 2]) -> Self {
        Self { x, y }
    }
}

impl Point {
    pub const fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    /// The point that lies `share` of the way to `other`.
    pub fn toward(self, other: Self, share: f64) -> Self {
        Self::new(between(self.x, other.x, share), between(self.y, other.y, share))
    }

    pub fn minus(self, other: Self) -> Self {
        Self::new(self.x - other.x, self.y - other.y)
    }

    /// The point `length` further in the direction of the unit vector `direction`.
    pub fn along(self, direction: Self, length: f64) -> Self {
        Self::new(self.x + direction.x * length, self.y + direction.y * length)
    }

    pub fn dot(self, other: Self) -> f64 {
        self.x * other.x + self.y * other.y
    }

    pub fn cross(self, other: Self) -> f64 {
        self.x * other.y - self.y * other.x
    }

    pub fn length(self) -> f64 {
        self.x.hypot(self.y)
    }

    pub fn distance(self, other: Self) -> f64 {
        self.minus(other).length()
    }

    pub fn direction_to(self, other: Self) -> Self {
        let way = other.minus(self);
        let length = way.length();
        Self::new(way.x / length, way.y / length)
    }

    pub fn bearing_to(self, other: Self) -> f64 {
        (other.y - self.y).atan2(other.x - self.x)
    }
}

/// The angle between two directions from -pi to pi.
pub fn wrap_rad(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    (angle + PI).rem_euclid(TAU) - PI
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    pub from: Point,
    pub to: Point,
}

impl Segment {
    pub fn length(&self) -> f64 {
        self.from.distance(self.to)
    }

    /// The foot of the perpendicular from `point`, if it lies within the segment.
    pub fn foot(&self, point: Point) -> Option<Point> {
        let direction = self.from.direction_to(self.to);
        let along = point.minus(self.from).dot(direction);
        (0.0..=self.length()).contains(&along).then(|| self.from.along(direction, along))
    }

    /// The point's image in the mirror that lies along this segment.
    pub fn image(&self, point: Point) -> Point {
        let direction = self.from.direction_to(self.to);
        let foot = self.from.along(direction, point.minus(self.from).dot(direction));
        point.toward(foot, 2.0)
    }

    /// Where this segment crosses `other`, if it does so strictly inside both.
    pub fn crossing(&self, other: &Segment) -> Option<Point> {
        let side = |point: Point| other.to.minus(other.from).cross(point.minus(other.from));
        let (before, after) = (side(self.from), side(self.to));
        self.crosses(other).then(|| self.from.toward(self.to, before / (before - after)))
    }

    /// Whether this segment crosses `other` strictly inside both.
    pub fn crosses(&self, other: &Segment) -> bool {
        let sides = |line: &Segment, point: Point| line.to.minus(line.from).cross(point.minus(line.from));
        let opposite = |a: f64, b: f64| a * b < 0.0 && a.abs().min(b.abs()) > 1e-9;
        opposite(sides(self, other.from), sides(self, other.to))
            && opposite(sides(other, self.from), sides(other, self.to))
    }

    pub fn distance(&self, point: Point) -> f64 {
        match self.foot(point) {
            Some(foot) => foot.distance(point),
            None => self.from.distance(point).min(self.to.distance(point)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Segment = Segment { from: Point::new(0.0, 0.0), to: Point::new(1.0, 0.0) };

    #[test]
    fn a_foot_exists_only_within_the_segment() {
        assert_eq!(UNIT.foot(Point::new(0.3, 2.0)), Some(Point::new(0.3, 0.0)));
        assert_eq!(UNIT.foot(Point::new(1.1, 2.0)), None);
    }

    #[test]
    fn touching_is_not_crossing() {
        let through = Segment { from: Point::new(0.5, -1.0), to: Point::new(0.5, 1.0) };
        let touching = Segment { from: Point::new(0.5, 0.0), to: Point::new(0.5, 1.0) };
        assert!(UNIT.crosses(&through));
        assert!(!UNIT.crosses(&touching));
    }

    #[test]
    fn distance_goes_to_the_nearer_end_beyond_the_segment() {
        assert_eq!(UNIT.distance(Point::new(4.0, 4.0)), 5.0);
        assert_eq!(UNIT.distance(Point::new(0.5, 2.0)), 2.0);
    }

    #[test]
    fn an_image_lies_as_far_behind_the_mirror_as_the_point_is_in_front_of_it() {
        assert_eq!(UNIT.image(Point::new(3.0, 2.0)), Point::new(3.0, -2.0));
    }

    #[test]
    fn segments_cross_where_they_meet() {
        let slanted = Segment { from: Point::new(0.0, -1.0), to: Point::new(1.0, 3.0) };
        assert_eq!(slanted.crossing(&UNIT), Some(Point::new(0.25, 0.0)));
        let beside = Segment { from: Point::new(2.0, -1.0), to: Point::new(2.0, 1.0) };
        assert_eq!(beside.crossing(&UNIT), None);
    }

    #[test]
    fn angles_wrap_to_half_a_turn_either_side() {
        use std::f64::consts::PI;
        assert!((wrap_rad(1.5 * PI) + 0.5 * PI).abs() < 1e-12);
    }
}
