//! Files by their addresses in the protocol. Files of the library have addresses of their own: they are on no disc.

use std::{
    path::{Path, PathBuf},
    str::FromStr,
};

use lsp_types::Uri;
use wfl_tasks::scene_file::plain_path;

/// What names of texts of the library start with.
pub(crate) const LIBRARY: &str = "<library>/";

/// The scheme of texts of the library; an editor asks for them with `wfl/library`.
const LIBRARY_SCHEME: &str = "wfl-library:/";

/// The address of a text by its name in messages; none for the command line.
pub(crate) fn address_of(name: &str) -> Option<Uri> {
    match name.strip_prefix(LIBRARY) {
        Some(file) => Uri::from_str(&format!("{LIBRARY_SCHEME}{file}")).ok(),
        None => address(Path::new(name)),
    }
}

/// The address of a file.
pub(crate) fn address(path: &Path) -> Option<Uri> {
    let text = path.to_str()?.replace('\\', "/");
    let mut coded = String::from(if text.starts_with('/') { "file://" } else { "file:///" });
    for byte in text.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'-' | b'_' | b'.' | b'~' => coded.push(char::from(byte)),
            _ => coded.push_str(&format!("%{byte:02X}")),
        }
    }
    Uri::from_str(&coded).ok()
}

/// The file of an address; none if it is no file.
pub(crate) fn file(address: &Uri) -> Option<PathBuf> {
    let coded = address.as_str().strip_prefix("file://")?;
    // a host may stand before the path
    let coded = &coded[coded.find('/')?..];
    let mut bytes = Vec::with_capacity(coded.len());
    let mut rest = coded.bytes();
    while let Some(byte) = rest.next() {
        if byte != b'%' {
            bytes.push(byte);
            continue;
        }
        let digits = [rest.next()?, rest.next()?];
        bytes.push(u8::from_str_radix(std::str::from_utf8(&digits).ok()?, 16).ok()?);
    }
    let text = String::from_utf8(bytes).ok()?;
    let drive = text.as_bytes().get(2) == Some(&b':');
    Some(plain_path(Path::new(if drive { &text[1..] } else { &text })))
}

/// The text of the library at an address.
pub(crate) fn library_text(address: &str) -> Option<&'static str> {
    let name = address.strip_prefix(LIBRARY_SCHEME)?.trim_start_matches('/');
    wfl::LIBRARY.iter().find(|l| l.0 == name).map(|l| l.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_and_addresses_lead_to_each_other() {
        for path in ["/home/a b/größe.wfl", "/x/100%.wfl"] {
            let uri = address(Path::new(path)).expect("an address");
            assert!(!uri.as_str().contains(' '));
            assert_eq!(file(&uri).as_deref(), Some(Path::new(path)));
        }
        let drive = Uri::from_str("file:///c%3A/scenes/a.wfl").expect("an address");
        assert_eq!(file(&drive).as_deref(), Some(Path::new("c:/scenes/a.wfl")));
        assert_eq!(file(&Uri::from_str("untitled:Untitled-1").expect("an address")), None);
        assert!(library_text("wfl-library:/contact.wfl").is_some_and(|t| t.contains("def nitsche")));
        assert_eq!(
            address_of("<library>/contact.wfl").map(|u| u.as_str().to_owned()).as_deref(),
            Some("wfl-library:/contact.wfl")
        );
    }
}
