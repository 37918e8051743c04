//! A mesh of triangles.

use std::collections::HashMap;

/// Most faces of a mesh: with what it takes to trace them, about 400 MB.
pub const MOST_FACES: usize = 2_000_000;

/// Which normals a mesh is shaded with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Normals {
    /// Those of its faces: flat facets.
    Face,
    /// Those of its file, or the means about each vertex, weighted by the angles there (Thürmer and Wüthrich 1998,
    /// doi:10.1080/10867651.1998.10487487); interpolated.
    Smooth,
}

/// What is unusual about a mesh and can be rendered all the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Flaws {
    /// Faces without area, left out.
    pub without_area: usize,
    /// Edges of more than two faces: the mesh is not a manifold.
    pub crowded_edges: usize,
    /// Edges of one face: the mesh is not closed.
    pub open_edges: usize,
}

/// Triangles, with a normal for each corner where it is smooth.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    pub(super) positions: Vec<[f64; 3]>,
    pub(super) faces: Vec<[u32; 3]>,
    /// Unit vectors; empty where faces are flat.
    pub(super) normals: Vec<[f64; 3]>,
    /// Positions in `normals` of the corners of each face; empty where faces are flat.
    pub(super) normal_faces: Vec<[u32; 3]>,
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| a[k] - b[k])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

/// Unit vector along `a`, or `a` itself where it is 0.
fn unit(a: [f64; 3]) -> [f64; 3] {
    let length = dot(a, a).sqrt();
    if length > 0.0 { a.map(|x| x / length) } else { a }
}

impl Mesh {
    /// The mesh of these vertices and faces, with flat facets.
    ///
    /// # Errors
    /// What is wrong: no face, too many, a coordinate that is not finite, a corner that there is not, no area at all.
    pub fn new(positions: Vec<[f64; 3]>, faces: Vec<[u32; 3]>) -> Result<Self, String> {
        if faces.is_empty() {
            return Err("it has no face; it must have at least 1".to_owned());
        }
        if faces.len() > MOST_FACES {
            return Err(format!("it has {} triangles; it must have at most {MOST_FACES}", faces.len()));
        }
        if let Some(k) = positions.iter().position(|p| !p.iter().all(|x| x.abs() <= 1e9)) {
            return Err(format!("vertex {k} is {:?}; coordinates must be numbers from -1e9 to 1e9", positions[k]));
        }
        let missing = |face: &[u32; 3]| face.iter().any(|&v| v as usize >= positions.len());
        if let Some(k) = faces.iter().position(missing) {
            return Err(format!(
                "face {k} has the corners {:?}; there are {} vertices, numbered from 0",
                faces[k],
                positions.len()
            ));
        }
        let mesh = Self { positions, faces, normals: Vec::new(), normal_faces: Vec::new() };
        if (0..mesh.faces.len()).all(|k| mesh.area_vector(k) == [0.0; 3]) {
            return Err("none of its faces has an area; at least one must".to_owned());
        }
        Ok(mesh)
    }

    /// The corners of a face.
    pub(crate) fn corners(&self, face: usize) -> [[f64; 3]; 3] {
        self.faces[face].map(|v| self.positions[v as usize])
    }

    /// The normals at the corners of a face, if the mesh is smooth.
    pub(crate) fn corner_normals(&self, face: usize) -> Option<[[f64; 3]; 3]> {
        self.normal_faces.get(face).map(|corners| corners.map(|v| self.normals[v as usize]))
    }

    /// Twice the area of a face, along its normal.
    pub(crate) fn area_vector(&self, face: usize) -> [f64; 3] {
        let [a, b, c] = self.corners(face);
        cross(minus(b, a), minus(c, a))
    }

    /// Number of faces.
    pub fn len(&self) -> usize {
        self.faces.len()
    }

    /// Whether there is no face: never.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// Smallest and largest coordinates.
    pub fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        let used = || self.faces.iter().flatten().map(|&v| self.positions[v as usize]);
        let edge = |start: f64, pick: fn(f64, f64) -> f64| {
            used().fold([start; 3], |edge, p| [0, 1, 2].map(|k| pick(edge[k], p[k])))
        };
        (edge(f64::INFINITY, f64::min), edge(f64::NEG_INFINITY, f64::max))
    }

    /// Moved by `translate`, then scaled by `scale`.
    pub fn placed(mut self, translate: [f64; 3], scale: f64) -> Self {
        for p in &mut self.positions {
            *p = [0, 1, 2].map(|k| scale * (p[k] + translate[k]));
        }
        if scale < 0.0 {
            self.normals.iter_mut().flatten().for_each(|x| *x = -*x);
        }
        self
    }

    /// On the table: the middle of its box above the origin, its lowest point at y = 0, as large as fits into 2 in height and 1.5 across.
    pub fn on_the_table(self) -> Self {
        let (low, high) = self.bounds();
        let translate = [-0.5 * (low[0] + high[0]), -low[1], -0.5 * (low[2] + high[2])];
        let [width, height, depth] = [0, 1, 2].map(|k| (high[k] - low[k]).max(1e-9));
        self.placed(translate, (2.0 / height).min(1.5 / width.max(depth)))
    }

    /// With the normals of its file, or the means about each vertex.
    pub fn smooth(mut self) -> Self {
        if !self.normal_faces.is_empty() {
            return self;
        }
        let mut normals = vec![[0.0; 3]; self.positions.len()];
        for face in 0..self.faces.len() {
            let normal = unit(self.area_vector(face));
            let corners = self.corners(face);
            for k in 0..3 {
                let [to_next, to_last] = [1, 2].map(|step| unit(minus(corners[(k + step) % 3], corners[k])));
                let angle = dot(to_next, to_last).clamp(-1.0, 1.0).acos();
                let sum = &mut normals[self.faces[face][k] as usize];
                *sum = [0, 1, 2].map(|c| sum[c] + angle * normal[c]);
            }
        }
        // A vertex whose faces cancel out keeps the normal of each face.
        self.normals = normals.into_iter().map(unit).collect();
        self.normal_faces = self.faces.clone();
        self
    }

    /// With flat facets.
    pub fn flat(mut self) -> Self {
        self.normals.clear();
        self.normal_faces.clear();
        self
    }

    /// What is unusual about it.
    pub fn flaws(&self) -> Flaws {
        let mut edges: HashMap<(u32, u32), u32> = HashMap::with_capacity(3 * self.faces.len() / 2);
        for face in &self.faces {
            for k in 0..3 {
                let (a, b) = (face[k], face[(k + 1) % 3]);
                *edges.entry((a.min(b), a.max(b))).or_default() += 1;
            }
        }
        let count = |wanted: fn(u32) -> bool| edges.values().filter(|n| wanted(**n)).count();
        Flaws {
            without_area: (0..self.faces.len()).filter(|&k| self.area_vector(k) == [0.0; 3]).count(),
            crowded_edges: count(|n| n > 2),
            open_edges: count(|n| n == 1),
        }
    }

    /// Whether a point is inside, by most of seven rays: each crosses the faces of a closed mesh an odd number of times.
    pub(crate) fn contains(&self, point: [f64; 3]) -> bool {
        let (low, high) = self.bounds();
        if (0..3).any(|k| point[k] < low[k] || point[k] > high[k]) {
            return false;
        }
        let inside = (0..7).filter(|&ray| {
            // Directions in no plane of any symmetry.
            let (z, phi) = ((ray as f64 + 0.37) / 3.7 - 0.93, 2.399_963 * ray as f64 + 0.123);
            let side = (1.0 - z * z).max(0.0).sqrt();
            let direction = [side * phi.cos(), side * phi.sin(), z];
            (0..self.faces.len()).filter(|&face| self.crosses(face, point, direction)).count() % 2 == 1
        });
        inside.count() > 3
    }

    fn crosses(&self, face: usize, from: [f64; 3], direction: [f64; 3]) -> bool {
        let [a, b, c] = self.corners(face);
        let (e1, e2, s) = (minus(b, a), minus(c, a), minus(from, a));
        let p = cross(direction, e2);
        let q = cross(s, e1);
        let det = dot(e1, p);
        let (u, v, t) = (dot(s, p) / det, dot(direction, q) / det, dot(e2, q) / det);
        det != 0.0 && u >= 0.0 && v >= 0.0 && u + v < 1.0 && t > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> Mesh {
        let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        Mesh::new(positions, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]).unwrap()
    }

    #[test]
    fn inside_and_outside_are_told_apart() {
        let mesh = tetrahedron();
        assert!(mesh.contains([0.2, 0.2, 0.2]) && mesh.contains([0.01, 0.5, 0.01]));
        assert!(!mesh.contains([0.5, 0.5, 0.5]) && !mesh.contains([2.0, 0.0, 0.0]));
        assert_eq!(mesh.flaws(), Flaws::default());
    }

    #[test]
    fn it_is_moved_first_and_scaled_then() {
        let mesh = tetrahedron().placed([1.0, 0.0, -1.0], 2.0);
        assert_eq!(mesh.bounds(), ([2.0, 0.0, -2.0], [4.0, 2.0, 0.0]));
        assert_eq!(tetrahedron().on_the_table().bounds(), ([-0.75, 0.0, -0.75], [0.75, 1.5, 0.75]));
    }

    #[test]
    fn smooth_normals_are_weighted_by_angles() {
        let mesh = tetrahedron().smooth();
        // At the corner of three right angles, minus the diagonal.
        let expected = -(1.0f64 / 3.0).sqrt();
        assert!(mesh.normals[0].iter().all(|x| (x - expected).abs() < 1e-12));
        assert_eq!(mesh.flat(), tetrahedron());
    }

    #[test]
    fn what_cannot_be_rendered_is_refused() {
        let three = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let message = |positions: &[[f64; 3]], faces: Vec<[u32; 3]>| Mesh::new(positions.to_vec(), faces).unwrap_err();
        assert!(message(&three, vec![]).contains("no face"));
        assert!(message(&three, vec![[0, 1, 3]]).contains("face 0 has the corners [0, 1, 3]; there are 3 vertices"));
        assert!(message(&three, vec![[0, 1, 1]]).contains("none of its faces has an area"));
        let nan = [[f64::NAN, 0.0, 0.0], three[1], three[2]];
        assert!(message(&nan, vec![[0, 1, 2]]).contains("vertex 0 is [NaN"));
        let two = Mesh::new(three, vec![[0, 1, 2], [0, 0, 1], [2, 1, 0], [0, 1, 2]]).unwrap();
        assert_eq!(two.flaws().without_area, 1);
        assert!(two.flaws().crowded_edges > 0);
    }
}
