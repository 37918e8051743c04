//! The shape in the pictures: normals seen by a distant viewer, and how much of the picture each covers.
//!
//! The unit sphere seen orthographically from +z on a 32 x 32 grid, x, y = (i + 0.5) / 16 - 1, pixels with
//! x^2 + y^2 < 0.975 (788 of them), each the mean of 2 x 2 sub-samples with r^2 clipped to 0.985. A sphere shows every visible
//! normal once; another shape under a distant light shows the same pixels with other frequencies, so that a mesh enters as
//! one weight a pixel: the projected area, as seen by the viewer, of its faces whose normal falls there.

use super::LightError;
use crate::io::read_text_at_most;
use crate::math::Vec3;
use std::path::Path;

/// Largest file of a mesh that is read: some two million faces.
pub(crate) const MOST_BYTES: u64 = 256 << 20;
/// Pixels along each side of a picture.
pub const SIDE: usize = 32;
const DISC: f64 = 0.975;
const SUB_SAMPLES: usize = 2;
const SUB_SAMPLE_LIMIT: f64 = 0.985;

/// The pixels of a picture and their weights.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Positions `row * SIDE + column` of the pixels on the disc; row 0 is at y = -1.
    cells: Vec<usize>,
    /// Share of the shape in each pixel; sums to 1.
    weights: Vec<f64>,
}

fn coordinate(index: f64) -> f64 {
    index / (SIDE / 2) as f64 - 1.0
}

impl Shape {
    /// The sphere: all pixels weigh the same.
    pub fn sphere() -> Self {
        let inside = |cell: &usize| {
            let (x, y) = (coordinate((cell % SIDE) as f64 + 0.5), coordinate((cell / SIDE) as f64 + 0.5));
            x * x + y * y < DISC
        };
        let cells: Vec<usize> = (0..SIDE * SIDE).filter(inside).collect();
        let weights = vec![1.0 / cells.len() as f64; cells.len()];
        Self { cells, weights }
    }

    /// The visible normals of an ASCII PLY mesh, by projected face area. Faces behind others count as visible.
    pub fn mesh(path: &Path) -> Result<Self, LightError> {
        let malformed = |reason: String| LightError::Mesh { path: path.to_owned(), reason };
        let text = read_text_at_most(path, MOST_BYTES).map_err(|e| malformed(e.to_string()))?;
        let mut shape = Self::sphere();
        let mut area = vec![0.0; SIDE * SIDE];
        let add = |[a, b, c]: [Vec3; 3]| {
            let normal = (b - a).cross(c - a);
            let length = normal.length();
            if normal.z > 0.0 && length > 0.0 {
                let bin = |x: f64| (((x / length + 1.0) * (SIDE / 2) as f64) as usize).min(SIDE - 1);
                area[bin(normal.y) * SIDE + bin(normal.x)] += 0.5 * normal.z;
            }
        };
        ply_triangles(&text, add).map_err(malformed)?;
        // Normals between the disc and the silhouette have no pixel and are left out.
        let total: f64 = shape.cells.iter().map(|&cell| area[cell]).sum();
        if !(total > 0.0 && total.is_finite()) {
            return Err(malformed(format!("its visible area is {total}; it must be finite and greater than 0")));
        }
        shape.weights = shape.cells.iter().map(|&cell| area[cell] / total).collect();
        Ok(shape)
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// Whether the shape has no pixel.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// Positions `row * SIDE + column` of the pixels.
    pub fn cells(&self) -> &[usize] {
        &self.cells
    }

    /// One weight a pixel, summing to 1.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// The four unit normals whose mean is pixel `index`.
    pub fn normals(&self, index: usize) -> [Vec3; SUB_SAMPLES * SUB_SAMPLES] {
        let (row, column) = (self.cells[index] / SIDE, self.cells[index] % SIDE);
        std::array::from_fn(|s| {
            let offset = |k: usize| (k as f64 + 0.5) / SUB_SAMPLES as f64;
            let (x, y) =
                (coordinate(column as f64 + offset(s % SUB_SAMPLES)), coordinate(row as f64 + offset(s / SUB_SAMPLES)));
            let r2 = x * x + y * y;
            let shrink = (SUB_SAMPLE_LIMIT / r2).sqrt().min(1.0);
            let (x, y) = (x * shrink, y * shrink);
            Vec3::new(x, y, (1.0 - x * x - y * y).sqrt())
        })
    }
}

/// Tells `found` the faces of an ASCII PLY file as triangles (fans, where a face has more corners). Room is made for what the
/// file holds, not for what its header says.
fn ply_triangles(text: &str, mut found: impl FnMut([Vec3; 3])) -> Result<(), String> {
    let mut lines = text.lines().enumerate();
    let (mut vertices, mut faces) = (0usize, 0usize);
    let mut element = "";
    let mut properties = Vec::new();
    if lines.next().map(|(_, l)| l.trim()) != Some("ply") {
        return Err("line 1 must be `ply`".into());
    }
    loop {
        let (number, line) = lines.next().ok_or("the header has no `end_header`")?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let count = |s: &str| s.parse().map_err(|_| format!("line {}: `{s}` is not a count", number + 1));
        match words[..] {
            ["format", "ascii", _] | ["comment", ..] | ["obj_info", ..] | [] => {}
            ["format", other, ..] => return Err(format!("its format is `{other}`; it must be ascii")),
            ["element", "vertex", n] => (element, vertices) = ("vertex", count(n)?),
            ["element", "face", n] => (element, faces) = ("face", count(n)?),
            ["element", ..] if faces > 0 => element = "",
            ["element", name, ..] => {
                return Err(format!("element `{name}` comes before the faces; only vertex and face may"));
            }
            ["property", _, name] if element == "vertex" => properties.push(name),
            ["property", ..] => {}
            ["end_header"] => break,
            _ => return Err(format!("line {}: `{line}` is no header line", number + 1)),
        }
    }
    let position = |axis: &str| properties.iter().position(|p| *p == axis).ok_or(format!("vertices have no `{axis}`"));
    let axes = [position("x")?, position("y")?, position("z")?];
    let mut row = |what: &str| {
        let (number, line) = lines.next().ok_or(format!("the file ends before its last {what}"))?;
        let values: Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
        values.map(|v| (number + 1, v)).map_err(|_| format!("line {}: a {what} must consist of numbers", number + 1))
    };
    let mut points = Vec::new();
    for _ in 0..vertices {
        let (number, v) = row("vertex")?;
        let at = |k: usize| v.get(k).copied().filter(|x| x.is_finite());
        match (at(axes[0]), at(axes[1]), at(axes[2])) {
            (Some(x), Some(y), Some(z)) => points.push(Vec3::new(x, y, z)),
            _ => return Err(format!("line {number}: a vertex needs finite x, y and z")),
        }
    }
    for _ in 0..faces {
        let (number, v) = row("face")?;
        let corners = v.first().copied().unwrap_or(0.0) as usize;
        if corners < 3 || v.len() <= corners {
            return Err(format!("line {number}: a face needs at least 3 corners"));
        }
        let corner = |k: usize| {
            let whole = v[k] >= 0.0 && v[k].fract() == 0.0;
            let point = points.get(v[k] as usize).filter(|_| whole);
            point.copied().ok_or(format!("line {number}: vertex {} of {vertices}", v[k]))
        };
        for k in 2..corners {
            found([corner(1)?, corner(k)?, corner(k + 1)?]);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sphere_has_788_unit_normals_towards_the_viewer() {
        let shape = Shape::sphere();
        assert_eq!(shape.len(), 788);
        assert!((shape.weights().iter().sum::<f64>() - 1.0).abs() < 1e-12);
        for n in (0..shape.len()).flat_map(|p| shape.normals(p)) {
            assert!((n.length() - 1.0).abs() < 1e-12 && n.z >= (1.0f64 - 0.985).sqrt() - 1e-12);
        }
    }

    #[test]
    fn a_mesh_weights_the_pixels_of_its_visible_faces() {
        let header = "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n\
                      element face 2\nproperty list uchar int vertex_indices\nend_header\n";
        // One triangle facing the viewer, one leaning by 45 degrees towards +x, one unit of area each.
        let body = "0 0 0\n1 0 0\n0 2 0\n0 0 0\n0.7071 0 -0.7071\n0 2 0\n3 0 1 2\n3 3 4 5\n";
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("two.ply");
        std::fs::write(&path, format!("{header}{body}")).unwrap();
        let shape = Shape::mesh(&path).unwrap();
        let weight = |row: usize, column: usize| {
            shape.cells().iter().position(|&c| c == row * SIDE + column).map(|p| shape.weights()[p]).unwrap()
        };
        let leaning = 0.5f64.sqrt();
        assert!((weight(16, 16) - 1.0 / (1.0 + leaning)).abs() < 1e-4);
        assert!((weight(16, 27) - leaning / (1.0 + leaning)).abs() < 1e-4);

        std::fs::write(&path, &header[..60]).unwrap();
        assert!(matches!(Shape::mesh(&path), Err(LightError::Mesh { .. })));
        std::fs::write(&path, format!("{header}{}", body.replace("3 3 4 5", "3 3 4 9"))).unwrap();
        assert!(Shape::mesh(&path).unwrap_err().to_string().contains("line 17: vertex 9 of 6"));
    }
}
