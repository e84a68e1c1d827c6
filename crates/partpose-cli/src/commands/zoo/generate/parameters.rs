//! Parameters of a vehicle as TOML.
//!
//! A file gives every parameter, or names a vehicle of the program as `base` and gives those that differ.

use std::path::Path;

use partpose::files;
use partpose::vehicle::ParametricVehicle;
use toml::{Table, Value};

use crate::report::hint;

/// The key that names the vehicle whose parameters a file changes.
const BASE: &str = "base";

/// All parameters of a vehicle, with what they are given in.
pub(crate) fn to_text(vehicle: &ParametricVehicle) -> anyhow::Result<String> {
    let head = "# Parameters of a vehicle for `partpose zoo generate --from`: metres and degrees, explained in\n\
                # docs/vehicles.md. Parameters may be left out where `base` names a vehicle of `zoo generate --list`.\n";
    Ok(head.to_owned() + &toml::to_string(vehicle)?)
}

/// The vehicle of a file.
pub(crate) fn read(path: &Path) -> anyhow::Result<ParametricVehicle> {
    let text = files::read_text(path)?;
    let shown = path.display();
    let given: Table = toml::from_str(&text).map_err(|error| {
        let line = error
            .span()
            .map_or(1, |span| 1 + text.get(..span.start).unwrap_or("").matches('\n').count());
        let what = error.message().lines().next().unwrap_or_default().to_owned();
        hint(
            anyhow::anyhow!("`{shown}` line {line}: {what}"),
            "a parameter file has lines like `length = 4.5`; `partpose zoo generate --parameters DIR` writes whole ones",
        )
    })?;
    let (mut table, has_base) = base(path, &given)?;
    let template = Table::try_from(ParametricVehicle::sedan())?;
    for (key, value) in given.iter().filter(|(key, _)| *key != BASE) {
        let line = line_of(&text, key);
        let Some(example) = template.get(key) else {
            let error = anyhow::anyhow!("`{shown}` line {line}: there is no parameter `{key}`");
            return Err(hint(error, similar(key, &template)));
        };
        if !same_kind(value, example) {
            let error = anyhow::anyhow!("`{shown}` line {line}: `{key}` must be {}", kind(example));
            return Err(hint(error, format!("for example `{key} = {example}`")));
        }
        table.insert(key.clone(), value.clone());
    }
    if has_base && !given.contains_key("name") {
        let stem = path.file_stem().map_or("vehicle".into(), |stem| stem.to_string_lossy());
        table.insert("name".to_owned(), Value::String(stem.into_owned()));
    }
    if let Some(missing) = template.keys().find(|key| !table.contains_key(*key)) {
        let error = anyhow::anyhow!("`{shown}` has no `{missing}`");
        return Err(hint(
            error,
            "add it, or `base = \"sedan\"` to take what is missing from there",
        ));
    }
    let vehicle: ParametricVehicle = table.try_into()?;
    let fits = |c: char| c.is_ascii_alphanumeric() || "_-. ".contains(c);
    // Files are named by it.
    if vehicle.name.is_empty() || vehicle.name.starts_with('.') || !vehicle.name.chars().all(fits) {
        let error = anyhow::anyhow!("`{shown}`: the name {:?} cannot name a file", vehicle.name);
        return Err(hint(error, "use letters, digits, `_`, `-` and `.`"));
    }
    Ok(vehicle)
}

/// The parameters of the vehicle that a file starts from, and whether it names one.
fn base(path: &Path, given: &Table) -> anyhow::Result<(Table, bool)> {
    let Some(name) = given.get(BASE) else { return Ok((Table::new(), false)) };
    let vehicles = ParametricVehicle::all();
    let base = vehicles.iter().find(|vehicle| Some(vehicle.name.as_str()) == name.as_str());
    let Some(base) = base else {
        let error = anyhow::anyhow!("`{}`: there is no vehicle {name}", path.display());
        let names: Vec<_> = vehicles.iter().map(|vehicle| vehicle.name.as_str()).collect();
        return Err(hint(error, format!("choose among `{}`", names.join("`, `"))));
    };
    Ok((Table::try_from(base)?, true))
}

fn same_kind(value: &Value, example: &Value) -> bool {
    match (value, example) {
        (Value::Integer(_) | Value::Float(_), Value::Float(_))
        | (Value::Boolean(_), Value::Boolean(_))
        | (Value::String(_), Value::String(_)) => true,
        (Value::Array(values), Value::Array(examples)) => {
            values.len() == examples.len()
                && values.iter().zip(examples).all(|(value, example)| same_kind(value, example))
        }
        _ => false,
    }
}

fn kind(example: &Value) -> &'static str {
    match example {
        Value::Boolean(_) => "`true` or `false`",
        Value::String(_) => "a text in quotes",
        Value::Array(_) => "a list of three numbers",
        _ => "a number",
    }
}

/// What may have been meant by a key that is none.
fn similar(key: &str, template: &Table) -> String {
    let has_word_of = |other: &&String| {
        key.split('_').any(|word| word.len() > 2 && other.split('_').any(|part| part == word))
    };
    let near: Vec<_> = template.keys().filter(has_word_of).map(String::as_str).collect();
    if near.is_empty() {
        "docs/vehicles.md lists the parameters".to_owned()
    } else {
        format!("near it are `{}`", near.join("`, `"))
    }
}

/// The line on which a key is given, from 1.
fn line_of(text: &str, key: &str) -> usize {
    let is_here = |line: &str| {
        line.trim_start().strip_prefix(key).is_some_and(|rest| rest.trim_start().starts_with('='))
    };
    1 + text.lines().position(is_here).unwrap_or(0)
}
