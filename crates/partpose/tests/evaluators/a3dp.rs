use partpose::eval::a3dp::{A3dpDistance, A3dpMatching, parse_similarity, read_a3dp, score_a3dp};
use partpose::files;

use super::shared;

/// What the evaluator of the `dataset-api` prints for its own example (commit 1b42203, `test_eval_data/res.txt`).
///
/// The `res.txt` of an earlier commit, 0.0768 and so on, belongs to other results: it has different recalls with 10 and
/// with 100 results an image, and no image here has more than 6.
const PRINTED: [(&str, &str); 12] = [
    ("AP", "0.1093"),
    ("AP_c0", "0.2360"),
    ("AP_c3", "0.1616"),
    ("AP_s", "0.0792"),
    ("AP_m", "0.1295"),
    ("AP_l", "0.1190"),
    ("AR_1", "0.0948"),
    ("AR_10", "0.1980"),
    ("AR_100", "0.1980"),
    ("AR_s", "0.1313"),
    ("AR_m", "0.2176"),
    ("AR_l", "0.2265"),
];

#[test]
fn every_printed_digit_of_the_released_evaluator_comes_out() {
    let Some(folder) = shared("a3dp") else { return };
    let path = folder.join("sim_mat.txt");
    let similarity = parse_similarity(&path, &files::read_text(&path).unwrap()).unwrap();
    let files =
        read_a3dp(&folder.join("det3d_gt"), &folder.join("det3d_res"), &similarity).unwrap();
    assert_eq!(files.images.len(), 57);
    assert!(files.images.iter().all(|image| image.results.len() <= 6));
    let scores =
        score_a3dp(&files.images, &similarity, A3dpDistance::Absolute, A3dpMatching::Released);
    let printed: Vec<(&str, String)> = scores
        .figures
        .iter()
        .map(|(name, value)| (*name, format!("{:.4}", value.unwrap())))
        .collect();
    let expected: Vec<(&str, String)> =
        PRINTED.iter().map(|(name, value)| (*name, (*value).to_owned())).collect();
    assert_eq!(printed, expected);
}
