//! The figures of data sets beside each other, as a text table.

use std::fmt::Write;

use partpose::parts::PartClass;

use super::Statistics;

const DISTANCES: [&str; 7] = ["0-5", "5-10", "10-20", "20-30", "30-45", "45-70", "70-"];
const FIFTHS: [&str; 5] = ["0.0-0.2", "0.2-0.4", "0.4-0.6", "0.6-0.8", "0.8-1.0"];
const CUT: [&str; 6] = ["none", "0.0-0.2", "0.2-0.4", "0.4-0.6", "0.6-0.8", "0.8-1.0"];
const TURNS: [&str; 8] =
    ["-180..-135", "-135..-90", "-90..-45", "-45..0", "0..45", "45..90", "90..135", "135..180"];

/// One of the two distributions that all data sets have.
type Bins<'a> = (&'a str, &'a [&'a str], fn(&Statistics) -> &[usize]);

/// The figures of one data set, or of several beside each other; of two with the ratio of their shares.
///
/// Shares of parts are of all pixels that show a part, the others of all rows of cars.
pub fn statistics_table(sets: &[(&str, &Statistics)]) -> String {
    let mut text = String::new();
    let mut header: Vec<String> = sets.iter().map(|(name, _)| (*name).to_owned()).collect();
    if sets.len() == 2 {
        header.push("ratio".to_owned());
    }
    line(&mut text, "", &header);
    let counts: [(&str, fn(&Statistics) -> u64); 5] = [
        ("frames", |set| set.frames as u64),
        ("rows of cars", |set| set.rows as u64),
        ("those that count", |set| set.counted as u64),
        ("rows of other vehicles", |set| set.others as u64),
        ("vehicle pixels", Statistics::part_pixels),
    ];
    for (name, of) in counts {
        let cells: Vec<String> = sets.iter().map(|(_, set)| of(set).to_string()).collect();
        line(&mut text, name, &cells);
    }
    for (i, name) in ["mean width m", "mean height m", "mean length m"].into_iter().enumerate() {
        let values: Vec<f64> = sets.iter().map(|(_, set)| set.mean_size()[i]).collect();
        line(&mut text, name, &beside(&values, |value| format!("{value:.2}")));
    }
    for part in PartClass::ALL {
        let name = format!("{} {}", part.id(), part.name());
        let values: Vec<f64> = sets.iter().map(|(_, set)| set.share(part)).collect();
        line(&mut text, &name, &shares(&values));
    }
    let bins: [Bins; 4] = [
        ("distance m", &DISTANCES, |set| &set.distances),
        ("occupancy", &FIFTHS, |set| &set.occupancy),
        ("truncation", &CUT, |set| &set.truncation),
        ("alpha deg", &TURNS, |set| &set.alpha),
    ];
    for (title, names, of) in bins {
        for (i, name) in names.iter().enumerate() {
            let values: Vec<f64> =
                sets.iter().map(|(_, set)| of(set)[i] as f64 / set.rows.max(1) as f64).collect();
            line(&mut text, &format!("{title} {name}"), &shares(&values));
        }
    }
    text
}

/// Per cent, and the ratio of two.
fn shares(values: &[f64]) -> Vec<String> {
    beside(values, |value| format!("{:.2} %", 100.0 * value))
}

/// As text, and the ratio of two.
fn beside(values: &[f64], text: impl Fn(f64) -> String) -> Vec<String> {
    let mut cells: Vec<String> = values.iter().map(|value| text(*value)).collect();
    if let [a, b] = values {
        cells.push(if *b > 0.0 { format!("{:.2}", a / b) } else { "-".to_owned() });
    }
    cells
}

fn line(text: &mut String, name: &str, cells: &[String]) {
    let _ = write!(text, "{name:<24}");
    for cell in cells {
        let _ = write!(text, "{cell:>14}");
    }
    text.push('\n');
}
