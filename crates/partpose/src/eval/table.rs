//! A table of text cells, as Markdown and CSV.

use std::fmt::Write;

use serde::Serialize;

/// Rows of cells under column titles.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Table {
    /// What it shows.
    pub title: String,
    /// Titles of the columns.
    pub columns: Vec<String>,
    /// As many cells a row as there are columns.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows.
    pub fn new(title: &str, columns: &[&str]) -> Self {
        let columns = columns.iter().map(|column| (*column).to_owned()).collect();
        Self { title: title.to_owned(), columns, rows: Vec::new() }
    }

    /// GitHub's Markdown, columns padded to equal width so that it reads as text too.
    pub fn to_markdown(&self) -> String {
        let width = |column: usize| {
            let cells = self.rows.iter().map(|row| row[column].chars().count());
            cells.chain([self.columns[column].chars().count(), 3]).max().unwrap_or(3)
        };
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        let line = |cells: &[String]| {
            let padded = cells.iter().zip(&widths).map(|(cell, width)| format!(" {cell:<width$} "));
            format!("|{}|\n", padded.collect::<Vec<_>>().join("|"))
        };
        let rule = widths.iter().map(|width| "-".repeat(width + 2)).collect::<Vec<_>>().join("|");
        let mut text = format!("**{}**\n\n{}|{rule}|\n", self.title, line(&self.columns));
        self.rows.iter().for_each(|row| text.push_str(&line(row)));
        text
    }

    /// Comma-separated values with a header line; cells with commas or quotes are quoted.
    pub fn to_csv(&self) -> String {
        let cell = |text: &String| {
            if text.contains([',', '"', '\n']) {
                format!("\"{}\"", text.replace('"', "\"\""))
            } else {
                text.clone()
            }
        };
        let mut text = String::new();
        for row in std::iter::once(&self.columns).chain(&self.rows) {
            let _ = writeln!(text, "{}", row.iter().map(cell).collect::<Vec<_>>().join(","));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_reads_as_markdown_and_as_csv() {
        let mut table = Table::new("T", &["name", "x"]);
        table.rows.push(vec!["a, b".to_owned(), "1".to_owned()]);
        assert_eq!(
            table.to_markdown(),
            "**T**\n\n| name | x   |\n|------|-----|\n| a, b | 1   |\n"
        );
        assert_eq!(table.to_csv(), "name,x\n\"a, b\",1\n");
    }
}
