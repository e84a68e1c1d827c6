//! Placing texts so that they do not cover each other.

use crate::geometry::{Point2, Rect};

use super::canvas::{Canvas, Pen, TextStyle, text_size};
use super::scene::palette;

/// Free pixels around a text, inside its plate.
const PADDING: i32 = 2;
/// How many places above and below a box are tried.
const TRIES: i32 = 14;

/// Texts with their places; nothing is drawn before all are placed.
#[derive(Debug)]
pub(super) struct Labels {
    area: Rect,
    placed: Vec<Label>,
}

#[derive(Debug)]
struct Label {
    text: String,
    place: Rect,
    anchor: Rect,
}

impl Labels {
    /// For texts within an area.
    pub(super) fn new(area: Rect) -> Self {
        Self { area, placed: Vec::new() }
    }

    /// Places a text beside a box: above it where there is room, further up with a thin line down to it, else below.
    pub(super) fn place(&mut self, anchor: &Rect, text: String) {
        if text.is_empty() {
            return;
        }
        let area = &self.area;
        let [width, height] = text_size(&text, 1).map(|side| side + 2 * PADDING);
        let left_limit = (area.x_max - f64::from(width)).max(area.x_min);
        let x = anchor.x_min.clamp(area.x_min, left_limit).round();
        let plate = |y: f64| Rect::new(x, y, x + f64::from(width), y + f64::from(height));
        let above = (0..TRIES).map(|k| anchor.y_min - 2.0 - f64::from(height + k * (height + 1)));
        let below = (0..TRIES).map(|k| anchor.y_max + 2.0 + f64::from(k * (height + 1)));
        let bottom = area.y_max - f64::from(height);
        let free = |place: &Rect| {
            place.y_min >= area.y_min
                && place.y_min <= bottom
                && self.placed.iter().all(|label| label.place.intersection(place).is_none())
        };
        let place = above.chain(below).map(|y| plate(y.round())).find(free);
        // Where everything is taken the text may cover another rather than be lost.
        let place = place.unwrap_or_else(|| {
            let lowest = bottom.max(area.y_min);
            plate((anchor.y_min - 2.0 - f64::from(height)).clamp(area.y_min, lowest).round())
        });
        self.placed.push(Label { text, place, anchor: *anchor });
    }

    /// Draws the lines to distant boxes, then the texts on dark plates.
    pub(super) fn draw(&self, canvas: &mut Canvas) {
        for label in &self.placed {
            draw_leader(canvas, &label.place, &label.anchor);
        }
        for Label { text, place, .. } in &self.placed {
            canvas.fill_rectangle(place, palette::with_opacity([0, 0, 0], 175));
            let at = [place.x_min as i32 + PADDING + 1, place.y_min as i32 + PADDING + 1];
            canvas.text(at, text, TextStyle::plain(palette::TEXT));
        }
    }
}

fn draw_leader(canvas: &mut Canvas, place: &Rect, anchor: &Rect) {
    let pen = Pen { color: palette::with_opacity(palette::TEXT, 170), width: 1.0 };
    let x = anchor.x_min.max(place.x_min).min(place.x_max);
    if place.y_max < anchor.y_min - 4.0 {
        canvas.line(&Point2::new(x, place.y_max), &Point2::new(x, anchor.y_min), pen);
    } else if place.y_min > anchor.y_max + 4.0 {
        canvas.line(&Point2::new(x, anchor.y_max), &Point2::new(x, place.y_min), pen);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_labels_at_one_place_do_not_cover_each_other() {
        let area = Rect::new(0.0, 0.0, 299.0, 199.0);
        let mut labels = Labels::new(area);
        for _ in 0..10 {
            let anchor = Rect::new(280.0, 100.0, 290.0, 110.0);
            labels.place(&anchor, "3 sedan z=12.3m".to_owned());
        }
        let places: Vec<Rect> = labels.placed.iter().map(|label| label.place).collect();
        for (i, a) in places.iter().enumerate() {
            assert!(a.x_max <= area.x_max && a.y_min >= 0.0 && a.y_max <= area.y_max);
            assert!(places[..i].iter().all(|b| a.intersection(b).is_none()));
        }
    }
}
