//! Meshes from files: PLY by `ply-rs-bw`, OBJ by `tobj`.

use super::mesh::{MOST_FACES, Mesh};
use super::{Normals, SceneError};
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{BeginList, Header, PropertyAccess, PropertyAccessResult};
use std::path::Path;
use vernis_metric::io::{one_line, read_at_most};

/// Largest file that is read: some two million faces.
const MOST_BYTES: u64 = 256 << 20;
/// Most corners of a face.
const MOST_CORNERS: usize = 1000;

impl Mesh {
    /// The mesh of a PLY or OBJ file; faces of more than three corners become fans of triangles.
    ///
    /// # Errors
    /// A file that cannot be read, is too large, or holds no mesh that can be rendered ([`Mesh::new`]).
    pub fn read(path: &Path, normals: Normals) -> Result<Self, SceneError> {
        let malformed =
            |reason: String| SceneError::Mesh { path: path.to_owned(), reason: one_line(&reason).into_owned() };
        let bytes = read_at_most(path, MOST_BYTES).map_err(|cause| SceneError::Io { path: path.to_owned(), cause })?;
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let mesh = match extension.as_str() {
            "ply" => ply(&bytes),
            "obj" => obj(&bytes),
            other => Err(format!("its name ends in `{other}`; it must end in ply or obj")),
        }
        .map_err(malformed)?;
        Ok(match normals {
            Normals::Face => mesh.flat(),
            Normals::Smooth => mesh.smooth(),
        })
    }
}

/// A vertex of a PLY file.
#[derive(Default, Clone)]
struct Vertex {
    position: [f64; 3],
    normal: [f64; 3],
}

impl Vertex {
    fn set(&mut self, name: &str, value: f64) -> PropertyAccessResult {
        match name {
            "x" => self.position[0] = value,
            "y" => self.position[1] = value,
            "z" => self.position[2] = value,
            "nx" => self.normal[0] = value,
            "ny" => self.normal[1] = value,
            "nz" => self.normal[2] = value,
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

/// Setters of scalars, all of them as numbers.
macro_rules! scalars {
    ($($name:ident: $type:ty),*) => {
        $(fn $name(&mut self, name: &str, value: $type) -> PropertyAccessResult {
            self.set(name, f64::from(value))
        })*
    };
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }
    scalars!(set_char: i8, set_uchar: u8, set_short: i16, set_ushort: u16, set_int: i32, set_uint: u32, set_float: f32, set_double: f64);
}

/// A face of a PLY file.
#[derive(Default)]
struct Face {
    corners: Vec<i64>,
}

impl Face {
    fn set<T: Into<i64>>(&mut self, name: &str, values: Vec<T>) -> PropertyAccessResult {
        if !CORNERS.contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        self.corners = values.into_iter().map(Into::into).collect();
        PropertyAccessResult::Set
    }

    /// Room is made for no more than a face may have.
    fn begin<T>(len: usize) -> BeginList<'static, T> {
        if len <= MOST_CORNERS { BeginList::UseSetter } else { BeginList::UnsupportedType }
    }
}

const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

/// Setters of lists of integers.
macro_rules! lists {
    ($($set:ident, $begin:ident: $type:ty);*) => {
        $(fn $set(&mut self, name: &str, values: Vec<$type>) -> PropertyAccessResult {
            self.set(name, values)
        }
        fn $begin(&mut self, _name: &str, len: usize) -> BeginList<'_, $type> {
            Self::begin(len)
        })*
    };
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }
    lists!(
        set_list_char, begin_list_char: i8; set_list_uchar, begin_list_uchar: u8; set_list_short, begin_list_short: i16;
        set_list_ushort, begin_list_ushort: u16; set_list_int, begin_list_int: i32; set_list_uint, begin_list_uint: u32
    );
}

/// Of elements that are neither vertices nor faces.
struct Other;

impl PropertyAccess for Other {
    fn new() -> Self {
        Self
    }
}

/// How many elements of a name the header says.
fn count(header: &Header, name: &str) -> Result<usize, String> {
    let element = header.elements.get(name).ok_or(format!("its header has no element `{name}`"))?;
    let most = if name == "face" { MOST_FACES } else { 3 * MOST_FACES };
    if element.count > most {
        return Err(format!("its header says {} of `{name}`; there must be at most {most}", element.count));
    }
    Ok(element.count)
}

fn ply(bytes: &[u8]) -> Result<Mesh, String> {
    // The first of the parser's errors says where and what; those below it repeat it.
    let said = |e: ParseError| {
        let all = e.to_string().replace("\n\t", " ").replace("\\n", "");
        all.split(" Error:").next().unwrap_or_default().to_owned()
    };
    let mut reader = Reader::new(bytes);
    let parser = Parser::<Vertex>::new();
    let header = parser.read_header(&mut reader).map_err(said)?;
    let (vertices, faces) = (count(&header, "vertex")?, count(&header, "face")?);
    if header.elements.values().any(|e| e.count > 3 * MOST_FACES) {
        return Err(format!("its header says more than {} elements of a kind", 3 * MOST_FACES));
    }
    let of_vertex = &header.elements["vertex"].properties;
    if let Some(axis) = ["x", "y", "z"].into_iter().find(|axis| !of_vertex.contains_key(*axis)) {
        return Err(format!("its vertices have no property `{axis}`"));
    }
    if !CORNERS.iter().any(|name| header.elements["face"].properties.contains_key(*name)) {
        return Err(format!("its faces have no list `{}` of integers", CORNERS[0]));
    }
    let has_normals = ["nx", "ny", "nz"].iter().all(|axis| of_vertex.contains_key(*axis));
    let mut positions = Vec::with_capacity(vertices.min(bytes.len()));
    let mut normals = Vec::new();
    let mut triangles: Vec<[u32; 3]> = Vec::with_capacity(faces.min(bytes.len()));
    for (name, element) in &header.elements {
        match name.as_str() {
            "vertex" => {
                for vertex in parser.read_payload_for_element(&mut reader, element, &header).map_err(said)? {
                    positions.push(vertex.position);
                    normals.push(vertex.normal);
                }
            }
            "face" => {
                let found =
                    Parser::<Face>::new().read_payload_for_element(&mut reader, element, &header).map_err(said)?;
                for (k, face) in found.iter().enumerate() {
                    fan(k, &face.corners, &mut triangles)?;
                }
            }
            _ => {
                Parser::<Other>::new().read_payload_for_element(&mut reader, element, &header).map_err(said)?;
            }
        }
    }
    let mut mesh = Mesh::new(positions, triangles)?;
    if has_normals {
        mesh.normals = unit_normals(normals)?;
        mesh.normal_faces = mesh.faces.clone();
    }
    Ok(mesh)
}

/// A face as triangles about its first corner.
fn fan(face: usize, corners: &[i64], triangles: &mut Vec<[u32; 3]>) -> Result<(), String> {
    if corners.len() < 3 {
        return Err(format!("face {face} has {} corners; it must have at least 3", corners.len()));
    }
    let corner = |k: usize| {
        u32::try_from(corners[k])
            .map_err(|_| format!("face {face} has the corner {}; corners are numbered from 0", corners[k]))
    };
    for k in 2..corners.len() {
        if triangles.len() == MOST_FACES {
            return Err(format!("it has more than {MOST_FACES} triangles"));
        }
        triangles.push([corner(0)?, corner(k - 1)?, corner(k)?]);
    }
    Ok(())
}

/// Normals of a file, of unit length; one of length 0 stays so, and its faces are flat there.
fn unit_normals(normals: Vec<[f64; 3]>) -> Result<Vec<[f64; 3]>, String> {
    let unit = |(k, n): (usize, [f64; 3])| {
        let length = n.iter().map(|x| x * x).sum::<f64>().sqrt();
        if !length.is_finite() {
            return Err(format!("the normal of vertex {k} is {n:?}; it must be finite"));
        }
        Ok(if length > 0.0 { n.map(|x| x / length) } else { n })
    };
    normals.into_iter().enumerate().map(unit).collect()
}

fn obj(bytes: &[u8]) -> Result<Mesh, String> {
    let options =
        tobj::LoadOptions { triangulate: true, ignore_points: true, ignore_lines: true, ..Default::default() };
    // Materials are not looked at.
    let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut &bytes[..], &options, no_materials).map_err(|e| e.to_string())?;
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    let (mut normals, mut normal_faces) = (Vec::new(), Vec::new());
    let triples =
        |values: &[f32]| -> Vec<[f64; 3]> { values.as_chunks::<3>().0.iter().map(|p| p.map(f64::from)).collect() };
    for tobj::Model { mesh, .. } in &models {
        let shifted = |indices: &[u32], by: usize| -> Result<Vec<[u32; 3]>, String> {
            let by = u32::try_from(by).map_err(|_| "it has too many vertices".to_owned())?;
            Ok(indices.as_chunks::<3>().0.iter().map(|face| face.map(|v| v.saturating_add(by))).collect())
        };
        faces.extend(shifted(&mesh.indices, positions.len())?);
        normal_faces.extend(shifted(&mesh.normal_indices, normals.len())?);
        positions.extend(triples(&mesh.positions));
        normals.extend(triples(&mesh.normals));
    }
    let mut mesh = Mesh::new(positions, faces)?;
    let fits = |face: &[u32; 3]| face.iter().all(|&v| (v as usize) < normals.len());
    if normal_faces.len() == mesh.faces.len() && normal_faces.iter().all(fits) {
        mesh.normals = unit_normals(normals)?;
        mesh.normal_faces = normal_faces;
    }
    Ok(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                          element face 2\nproperty list uchar int vertex_indices\nend_header\n";
    const BODY: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n4 0 1 2 3\n";

    fn read(name: &str, bytes: &[u8]) -> Result<Mesh, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        Mesh::read(&path, Normals::Face).map_err(|e| e.to_string())
    }

    #[test]
    fn faces_become_triangles() {
        let mesh = read("a.ply", format!("{HEADER}{BODY}").as_bytes()).unwrap();
        assert_eq!(mesh.faces, [[0, 1, 2], [0, 1, 2], [0, 2, 3]]);
        let obj = read("a.obj", b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 2 3 4\n").unwrap();
        assert_eq!(obj, mesh);
    }

    #[test]
    fn a_binary_file_is_read_as_well() {
        let mut bytes = HEADER.replace("ascii", "binary_little_endian").replace("face 2", "face 1").into_bytes();
        for x in [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0] {
            bytes.extend(x.to_le_bytes());
        }
        bytes.push(3);
        [0i32, 1, 2].iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        assert_eq!(read("a.ply", &bytes).unwrap().faces, [[0, 1, 2]]);
    }

    #[test]
    fn what_is_no_mesh_is_one_message() {
        let whole = format!("{HEADER}{BODY}");
        for (bytes, expected) in [
            (String::new(), "mesh: "),
            (HEADER[..60].to_owned(), "mesh: "),
            (HEADER.to_owned(), "nexpected end of file"),
            (whole.replace("3 0 1 2", "3 0 1 9"), "face 0 has the corners [0, 1, 9]; there are 4 vertices"),
            (whole.replace("3 0 1 2", "3 0 1 -1"), "face 0 has the corner -1"),
            (whole.replace("3 0 1 2", "2 0 1"), "face 0 has 2 corners"),
            (whole.replace("1 1 0", "nan 1 0"), "Line 12: "),
            (whole.replace("1 1 0", "1e60 1 0"), "vertex 2 is [inf"),
            (whole.replace("face 2", "face 4000000000"), "must be at most"),
            (whole.replace("vertex 4", "vertex 4000000000"), "must be at most"),
            (HEADER.replace("face 2", "face 0") + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n", "it has no face"),
            (whole.replace("property float z\n", ""), "no property `z`"),
            (whole.replace("vertex_indices", "corners"), "no list `vertex_indices`"),
        ] {
            let message = read("a.ply", bytes.as_bytes()).unwrap_err();
            assert!(message.contains(expected) && !message.contains('\n'), "{message}");
        }
        for (text, expected) in [
            ("", "it has no face"),
            ("v 0 0 0\nf 1 2 3\n", "out of bounds"),
            ("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertex 0 is [0.0, 0.0, NaN]"),
        ] {
            let message = read("a.obj", text.as_bytes()).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
        assert!(read("a.stl", b"").unwrap_err().contains("must end in ply or obj"));
    }
}
