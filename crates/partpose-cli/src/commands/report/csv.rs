//! Comma-separated values (RFC 4180): quoted cells, doubled quotes.

use std::path::Path;

use anyhow::bail;
use partpose::eval::Table;
use partpose::files;

/// Most cells of a file that are read.
const MOST_CELLS: usize = 20_000_000;

/// A file with a header line; every row must have as many cells.
pub(super) fn read(path: &Path) -> anyhow::Result<Table> {
    parse(path, &files::read_text(path)?)
}

fn parse(path: &Path, text: &str) -> anyhow::Result<Table> {
    let mut rows = split(text).into_iter();
    let columns = rows.next().unwrap_or_default();
    let rows: Vec<Vec<String>> = rows.collect();
    if columns.len() * rows.len() > MOST_CELLS {
        bail!("`{}` has more than {MOST_CELLS} cells", path.display());
    }
    if let Some(at) = rows.iter().position(|row| row.len() != columns.len()) {
        let (given, needed) = (rows[at].len(), columns.len());
        bail!("`{}` row {}: {given} cells, but the header has {needed}", path.display(), at + 2);
    }
    Ok(Table { title: String::new(), columns, rows })
}

fn split(text: &str) -> Vec<Vec<String>> {
    let (mut rows, mut row, mut cell) = (Vec::new(), Vec::new(), String::new());
    let mut characters = text.chars().peekable();
    let mut quoted = false;
    while let Some(character) = characters.next() {
        match character {
            '"' if quoted && characters.peek() == Some(&'"') => {
                characters.next();
                cell.push('"');
            }
            '"' => quoted = !quoted,
            ',' if !quoted => row.push(std::mem::take(&mut cell)),
            '\r' if !quoted => {}
            '\n' if !quoted => {
                row.push(std::mem::take(&mut cell));
                rows.push(std::mem::take(&mut row));
            }
            other => cell.push(other),
        }
    }
    if !cell.is_empty() || !row.is_empty() {
        row.push(cell);
        rows.push(row);
    }
    rows.retain(|row| row.iter().any(|cell| !cell.is_empty()));
    rows
}

/// The position of a column.
pub(super) fn column(table: &Table, name: &str) -> Option<usize> {
    table.columns.iter().position(|column| column == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_tables_write_is_read_back() {
        let mut table = Table::new("", &["a", "b,c"]);
        table.rows.push(vec!["x \"y\"".to_owned(), "1\n2".to_owned()]);
        table.rows.push(vec!["3".to_owned(), String::new()]);
        assert_eq!(parse(Path::new("a.csv"), &table.to_csv()).unwrap(), table);
        let said = parse(Path::new("a.csv"), "a,b\r\n1,2\r\n1\r\n").unwrap_err().to_string();
        assert_eq!(said, "`a.csv` row 3: 1 cells, but the header has 2");
    }
}
