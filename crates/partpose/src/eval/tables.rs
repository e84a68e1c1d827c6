//! The paper's Tables III to V, and scores by distance, occlusion and truncation.

use serde::{Deserialize, Serialize};

use crate::parts::Scaling;
use crate::pose::{Center2d, Center3d, PartFilters, PoseOptions};

use super::{Configuration, PoseScores, Scored, Table, summarize};

/// The kernel sizes of the paper.
const KERNELS: [usize; 4] = [14, 28, 42, 56];
/// The pairs of centres of the paper.
const PAIRS: [(&str, Center2d, Center3d); 2] = [
    ("CM / CM", Center2d::Mass, Center3d::Mass),
    ("RECT / CUB", Center2d::Rectangle, Center3d::Cuboid),
];

/// The rows of Tables III, IV and V in their order, for the paper's solver or another in `base`.
///
/// The filters of `base` are those of Table V's last row; III and IV have none.
pub fn paper_configurations(base: &PoseOptions) -> Vec<Configuration> {
    let mut rows = Vec::new();
    for (table, scaling) in [("III", Scaling::Bilinear), ("IV", Scaling::Nearest)] {
        for kernel in KERNELS {
            for (pair, center_2d, center_3d) in PAIRS {
                let filters = PartFilters::default();
                let pose = PoseOptions { scaling, center_2d, center_3d, filters, ..*base };
                let name = format!("{table}: {kernel} {pair}");
                rows.push(Configuration { name, kernel, pose, degradation: None });
            }
        }
    }
    let without_border = PartFilters { image_border: None, ..base.filters };
    let tuned = [
        ("baseline", PartFilters::default()),
        ("-SP +BL +WL", without_border),
        ("-SP +BL +WL +CFIX", base.filters),
    ];
    for (step, filters) in tuned {
        let pose = PoseOptions {
            scaling: Scaling::Bilinear,
            center_2d: Center2d::Rectangle,
            center_3d: Center3d::Cuboid,
            filters,
            ..*base
        };
        let name = format!("V: {step}");
        rows.push(Configuration { name, kernel: 56, pose, degradation: None });
    }
    rows
}

/// Tables III, IV and V from the scores of [`paper_configurations`], by the names of the rows.
pub fn paper_tables(rows: &[(String, PoseScores)]) -> Vec<Table> {
    let titles = [
        ("III", "Table III: bilinear scaling"),
        ("IV", "Table IV: nearest-neighbour scaling"),
        ("V", "Table V: filters, 56 x 56, bilinear, RECT / CUB"),
    ];
    let table = |(key, title): (&str, &str)| {
        let mine = rows.iter().filter_map(|(name, scores)| {
            let (table, row) = name.split_once(": ")?;
            (table == key).then(|| (row.to_owned(), *scores))
        });
        score_table(title, &mine.collect::<Vec<_>>())
    };
    titles.into_iter().map(table).collect()
}

/// Scores as the paper prints them, a row a name: percent, metres, radians.
pub fn score_table(title: &str, rows: &[(String, PoseScores)]) -> Table {
    let columns = [
        "",
        "count",
        "unfittable %",
        "model %",
        "3D IoU %",
        "median IoU %",
        "ΔT m",
        "ΔR rad",
        "Δx",
        "Δy",
        "Δz",
        "Δαx",
        "Δαy",
        "Δαz",
        "IoU of all %",
    ];
    let mut table = Table::new(title, &columns);
    for (name, s) in rows {
        let two = |value: f64| if value.is_nan() { String::new() } else { format!("{value:.2}") };
        let percent = |share: f64| two(100.0 * share);
        let mut cells = vec![name.clone(), s.count.to_string()];
        cells.extend([s.unfittable, s.model_precision, s.mean_iou3d, s.median_iou3d].map(percent));
        cells.extend([s.delta_t, s.delta_r].map(two));
        cells.extend(s.delta_xyz.map(two));
        cells.extend(s.delta_angles.map(two));
        cells.push(percent(s.mean_iou3d_all));
        table.rows.push(cells);
    }
    table
}

/// What a breakdown needs to know of a scored vehicle.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Stratum {
    /// Metres along the viewing axis.
    pub depth: f64,
    /// The data set's level, 0 to 2.
    pub occluded: u8,
    /// The data set's level, 0 to 2.
    pub truncated: u8,
    /// Visible pixels over pixels of the box, where the data set has it: what is hidden, in steps.
    pub occupancy: Option<f64>,
}

/// Scores by distance, occlusion and truncation.
pub fn breakdown(scored: &[(Stratum, Scored)]) -> Vec<(String, PoseScores)> {
    let pick = |name: &str, keep: &dyn Fn(&Stratum) -> bool| {
        let scores = summarize(scored.iter().filter(|(s, _)| keep(s)).map(|(_, scored)| *scored));
        (scores.count > 0).then(|| (name.to_owned(), scores))
    };
    let mut rows = vec![pick("all", &|_| true)];
    let limits = [0.0, 10.0, 20.0, 30.0, 40.0, 60.0, f64::INFINITY];
    for pair in limits.windows(2) {
        let name = if pair[1].is_finite() {
            format!("{} to {} m", pair[0], pair[1])
        } else {
            format!("beyond {} m", pair[0])
        };
        rows.push(pick(&name, &|s| (pair[0]..pair[1]).contains(&s.depth)));
    }
    let levels = [("not occluded", "not truncated"), ("occluded", "truncated")];
    for (level, (occluded, truncated)) in (0u8..).zip(levels) {
        rows.push(pick(occluded, &|s| s.occluded.min(1) == level));
        rows.push(pick(truncated, &|s| s.truncated.min(1) == level));
    }
    for [low, high] in [[0, 30], [30, 60], [60, 100]] {
        let inside = move |share: f64| {
            let percent = 100.0 * share;
            percent >= f64::from(low) && (percent < f64::from(high) || high == 100)
        };
        let name = format!("fills {low} to {high} % of its box");
        rows.push(pick(&name, &|s| s.occupancy.is_some_and(inside)));
    }
    rows.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paper_has_sixteen_rows_and_three_steps() {
        let rows = paper_configurations(&PoseOptions::default());
        assert_eq!(rows.len(), 19);
        assert_eq!(
            rows.last().map(|row| (row.kernel, row.pose.filters)),
            Some((56, PartFilters::ALL))
        );
        let scores: Vec<_> = rows.iter().map(|row| (row.name.clone(), summarize([]))).collect();
        let tables = paper_tables(&scores);
        assert_eq!(tables.iter().map(|table| table.rows.len()).collect::<Vec<_>>(), [8, 8, 3]);
    }

    #[test]
    fn breakdown_leaves_out_what_is_empty() {
        let stratum = Stratum { depth: 12.0, occluded: 1, truncated: 0, occupancy: Some(0.4) };
        let rows = breakdown(&[(stratum, None)]);
        let names: Vec<&str> = rows.iter().map(|(name, _)| name.as_str()).collect();
        let filled = "fills 30 to 60 % of its box";
        assert_eq!(names, ["all", "10 to 20 m", "not truncated", "occluded", filled]);
    }
}
