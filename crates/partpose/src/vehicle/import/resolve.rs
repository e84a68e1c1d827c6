//! References from a model to other files: within its folder, or not followed.
//!
//! The usual glTF crate follows `..` and `file:` to any file that the user can read, and panics at a bad percent
//! escape. Here a reference is relative, has no scheme and no `..`, and what it leads to, links followed, lies below the
//! model's folder.

use std::path::{Component, Path, PathBuf};

use crate::files;

use super::PathFault;

/// Longest reference that is repeated in a message, characters.
const SHOWN: usize = 100;

/// The bytes that a glTF URI stands for: a `data:` URI or a file within the folder.
pub(super) fn read_uri(folder: &Path, uri: &str) -> Result<Vec<u8>, PathFault> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (_, encoded) = data.split_once(";base64,").ok_or(PathFault::Base64(0))?;
        return from_base64(encoded.as_bytes());
    }
    if has_scheme(uri) {
        return Err(PathFault::Scheme(shown(uri)));
    }
    let path = file_inside(folder, &without_escapes(uri)?)?;
    files::read(&path).map_err(PathFault::File)
}

/// The file that a relative path leads to, which lies within the folder.
pub(super) fn file_inside(folder: &Path, reference: &str) -> Result<PathBuf, PathFault> {
    let outside = || PathFault::Outside(shown(reference));
    // A backslash separates folders on one system and is part of a name on another; a colon may name a drive.
    if reference.is_empty() || reference.contains(['\\', ':', '\0']) {
        return Err(outside());
    }
    let relative = Path::new(reference);
    if !relative.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
        return Err(outside());
    }
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let not_a_file = |_| PathFault::NotAFile(shown(reference));
    let folder = folder.canonicalize().map_err(not_a_file)?;
    let path = folder.join(relative).canonicalize().map_err(not_a_file)?;
    if !path.starts_with(&folder) {
        return Err(outside());
    }
    // Not a folder, and not a pipe that never ends.
    if !path.is_file() {
        return Err(PathFault::NotAFile(shown(reference)));
    }
    Ok(path)
}

/// RFC 3986, § 3.1: letters, digits, `+`, `-` and `.` before the first colon, which comes before any `/`.
fn has_scheme(uri: &str) -> bool {
    let scheme = uri.split_once(':').map_or("", |(scheme, _)| scheme);
    !scheme.is_empty() && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
}

/// RFC 3986, § 2.1.
fn without_escapes(uri: &str) -> Result<String, PathFault> {
    let broken = || PathFault::Escape(shown(uri));
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((first, after)) = rest.split_first() {
        if *first == b'%' {
            let digit = |at: usize| char::from(*after.get(at)?).to_digit(16);
            let (high, low) = digit(0).zip(digit(1)).ok_or_else(broken)?;
            bytes.push((high << 4 | low) as u8);
            rest = &after[2..];
        } else {
            bytes.push(*first);
            rest = after;
        }
    }
    String::from_utf8(bytes).map_err(|_| broken())
}

/// RFC 4648, § 4; padding may be missing.
fn from_base64(text: &[u8]) -> Result<Vec<u8>, PathFault> {
    let end = text.iter().rposition(|c| *c != b'=').map_or(0, |last| last + 1);
    let mut bytes = Vec::with_capacity(end / 4 * 3 + 2);
    for (quad_at, quad) in text[..end].chunks(4).enumerate() {
        if quad.len() == 1 {
            return Err(PathFault::Base64(4 * quad_at));
        }
        let mut bits = 0_u32;
        for (at, c) in quad.iter().enumerate() {
            let value = match c {
                b'A'..=b'Z' => c - b'A',
                b'a'..=b'z' => c - b'a' + 26,
                b'0'..=b'9' => c - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return Err(PathFault::Base64(4 * quad_at + at)),
            };
            bits |= u32::from(value) << (18 - 6 * at);
        }
        bytes.extend(&bits.to_be_bytes()[1..quad.len()]);
    }
    Ok(bytes)
}

fn shown(reference: &str) -> String {
    reference.chars().take(SHOWN).collect::<String>().escape_debug().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_decoded_with_and_without_padding() {
        for (text, bytes) in [
            ("", &b""[..]),
            ("Zg==", b"f"),
            ("Zm8", b"fo"),
            ("Zm9v", b"foo"),
            ("Zm9vYmE=", b"fooba"),
            ("+/+/", &[0xfb, 0xff, 0xbf]),
        ] {
            assert_eq!(from_base64(text.as_bytes()).unwrap(), bytes, "{text}");
        }
        for text in ["Z", "Zm9vZ", "Z!==", "Zm 9v", "Zg==Zg=="] {
            assert!(matches!(from_base64(text.as_bytes()), Err(PathFault::Base64(_))), "{text}");
        }
    }

    #[test]
    fn nothing_outside_the_folder_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("model");
        std::fs::create_dir_all(inside.join("data")).unwrap();
        std::fs::write(folder.path().join("secret.bin"), b"secret").unwrap();
        std::fs::write(inside.join("data/a b.bin"), b"mesh").unwrap();
        assert_eq!(read_uri(&inside, "data/a%20b.bin").unwrap(), b"mesh");
        assert_eq!(read_uri(&inside, "./data/a b.bin").unwrap(), b"mesh");
        let absolute = folder.path().join("secret.bin").display().to_string();
        for uri in [
            "../secret.bin",
            "data/../../secret.bin",
            "%2e%2e/secret.bin",
            "..%2Fsecret.bin",
            "file:///etc/passwd",
            "FILE:secret.bin",
            "https://example.org/a.bin",
            "C:\\secret.bin",
            "..\\secret.bin",
            "//host/share",
            "data",
            "data/none.bin",
            "",
            ".",
            "%",
            "%zz",
            "%ff",
            "a%00b",
            "data:application/octet-stream,plain",
            &absolute,
        ] {
            assert!(read_uri(&inside, uri).is_err(), "{uri} was read");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(folder.path().join("secret.bin"), inside.join("link.bin"))
                .unwrap();
            let error = read_uri(&inside, "link.bin").unwrap_err();
            assert!(matches!(error, PathFault::Outside(_)), "{error}");
        }
    }
}
