//! Pages in headless Chromium, where there is one: what they become, and what they complain about.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Where browsers are looked for besides the variable `CHROMIUM`.
const PLACES: [&str; 3] =
    ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];

/// Longest that a page may take, seconds.
const PATIENCE: &str = "120";

fn browser() -> Option<PathBuf> {
    let named = std::env::var_os("CHROMIUM").map(PathBuf::from);
    named.into_iter().chain(PLACES.map(PathBuf::from)).find(|path| path.is_file())
}

/// Opens a page from disk, without a network, and gives the document as it is then; `None` without a browser, which is
/// told. A message of the page to the console fails the test.
#[expect(clippy::print_stderr, reason = "a test that is skipped says so")]
pub(crate) fn open(page: &Path, fragment: &str, screenshot: Option<&Path>) -> Option<String> {
    let Some(browser) = browser() else {
        eprintln!(
            "skipped: no Chromium is installed (`apt-get install chromium`, or set CHROMIUM)"
        );
        return None;
    };
    let profile = tempfile::tempdir().unwrap();
    let mut command = Command::new("timeout");
    command
        .arg(PATIENCE)
        .arg(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
        .args(["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"])
        .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
        // Nothing that a page asks of a network is answered.
        .arg("--host-resolver-rules=MAP * ~NOTFOUND")
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .args(["--window-size=1280,760", "--virtual-time-budget=8000", "--enable-logging=stderr"]);
    match screenshot {
        Some(path) => command.arg(format!("--screenshot={}", path.display())),
        None => command.arg("--dump-dom"),
    };
    command.arg(format!("file://{}{fragment}", page.canonicalize().unwrap().display()));
    let output = command.stdin(Stdio::null()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    // What the software renderer says of its own speed is no complaint of the page.
    let complaint = |line: &&str| line.contains("CONSOLE") && !line.contains("GL Driver Message");
    let complaints: Vec<&str> = said.lines().filter(complaint).collect();
    assert!(complaints.is_empty(), "{complaints:#?}");
    assert!(output.status.success(), "{said}");
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// A copy of a page in which a script runs after its own.
pub(crate) fn with_script(page: &Path, script: &str) -> PathBuf {
    let html = std::fs::read_to_string(page).unwrap();
    let path = page.with_extension("scripted.html");
    let html = html.replace("</body>", &format!("<script>{script}</script></body>"));
    std::fs::write(&path, html).unwrap();
    path
}

/// Nothing in a page may name a place outside of it.
pub(crate) fn is_self_contained(html: &str) -> bool {
    let outside = ["src=\"http", "href=\"http", "src=\"//", "@import", "url(http", "fetch("];
    outside.iter().all(|word| !html.contains(word))
}
