//! A confusion matrix as a picture: what each class of a reference was called.

use crate::files::RgbImage;
use crate::geometry::Rect;

use super::canvas::{Canvas, TextStyle, text_size};

/// Side of a cell, pixels.
const CELL: i32 = 22;
/// Free pixels around everything.
const MARGIN: i32 = 12;
/// Shares below this, in percent, are shaded but not written.
const LEAST_WRITTEN: f64 = 0.5;

const PAPER: [u8; 3] = [255; 3];
const INK: [u8; 3] = [30, 30, 30];

/// A class of the matrix.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConfusionClass {
    /// Its name.
    pub name: String,
    /// Its colour.
    pub color: [u8; 3],
}

/// Draws a matrix of counts, a row for each class of the reference, shaded and written in percent of its row.
///
/// The diagonal is green, everything else red; `counts` holds a row of as many counts as classes for each class.
pub fn confusion_picture(title: &str, classes: &[ConfusionClass], counts: &[u64]) -> RgbImage {
    let widest = classes.iter().map(|class| text_size(&class.name, 1)[0]).max().unwrap_or(0);
    let edge = MARGIN + widest + CELL;
    let top = edge + 2 * MARGIN;
    let side = CELL * classes.len() as i32;
    let size = [edge + side + MARGIN, top + side + MARGIN].map(|side| side.max(1) as u32);
    let mut canvas = Canvas::new(size, PAPER);
    let style = TextStyle::plain(INK);
    canvas.text([MARGIN, MARGIN], title, style);
    for (at, class) in classes.iter().enumerate() {
        let start = CELL * at as i32;
        swatch(&mut canvas, [edge - CELL, top + start], class.color);
        swatch(&mut canvas, [edge + start, top - CELL], class.color);
        let [width, height] = text_size(&class.name, 1);
        let y = top + start + (CELL - height) / 2;
        canvas.text([edge - CELL - 4 - width, y], &class.name, style);
        upwards(&mut canvas, [edge + start + (CELL - height) / 2, top - CELL - 4], &class.name);
    }
    for (row, counts) in counts.chunks_exact(classes.len().max(1)).enumerate() {
        let total = counts.iter().sum::<u64>().max(1) as f64;
        for (column, count) in counts.iter().enumerate() {
            let share = *count as f64 / total;
            let corner = [edge + CELL * column as i32, top + CELL * row as i32];
            // Small shares are what is looked for, so they are shaded more than in proportion.
            let shade = (255.0 - 190.0 * share.sqrt()) as u8;
            let color = if row == column { [shade, 255, shade] } else { [255, shade, shade] };
            fill(&mut canvas, corner, color);
            if 100.0 * share >= LEAST_WRITTEN {
                let text = format!("{:.0}", 100.0 * share);
                let [width, height] = text_size(&text, 1);
                let at = [corner[0] + (CELL - width) / 2, corner[1] + (CELL - height) / 2];
                canvas.text(at, &text, style);
            }
        }
    }
    canvas.into_rgb()
}

fn fill(canvas: &mut Canvas, [x, y]: [i32; 2], [r, g, b]: [u8; 3]) {
    let (x, y, side) = (f64::from(x), f64::from(y), f64::from(CELL - 2));
    canvas.fill_rectangle(&Rect::new(x, y, x + side, y + side), [r, g, b, 255]);
}

fn swatch(canvas: &mut Canvas, corner: [i32; 2], color: [u8; 3]) {
    fill(canvas, corner, [120; 3]);
    let [x, y] = corner.map(|at| f64::from(at) + 1.0);
    let side = f64::from(CELL - 4);
    let [r, g, b] = color;
    canvas.fill_rectangle(&Rect::new(x, y, x + side, y + side), [r, g, b, 255]);
}

/// Writes a text from bottom to top; `at` is its lower left corner, where the first letter stands.
fn upwards(canvas: &mut Canvas, at: [i32; 2], text: &str) {
    let [width, height] = text_size(text, 1).map(|side| side.max(1));
    let mut line = Canvas::new([width as u32, height as u32], PAPER);
    line.text([0, 0], text, TextStyle::plain(INK));
    let line = line.into_rgb();
    let turned = RgbImage {
        size: [line.size[1], line.size[0]],
        pixels: (0..line.size[0])
            .rev()
            .flat_map(|x| (0..line.size[1]).map(move |y| (x, y)))
            .flat_map(|(x, y)| {
                let start = 3 * (y * line.size[0] + x) as usize;
                [line.pixels[start], line.pixels[start + 1], line.pixels[start + 2]]
            })
            .collect(),
    };
    canvas.paste(&turned, [at[0], at[1] - width]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn diagonal_is_green_and_what_is_off_it_red() {
        let class = |name: &str| ConfusionClass { name: name.to_owned(), color: [1, 2, 3] };
        let picture = confusion_picture("t", &[class("a"), class("b")], &[9, 1, 0, 5]);
        let [width, height] = picture.size.map(|side| side as usize);
        // A corner of a cell, where no number stands; cells are counted from the last.
        let cell = |row: usize, column: usize| {
            let back = |at: usize| MARGIN as usize + (2 - at) * CELL as usize - 2;
            let start = 3 * ((height - back(row)) * width + width - back(column));
            [picture.pixels[start], picture.pixels[start + 1], picture.pixels[start + 2]]
        };
        assert!(cell(0, 0)[1] > cell(0, 0)[0] && cell(1, 1)[1] > cell(1, 1)[0]);
        assert!(cell(0, 1)[0] > cell(0, 1)[1]);
        assert_eq!(cell(1, 0), [255, 255, 255]);
    }
}
