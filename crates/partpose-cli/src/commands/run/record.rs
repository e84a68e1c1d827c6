//! What a run depends on, as a file beside its results, so that two kinds of results are not mixed.

use partpose::files;
use serde_json::{Value, json};

use super::Arguments;
use crate::commands::fitting::Fitter;
use crate::network::hash;
use crate::report::hint;

/// Name of the record.
const RECORD: &str = "run.json";

/// Writes the record; with `--resume` an earlier one must say the same. Returns what tells it from others.
///
/// Each result says of which record it is, since results of others may lie beside them: a run that is done anew with
/// other settings replaces the record at once, and the results, which are of use until then, one by one.
pub(super) fn settle(
    arguments: &Arguments,
    weights: &str,
    fitter: &Fitter,
) -> anyhow::Result<String> {
    let path = arguments.out.join(RECORD);
    let record = record(arguments, weights, fitter)?;
    let identity = format!("{:016x}", hash(record.to_string().as_bytes()));
    if arguments.resume && path.exists() {
        let earlier: Value = serde_json::from_slice(&files::read(&path)?).unwrap_or(Value::Null);
        if let Some((key, was, is)) = difference(&earlier, &record) {
            return Err(hint(
                anyhow::anyhow!(
                    "`{}` was written with other settings: `{key}` was {was}, now it is {is}",
                    arguments.out.display()
                ),
                "give the same settings, another `--out`, or leave out `--resume` to write everything anew",
            ));
        }
        return Ok(identity);
    }
    files::write(&path, serde_json::to_string_pretty(&record)?.as_bytes())?;
    Ok(identity)
}

fn record(arguments: &Arguments, weights: &str, fitter: &Fitter) -> anyhow::Result<Value> {
    let camera = match &arguments.camera {
        Some(path) => json!(std::path::absolute(path)?.display().to_string()),
        None => json!(format!("guessed: EXIF, else {} degrees", arguments.fov)),
    };
    Ok(json!({
        "version": env!("CARGO_PKG_VERSION"),
        "weights": weights,
        "min_score": arguments.min_score,
        "camera": camera,
        "scene": arguments.fit.scene(),
        "fit": serde_json::to_value(fitter.settings())?,
    }))
}

/// The first setting that differs, by the keys that lead to it, with its earlier and its present value.
fn difference(earlier: &Value, now: &Value) -> Option<(String, Value, Value)> {
    let within = now.as_object().filter(|_| earlier.is_object());
    let Some(within) = within else {
        return (earlier != now).then(|| (String::new(), earlier.clone(), now.clone()));
    };
    within.iter().find_map(|(key, is)| {
        let was = earlier.get(key).unwrap_or(&Value::Null);
        let (below, was, is) = difference(was, is)?;
        let path = if below.is_empty() { key.clone() } else { format!("{key}.{below}") };
        Some((path, was, is))
    })
}
