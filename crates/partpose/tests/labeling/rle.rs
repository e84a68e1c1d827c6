//! Run lengths against what pycocotools makes of the same masks, and against themselves.

use partpose::parts::rle::{CocoRle, Rle};
use proptest::prelude::*;

#[derive(serde::Deserialize)]
struct Golden {
    cases: Vec<Case>,
}

#[derive(serde::Deserialize)]
struct Case {
    size: [u32; 2],
    formula: [u64; 6],
    counts: String,
    area: u64,
    bbox: [u32; 4],
}

fn pixels(case: &Case) -> Vec<bool> {
    let [p, q, r, s, m, t] = case.formula;
    let at = |x: u64, y: u64| (p * x * x + q * y * y + r * x * y + s) % m < t;
    let [width, height] = case.size.map(u64::from);
    (0..height).flat_map(|y| (0..width).map(move |x| at(x, y))).collect()
}

#[test]
fn runs_area_and_box_match_pycocotools() {
    let golden: Golden = serde_json::from_str(include_str!("rle.json")).unwrap();
    assert!(golden.cases.len() > 15);
    for case in golden.cases {
        let inside = pixels(&case);
        let rle = Rle::encode(case.size, &inside);
        let [width, height] = case.size;
        let coco = CocoRle { size: [height, width], counts: case.counts.clone() };
        assert_eq!(rle.to_coco(), coco, "{:?}", case.formula);
        assert_eq!((rle.area(), rle.bounds()), (case.area, case.bbox), "{:?}", case.formula);
        assert_eq!(Rle::from_coco(&coco).unwrap(), rle);
        assert_eq!(rle.decode(), inside);
    }
}

fn masks() -> impl Strategy<Value = ([u32; 2], Vec<bool>, Vec<bool>)> {
    (0..12u32, 0..12u32).prop_flat_map(|(width, height)| {
        let count = (width * height) as usize;
        let mask = || prop::collection::vec(any::<bool>(), count);
        (Just([width, height]), mask(), mask())
    })
}

proptest! {
    #[test]
    fn mask_survives_text((size, inside, _) in masks()) {
        let rle = Rle::encode(size, &inside);
        let read = Rle::from_coco(&rle.to_coco()).unwrap();
        prop_assert_eq!(read.decode(), inside);
        prop_assert_eq!(read, rle);
    }

    #[test]
    fn merged_masks_are_those_of_the_pixels((size, a, b) in masks()) {
        let both = |keep: fn(bool, bool) -> bool| -> Vec<bool> {
            a.iter().zip(&b).map(|(a, b)| keep(*a, *b)).collect()
        };
        let (a, b) = (Rle::encode(size, &a), Rle::encode(size, &b));
        prop_assert_eq!(a.union(&b).unwrap(), Rle::encode(size, &both(|a, b| a || b)));
        prop_assert_eq!(a.intersection(&b).unwrap(), Rle::encode(size, &both(|a, b| a && b)));
    }

    #[test]
    fn any_text_is_a_mask_or_an_error(width in 0..2000u32, height in 0..2000u32, counts in ".{0,40}") {
        if let Ok(rle) = Rle::from_coco(&CocoRle { size: [height, width], counts }) {
            let pixels: u64 = rle.counts().iter().map(|count| u64::from(*count)).sum();
            prop_assert_eq!(pixels, u64::from(width) * u64::from(height));
        }
    }

    #[test]
    fn text_of_the_right_characters_is_a_mask_or_an_error(width in 0..40u32, height in 0..40u32, counts in "[0-o]{0,12}") {
        if let Ok(rle) = Rle::from_coco(&CocoRle { size: [height, width], counts }) {
            let again = Rle::from_coco(&rle.to_coco()).unwrap();
            prop_assert_eq!(again.decode().len(), (width * height) as usize);
        }
    }
}
