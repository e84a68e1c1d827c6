//! Which request is answered how.

use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use http_body_util::{BodyExt, Full};
use hyper::body::{Body, Bytes};
use hyper::header::{
    ALLOW, CONTENT_ENCODING, CONTENT_LENGTH, CONTENT_TYPE, HeaderName, HeaderValue, RETRY_AFTER,
};
use hyper::{Method, Request, Response, StatusCode};
use serde_json::{Value, json};
use tokio::sync::{Semaphore, SemaphorePermit};
use tokio::time::{Instant, timeout_at};

use super::kserve::{self, MODEL, VERSION};
use super::metrics::Metrics;
use super::workers::{Question, Refusal, Workers};
use super::{Limits, estimate};

/// Header with the length of the JSON before binary tensors.
const JSON_LENGTH: HeaderName = HeaderName::from_static("inference-header-content-length");
/// How much more than the limit of a request is read and thrown away, so that who sends it hears why.
const DRAINED: usize = 8;

/// Everything that requests share.
pub(super) struct Server {
    workers: Workers,
    metrics: Arc<Metrics>,
    limits: Limits,
    admission: Semaphore,
}

/// A whole answer.
type Reply = Response<Full<Bytes>>;

impl Server {
    pub(super) fn new(workers: Workers, metrics: Arc<Metrics>, limits: Limits) -> Self {
        Self { workers, metrics, limits, admission: Semaphore::new(limits.admitted()) }
    }

    /// Answers one request, whatever it is.
    pub(super) async fn answer<B>(&self, request: Request<B>) -> Result<Reply, Infallible>
    where
        B: Body<Data = Bytes> + Unpin,
    {
        let path = request.uri().path().trim_end_matches('/').to_owned();
        let (route, allowed) = route(&path);
        let reply = if !allowed.contains(request.method()) && !allowed.is_empty() {
            let names: Vec<&str> = allowed.iter().map(Method::as_str).collect();
            let reason = format!("`{path}` takes {}", names.join(", "));
            let mut reply = refusal(&Refusal::new(StatusCode::METHOD_NOT_ALLOWED, reason));
            if let Ok(value) = HeaderValue::from_str(&names.join(", ")) {
                reply.headers_mut().insert(ALLOW, value);
            }
            reply
        } else {
            self.reply(route, request).await.unwrap_or_else(|refused| refusal(&refused))
        };
        self.metrics.answered(route, reply.status().as_u16());
        Ok(reply)
    }

    async fn reply<B>(&self, route: &'static str, request: Request<B>) -> Result<Reply, Refusal>
    where
        B: Body<Data = Bytes> + Unpin,
    {
        match route {
            "live" => Ok(whole(StatusCode::OK, "application/json", r#"{"live":true}"#)),
            "ready" => Ok(whole(StatusCode::OK, "application/json", r#"{"ready":true}"#)),
            "server" => Ok(object(&kserve::server())),
            "model" => Ok(object(&kserve::model())),
            "metrics" => {
                let text = self.metrics.text();
                Ok(whole(StatusCode::OK, "text/plain; version=0.0.4", text))
            }
            "infer" => {
                let length = json_length(&request)?;
                let (permit, body) = self.admit(request).await?;
                let (question, form) = kserve::question(length, &body)?;
                let result = self.ask(question, permit).await?;
                let (body, length) = kserve::answer(&form, &result);
                let kind = match length {
                    Some(_) => "application/octet-stream",
                    None => "application/json",
                };
                let mut reply = whole(StatusCode::OK, kind, body);
                if let Some(length) = length {
                    reply.headers_mut().insert(JSON_LENGTH, HeaderValue::from(length));
                }
                Ok(reply)
            }
            "estimate" => {
                let query = request.uri().query().unwrap_or_default().to_owned();
                let kind = request.headers().get(CONTENT_TYPE).cloned();
                let kind = kind.as_ref().and_then(|kind| kind.to_str().ok());
                let (permit, body) = self.admit(request).await?;
                let question = estimate::question(&query, kind, body)?;
                let result = self.ask(question, permit).await?;
                let text = serde_json::to_vec(&result).map_err(|error| {
                    Refusal::new(StatusCode::INTERNAL_SERVER_ERROR, error.to_string())
                })?;
                Ok(whole(StatusCode::OK, "application/json", text))
            }
            _ => {
                let known = "/v1/estimate, /v2, /v2/health/live, /v2/health/ready, /v2/models/partpose and /metrics";
                let reason = format!("there is nothing here; there are {known}");
                Err(Refusal::new(StatusCode::NOT_FOUND, reason))
            }
        }
    }

    /// Takes a request in and reads it, if there is room and it is not too large.
    async fn admit<B>(&self, request: Request<B>) -> Result<(Admitted<'_>, Bytes), Refusal>
    where
        B: Body<Data = Bytes> + Unpin,
    {
        let permit = self.admission.try_acquire().map_err(|_| {
            let reason = "as many requests as the server takes at once are in work; try again";
            Refusal::new(StatusCode::SERVICE_UNAVAILABLE, reason)
        })?;
        let permit = Admitted::new(permit, &self.metrics);
        if let Some(coding) = request.headers().get(CONTENT_ENCODING)
            && coding.as_bytes() != b"identity"
        {
            let reason = "the body must not be compressed";
            return Err(Refusal::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, reason));
        }
        let body = self.read(request).await?;
        Ok((permit, body))
    }

    async fn read<B>(&self, request: Request<B>) -> Result<Bytes, Refusal>
    where
        B: Body<Data = Bytes> + Unpin,
    {
        let most = self.limits.body();
        let told = request.headers().get(CONTENT_LENGTH).and_then(|value| value.to_str().ok());
        let told: Option<usize> = told.and_then(|told| told.parse().ok());
        let too_large = || {
            let reason = format!("the request is larger than {} MiB", self.limits.max_body);
            Refusal::new(StatusCode::PAYLOAD_TOO_LARGE, reason)
        };
        if told.is_some_and(|told| told > DRAINED * most) {
            return Err(too_large());
        }
        let until = Instant::now() + self.limits.time();
        let mut body = request.into_body();
        let (mut bytes, mut count) = (Vec::new(), 0usize);
        loop {
            let frame = timeout_at(until, body.frame()).await.map_err(|_| {
                let reason = format!("the request did not arrive within {} s", self.limits.timeout);
                Refusal::new(StatusCode::REQUEST_TIMEOUT, reason)
            })?;
            let Some(frame) = frame else { break };
            let frame = frame.map_err(|_| Refusal::bad("the request broke off"))?;
            let Ok(data) = frame.into_data() else { continue };
            count = count.saturating_add(data.len());
            if count > DRAINED * most {
                return Err(too_large());
            }
            if count <= most {
                bytes.extend_from_slice(&data);
            } else {
                bytes = Vec::new();
            }
        }
        if count > most { Err(too_large()) } else { Ok(bytes.into()) }
    }

    async fn ask(
        &self,
        question: Question,
        _permit: Admitted<'_>,
    ) -> Result<partpose::formats::ImageResult, Refusal> {
        let mut pending = self.workers.ask(question)?;
        let until = Instant::now() + self.limits.time();
        match timeout_at(until, &mut pending.answer).await {
            Ok(Ok(answer)) => answer,
            Ok(Err(_)) => Err(Refusal::new(StatusCode::SERVICE_UNAVAILABLE, "the server stops")),
            Err(_) if pending.has_begun() => {
                let reason = format!("it took longer than {} s", self.limits.timeout);
                Err(Refusal::new(StatusCode::GATEWAY_TIMEOUT, reason))
            }
            Err(_) => {
                let reason = format!("no worker was free within {} s", self.limits.timeout);
                Err(Refusal::new(StatusCode::SERVICE_UNAVAILABLE, reason))
            }
        }
    }

    /// How long a connection may take with the head of a request.
    pub(super) fn time(&self) -> Duration {
        self.limits.time()
    }
}

/// A request that counts as one of those that the server has taken.
struct Admitted<'a> {
    metrics: &'a Metrics,
    _permit: SemaphorePermit<'a>,
}

impl<'a> Admitted<'a> {
    fn new(permit: SemaphorePermit<'a>, metrics: &'a Metrics) -> Self {
        metrics.admitted.fetch_add(1, Ordering::Relaxed);
        Self { metrics, _permit: permit }
    }
}

impl Drop for Admitted<'_> {
    fn drop(&mut self) {
        self.metrics.admitted.fetch_sub(1, Ordering::Relaxed);
    }
}

/// The name of a path in metrics, and the methods that it takes; none where there is nothing.
fn route(path: &str) -> (&'static str, Vec<Method>) {
    let model = format!("/v2/models/{MODEL}");
    let get = || vec![Method::GET, Method::HEAD];
    if let Some(rest) = path.strip_prefix(&model) {
        let version = format!("/versions/{VERSION}");
        return match rest.strip_prefix(version.as_str()).unwrap_or(rest) {
            "" => ("model", get()),
            "/ready" => ("ready", get()),
            "/infer" => ("infer", vec![Method::POST]),
            _ => ("unknown", Vec::new()),
        };
    }
    match path {
        "/v2" => ("server", get()),
        "/v2/health/live" => ("live", get()),
        "/v2/health/ready" => ("ready", get()),
        "/metrics" => ("metrics", get()),
        "/v1/estimate" => ("estimate", vec![Method::POST]),
        _ => ("unknown", Vec::new()),
    }
}

fn json_length<B>(request: &Request<B>) -> Result<Option<usize>, Refusal> {
    let Some(value) = request.headers().get(JSON_LENGTH) else { return Ok(None) };
    let length = value.to_str().ok().and_then(|text| text.parse().ok());
    length.map(Some).ok_or_else(|| Refusal::bad(format!("the header `{JSON_LENGTH}` is no length")))
}

fn whole(status: StatusCode, kind: &'static str, body: impl Into<Bytes>) -> Reply {
    let mut reply = Response::new(Full::new(body.into()));
    *reply.status_mut() = status;
    reply.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static(kind));
    reply
}

fn object(value: &Value) -> Reply {
    whole(StatusCode::OK, "application/json", value.to_string())
}

fn refusal(refused: &Refusal) -> Reply {
    let body = json!({ "error": refused.reason }).to_string();
    let mut reply = whole(refused.status, "application/json", body);
    if refused.status == StatusCode::SERVICE_UNAVAILABLE {
        reply.headers_mut().insert(RETRY_AFTER, HeaderValue::from_static("1"));
    }
    reply
}
