//! The container of RGL's files: named arrays in one file, little-endian.
//!
//! ```text
//! "tensor_file\0"  u8 major (1)  u8 minor  u32 number of arrays, then of each
//! u16 length of its name, the name, u16 number of axes, u8 type, u64 where its numbers begin, u64 length of each axis
//! ```
//!
//! The last axis runs fastest. Types in use: 1 is u8, 10 is f32. Nothing is believed before it is checked: numbers of arrays,
//! names, axes and places are held to what the file can hold.

use std::ops::Range;

/// The first bytes of every such file.
pub const MAGIC: &[u8; 12] = b"tensor_file\0";
/// Arrays, bytes of a name and axes at most; the published files have 11, 11 and 5.
const MOST_ARRAYS: u32 = 64;
const MOST_NAME: usize = 64;
const MOST_AXES: usize = 8;

const U8: u8 = 1;
const F32: u8 = 10;
/// Bytes of a number of each type, from 1: u8, i8, u16, i16, u32, i32, u64, i64, f16, f32, f64.
const BYTES: [usize; 11] = [1, 1, 2, 2, 4, 4, 8, 8, 2, 4, 8];

/// The arrays of a file: where they are, not yet read.
#[derive(Debug)]
pub struct Directory {
    arrays: Vec<Array>,
}

#[derive(Debug)]
struct Array {
    name: String,
    kind: u8,
    shape: Vec<usize>,
    place: Range<usize>,
}

/// The next bytes of a header.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let end = self.at.checked_add(count).filter(|end| *end <= self.bytes.len());
        let end = end.ok_or_else(|| format!("its header is cut off after {} bytes", self.bytes.len()))?;
        let taken = &self.bytes[self.at..end];
        self.at = end;
        Ok(taken)
    }

    fn number(&mut self, bytes: usize) -> Result<u64, String> {
        Ok(self.take(bytes)?.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte)))
    }
}

impl Directory {
    /// The directory in `bytes`, the whole file or as much of it as holds the directory; the file has `size` bytes.
    ///
    /// # Errors
    /// Another kind of file, a directory that is cut off, contradicts itself, or speaks of places that the file lacks.
    pub fn read(bytes: &[u8], size: u64) -> Result<Self, String> {
        if !bytes.starts_with(MAGIC) {
            return Err("it does not begin with `tensor_file` as RGL's files do (other programs, such as Zemax, \
                        have formats of the same extension)"
                .to_owned());
        }
        let mut cursor = Cursor { bytes, at: MAGIC.len() };
        let (major, minor) = (cursor.number(1)?, cursor.number(1)?);
        if major != 1 {
            return Err(format!("its version is {major}.{minor}; it must be 1.0"));
        }
        let count = cursor.number(4)?;
        if count > u64::from(MOST_ARRAYS) {
            return Err(format!("it says that it holds {count} arrays; at most {MOST_ARRAYS} are allowed"));
        }
        let mut arrays: Vec<Array> = Vec::new();
        for _ in 0..count {
            let array = Array::read(&mut cursor, size)?;
            if arrays.iter().any(|other| other.name == array.name) {
                return Err(format!("the array `{}` is there twice", array.name));
            }
            arrays.push(array);
        }
        Ok(Self { arrays })
    }

    /// Whether there is such an array.
    pub fn has(&self, name: &str) -> bool {
        self.arrays.iter().any(|array| array.name == name)
    }

    /// The lengths of the axes of an array.
    ///
    /// # Errors
    /// No such array, or another number of axes.
    pub fn shape<const AXES: usize>(&self, name: &str) -> Result<[usize; AXES], String> {
        let shape = &self.array(name)?.shape;
        <[usize; AXES]>::try_from(&shape[..])
            .map_err(|_| format!("`{name}` has {} axes; it must have {AXES}", shape.len()))
    }

    /// The numbers of an array of f32, each held to `allowed`.
    ///
    /// # Errors
    /// No such array, another type, a number that is not allowed or not finite.
    pub fn floats(&self, bytes: &[u8], name: &str, allowed: Allowed) -> Result<Vec<f64>, String> {
        let data = self.data(bytes, name, F32, "f32")?;
        let numbers: Vec<f64> = data.as_chunks::<4>().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect();
        match numbers.iter().position(|v| !v.is_finite() || (allowed == Allowed::NotNegative && *v < 0.0)) {
            None => Ok(numbers),
            Some(k) => {
                let allowed = if allowed == Allowed::NotNegative { " that are not negative" } else { "" };
                Err(format!("`{name}` holds {} at {k}; it must hold finite numbers{allowed}", numbers[k]))
            }
        }
    }

    /// The numbers of an array of u8.
    ///
    /// # Errors
    /// No such array, another type.
    pub fn bytes<'a>(&self, bytes: &'a [u8], name: &str) -> Result<&'a [u8], String> {
        self.data(bytes, name, U8, "u8")
    }

    fn data<'a>(&self, bytes: &'a [u8], name: &str, kind: u8, needed: &str) -> Result<&'a [u8], String> {
        let array = self.array(name)?;
        if array.kind != kind {
            return Err(format!("`{name}` is of type {}; it must be {kind} ({needed})", array.kind));
        }
        bytes.get(array.place.clone()).ok_or_else(|| format!("`{name}` is cut off"))
    }

    fn array(&self, name: &str) -> Result<&Array, String> {
        self.arrays.iter().find(|array| array.name == name).ok_or_else(|| {
            let found: Vec<_> = self.arrays.iter().map(|array| array.name.as_str()).collect();
            format!("it has no array `{name}`; its arrays are {}", found.join(", "))
        })
    }
}

/// What numbers an array may hold, besides being finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Allowed {
    Any,
    NotNegative,
}

impl Array {
    fn read(cursor: &mut Cursor<'_>, size: u64) -> Result<Self, String> {
        let length = cursor.number(2)? as usize;
        if length > MOST_NAME {
            return Err(format!("the name of an array has {length} bytes; at most {MOST_NAME} are allowed"));
        }
        let name = String::from_utf8_lossy(cursor.take(length)?).into_owned();
        let axes = cursor.number(2)? as usize;
        if axes > MOST_AXES {
            return Err(format!("`{name}` has {axes} axes; at most {MOST_AXES} are allowed"));
        }
        let kind = cursor.number(1)? as u8;
        let Some(width) = usize::from(kind).checked_sub(1).and_then(|k| BYTES.get(k)) else {
            return Err(format!("`{name}` is of type {kind}; the types are 1 to {}", BYTES.len()));
        };
        let start = cursor.number(8)?;
        let lengths: Vec<u64> = (0..axes).map(|_| cursor.number(8)).collect::<Result<_, _>>()?;
        let end = lengths
            .iter()
            .try_fold(*width as u64, |product, length| product.checked_mul(*length))
            .and_then(|bytes| start.checked_add(bytes));
        let shown = || lengths.iter().map(u64::to_string).collect::<Vec<_>>().join("x");
        match end {
            Some(end) if end <= size => {
                let shape = lengths.iter().map(|n| *n as usize).collect();
                Ok(Self { name, kind, shape, place: start as usize..end as usize })
            }
            _ => Err(format!(
                "`{name}` with {} numbers from byte {start} on ends behind the {size} bytes of the file",
                shown()
            )),
        }
    }
}
