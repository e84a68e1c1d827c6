//! The threads that look at images, and the queue before them.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Instant;

use hyper::StatusCode;
use hyper::body::Bytes;
use partpose::detection::Detection;
use partpose::files::{Photo, RgbImage, decode_photo, photo_size};
use partpose::formats::{ImageResult, image_result};
use partpose::geometry::Camera;
use tokio::sync::oneshot;

use crate::camera::{Cameras, check_ranges};
use crate::commands::fitting::Fitter;

use super::metrics::Metrics;

/// Why a request is not answered as it was meant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Refusal {
    pub(super) status: StatusCode,
    pub(super) reason: String,
}

impl Refusal {
    pub(super) fn new(status: StatusCode, reason: impl Into<String>) -> Self {
        Self { status, reason: reason.into() }
    }

    pub(super) fn bad(reason: impl Into<String>) -> Self {
        Self::new(StatusCode::BAD_REQUEST, reason)
    }
}

/// An image as it came.
#[derive(Clone, Debug)]
pub(super) enum Picture {
    /// The bytes of a PNG or JPEG file.
    File(Bytes),
    /// Pixels.
    Pixels(RgbImage),
}

/// What is asked.
#[derive(Clone, Debug)]
pub(super) struct Question {
    /// What the image is called in the answer.
    pub(super) name: String,
    pub(super) picture: Picture,
    /// `fx, fy, cx, cy`; the server's own camera where there is none.
    pub(super) camera: Option<[f64; 4]>,
    pub(super) min_score: Option<f64>,
}

/// What every image is answered with.
pub(super) struct Engine {
    pub(super) detect: Box<dyn Fn(&RgbImage) -> anyhow::Result<Vec<Detection>> + Send + Sync>,
    pub(super) fitter: Fitter,
    pub(super) cameras: Cameras,
    pub(super) min_score: f64,
    pub(super) most_pixels: u64,
}

/// The answer, or why there is none.
pub(super) type Answer = Result<ImageResult, Refusal>;

/// A question on its way; dropping it takes the question back where nobody has begun with it.
pub(super) struct Pending {
    pub(super) answer: oneshot::Receiver<Answer>,
    begun: Arc<AtomicBool>,
    forgotten: Arc<AtomicBool>,
}

impl Pending {
    pub(super) fn has_begun(&self) -> bool {
        self.begun.load(Ordering::Relaxed)
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        self.forgotten.store(true, Ordering::Relaxed);
    }
}

struct Job {
    question: Question,
    answer: oneshot::Sender<Answer>,
    begun: Arc<AtomicBool>,
    forgotten: Arc<AtomicBool>,
}

/// The threads; they end when this is dropped and the queue is empty.
pub(super) struct Workers {
    queue: Option<SyncSender<Job>>,
    threads: Vec<JoinHandle<()>>,
}

impl Workers {
    /// Starts `count` threads with a queue for `waiting` questions.
    pub(super) fn start(
        engine: Engine,
        count: usize,
        waiting: usize,
        metrics: &Arc<Metrics>,
    ) -> Self {
        let (queue, jobs) = sync_channel(waiting);
        let (engine, jobs) = (Arc::new(engine), Arc::new(Mutex::new(jobs)));
        let start = |_| {
            let (engine, jobs, metrics) =
                (Arc::clone(&engine), Arc::clone(&jobs), Arc::clone(metrics));
            thread::spawn(move || work(&engine, &jobs, &metrics))
        };
        Self { queue: Some(queue), threads: (0..count).map(start).collect() }
    }

    /// Puts a question into the queue.
    pub(super) fn ask(&self, question: Question) -> Result<Pending, Refusal> {
        let (send, answer) = oneshot::channel();
        let pending = Pending {
            answer,
            begun: Arc::new(AtomicBool::new(false)),
            forgotten: Arc::new(AtomicBool::new(false)),
        };
        let (begun, forgotten) = (Arc::clone(&pending.begun), Arc::clone(&pending.forgotten));
        let job = Job { question, answer: send, begun, forgotten };
        let unavailable = StatusCode::SERVICE_UNAVAILABLE;
        match self.queue.as_ref().map(|queue| queue.try_send(job)) {
            Some(Ok(())) => Ok(pending),
            Some(Err(TrySendError::Full(_))) => Err(Refusal::new(unavailable, "the queue is full")),
            Some(Err(TrySendError::Disconnected(_))) | None => {
                Err(Refusal::new(unavailable, "the server stops"))
            }
        }
    }
}

impl Drop for Workers {
    fn drop(&mut self) {
        self.queue = None;
        for thread in self.threads.drain(..) {
            // Panics are caught where they happen.
            let _ = thread.join();
        }
    }
}

fn work(engine: &Engine, jobs: &Mutex<Receiver<Job>>, metrics: &Metrics) {
    loop {
        let next = jobs.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok(Job { question, answer, begun, forgotten }) = next else { return };
        if forgotten.load(Ordering::Relaxed) {
            continue;
        }
        begun.store(true, Ordering::Relaxed);
        metrics.working.fetch_add(1, Ordering::Relaxed);
        let start = Instant::now();
        let found = catch_unwind(AssertUnwindSafe(|| engine.answer(question)));
        metrics.working.fetch_sub(1, Ordering::Relaxed);
        let found = found.unwrap_or_else(|_| {
            let status = StatusCode::INTERNAL_SERVER_ERROR;
            Err(Refusal::new(status, "the program has a fault that this image shows"))
        });
        if let Ok(result) = &found {
            let posed = result.vehicles.iter().filter(|vehicle| vehicle.pose.is_some()).count();
            metrics.done(start.elapsed(), posed, result.vehicles.len() - posed);
        }
        // Whoever asked may have gone.
        let _ = answer.send(found);
    }
}

impl Engine {
    fn answer(&self, question: Question) -> Answer {
        let Question { name, picture, camera, min_score } = question;
        let unusable = |error: &dyn std::fmt::Display| {
            Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, error.to_string())
        };
        let path = Path::new(&name);
        let photo = self.decode(path, picture)?;
        let camera = match camera {
            Some([fx, fy, cx, cy]) => {
                Camera { focal: [fx, fy], principal_point: [cx, cy], size: photo.image.size }
            }
            None => {
                self.cameras.of(path, &photo).map_err(|error| unusable(&format!("{error:#}")))?.0
            }
        };
        check_ranges(Path::new("the request"), &camera).map_err(|error| unusable(&error))?;
        let mut found =
            (self.detect)(&photo.image).map_err(|error| unusable(&format!("{error:#}")))?;
        let least = min_score.unwrap_or(self.min_score);
        found.retain(|found| found.score >= least);
        let estimated = self.fitter.estimate(&camera, found);
        Ok(image_result(&name, &camera, self.fitter.settings(), &estimated))
    }

    fn decode(&self, path: &Path, picture: Picture) -> Result<Photo, Refusal> {
        let too_large = |[width, height]: [u32; 2]| {
            let most = self.most_pixels / 1_000_000;
            let reason =
                format!("the image has {width} x {height} pixels, more than {most} million");
            let is = u64::from(width) * u64::from(height) > self.most_pixels;
            if is { Err(Refusal::new(StatusCode::PAYLOAD_TOO_LARGE, reason)) } else { Ok(()) }
        };
        let bytes = match picture {
            Picture::Pixels(image) => {
                too_large(image.size)?;
                return Ok(Photo { image, focal_35mm: None });
            }
            Picture::File(bytes) => bytes,
        };
        let unreadable = |error: partpose::files::FileError| {
            let error = anyhow::Error::from(error);
            Refusal::bad(format!("{error:#}; a PNG or JPEG file is meant"))
        };
        too_large(photo_size(path, &bytes).map_err(unreadable)?)?;
        decode_photo(path, &bytes).map_err(unreadable)
    }
}
