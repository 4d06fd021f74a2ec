//! Values given at a few points of a rising scale, linear in between and constant beyond.

/// The points on either side of `at`, and the way from the first to the second as a share of 1. `scale` gives a point's
/// place on the scale; `points` must not be empty and their places must rise.
pub fn bracket<P>(points: &[P], scale: impl Fn(&P) -> f64, at: f64) -> (&P, &P, f64) {
    let after = points.partition_point(|point| scale(point) <= at);
    let before = &points[after.saturating_sub(1)];
    let beyond = &points[after.min(points.len() - 1)];
    let span = scale(beyond) - scale(before);
    let share = if span > 0.0 { ((at - scale(before)) / span).clamp(0.0, 1.0) } else { 0.0 };
    (before, beyond, share)
}

/// The value that lies `share` of the way from `from` to `to`.
pub fn between(from: f64, to: f64, share: f64) -> f64 {
    from + share * (to - from)
}

/// Whether there are points and their places rise.
pub fn rises<P>(points: &[P], scale: impl Fn(&P) -> f64) -> bool {
    !points.is_empty() && points.windows(2).all(|pair| scale(&pair[0]) < scale(&pair[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(at: f64) -> f64 {
        let (from, to, share) = bracket(&[(10.0, 1.0), (20.0, 3.0)], |point| point.0, at);
        between(from.1, to.1, share)
    }

    #[test]
    fn values_are_linear_in_between_and_constant_beyond() {
        assert_eq!([0.0, 10.0, 15.0, 20.0, 99.0].map(value), [1.0, 1.0, 2.0, 3.0, 3.0]);
    }

    #[test]
    fn points_that_do_not_rise_are_told() {
        let rise = |places: &[f64]| rises(places, |&place| place);
        assert!(rise(&[1.0, 2.0]) && !rise(&[1.0, 1.0]) && !rise(&[]));
    }
}
