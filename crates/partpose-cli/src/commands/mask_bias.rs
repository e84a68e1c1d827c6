//! Files that say how far masks lie off the models' outlines.

use std::path::Path;

use partpose::files;
use partpose::pose::dense::MaskBias;

use crate::report::{hint, note};

/// The name of such a file.
pub(crate) const NAME: &str = "mask-bias.json";

/// Reads what `zoo carve` and `evaluate poses --mask-bias` write.
pub(crate) fn read(path: &Path) -> anyhow::Result<MaskBias> {
    let text = files::read(path)?;
    serde_json::from_slice(&text).map_err(|error| {
        hint(
            anyhow::anyhow!("`{}` is no mask bias: {error}", path.display()),
            "`evaluate poses --mask-bias WORLDS` writes one as `mask-bias.json`",
        )
    })
}

/// Writes it, and says what it comes to near and far.
pub(crate) fn write(path: &Path, bias: &MaskBias) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(bias)?;
    files::write(path, text.as_bytes())?;
    let sides = |z: f64| bias.at(z).map(|side| format!("{side:+.2}")).join(", ");
    note(format_args!(
        "masks lie off the models by (left, top, right, bottom) {} px at 15 m, {} px at 40 m; wrote `{}`",
        sides(15.0),
        sides(40.0),
        path.display()
    ));
    Ok(())
}
