//! Zip archives of BRDFs, read in place: networks (`.h5`) as NBRDF publishes them, tables (`.binary`, `.titopo`, `.titopoh`)
//! such as the measured materials of MERL in one download, and RGL's measurements (`.bsdf`).
//!
//! A member is found by its file name without the extension, in whatever folder it lies; its bytes are unpacked into memory,
//! never onto the disk, and no more of them than its format has a use for.

use super::{extension, io_error, merl, nbrdf, rgl, titopo};
use crate::brdf::BrdfError;
use crate::io::{nearest, open_regular};
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;
use zip::ZipArchive;

/// The directory of an archive ends with a record of 22 bytes and a comment of at most 65,535.
const LONGEST_END: u64 = 22 + 65_535;
/// More than any collection of materials has.
const MOST_MEMBERS: u64 = 1_000_000;
/// The first bytes of that record.
const END: &[u8] = b"PK\x05\x06";

/// What an archive holds of a material.
pub struct Member {
    /// Its name in the archive, with folders and extension.
    pub name: String,
    /// Its content, unpacked.
    pub bytes: Vec<u8>,
}

/// The materials of the archive, in its order.
pub fn materials(path: &Path) -> Result<Vec<String>, BrdfError> {
    let archive = open(path)?;
    Ok(archive.file_names().filter_map(material_of).map(str::to_owned).collect())
}

/// The member of a material in the archive at `path`.
///
/// # Errors
/// A file that is no archive, a material that it lacks or has twice, a member that is larger than its format allows.
pub fn member(path: &Path, material: &str) -> Result<Member, BrdfError> {
    let mut archive = open(path)?;
    let mut members = archive.file_names().filter(|n| material_of(n) == Some(material)).map(str::to_owned);
    let (name, second) = (members.next(), members.next());
    drop(members);
    if let (Some(first), Some(second)) = (&name, second) {
        return Err(malformed(
            path,
            format!("{first} and {second} are both of {material}; there must be one member for it"),
        ));
    }
    let Some(name) = name else {
        return Err(BrdfError::UnknownMaterial {
            path: path.to_owned(),
            found: material.to_owned(),
            nearest: nearest(material, archive.file_names().filter_map(material_of)),
        });
    };
    let most = most_bytes(&name).unwrap_or(0);
    let mut file = archive.by_name(&name).map_err(|e| malformed(path, e.to_string()))?;
    let mut bytes = Vec::new();
    // What the archive says of the size need not be so.
    let read = file.by_ref().take(most + 1).read_to_end(&mut bytes);
    read.map_err(|e| malformed(path, format!("{name}: {e}")))?;
    if bytes.len() as u64 > most {
        return Err(malformed(path, format!("{name} has more than {most} bytes; it must have at most that many")));
    }
    Ok(Member { name, bytes })
}

fn open(path: &Path) -> Result<ZipArchive<BufReader<File>>, BrdfError> {
    let mut file = open_regular(path).map_err(io_error(path))?;
    // The reader would look for the end of the directory through all of a file, which may be of any size.
    let size = file.metadata().map_err(io_error(path))?.len();
    let mut end = Vec::new();
    file.seek(SeekFrom::Start(size.saturating_sub(LONGEST_END)))
        .and_then(|_| file.by_ref().take(LONGEST_END).read_to_end(&mut end))
        .map_err(io_error(path))?;
    if !end.windows(END.len()).any(|window| window == END) {
        return Err(malformed(path, "no directory at its end; is it cut off?".to_owned()));
    }
    check_members(&mut file, &end).map_err(|reason| malformed(path, reason))?;
    ZipArchive::new(BufReader::new(file)).map_err(|e| malformed(path, e.to_string()))
}

/// That the directory of a large archive, by its `end`, does not say that it has more members than any archive: the reader makes
/// room for as many as it says. In other archives it cannot say more than 65,535.
fn check_members(file: &mut File, end: &[u8]) -> Result<(), String> {
    // Signature, disk, place of the record (u64), number of disks; before the end of the directory.
    const LOCATOR: usize = 20;
    for at in (LOCATOR..end.len()).filter(|&at| end[at..].starts_with(END)) {
        let locator = &end[at - LOCATOR..at];
        if !locator.starts_with(b"PK\x06\x07") {
            continue;
        }
        let place = u64::from_le_bytes(std::array::from_fn(|b| locator[8 + b]));
        // Signature, size, two versions, two disks, members on this disk (u64), members (u64).
        let mut record = [0; 40];
        let read = file.seek(SeekFrom::Start(place)).and_then(|_| file.read_exact(&mut record));
        if read.is_err() || !record.starts_with(b"PK\x06\x06") {
            return Err("its directory is not where its end says".to_owned());
        }
        let members = u64::from_le_bytes(std::array::from_fn(|b| record[32 + b]));
        if members > MOST_MEMBERS {
            return Err(format!("its directory says {members} members; it must have at most {MOST_MEMBERS}"));
        }
    }
    Ok(())
}

fn malformed(path: &Path, reason: String) -> BrdfError {
    BrdfError::Malformed { path: path.to_owned(), format: "archive of BRDFs", reason }
}

/// The file stem of a member that is a BRDF.
fn material_of(member: &str) -> Option<&str> {
    most_bytes(member)?;
    let name = member.rsplit('/').next()?;
    // What some systems add beside a file is none.
    Some(name.rsplit_once('.')?.0).filter(|stem| !stem.is_empty() && !stem.starts_with("._"))
}

/// What the format of a member, by its extension, has a use for.
fn most_bytes(member: &str) -> Option<u64> {
    match extension(Path::new(member)).as_str() {
        "h5" => Some(nbrdf::MOST_BYTES),
        "binary" => Some(merl::MOST_BYTES),
        "titopo" | "titopoh" => Some(titopo::MOST_BYTES),
        "bsdf" => Some(rgl::MOST_BYTES),
        _ => None,
    }
}
