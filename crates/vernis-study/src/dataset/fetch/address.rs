//! Where a pinned file is read from.
//!
//! * without a mirror: the file of the manifest's repository at the pinned commit,
//!   `https://raw.githubusercontent.com/OWNER/REPOSITORY/COMMIT/PATH`;
//! * with a mirror, a folder or an address that is laid out as the data folder is: `MIRROR/PATH-IN-THE-DATA-FOLDER`.

use super::super::DatasetError;
use super::super::manifest::PinnedFile;
use std::fmt;
use std::path::PathBuf;

const GITHUB: &str = "https://github.com/";
const GITHUB_RAW: &str = "https://raw.githubusercontent.com/";

/// A copy of a data folder, complete or not.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Mirror {
    /// A folder that is laid out as the data folder is.
    Folder(PathBuf),
    /// `http://` or `https://`, without a slash at the end.
    Url(String),
}

impl Mirror {
    /// A folder's path, or an address that begins with `file://`, `http://` or `https://`.
    ///
    /// # Errors
    /// Another scheme, or a `file://` address that is no absolute path of this machine.
    pub fn parse(text: &str) -> Result<Self, DatasetError> {
        let error = |reason: &str| DatasetError::Fetch { address: without_password(text), reason: reason.into() };
        let Some((scheme, rest)) = text.split_once("://") else {
            return Ok(Self::Folder(text.into()));
        };
        match scheme.to_ascii_lowercase().as_str() {
            "http" | "https" if !rest.trim_matches('/').is_empty() => Ok(Self::Url(text.trim_end_matches('/').into())),
            "file" => {
                let path = decoded(rest.strip_prefix("localhost").unwrap_or(rest))
                    .filter(|path| path.starts_with('/'))
                    .ok_or_else(|| error("an absolute path must follow file://"))?;
                // file:///C:/data
                let drive = cfg!(windows) && path.as_bytes().get(2) == Some(&b':');
                Ok(Self::Folder(if drive { &path[1..] } else { &path[..] }.into()))
            }
            _ => Err(error("it must be a folder, file:///PATH, http://HOST/PATH or https://HOST/PATH")),
        }
    }
}

/// The place of one file.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Address {
    /// A file on this computer.
    File(PathBuf),
    /// An `http://` or `https://` address.
    Http(String),
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            // What was meant as an address may have been taken for a path.
            Self::File(path) => f.write_str(&without_password(&path.display().to_string())),
            Self::Http(url) => f.write_str(&without_password(url)),
        }
    }
}

impl Address {
    /// Where `file` is read from.
    ///
    /// # Errors
    /// Without a mirror, a source that is no repository on GitHub.
    pub fn of(file: &PinnedFile, mirror: Option<&Mirror>) -> Result<Self, DatasetError> {
        Ok(match mirror {
            Some(Mirror::Folder(folder)) => Self::File(folder.join(&file.path)),
            Some(Mirror::Url(url)) => Self::Http(format!("{url}/{}", encoded(&file.path))),
            None => Self::Http(raw_file(file).ok_or_else(|| DatasetError::Fetch {
                address: file.source.clone(),
                reason: format!("{} cannot be fetched from there; it must be {GITHUB}OWNER/REPOSITORY", file.path),
            })?),
        })
    }
}

/// The address of the bytes of a file at a commit of a repository on GitHub.
fn raw_file(file: &PinnedFile) -> Option<String> {
    let repository = file.source.strip_prefix(GITHUB)?.trim_end_matches('/');
    let repository = repository.strip_suffix(".git").unwrap_or(repository);
    let (owner, name) = repository.split_once('/')?;
    let sound = !owner.is_empty() && !name.is_empty() && !name.contains('/');
    sound.then(|| format!("{GITHUB_RAW}{owner}/{name}/{}/{}", file.revision, encoded(&file.source_path)))
}

/// An address as it may be shown: without the user and the password before its host (RFC 3986, section 3.2.1).
pub(super) fn without_password(address: &str) -> String {
    // With one slash or none it is no address, and still holds a password.
    let Some((scheme, rest)) = address.split_once(":/") else { return address.to_owned() };
    if scheme.is_empty() || !scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c)) {
        return address.to_owned();
    }
    let slashes = rest.len() - rest.trim_start_matches('/').len();
    let authority = &rest[slashes..];
    let end = authority.find(['/', '?', '#']).unwrap_or(authority.len());
    match authority[..end].rfind('@') {
        Some(at) => format!("{scheme}:/{}{}", &rest[..slashes], &authority[at + 1..]),
        None => address.to_owned(),
    }
}

/// A path as it is written in an address: RFC 3986, section 2.
fn encoded(path: &str) -> String {
    let mut text = String::with_capacity(path.len());
    for byte in path.bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' | b'/' => text.push(byte.into()),
            _ => text += &format!("%{byte:02X}"),
        }
    }
    text
}

/// The path that an address stands for; `None` where it is no UTF-8 or a `%` lacks its two digits.
fn decoded(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&first, tail)) = rest.split_first() {
        rest = tail;
        bytes.push(if first == b'%' {
            let digits = std::str::from_utf8(tail.get(..2)?).ok()?;
            rest = &tail[2..];
            u8::from_str_radix(digits, 16).ok()?
        } else {
            first
        });
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::super::super::manifest::{Manifest, NAMES};
    use super::*;

    fn file(path: &str) -> PinnedFile {
        let open = Manifest::embedded("lavoue2021-open").unwrap();
        open.files().into_iter().find(|f| f.path == path).unwrap().clone()
    }

    #[test]
    fn a_repository_on_github_gives_the_address_of_the_raw_file() {
        let zip = file("nbrdf/merl_nbrdf.zip");
        let expected = "https://raw.githubusercontent.com/asztr/Neural-BRDF/\
                        e229dda3308c78f05e57dbc9455326884f766301/data/merl_nbrdf.zip";
        assert_eq!(Address::of(&zip, None).unwrap().to_string(), expected);
        for same in ["https://github.com/asztr/Neural-BRDF/", "https://github.com/asztr/Neural-BRDF.git"] {
            let zip = PinnedFile { source: same.into(), ..zip.clone() };
            assert_eq!(Address::of(&zip, None).unwrap().to_string(), expected);
        }
        let spaced = PinnedFile { source_path: "data/a b+ä.zip".into(), ..zip.clone() };
        assert!(Address::of(&spaced, None).unwrap().to_string().ends_with("/data/a%20b%2B%C3%A4.zip"));
        for other in ["https://zenodo.org/records/1", "https://github.com/asztr", "https://github.com/a/b/tree/main"] {
            let message =
                Address::of(&PinnedFile { source: other.into(), ..zip.clone() }, None).unwrap_err().to_string();
            assert!(message.contains(other) && message.contains("nbrdf/merl_nbrdf.zip"), "{message}");
        }
    }

    #[test]
    fn every_pinned_file_has_an_address_and_stays_in_the_data_folder() {
        for name in NAMES {
            for file in Manifest::embedded(name).unwrap().files() {
                let address = Address::of(file, None).unwrap().to_string();
                assert!(address.starts_with(GITHUB_RAW) && address.contains(&file.revision), "{address}");
                let inside = std::path::Path::new(&file.path).components();
                assert!(inside.into_iter().all(|c| matches!(c, std::path::Component::Normal(_))), "{}", file.path);
            }
        }
    }

    #[test]
    fn passwords_are_not_shown() {
        for (address, shown) in [
            ("https://user:pass@example.org/a@b", "https://example.org/a@b"),
            ("http://user:p@ss@127.0.0.1:80/x", "http://127.0.0.1:80/x"),
            ("ftp://user:pass@h", "ftp://h"),
            ("http:/user:pass@h/x", "http:/h/x"),
            ("https://example.org/a?b=c@d", "https://example.org/a?b=c@d"),
            ("/srv/data@home", "/srv/data@home"),
            ("a b:/c@d", "a b:/c@d"),
        ] {
            assert_eq!(without_password(address), shown);
        }
        let zip = file("nbrdf/merl_nbrdf.zip");
        let mirror = Mirror::parse("https://user:pass@example.org/a").unwrap();
        let address = Address::of(&zip, Some(&mirror)).unwrap();
        assert_eq!(address.to_string(), "https://example.org/a/nbrdf/merl_nbrdf.zip");
        assert!(matches!(address, Address::Http(url) if url.contains("user:pass@")), "the server is given it");
        let message = Mirror::parse("ftp://user:pass@example.org/a").unwrap_err().to_string();
        assert!(message.starts_with("ftp://example.org/a") && !message.contains("pass"), "{message}");
    }

    #[test]
    fn a_mirror_is_a_folder_or_an_address() {
        let zip = file("nbrdf/merl_nbrdf.zip");
        for (text, expected) in [
            ("/srv/brdf data", "/srv/brdf data/nbrdf/merl_nbrdf.zip"),
            ("file:///srv/brdf%20data/", "/srv/brdf data/nbrdf/merl_nbrdf.zip"),
            ("file://localhost/srv", "/srv/nbrdf/merl_nbrdf.zip"),
            ("copies", "copies/nbrdf/merl_nbrdf.zip"),
            ("http://127.0.0.1:8080/", "http://127.0.0.1:8080/nbrdf/merl_nbrdf.zip"),
            ("https://example.org/a/b", "https://example.org/a/b/nbrdf/merl_nbrdf.zip"),
        ] {
            let mirror = Mirror::parse(text).unwrap();
            assert_eq!(Address::of(&zip, Some(&mirror)).unwrap().to_string(), expected);
        }
        for wrong in ["ftp://example.org/a", "file://relative", "file:///a%2", "file:///%ff", "https://"] {
            assert!(Mirror::parse(wrong).unwrap_err().to_string().starts_with(wrong));
        }
    }
}
