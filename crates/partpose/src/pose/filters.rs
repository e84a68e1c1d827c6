//! Which parts may speak: the filters of the paper's Table V.

use serde::{Deserialize, Serialize};

use crate::geometry::Rect;
use crate::parts::{PartClass, PartGroup, PartMap};

use super::PartEvidence;

/// Smallest share of the detection box that a part must exceed; the paper does not give its own.
///
/// On 225 unoccluded cars it keeps 7 / 11 / 13 parts (5 / 50 / 95 %), never fewer than 4.
pub const DEFAULT_SMALL_PART: f64 = 0.005;

/// The four filters; the default is none, the paper's baseline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PartFilters {
    /// -SP: keep a part only if its share of the box exceeds this.
    pub small_parts: Option<f64>,
    /// +WL: lights and mirrors pass -SP whatever their size.
    pub whitelist: bool,
    /// +BL: sides, aprons and roof never speak.
    pub blacklist: bool,
    /// +CFIX: parts with a pixel in this many outermost rows or columns of the image do not speak.
    pub image_border: Option<u32>,
}

impl PartFilters {
    /// All filters, the last row of Table V.
    pub const ALL: Self = Self {
        small_parts: Some(DEFAULT_SMALL_PART),
        whitelist: true,
        blacklist: true,
        image_border: Some(1),
    };

    /// Removes what must not speak; `bounds` is the detection box, clipped to the image for its area.
    pub fn apply(&self, parts: &mut PartMap<PartEvidence>, bounds: &Rect, image_size: [u32; 2]) {
        let [width, height] = image_size.map(f64::from);
        let image = Rect::new(-0.5, -0.5, width - 0.5, height - 0.5);
        let area = bounds.intersection(&image).map_or(0.0, |clipped| clipped.area());
        parts.retain(|class, part| self.keeps(class, part, area, &image));
    }

    fn keeps(&self, class: PartClass, part: &PartEvidence, area: f64, image: &Rect) -> bool {
        if self.blacklist && class.group() == PartGroup::Blacklist {
            return false;
        }
        let exempt = self.whitelist && class.group() == PartGroup::Whitelist;
        if let Some(share) = self.small_parts
            && !exempt
            && part.pixels as f64 <= share * area
        {
            return false;
        }
        let Some(border) = self.image_border else { return true };
        let border = f64::from(border);
        part.bounds.x_min >= image.x_min + border
            && part.bounds.y_min >= image.y_min + border
            && part.bounds.x_max <= image.x_max - border
            && part.bounds.y_max <= image.y_max - border
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parts::PartMask;
    use crate::pose::{Center2d, part_evidence};

    /// A box of 20 x 10 px at the left border of an image: hood 2 px, lamp 1 px, side 40 px, trunk at the border.
    fn parts() -> PartMap<PartEvidence> {
        let mut mask = PartMask::background([0, 0], [20, 10]);
        let mut paint = |x: usize, y: usize, label| mask.labels[y * 20 + x] = label;
        paint(5, 5, 27);
        paint(6, 5, 27);
        paint(8, 5, 1);
        (0..40).for_each(|i| paint(10 + i % 8, i / 8, 15));
        (0..9).for_each(|y| paint(0, y, 26));
        part_evidence(&mask, Center2d::Mass)
    }

    fn kept(filters: PartFilters) -> Vec<u8> {
        let mut parts = parts();
        filters.apply(&mut parts, &Rect::new(-0.5, -0.5, 19.5, 9.5), [100, 100]);
        parts.iter().map(|(class, _)| class.id()).collect()
    }

    #[test]
    fn each_filter_drops_its_own() {
        let none = PartFilters::default();
        assert_eq!(kept(none), [1, 15, 26, 27]);
        assert_eq!(kept(PartFilters { small_parts: Some(0.02), ..none }), [15, 26]);
        assert_eq!(
            kept(PartFilters { small_parts: Some(0.02), whitelist: true, ..none }),
            [1, 15, 26]
        );
        assert_eq!(kept(PartFilters { blacklist: true, ..none }), [1, 26, 27]);
    }

    #[test]
    fn part_at_the_image_border_is_dropped() {
        let filters = PartFilters { image_border: Some(1), ..Default::default() };
        // The side reaches row 0, the trunk column 0.
        assert_eq!(kept(filters), [1, 27]);
    }

    #[test]
    fn share_must_be_exceeded() {
        // The hood has exactly 2 of 200 pixels.
        assert_eq!(kept(PartFilters { small_parts: Some(0.01), ..Default::default() }), [15, 26]);
    }
}
