//! What is said of the parts of vehicles: on a data set of whole vehicles everything but "agrees" is a false alarm.

use crate::parts::PartClass;
use crate::pose::{PartState, PartVerdict};

use super::Table;

/// One verdict a column of [`part_table`].
const VERDICTS: [(PartVerdict, &str); 6] = [
    (PartVerdict::Agrees, "agrees %"),
    (PartVerdict::Missing, "missing %"),
    (PartVerdict::Displaced, "displaced %"),
    (PartVerdict::Unexpected, "unexpected %"),
    (PartVerdict::Hidden, "hidden %"),
    (PartVerdict::TooSmall, "too small %"),
];

/// How often each part was said to be what, in percent of the vehicles whose mask or model shows it.
pub fn part_table(title: &str, vehicles: &[&[PartState]]) -> Table {
    let columns: Vec<&str> =
        ["part", "count"].into_iter().chain(VERDICTS.map(|(_, name)| name)).collect();
    let mut table = Table::new(title, &columns);
    let mut add = |name: &str, of: &dyn Fn(PartClass) -> bool| {
        let states: Vec<&PartState> =
            vehicles.iter().flat_map(|parts| parts.iter()).filter(|s| of(s.part)).collect();
        if states.is_empty() {
            return;
        }
        let share = |verdict: PartVerdict| {
            let said = states.iter().filter(|state| state.verdict == verdict).count();
            format!("{:.1}", 100.0 * said as f64 / states.len() as f64)
        };
        let mut cells = vec![name.to_owned(), states.len().to_string()];
        cells.extend(VERDICTS.map(|(verdict, _)| share(verdict)));
        table.rows.push(cells);
    };
    for part in PartClass::ALL {
        add(part.name(), &|other| other == part);
    }
    add("all", &|_| true);
    table
}
