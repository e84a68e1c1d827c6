//! The page in 3D: what it holds, and that a browser shows it.

use std::fs;
use std::path::Path;

use super::{browser, run};

fn page() -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    run(root, &["demo", "--out", "demo", "--scenes", "2"]);
    let arguments = ["view", "demo", "--images", "demo/images", "--truth", "demo/truth", "--out"];
    let said = run(root, &[&arguments[..], &["view.html"]].concat());
    assert!(said.contains("vehicles of 2 images to `view.html`\n--- exit 0"), "{said}");
    let page = root.join("view.html");
    (folder, page)
}

#[test]
fn a_browser_shows_the_vehicles_and_tells_the_figures_of_the_one_that_is_clicked() {
    let (_folder, page) = page();
    let html = fs::read_to_string(&page).unwrap();
    assert!(browser::is_self_contained(&html));
    // Draws, counts the pixels that a part's colour can have, clicks where the first label says a vehicle is, and goes
    // to the second frame.
    let script = r##"
        setTimeout(() => {
            const canvas = document.getElementById("canvas"), gl = canvas.getContext("webgl");
            dispatchEvent(new Event("resize"));
            const pixels = new Uint8Array(canvas.width * canvas.height * 4);
            gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
            let colored = 0;
            for (let i = 0; i < pixels.length; i += 4)
                if (Math.max(pixels[i], pixels[i + 1], pixels[i + 2]) - Math.min(pixels[i], pixels[i + 1], pixels[i + 2]) > 60) colored++;
            document.body.dataset.colored = String(colored > 2000);
            const label = document.querySelector("#labels span"), area = canvas.getBoundingClientRect();
            const at = { clientX: area.left + parseFloat(label.style.left), clientY: area.top + parseFloat(label.style.top) + 25, pointerId: 1 };
            canvas.setPointerCapture = () => {};
            for (const kind of ["pointerdown", "pointerup"]) canvas.dispatchEvent(new PointerEvent(kind, at));
            document.body.dataset.clicked = document.body.dataset.selected;
            document.body.dataset.facts = String(document.querySelectorAll("#facts tr").length);
            document.getElementById("parts-none").click();
            document.getElementById("inside").click();
            document.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight", bubbles: true }));
        }, 1500);"##;
    let scripted = browser::with_script(&page, script);
    let Some(document) = browser::open(&scripted, "", None) else { return };
    let has = |name: &str, value: &str| {
        assert!(document.contains(&format!("data-{name}=\"{value}\"")), "{name} is not {value}");
    };
    has("state", "ready");
    has("errors", "0");
    has("colored", "true");
    has("frame", "1");
    let clicked = document.split("data-clicked=\"").nth(1).unwrap();
    assert!(!clicked.starts_with('-'), "no vehicle was hit");
    let facts = document.split("data-facts=\"").nth(1).unwrap().split('"').next().unwrap();
    assert!(facts.parse::<u32>().unwrap() >= 10, "{facts}");
}

#[test]
fn names_from_files_are_no_markup() {
    let (folder, _) = page();
    let path = folder.path().join("demo/scene-1.json");
    let evil = "</script><script>document.body.dataset.state='taken'</script>";
    let text = fs::read_to_string(&path).unwrap().replace("scene-1.png", evil);
    fs::write(&path, text).unwrap();
    let said = run(folder.path(), &["view", "demo/scene-1.json", "--title", evil]);
    assert!(said.ends_with("--- exit 0\n"), "{said}");
    let html = fs::read_to_string(folder.path().join("view.html")).unwrap();
    assert!(!html.contains(evil));
    let Some(document) = browser::open(&folder.path().join("view.html"), "", None) else { return };
    assert!(document.contains("data-state=\"ready\""));
}

#[test]
fn a_scene_is_written_as_glb() {
    let (folder, _) = page();
    let arguments = ["export", "--results", "demo/scene-1.json", "--to", "glb", "--out", "glb"];
    let more = ["--images", "demo/images", "--truth", "demo/truth"];
    let said = run(folder.path(), &[&arguments[..], &more[..]].concat());
    assert!(said.ends_with("--- exit 0\n"), "{said}");
    let glb = fs::read(folder.path().join("glb/scene-1.glb")).unwrap();
    assert_eq!(&glb[..4], b"glTF");
}

#[test]
fn what_is_no_result_is_named() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.json"), "{\"image\": 3}").unwrap();
    let said = run(folder.path(), &["view", "a.json"]);
    assert!(
        said.contains("error: `a.json` is not a result") && said.ends_with("exit 2\n"),
        "{said}"
    );
    assert!(!Path::new(&folder.path().join("view.html")).exists());
}
