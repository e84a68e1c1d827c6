//! How well labels come back: models are stripped and annotated from those of other body styles.

use std::fmt::Write;

use partpose::annotate::{self, Agreement, AnnotateOptions};
use partpose::parts::PartClass;
use partpose::vehicle::ModelZoo;

use crate::progress;
use crate::report::{self, Outcome};

pub(super) fn run(
    zoo: &ModelZoo,
    targets: Option<&ModelZoo>,
    options: &AnnotateOptions,
) -> anyhow::Result<Outcome> {
    let sources = super::prepare(zoo);
    let targets = &targets.unwrap_or(zoo).models;
    let bar = progress::bar("annotating", targets.len() as u64);
    let results = annotate::leave_style_out(targets, &sources, options, &mut |done| {
        bar.set_position(done as u64);
    });
    bar.finish_and_clear();
    let mut good: Vec<Agreement> = Vec::new();
    let mut outcome = Outcome::Done;
    for (name, result) in results {
        match result {
            Ok(agreement) => good.push(agreement),
            Err(error) => {
                report::warn_error(format_args!("`{name}`"), &error);
                outcome = Outcome::Skipped;
            }
        }
    }
    if good.is_empty() {
        anyhow::bail!("no model could be stripped and annotated from others");
    }
    report::data(&(models(&good) + "\n" + &parts(&good) + "\n" + &reliability(&good)))?;
    Ok(outcome)
}

fn models(results: &[Agreement]) -> String {
    let mut text = format!(
        "{:<20} {:<18} {:>7} {:>7} {:>10}  from\n",
        "model", "body style", "seen", "all", "confidence"
    );
    for result in results {
        let Agreement { name, body_style, outside, all, confidence, sources, .. } = result;
        let sources = sources.join(" ");
        let _ = writeln!(
            text,
            "{name:<20} {body_style:<18} {outside:>7.3} {all:>7.3} {confidence:>10.3}  {sources}"
        );
    }
    let mean = |value: fn(&Agreement) -> f64| {
        results.iter().map(value).sum::<f64>() / results.len() as f64
    };
    let [outside, all, confidence] = [mean(|r| r.outside), mean(|r| r.all), mean(|r| r.confidence)];
    let _ = writeln!(text, "{:<39} {outside:>7.3} {all:>7.3} {confidence:>10.3}", "mean");
    text
}

/// Left and right together: of the true area how much was found, and of the found area how much is true.
fn parts(results: &[Agreement]) -> String {
    let mut text = "part             m2  found  right\n".to_owned();
    for part in PartClass::ALL {
        let opposite = part.opposite();
        if opposite.id() < part.id() {
            continue;
        }
        let mut sums = [0.0; 3];
        for result in results {
            for (i, sum) in sums.iter_mut().enumerate() {
                *sum += result.parts[part.index()][i];
                if opposite != part {
                    *sum += result.parts[opposite.index()][i];
                }
            }
        }
        let [real, found, both] = sums;
        let share = |of: f64| if of > 0.0 { format!("{:.3}", both / of) } else { "-".to_owned() };
        let name = part.name();
        let _ = writeln!(text, "{name:<12} {real:>6.2}  {:>5}  {:>5}", share(real), share(found));
    }
    text
}

/// What share is right at each confidence.
fn reliability(results: &[Agreement]) -> String {
    let mut text = "confidence     m2  right\n".to_owned();
    for bin in 0..10 {
        let sum = |i: usize| results.iter().map(|result| result.reliability[bin][i]).sum::<f64>();
        let [area, right] = [sum(0), sum(1)];
        let right = if area > 0.0 { format!("{:.3}", right / area) } else { "-".to_owned() };
        let from = bin as f64 / 10.0;
        let _ = writeln!(text, "{from:.1} - {:.1}  {area:>6.1}  {right:>5}", from + 0.1);
    }
    text
}
