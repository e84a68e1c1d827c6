//! What self-contained pages are made of: texts, data and pictures inside one HTML file.

use std::fmt::Write;

/// A text that HTML shows as it is, in content and in quoted attributes.
pub fn html_escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            // Control characters would make the page invalid.
            c if c.is_control() && c != '\n' && c != '\t' => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}

/// JSON that may stand in a `script` element: no text in it can end the element.
pub fn json_for_html(value: &serde_json::Value) -> String {
    // Outside of texts JSON has none of these characters.
    let mut escaped = String::new();
    for character in value.to_string().chars() {
        match character {
            '<' | '>' | '&' | '\u{2028}' | '\u{2029}' => {
                let _ = write!(escaped, "\\u{:04x}", u32::from(character));
            }
            c => escaped.push(c),
        }
    }
    escaped
}

/// Bytes as base64 with padding (RFC 4648, § 4).
pub fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let at = |i: usize| u32::from(chunk.get(i).copied().unwrap_or(0));
        let word = at(0) << 16 | at(1) << 8 | at(2);
        for i in 0..4 {
            let digit = DIGITS[(word >> (18 - 6 * i) & 63) as usize];
            text.push(if i > chunk.len() { '=' } else { char::from(digit) });
        }
    }
    text
}

/// A PNG or JPEG file as an address that holds it; `None` for what is neither.
pub fn picture_uri(bytes: &[u8]) -> Option<String> {
    let kind = match bytes {
        [0x89, b'P', b'N', b'G', ..] => "png",
        [0xff, 0xd8, 0xff, ..] => "jpeg",
        _ => return None,
    };
    Some(format!("data:image/{kind};base64,{}", base64(bytes)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_rfc() {
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }

    #[test]
    fn no_text_ends_its_element() {
        let evil = "</script><script>alert('1')</script>";
        let text = json_for_html(&serde_json::json!({ "a": evil }));
        assert!(!text.contains('<'));
        let back: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(back["a"], evil);
        assert_eq!(html_escape("<a b='&'>"), "&lt;a b=&#39;&amp;&#39;&gt;");
    }

    #[test]
    fn only_pictures_become_addresses() {
        assert_eq!(picture_uri(b"<svg onload=alert(1)>"), None);
        let png =
            crate::files::encode_png(&crate::files::RgbImage { size: [1, 1], pixels: vec![9; 3] });
        assert!(picture_uri(&png).unwrap().starts_with("data:image/png;base64,iVBORw0"));
    }
}
