//! The sheet that a room is drawn on: from metres to pixels, a grid with its figures, a scale.

use crate::room::geometry::Point;
use std::fmt::Write;

pub const MARGIN_PX: f64 = 56.0;
pub const TITLE_PX: f64 = 72.0;
const LONGER_SIDE_PX: f64 = 760.0;
/// Room for the legend, even below a narrow room.
const NARROWEST_PX: f64 = 640.0;
/// Air around what is drawn.
const BORDER_M: f64 = 0.15;

pub struct Paper {
    low: Point,
    high: Point,
    pixels_per_m: f64,
}

impl Paper {
    /// A sheet on which all of these points lie; there must be one at least.
    pub fn around(points: &[Point]) -> Self {
        let least =
            |pick: fn(&Point) -> f64| points.iter().map(pick).fold(f64::INFINITY, f64::min) - BORDER_M;
        let most =
            |pick: fn(&Point) -> f64| points.iter().map(pick).fold(f64::NEG_INFINITY, f64::max) + BORDER_M;
        let low = Point::new(least(|point| point.x), least(|point| point.y));
        let high = Point::new(most(|point| point.x), most(|point| point.y));
        let pixels_per_m = LONGER_SIDE_PX / (high.x - low.x).max(high.y - low.y);
        Self { low, high, pixels_per_m }
    }

    /// Where a point of the room is on paper: x to the right, y down.
    pub fn at(&self, point: Point) -> (f64, f64) {
        let left = (self.width_px() - self.length(self.high.x - self.low.x)) / 2.0;
        (left + self.length(point.x - self.low.x), TITLE_PX + self.length(self.high.y - point.y))
    }

    pub fn length(&self, length_m: f64) -> f64 {
        length_m * self.pixels_per_m
    }

    pub fn width_px(&self) -> f64 {
        (self.length(self.high.x - self.low.x) + 2.0 * MARGIN_PX).max(NARROWEST_PX)
    }

    pub fn height_px(&self) -> f64 {
        TITLE_PX + self.length(self.high.y - self.low.y) + 1.4 * MARGIN_PX
    }

    /// The beginning of a document of that title.
    pub fn begin(&self, title: &str, style: &str) -> String {
        let (width, height) = (self.width_px(), self.height_px());
        format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0} {height:.0}" width="{width:.0}" height="{height:.0}" role="img">
<title>{}</title>
<style>{style}</style>
<rect width="100%" height="100%" fill="#fdfdfb"/>
"##,
            super::escaped(title)
        )
    }

    pub fn polyline(&self, points: &[Point], closed: bool) -> String {
        let mut data = String::new();
        for (index, &point) in points.iter().enumerate() {
            let (x, y) = self.at(point);
            let _ = write!(data, "{}{x:.1} {y:.1}", if index == 0 { 'M' } else { 'L' });
        }
        if closed { data + "Z" } else { data }
    }

    /// Lines a metre, or half of one, apart, with their figures.
    pub fn write_grid(&self, svg: &mut String) {
        let step_m = if self.high.x - self.low.x > 4.0 { 1.0 } else { 0.5 };
        let (left, top) = self.at(Point::new(self.low.x, self.high.y));
        let (right, bottom) = self.at(Point::new(self.high.x, self.low.y));
        for at_m in multiples(self.low.x, self.high.x, step_m) {
            let (x, _) = self.at(Point::new(at_m, 0.0));
            let _ = writeln!(svg, r#"<path class="grid" d="M{x:.1} {top:.1}V{bottom:.1}"/>"#);
            let _ = writeln!(
                svg,
                r#"<text class="figure" x="{x:.1}" y="{:.1}" text-anchor="middle">{at_m}</text>"#,
                bottom + 14.0
            );
        }
        for at_m in multiples(self.low.y, self.high.y, step_m) {
            let (_, y) = self.at(Point::new(0.0, at_m));
            let _ = writeln!(svg, r#"<path class="grid" d="M{left:.1} {y:.1}H{right:.1}"/>"#);
            let _ = writeln!(
                svg,
                r#"<text class="figure" x="{:.1}" y="{:.1}" text-anchor="end">{at_m}</text>"#,
                left - 8.0,
                y + 3.5
            );
        }
    }

    /// A bar of a metre at the lower left; gives where it ends.
    pub fn write_scale(&self, svg: &mut String, y: f64) -> f64 {
        let (length, end) = (self.length(1.0), MARGIN_PX + self.length(1.0));
        let _ = writeln!(
            svg,
            r#"<path class="scale" d="M{MARGIN_PX} {:.1}v8m0 -4h{length:.1}m0 -4v8"/>"#,
            y - 4.0
        );
        let _ = writeln!(svg, r#"<text class="words" x="{:.1}" y="{:.1}">1 m</text>"#, end + 8.0, y + 4.0);
        end + 32.0
    }
}

fn multiples(low: f64, high: f64, step: f64) -> impl Iterator<Item = f64> {
    ((low / step).ceil() as i64..=(high / step).floor() as i64).map(move |count| count as f64 * step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_higher_in_the_room_is_higher_on_paper_and_a_metre_is_as_long_either_way() {
        let paper = Paper::around(&[Point::new(-1.0, -1.0), Point::new(3.0, 1.0)]);
        let (x, y) = paper.at(Point::new(0.0, 0.0));
        let (right, up) = (paper.at(Point::new(1.0, 0.0)), paper.at(Point::new(0.0, 1.0)));
        assert!(
            (right.0 - x - paper.length(1.0)).abs() < 1e-9 && (y - up.1 - paper.length(1.0)).abs() < 1e-9
        );
    }

    #[test]
    fn grid_lines_are_at_whole_multiples() {
        assert_eq!(multiples(-0.6, 1.1, 0.5).collect::<Vec<_>>(), [-0.5, 0.0, 0.5, 1.0]);
    }
}
