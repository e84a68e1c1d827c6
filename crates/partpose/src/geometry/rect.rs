//! Axis-aligned rectangles in the image.

use serde::{Deserialize, Serialize};

use super::Point2;

/// A rectangle in continuous pixel coordinates, where pixel `(i, j)` covers `i ± 0.5`, `j ± 0.5`.
///
/// The inclusive integer boxes of the data sets are converted by [`Rect::from_inclusive`] in their readers only.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rect {
    /// Left edge.
    pub x_min: f64,
    /// Top edge.
    pub y_min: f64,
    /// Right edge.
    pub x_max: f64,
    /// Bottom edge.
    pub y_max: f64,
}

impl Rect {
    /// The rectangle between two corners.
    pub const fn new(x_min: f64, y_min: f64, x_max: f64, y_max: f64) -> Self {
        Self { x_min, y_min, x_max, y_max }
    }

    /// The area of the pixels `left..=right` x `top..=bottom`.
    pub fn from_inclusive(left: f64, top: f64, right: f64, bottom: f64) -> Self {
        Self::new(left - 0.5, top - 0.5, right + 0.5, bottom + 0.5)
    }

    /// The smallest rectangle that holds all points, or `None` without points.
    pub fn around<'a>(points: impl IntoIterator<Item = &'a Point2>) -> Option<Self> {
        let mut points = points.into_iter();
        let first = points.next()?;
        let start = Self::new(first.x, first.y, first.x, first.y);
        Some(points.fold(start, |rect, point| Self {
            x_min: rect.x_min.min(point.x),
            y_min: rect.y_min.min(point.y),
            x_max: rect.x_max.max(point.x),
            y_max: rect.y_max.max(point.y),
        }))
    }

    /// Width in pixels.
    pub fn width(&self) -> f64 {
        self.x_max - self.x_min
    }

    /// Height in pixels.
    pub fn height(&self) -> f64 {
        self.y_max - self.y_min
    }

    /// Area in square pixels; 0 for an empty or inverted rectangle.
    pub fn area(&self) -> f64 {
        self.width().max(0.0) * self.height().max(0.0)
    }

    /// The centre.
    pub fn center(&self) -> Point2 {
        Point2::new(0.5 * (self.x_min + self.x_max), 0.5 * (self.y_min + self.y_max))
    }

    /// The overlap, or `None` where the rectangles share no area.
    pub fn intersection(&self, other: &Self) -> Option<Self> {
        let overlap = Self {
            x_min: self.x_min.max(other.x_min),
            y_min: self.y_min.max(other.y_min),
            x_max: self.x_max.min(other.x_max),
            y_max: self.y_max.min(other.y_max),
        };
        (overlap.x_max > overlap.x_min && overlap.y_max > overlap.y_min).then_some(overlap)
    }

    /// Intersection over union, in `[0, 1]`.
    pub fn iou(&self, other: &Self) -> f64 {
        let shared = self.intersection(other).map_or(0.0, |overlap| overlap.area());
        let union = self.area() + other.area() - shared;
        if union > 0.0 { shared / union } else { 0.0 }
    }

    /// Whether a point lies inside or on the edge.
    pub fn contains(&self, point: &Point2) -> bool {
        (self.x_min..=self.x_max).contains(&point.x) && (self.y_min..=self.y_max).contains(&point.y)
    }

    /// The pixels whose centres lie inside, clipped to an image: `(x0, y0, x1, y1)`, ends exclusive, maybe empty.
    pub fn pixels(&self, size: [u32; 2]) -> (u32, u32, u32, u32) {
        let clip = |value: f64, limit: u32| value.ceil().clamp(0.0, f64::from(limit)) as u32;
        let (x0, y0) = (clip(self.x_min, size[0]), clip(self.y_min, size[1]));
        (x0, y0, clip(self.x_max, size[0]).max(x0), clip(self.y_max, size[1]).max(y0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inclusive_box_covers_its_pixels() {
        let rect = Rect::from_inclusive(3.0, 4.0, 5.0, 4.0);
        assert_eq!((rect.width(), rect.height()), (3.0, 1.0));
        assert_eq!(rect.pixels([100, 100]), (3, 4, 6, 5));
    }

    #[test]
    fn iou_of_halves_is_a_third() {
        let a = Rect::new(0.0, 0.0, 2.0, 1.0);
        let b = Rect::new(1.0, 0.0, 3.0, 1.0);
        assert!((a.iou(&b) - 1.0 / 3.0).abs() < 1e-12);
        assert!((a.iou(&Rect::new(5.0, 5.0, 6.0, 6.0))).abs() < 1e-12);
    }
}
