//! Every command line of the guide, run as it stands there; and completions and manual pages.

use std::fs;
use std::path::{Path, PathBuf};

use super::run;

/// The pages, in the order of their names.
fn pages() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/guide");
    let mut pages: Vec<PathBuf> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    pages.retain(|page| page.extension().is_some_and(|ending| ending == "md"));
    pages.sort();
    pages
}

/// The lines that begin with `partpose` in the page's blocks of kind `console`, with continued lines joined. After the
/// kind stands what the block needs, if not everybody has it.
fn commands(page: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let mut inside = false;
    for line in page.replace("\\\n", " ").lines() {
        if let Some(kind) = line.strip_prefix("```") {
            let needs = kind.strip_prefix("console").map(str::trim);
            inside = !inside && needs.is_some_and(is_there);
        } else if inside && line.starts_with("partpose ") {
            found.push(line.split_whitespace().skip(1).map(str::to_owned).collect());
        }
    }
    found
}

/// Whether what a block needs is there.
#[expect(clippy::print_stderr, reason = "what is skipped is told")]
fn is_there(needs: &str) -> bool {
    let there = match needs {
        // Whether the library is there is found out by the program.
        "" | "onnxruntime" => true,
        "mcap" => cfg!(feature = "mcap"),
        "parquet" => cfg!(feature = "parquet"),
        other => panic!("the guide needs `{other}`, which nobody knows"),
    };
    if !there {
        eprintln!("skipped: a block of the guide needs {needs}");
    }
    there
}

/// The blocks that a page tells to write to a file: the line before names it, "`NAME`:".
fn files(page: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    for block in page.split("\n```toml\n").collect::<Vec<_>>().windows(2) {
        let name = block[0].trim_end().lines().last().unwrap_or_default();
        let name = name.rsplit('`').nth(1).unwrap_or_default();
        let content = block[1].split("\n```").next().unwrap_or_default();
        found.push((name.to_owned(), content.to_owned() + "\n"));
    }
    found
}

#[test]
#[expect(clippy::print_stderr, reason = "what is skipped is told")]
fn every_command_line_of_the_guide_runs() {
    let folder = tempfile::tempdir().unwrap();
    let mut count = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        for (name, content) in files(&text) {
            fs::write(folder.path().join(name), content).unwrap();
        }
        for command in commands(&text) {
            let arguments: Vec<&str> = command.iter().map(String::as_str).collect();
            let said = run(folder.path(), &arguments);
            if said.contains("library was not found") {
                eprintln!("skipped: there is no ONNX Runtime");
                continue;
            }
            assert!(said.ends_with("--- exit 0\n"), "{}: {command:?}\n{said}", page.display());
            count += 1;
        }
    }
    assert!(count > 25, "only {count} commands were found");
}

#[test]
fn completions_and_manual_pages_know_every_command() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let said = run(folder.path(), &["completions", shell]);
        assert!(said.contains("evaluate") && said.contains("detections"), "{shell}");
        assert!(said.ends_with("--- exit 0\n"), "{shell}");
    }
    let said = run(folder.path(), &["man", "--out", "man"]);
    assert!(said.ends_with("--- exit 0\n"), "{said}");
    for page in ["partpose", "partpose-fit", "partpose-zoo-import", "partpose-evaluate-kitti"] {
        let text = fs::read_to_string(folder.path().join(format!("man/{page}.1"))).unwrap();
        assert!(text.contains(".SH SYNOPSIS"), "{page}");
    }
    for page in fs::read_dir(folder.path().join("man")).unwrap() {
        let path = page.unwrap().path();
        let text = fs::read_to_string(&path).unwrap();
        let is_group = text.contains(".SH SUBCOMMANDS");
        assert!(is_group || text.contains("Example"), "{} has no example", path.display());
    }
}
