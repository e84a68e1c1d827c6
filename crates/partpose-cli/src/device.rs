//! Where the network computes: `--device`.
//!
//! Processors are always there. Graphics processors are features of the build (`cuda`, `wgpu`), since burn's parts for
//! them are many; a device that is not there is told before any work begins.

use burn::tensor::Device;
#[cfg(any(feature = "cuda", feature = "wgpu"))]
use burn::tensor::DeviceType;

const CPU: &str = "cpu";

/// A device of this build.
#[derive(Clone, Debug)]
pub(crate) struct DeviceFlag {
    pub(crate) device: Device,
    /// What is typed before the number.
    pub(crate) kind: &'static str,
}

impl Default for DeviceFlag {
    /// The processors. (`Device::default` is whatever burn thinks fastest.)
    fn default() -> Self {
        Self { device: Device::flex(), kind: CPU }
    }
}

impl DeviceFlag {
    /// Whether it is the processors.
    pub(crate) fn is_processor(&self) -> bool {
        self.kind == CPU
    }
}

/// The device of a name: `cpu`, `cuda`, `cuda:1`, `wgpu`, ...
pub(crate) fn parse_device(name: &str) -> Result<DeviceFlag, String> {
    let (kind, number) = match name.split_once(':') {
        None => (name, None),
        Some((kind, number)) => {
            let number = number.parse::<usize>();
            let number = number.map_err(|_| format!("`{kind}:` wants a number: `{kind}:0`"))?;
            (kind, Some(number))
        }
    };
    match (kind, number) {
        (CPU, None) => Ok(DeviceFlag::default()),
        ("cuda", number) => cuda(number),
        ("wgpu", number) => wgpu(number),
        _ => Err(format!(
            "no such device; there are `cpu`, `cuda`, `cuda:N`, `wgpu`, `wgpu:N`{}",
            of_this_build()
        )),
    }
}

fn of_this_build() -> &'static str {
    match (cfg!(feature = "cuda"), cfg!(feature = "wgpu")) {
        (true, true) => "",
        (true, false) => ", `wgpu` not in this build",
        (false, true) => ", `cuda` not in this build",
        (false, false) => ", all but `cpu` not in this build",
    }
}

#[cfg(not(all(feature = "cuda", feature = "wgpu")))]
fn not_built(kind: &str) -> String {
    format!(
        "this build has no `{kind}`; from a clone `cargo install --path crates/partpose-cli --features {kind}` adds it"
    )
}

#[cfg(feature = "cuda")]
fn cuda(number: Option<usize>) -> Result<DeviceFlag, String> {
    let found: Vec<Device> = Device::enumerate(DeviceType::Cuda).into_vec();
    choose("cuda", found, number)
}

#[cfg(not(feature = "cuda"))]
fn cuda(_: Option<usize>) -> Result<DeviceFlag, String> {
    Err(not_built("cuda"))
}

#[cfg(feature = "wgpu")]
fn wgpu(number: Option<usize>) -> Result<DeviceFlag, String> {
    let found: Vec<Device> = Device::enumerate(DeviceType::Wgpu).into_vec();
    choose("wgpu", found, number)
}

#[cfg(not(feature = "wgpu"))]
fn wgpu(_: Option<usize>) -> Result<DeviceFlag, String> {
    Err(not_built("wgpu"))
}

/// The device of a number among those that were found, the first without one.
#[cfg(any(feature = "cuda", feature = "wgpu"))]
fn choose(
    kind: &'static str,
    found: Vec<Device>,
    number: Option<usize>,
) -> Result<DeviceFlag, String> {
    let count = found.len();
    match (found.into_iter().nth(number.unwrap_or(0)), count) {
        (Some(device), _) => Ok(DeviceFlag { device, kind }),
        (None, 0) => Err(format!(
            "no GPU was found that `{kind}` can use (is its driver installed?); `--device cpu` needs none"
        )),
        (None, 1) => Err(format!("there is one `{kind}` device: `{kind}:0`")),
        (None, _) => {
            Err(format!("there are {count} `{kind}` devices: `{kind}:0` to `{kind}:{}`", count - 1))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_are_told_by_their_names() {
        assert!(parse_device("cpu").unwrap().is_processor());
        for name in ["gpu", "cpu:1", "cuda:", "cuda:x", ""] {
            assert!(parse_device(name).is_err(), "{name}");
        }
    }

    #[test]
    fn a_device_that_is_not_there_is_an_error() {
        for name in ["cuda:99", "wgpu:99"] {
            let error = parse_device(name).map(|_| ()).unwrap_err();
            let told = ["not in", "no `", "no GPU", "there is", "there are"];
            assert!(told.iter().any(|words| error.contains(words)), "{error}");
        }
    }
}
