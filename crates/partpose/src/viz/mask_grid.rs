//! Masks of one vehicle side by side, as in the paper's Fig. 4: kernels of several sizes, scaled in several ways.

use crate::files::RgbImage;
use crate::parts::{PartClass, PartMask};

use super::canvas::{Canvas, TextStyle, text_size};

/// Free pixels around the cells.
const MARGIN: i32 = 10;
/// Height of a line of text with its distance, pixels.
const LINE: i32 = 16;
/// Width that a cell is magnified to, if whole pixels allow it.
const CELL_WIDTH: u32 = 300;
/// Largest magnification.
const MOST: u32 = 16;

const PAPER: [u8; 3] = [255; 3];
const INK: [u8; 3] = [30, 30, 30];
/// What background is drawn in, where the image is not.
const GROUND: [u8; 3] = [40, 42, 48];

/// One cell of the grid.
#[derive(Clone, Debug, PartialEq)]
pub struct MaskCell<'a> {
    /// What stands above it.
    pub title: String,
    /// What is drawn; `None` draws the image alone.
    pub mask: Option<&'a PartMask>,
}

/// Draws rows of cells that show the pixels `[x0, y0, x1, y1]` (ends exclusive) of an image, magnified by a whole number.
///
/// Masks are drawn in the author's colours over the image, which is darkened, or over a dark ground without one.
pub fn mask_grid(
    title: &str,
    image: Option<&RgbImage>,
    pixels: [i32; 4],
    rows: &[Vec<MaskCell>],
) -> RgbImage {
    let [x0, y0, x1, y1] = pixels;
    let [width, height] = [(x1 - x0).clamp(1, 2048) as u32, (y1 - y0).clamp(1, 2048) as u32];
    let zoom = (CELL_WIDTH / width).clamp(1, MOST) as i32;
    let [cell_width, cell_height] = [width as i32 * zoom, height as i32 * zoom];
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0) as i32;
    let size = [
        (MARGIN + columns * (cell_width + MARGIN)).max(text_size(title, 2)[0] + 2 * MARGIN),
        2 * LINE + MARGIN + rows.len() as i32 * (cell_height + LINE + MARGIN),
    ];
    let mut canvas = Canvas::new(size.map(|side| side.max(1) as u32), PAPER);
    canvas.text([MARGIN, MARGIN], title, TextStyle { scale: 2, ..TextStyle::plain(INK) });
    for (row, cells) in (0..).zip(rows) {
        let top = 2 * LINE + MARGIN + row * (cell_height + LINE + MARGIN);
        for (column, cell) in (0..).zip(cells) {
            let left = MARGIN + column * (cell_width + MARGIN);
            canvas.text([left, top], &cell.title, TextStyle::plain(INK));
            let shown = enlarged(cell, image, [x0, y0], [width, height], zoom as u32);
            canvas.paste(&shown, [left, top + LINE]);
        }
    }
    canvas.into_rgb()
}

fn enlarged(
    cell: &MaskCell,
    image: Option<&RgbImage>,
    [x0, y0]: [i32; 2],
    [width, height]: [u32; 2],
    zoom: u32,
) -> RgbImage {
    let size = [width * zoom, height * zoom];
    let mut pixels = Vec::with_capacity(3 * size[0] as usize * size[1] as usize);
    for y in 0..size[1] {
        for x in 0..size[0] {
            let at = [x0 + (x / zoom) as i32, y0 + (y / zoom) as i32];
            let ground = image.map_or(Some(GROUND), |image| pixel(image, at)).unwrap_or(GROUND);
            pixels.extend(match cell.mask {
                None => ground,
                Some(mask) => match PartClass::from_id(mask.at(at[0], at[1])) {
                    Some(class) => class.color(),
                    None => ground.map(|value| value / 2),
                },
            });
        }
    }
    RgbImage { size, pixels }
}

fn pixel(image: &RgbImage, [x, y]: [i32; 2]) -> Option<[u8; 3]> {
    let [x, y] = [u32::try_from(x).ok()?, u32::try_from(y).ok()?];
    if x >= image.size[0] || y >= image.size[1] {
        return None;
    }
    let start = 3 * (y as usize * image.size[0] as usize + x as usize);
    image.pixels.get(start..start + 3)?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_shows_its_mask_magnified() {
        let part = |id: u8| PartMask { origin: [4, 4], size: [2, 1], labels: vec![id, 0] };
        let masks = [part(1), part(27)];
        let row = masks
            .iter()
            .map(|mask| MaskCell { title: "m".to_owned(), mask: Some(mask) })
            .collect::<Vec<_>>();
        let picture = mask_grid("t", None, [4, 4, 24, 9], &[row]);
        let count = |id: u8| {
            let color = PartClass::from_id(id).unwrap().color();
            picture.pixels.chunks_exact(3).filter(|rgb| **rgb == color).count()
        };
        // Cells of 20 pixels are magnified to 300: each pixel 15 times.
        assert_eq!((count(1), count(27)), (225, 225));
    }
}
