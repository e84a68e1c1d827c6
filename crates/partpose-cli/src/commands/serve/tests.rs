//! The server over loopback, with a detector that needs no network.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use clap::Parser;
use partpose::detection::Detection;
use partpose::files::{RgbImage, encode_png};
use partpose::geometry::Rect;
use partpose::parts::{CHANNELS, PartProbabilities};
use serde_json::{Value, json};
use tokio::net::TcpListener;
use tokio::sync::oneshot;

use super::*;

#[derive(Parser)]
struct Typed {
    #[command(flatten)]
    arguments: Arguments,
}

/// A running server; it is stopped, and must end, when this is dropped.
struct Running {
    address: SocketAddr,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<thread::JoinHandle<()>>,
    calls: Arc<AtomicUsize>,
}

/// A server whose detector takes `seconds` and finds one vehicle of the size of the image.
fn start(more: &[&str], seconds: f64) -> Running {
    // The dense fit takes long to make ready.
    let typed = ["serve", "--no-pictures", "--fit", "epnp"].into_iter().chain(more.iter().copied());
    let arguments = Typed::parse_from(typed).arguments;
    let calls = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&calls);
    let detect = Box::new(move |image: &RgbImage| {
        counted.fetch_add(1, Ordering::SeqCst);
        thread::sleep(Duration::from_secs_f64(seconds));
        let [width, height] = image.size.map(f64::from);
        assert!(width < 500.0, "a fault");
        let mut values = vec![0.0; CHANNELS * 4];
        values[4 * 5..4 * 6].fill(1.0);
        let detection = Detection {
            bounds: Rect::new(0.0, 0.0, width, height),
            score: 0.9,
            probabilities: PartProbabilities::new(2, values).unwrap(),
            unknown: None,
            size: None,
            models: None,
        };
        Ok(vec![detection])
    });
    let fitter = Fitter::new(&arguments.fit, &PathBuf::new()).unwrap();
    let limits = arguments.limits;
    let metrics = Arc::new(Metrics::default());
    let engine = Engine {
        detect,
        fitter,
        cameras: Cameras::guess(1.0),
        min_score: arguments.min_score,
        most_pixels: limits.pixels(),
    };
    let workers = Workers::start(engine, limits.workers as usize, limits.admitted(), &metrics);
    let server = Arc::new(Server::new(workers, metrics, limits));
    let (stop, stopped) = oneshot::channel();
    let (bound, address) = std::sync::mpsc::channel();
    let thread = thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().unwrap();
        runtime.block_on(async move {
            let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
            bound.send(listener.local_addr().unwrap()).unwrap();
            http::accept(listener, server, async { drop(stopped.await) }).await;
        });
    });
    Running { address: address.recv().unwrap(), stop: Some(stop), thread: Some(thread), calls }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.take();
        self.thread.take().unwrap().join().unwrap();
    }
}

impl Running {
    /// Sends bytes and goes.
    fn break_off(&self, bytes: &[u8]) {
        TcpStream::connect(self.address).unwrap().write_all(bytes).unwrap();
    }

    /// Status, head and body of what bytes are answered with; nothing where the connection is closed without an answer.
    fn raw(&self, bytes: &[u8]) -> Option<(u16, String, Vec<u8>)> {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(50))).unwrap();
        // The server may close before all is sent.
        let _ = stream.write_all(bytes);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let end = answer.windows(4).position(|bytes| bytes == b"\r\n\r\n")?;
        let head = String::from_utf8_lossy(&answer[..end]).to_lowercase();
        let status = head.split(' ').nth(1)?.parse().ok()?;
        Some((status, head, answer[end + 4..].to_vec()))
    }

    fn send(&self, method: &str, path: &str, headers: &str, body: &[u8]) -> (u16, String, Vec<u8>) {
        let head = format!(
            "{method} {path} HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Length: {}\r\n{headers}\r\n",
            body.len()
        );
        self.raw(&[head.as_bytes(), body].concat()).unwrap()
    }

    fn get(&self, path: &str) -> (u16, String) {
        let (status, _, body) = self.send("GET", path, "", b"");
        (status, String::from_utf8(body).unwrap())
    }

    fn estimate(&self, query: &str, body: &[u8]) -> (u16, Value) {
        let (status, _, body) = self.send("POST", &format!("/v1/estimate{query}"), "", body);
        (status, serde_json::from_slice(&body).unwrap())
    }
}

fn image(size: [u32; 2]) -> RgbImage {
    RgbImage { size, pixels: vec![90; 3 * size[0] as usize * size[1] as usize] }
}

fn png() -> Vec<u8> {
    encode_png(&image([40, 30]))
}

#[test]
fn an_image_gets_the_json_of_run() {
    let server = start(&[], 0.0);
    let (status, result) = server.estimate("?fx=50&fy=51&cx=20&cy=15&name=a.png", &png());
    assert_eq!((status, &result["image"]), (200, &json!("a.png")));
    assert_eq!(result["camera"]["focal"], json!([50.0, 51.0]));
    assert_eq!(result["vehicles"][0]["score"], 0.9);
    let (_, result) = server.estimate("?min_score=0.95", &png());
    assert_eq!(result["vehicles"], json!([]));
    let (_, metrics) = server.get("/metrics");
    assert!(metrics.contains("partpose_images_total 2\n"), "{metrics}");
}

#[test]
fn health_and_metadata_are_those_of_kserve() {
    let server = start(&[], 0.0);
    for path in ["/v2/health/live", "/v2/health/ready", "/v2/models/partpose/ready"] {
        assert_eq!(server.get(path).0, 200, "{path}");
    }
    let (_, text) = server.get("/v2/models/partpose/versions/1");
    let model: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(model["inputs"][0]["name"], "image");
    assert_eq!(server.get("/v2/models/other").0, 404);
    assert_eq!(server.get("/v1/estimate").0, 405);
}

#[test]
fn infer_takes_and_gives_binary_tensors() {
    let server = start(&[], 0.0);
    let file = png();
    let element = [&(file.len() as u32).to_le_bytes()[..], &file].concat();
    let camera: Vec<u8> =
        [50.0f64, 50.0, 20.0, 15.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let request = json!({
        "id": "7",
        "inputs": [
            {"name": "image", "shape": [1], "datatype": "BYTES", "parameters": {"binary_data_size": element.len()}},
            {"name": "camera", "shape": [4], "datatype": "FP64", "parameters": {"binary_data_size": camera.len()}},
        ],
        "outputs": [{"name": "result", "parameters": {"binary_data": true}}, {"name": "scores"}],
    })
    .to_string();
    let body = [request.as_bytes(), &element, &camera].concat();
    let header = format!("Inference-Header-Content-Length: {}\r\n", request.len());
    let path = "/v2/models/partpose/infer";
    let (status, head, body) = server.send("POST", path, &header, &body);
    assert_eq!(status, 200, "{}", String::from_utf8_lossy(&body));
    let length = head.split("inference-header-content-length: ").nth(1).unwrap();
    let length: usize = length.lines().next().unwrap().trim().parse().unwrap();
    let answer: Value = serde_json::from_slice(&body[..length]).unwrap();
    assert_eq!((&answer["id"], &answer["outputs"][1]["name"]), (&json!("7"), &json!("scores")));
    let result: Value = serde_json::from_slice(&body[length + 4..]).unwrap();
    assert_eq!(result["camera"]["size"], json!([40, 30]));
    // The same in JSON alone.
    let data = vec![90; 40 * 30 * 3];
    let request = json!({ "inputs": [{"name": "image", "shape": [30, 40, 3], "datatype": "UINT8", "data": data}] });
    let (status, _, body) = server.send("POST", path, "", request.to_string().as_bytes());
    let answer: Value = serde_json::from_slice(&body).unwrap();
    assert_eq!((status, answer["outputs"].as_array().unwrap().len()), (200, 8));
}

#[test]
fn bad_input_is_refused_with_a_reason_and_the_server_goes_on() {
    let server = start(&["--max-body", "1", "--max-pixels", "1"], 0.0);
    let large = encode_png(&image([2000, 1000]));
    for (query, body, status, word) in [
        ("", b"no picture".to_vec(), 400, "png or jpeg"),
        ("", png()[..60].to_vec(), 400, "png or jpeg"),
        ("", Vec::new(), 400, "png or jpeg"),
        ("", large, 413, "2000 x 1000"),
        ("", vec![0; 3 << 20], 413, "1 mib"),
        ("?fx=0&fy=1&cx=0&cy=0", png(), 422, "`fx`"),
        ("?fx=1e999&fy=1&cx=0&cy=0", png(), 422, "`fx`"),
        ("?what=1", png(), 400, "`what`"),
        ("", encode_png(&image([600, 20])), 500, "fault"),
    ] {
        let (is, said) = server.estimate(query, &body);
        let said = said["error"].as_str().unwrap().to_lowercase();
        assert!(is == status && said.contains(word), "{query}: {is} {said}");
    }
    for (body, word) in [
        ("{", "inference request"),
        (r#"{"inputs": []}"#, "missing"),
        (r#"{"inputs": [{"name": "x", "shape": [1], "datatype": "FP64"}]}"#, "no input"),
        (r#"{"inputs": [{"name": "image", "shape": [30, 40], "datatype": "UINT8"}]}"#, "shape"),
        (
            r#"{"inputs": [{"name": "image", "shape": [1, 1, 3], "datatype": "UINT8", "data": [1, 2]}]}"#,
            "2 values",
        ),
        (
            r#"{"inputs": [{"name": "image", "shape": [1, 1, 3], "datatype": "UINT8", "data": [1, 2, 300]}]}"#,
            "0 to 255",
        ),
        (
            r#"{"inputs": [{"name": "image", "shape": [9, 9, 3], "datatype": "UINT8", "parameters": {"binary_data_size": 999}}]}"#,
            "binary_data_size",
        ),
        (
            r#"{"inputs": [{"name": "image", "shape": [18446744073709551615, 2, 3], "datatype": "UINT8", "data": []}]}"#,
            "16384",
        ),
    ] {
        let (status, _, answer) =
            server.send("POST", "/v2/models/partpose/infer", "", body.as_bytes());
        let answer = String::from_utf8(answer).unwrap();
        assert!((400..500).contains(&status) && answer.contains(word), "{body}: {status} {answer}");
    }
    let wrong = "Inference-Header-Content-Length: 1000000\r\n";
    assert_eq!(server.send("POST", "/v2/models/partpose/infer", wrong, b"{}").0, 400);
    assert_eq!(server.send("POST", "/v1/estimate", "Content-Encoding: gzip\r\n", b"x").0, 415);
    // What is no HTTP, or breaks off, ends its own connection only.
    assert_eq!(server.raw(b"\x16\x03\x01\x02\x00 no http\r\n\r\n").map_or(400, |said| said.0), 400);
    server.break_off(b"POST /v1/estimate HTTP/1.1\r\nHost: x\r\nContent-Length: 1000\r\n\r\nshort");
    server.break_off(b"POST /v1/est");
    assert_eq!(server.estimate("", &png()).0, 200);
}

#[test]
fn what_is_too_much_or_too_slow_is_refused() {
    let server = start(&["--workers", "1", "--queue", "1", "--timeout", "1"], 1.6);
    let statuses: Vec<u16> = thread::scope(|scope| {
        let ask = |_| {
            thread::sleep(Duration::from_millis(100));
            scope.spawn(|| server.estimate("", &png()).0)
        };
        let asked: Vec<_> = (0..4).map(ask).collect();
        asked.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    // The first is worked on for too long, the second waits in vain, the others find no place.
    assert_eq!(statuses, [504, 503, 503, 503]);
    assert_eq!(server.calls.load(Ordering::SeqCst), 1, "what nobody waits for is not begun");
    let (status, metrics) = server.get("/metrics");
    assert!(status == 200 && metrics.contains("status=\"504\"} 1\n"), "{metrics}");
}

#[test]
fn stopping_answers_what_was_admitted() {
    let mut server = start(&["--workers", "1"], 0.7);
    let address = server.address;
    let stop = server.stop.take();
    thread::scope(|scope| {
        let asked = scope.spawn(|| server.estimate("", &png()).0);
        thread::sleep(Duration::from_millis(300));
        drop(stop);
        assert_eq!(asked.join().unwrap(), 200);
    });
    drop(server);
    assert!(TcpStream::connect(address).is_err());
}
