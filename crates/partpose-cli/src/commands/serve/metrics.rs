//! What the server has done, in Prometheus' text format.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Upper ends of the buckets of times, seconds.
const BUCKETS: [f64; 10] = [0.05, 0.1, 0.2, 0.35, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0];

/// Counters; all of them only rise, but what is in work.
#[derive(Debug, Default)]
pub(super) struct Metrics {
    requests: Mutex<BTreeMap<(&'static str, u16), u64>>,
    /// Requests that were admitted and are not yet answered.
    pub(super) admitted: AtomicU64,
    /// Images that a worker has in hand.
    pub(super) working: AtomicU64,
    /// Images that were done.
    images: AtomicU64,
    /// Vehicles found in them, with and without a pose.
    vehicles: [AtomicU64; 2],
    /// Microseconds and counts by bucket of the work on an image.
    micros: AtomicU64,
    buckets: [AtomicU64; BUCKETS.len()],
}

impl Metrics {
    pub(super) fn answered(&self, route: &'static str, status: u16) {
        // A thread that panicked here left whole numbers behind.
        let mut requests = self.requests.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        *requests.entry((route, status)).or_default() += 1;
    }

    pub(super) fn done(&self, took: Duration, posed: usize, without: usize) {
        self.images.fetch_add(1, Ordering::Relaxed);
        self.vehicles[0].fetch_add(posed as u64, Ordering::Relaxed);
        self.vehicles[1].fetch_add(without as u64, Ordering::Relaxed);
        self.micros.fetch_add(took.as_micros() as u64, Ordering::Relaxed);
        for (bucket, end) in self.buckets.iter().zip(BUCKETS) {
            if took.as_secs_f64() <= end {
                bucket.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    pub(super) fn text(&self) -> String {
        let get = |value: &AtomicU64| value.load(Ordering::Relaxed);
        let mut text = String::new();
        let mut family = |name: &str, kind: &str, help: &str, lines: &[(String, String)]| {
            // Writing to a string does not fail.
            let _ = writeln!(text, "# HELP partpose_{name} {help}\n# TYPE partpose_{name} {kind}");
            for (labels, value) in lines {
                let _ = writeln!(text, "partpose_{name}{labels} {value}");
            }
        };
        let requests = self.requests.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let lines: Vec<(String, String)> = requests
            .iter()
            .map(|((route, status), count)| {
                (format!("{{route=\"{route}\",status=\"{status}\"}}"), count.to_string())
            })
            .collect();
        drop(requests);
        family("requests_total", "counter", "Requests answered, by route and status.", &lines);
        let one = |value: &AtomicU64| [(String::new(), get(value).to_string())];
        family(
            "requests_admitted",
            "gauge",
            "Requests arriving, waiting or in work.",
            &one(&self.admitted),
        );
        family("images_in_work", "gauge", "Images that workers have in hand.", &one(&self.working));
        family("images_total", "counter", "Images done.", &one(&self.images));
        let vehicles = ["yes", "no"].iter().zip(&self.vehicles);
        let vehicles: Vec<(String, String)> = vehicles
            .map(|(posed, count)| (format!("{{posed=\"{posed}\"}}"), get(count).to_string()))
            .collect();
        family("vehicles_total", "counter", "Vehicles found, with a pose and without.", &vehicles);
        let count = get(&self.images);
        let help = "Seconds of work on an image, waiting left out.";
        let _ = writeln!(
            text,
            "# HELP partpose_image_seconds {help}\n# TYPE partpose_image_seconds histogram"
        );
        for (bucket, end) in self.buckets.iter().zip(BUCKETS) {
            let _ = writeln!(text, "partpose_image_seconds_bucket{{le=\"{end}\"}} {}", get(bucket));
        }
        let _ = writeln!(text, "partpose_image_seconds_bucket{{le=\"+Inf\"}} {count}");
        let _ = writeln!(text, "partpose_image_seconds_sum {}", get(&self.micros) as f64 * 1e-6);
        let _ = writeln!(text, "partpose_image_seconds_count {count}");
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_told_by_route_and_time() {
        let metrics = Metrics::default();
        metrics.answered("estimate", 200);
        metrics.answered("estimate", 200);
        metrics.answered("estimate", 413);
        metrics.done(Duration::from_millis(300), 2, 1);
        let text = metrics.text();
        for line in [
            "partpose_requests_total{route=\"estimate\",status=\"200\"} 2",
            "partpose_requests_total{route=\"estimate\",status=\"413\"} 1",
            "partpose_vehicles_total{posed=\"yes\"} 2",
            "partpose_image_seconds_bucket{le=\"0.2\"} 0",
            "partpose_image_seconds_bucket{le=\"0.35\"} 1",
            "partpose_image_seconds_sum 0.3",
        ] {
            assert!(text.lines().any(|other| other == line), "{line} is not in\n{text}");
        }
    }
}
