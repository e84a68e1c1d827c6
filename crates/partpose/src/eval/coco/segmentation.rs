//! The three ways in which COCO's JSON writes a mask.

use serde::Deserialize;

use crate::parts::rle::{CocoRle, MAX_PIXELS, Rle, RleBuilder, RleError};

use super::polygon::rasterize;

/// A mask as it stands in a file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Segmentation {
    /// Corners `x, y, x, y ...` of one or several polygons, pixels.
    Polygons(Vec<Vec<f64>>),
    /// Runs.
    Runs {
        /// Height and width in pixels.
        size: [u32; 2],
        /// The runs.
        counts: Counts,
    },
}

/// Runs as text or as numbers.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Counts {
    /// Compressed.
    Text(String),
    /// Lengths, the first of them outside.
    Lengths(Vec<u32>),
}

/// Why a segmentation is no mask of its image.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SegmentationError {
    /// Not a run-length encoding.
    #[error("has a segmentation that cannot be read: {0}")]
    Runs(RleError),
    /// Runs that do not fill the mask.
    #[error("has runs of {pixels} pixels, but the mask has {width} x {height}")]
    Total {
        /// Their sum.
        pixels: u64,
        /// Width of the mask.
        width: u32,
        /// Height of the mask.
        height: u32,
    },
    /// A mask of another size than its image.
    #[error("has a mask of {} x {} pixels in an image of {} x {}", mask[0], mask[1], image[0], image[1])]
    Size {
        /// Width and height of the mask.
        mask: [u32; 2],
        /// Width and height of the image.
        image: [u32; 2],
    },
    /// A polygon needs to know the image's size.
    #[error("has polygons, but its image has no `width` and `height`")]
    UnknownSize,
    /// Coordinates that are none.
    #[error("has a polygon that is none: {0}")]
    Polygon(&'static str),
}

/// The pixels of a segmentation of an image of this width and height, if they are known.
pub fn segmentation_rle(
    segmentation: &Segmentation,
    image: Option<[u32; 2]>,
) -> Result<Rle, SegmentationError> {
    let rle = match segmentation {
        Segmentation::Polygons(polygons) => {
            let size = image.ok_or(SegmentationError::UnknownSize)?;
            let mut whole = RleBuilder::new(size).finish();
            for polygon in polygons {
                let part = rasterize(polygon, size).map_err(SegmentationError::Polygon)?;
                whole = whole.union(&part).unwrap_or(whole);
            }
            whole
        }
        Segmentation::Runs { size, counts: Counts::Text(text) } => {
            let coco = CocoRle { size: *size, counts: text.clone() };
            Rle::from_coco(&coco).map_err(SegmentationError::Runs)?
        }
        Segmentation::Runs { size, counts: Counts::Lengths(lengths) } => {
            from_lengths(*size, lengths)?
        }
    };
    match image {
        Some(image) if image != rle.size() => {
            Err(SegmentationError::Size { mask: rle.size(), image })
        }
        _ => Ok(rle),
    }
}

fn from_lengths([height, width]: [u32; 2], lengths: &[u32]) -> Result<Rle, SegmentationError> {
    let pixels = lengths.iter().map(|length| u64::from(*length)).sum();
    if u64::from(height) * u64::from(width) > MAX_PIXELS {
        return Err(SegmentationError::Runs(RleError::TooLarge { width, height }));
    }
    if pixels != u64::from(height) * u64::from(width) {
        return Err(SegmentationError::Total { pixels, width, height });
    }
    let mut builder = RleBuilder::new([width, height]);
    let mut at = 0;
    for (run, length) in lengths.iter().enumerate() {
        if run % 2 == 1 {
            push_run(&mut builder, height, [at, at + length]);
        }
        at += length;
    }
    Ok(builder.finish())
}

/// Adds the pixels `from..to`, counted by columns of `height`.
pub(super) fn push_run(builder: &mut RleBuilder, height: u32, [mut from, to]: [u32; 2]) {
    while from < to {
        let end = to.min((from / height + 1) * height);
        builder.push(from / height, from % height, end - from);
        from = end;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(json: &str, image: Option<[u32; 2]>) -> Result<Rle, SegmentationError> {
        segmentation_rle(&serde_json::from_str(json).unwrap(), image)
    }

    #[test]
    fn lengths_text_and_polygons_give_the_same_mask() {
        let lengths = read(r#"{"size": [4, 3], "counts": [5, 2, 5]}"#, Some([3, 4])).unwrap();
        assert_eq!(lengths.counts(), [5, 2, 5]);
        let text = read(r#"{"size": [4, 3], "counts": "525"}"#, None).unwrap();
        let polygon = read("[[1, 1, 2, 1, 2, 3, 1, 3]]", Some([3, 4])).unwrap();
        assert_eq!((&text, &polygon), (&lengths, &lengths));
    }

    #[test]
    fn a_mask_that_does_not_fit_is_refused() {
        for (json, size) in [
            (r#"{"size": [4, 3], "counts": [5, 2]}"#, Some([3, 4])),
            (r#"{"size": [4, 3], "counts": [12]}"#, Some([4, 3])),
            (r#"{"size": [100000, 100000], "counts": [12]}"#, None),
            (r#"{"size": [4, 3], "counts": "T"}"#, None),
            ("[[1, 1, 2, 2, 3, 3]]", None),
            ("[[1, 1, 2]]", Some([3, 4])),
            ("[[1, 1, 1e300, 2, 2, 2]]", Some([3, 4])),
        ] {
            assert!(read(json, size).is_err(), "{json}");
        }
    }
}
