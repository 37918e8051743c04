//! The acceleration structure: a tree of four boxes a node over packs of four triangles.
//!
//! obvhs builds a binary tree (PLOC, Meister and Bittner 2018, doi:10.1109/TVCG.2017.2669983, with reinsertion); its nodes are
//! joined by fours, the largest box opened first, and a part of at most four triangles becomes a leaf. Boxes and triangles are tested four
//! at a time (Möller and Trumbore 1997, doi:10.1080/10867651.1997.10487468).
//! With it, a rendering of the Buddha takes two thirds of the CPU time that obvhs's own traversal of a compressed tree takes, whose boxes are
//! unpacked at every visit.

use glam::{Vec3A, Vec4};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::triangle::Triangle;
use std::time::Duration;

/// Marks a child that is a leaf.
const LEAF: u32 = 1 << 31;
/// Marks a child that is not there: its box is empty.
const NONE: u32 = u32::MAX;
/// Nodes that wait in nearly every tree, and in any: a deeper tree than 300 nodes is not made of finite coordinates.
const USUAL_STACK: usize = 64;
const LARGE_STACK: usize = 1024;
/// Roundings in the test of a box make it this much larger.
const LARGER: f32 = 1.000_001;

/// Four boxes, an axis a vector.
struct Node {
    low: [Vec4; 3],
    high: [Vec4; 3],
    children: [u32; 4],
}

/// Four triangles, an axis a vector: a corner and the edges from it. Lanes without a triangle have no edges.
struct Pack {
    corner: [Vec4; 3],
    first: [Vec4; 3],
    second: [Vec4; 3],
    ids: [u32; 4],
}

/// The tree.
pub struct Tree {
    nodes: Vec<Node>,
    packs: Vec<Pack>,
    /// Nodes from the root to the deepest leaf.
    depth: usize,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy)]
pub struct TriangleHit {
    /// Distance along the ray.
    pub distance: f32,
    /// The triangle, as it was given.
    pub triangle: usize,
    /// Weights of its second and third corner.
    pub weights: [f32; 2],
    /// The point, and the area vector.
    pub point: Vec3A,
    /// Not of unit length.
    pub normal: Vec3A,
}

/// A ray, an axis a vector.
struct Ray4 {
    from: [Vec4; 3],
    direction: [Vec4; 3],
    inverse: [Vec4; 3],
    backwards: [bool; 3],
}

impl Ray4 {
    #[inline(always)]
    fn new(from: Vec3A, direction: Vec3A) -> Self {
        let inverse = |d: f32| 1.0 / if d.abs() < 1e-20 { 1e-20f32.copysign(d) } else { d };
        let (from, direction) = (from.to_array(), direction.to_array());
        Self {
            from: from.map(Vec4::splat),
            direction: direction.map(Vec4::splat),
            inverse: direction.map(|d| Vec4::splat(inverse(d))),
            backwards: direction.map(|d| d.is_sign_negative()),
        }
    }

    /// Distances at which the ray enters the boxes, and which of them it meets before `most`.
    #[inline(always)]
    fn boxes(&self, node: &Node, most: f32) -> (Vec4, u32) {
        let side = |axis: usize| {
            let (near, far) = if self.backwards[axis] {
                (node.high[axis], node.low[axis])
            } else {
                (node.low[axis], node.high[axis])
            };
            ((near - self.from[axis]) * self.inverse[axis], (far - self.from[axis]) * self.inverse[axis])
        };
        let ((nx, fx), (ny, fy), (nz, fz)) = (side(0), side(1), side(2));
        let near = nx.max(ny).max(nz.max(Vec4::ZERO));
        let far = (fx.min(fy).min(fz) * LARGER).min(Vec4::splat(most));
        (near, near.cmple(far).bitmask())
    }

    /// Distances of the triangles, their weights, and which of them the ray meets before `most`.
    #[inline(always)]
    fn triangles(&self, pack: &Pack, most: f32) -> (Vec4, Vec4, Vec4, u32) {
        let dot = |a: &[Vec4; 3], b: &[Vec4; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let cross = |a: &[Vec4; 3], b: &[Vec4; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let p = cross(&self.direction, &pack.second);
        let inverse = Vec4::ONE / dot(&pack.first, &p);
        let s = [0, 1, 2].map(|k| self.from[k] - pack.corner[k]);
        let u = dot(&s, &p) * inverse;
        let q = cross(&s, &pack.first);
        let v = dot(&self.direction, &q) * inverse;
        let t = dot(&pack.second, &q) * inverse;
        let zero = Vec4::ZERO;
        let met = u.cmpge(zero) & v.cmpge(zero) & (u + v).cmple(Vec4::ONE) & t.cmpgt(zero) & t.cmplt(Vec4::splat(most));
        (t, u, v, met.bitmask())
    }
}

impl Tree {
    /// The tree of triangles, which must be at least one.
    pub fn new(triangles: &[Triangle]) -> Self {
        let params = BvhBuildParams { max_prims_per_leaf: 1, pre_split: false, ..BvhBuildParams::medium_build() };
        let binary = build_bvh2_from_tris(triangles, params, &mut Duration::default());
        let mut tree = Self { nodes: Vec::new(), packs: Vec::new(), depth: 0 };
        let counts = counts(&binary);
        tree.add(&binary, &counts, triangles, &[0], 1);
        tree
    }

    /// Adds a node whose children are gathered from `open`, nodes of the binary tree, and returns its place.
    fn add(&mut self, binary: &Bvh2, counts: &[u32], triangles: &[Triangle], open: &[usize], depth: usize) -> u32 {
        self.depth = self.depth.max(depth);
        let is_inner = |node: usize| counts[node] > 4;
        let mut open = open.to_vec();
        while open.len() < 4 {
            let area = |k: &usize| binary.nodes[open[*k]].aabb.half_area();
            let inner = (0..open.len()).filter(|&k| is_inner(open[k]));
            let Some(largest) = inner.max_by(|a, b| area(a).total_cmp(&area(b))) else { break };
            let first = binary.nodes[open.swap_remove(largest)].first_index as usize;
            open.extend([first, first + 1]);
        }
        let at = self.nodes.len();
        self.nodes.push(Node {
            low: [Vec4::splat(f32::INFINITY); 3],
            high: [Vec4::splat(f32::NEG_INFINITY); 3],
            children: [NONE; 4],
        });
        for (lane, &node) in open.iter().enumerate() {
            let aabb = binary.nodes[node].aabb;
            for axis in 0..3 {
                self.nodes[at].low[axis][lane] = aabb.min[axis];
                self.nodes[at].high[axis][lane] = aabb.max[axis];
            }
            let child = if is_inner(node) {
                let first = binary.nodes[node].first_index as usize;
                self.add(binary, counts, triangles, &[first, first + 1], depth + 1)
            } else {
                let mut ids = Vec::new();
                gather(binary, node, &mut ids);
                self.packs.push(pack(triangles, &ids));
                LEAF | (self.packs.len() - 1) as u32
            };
            self.nodes[at].children[lane] = child;
        }
        at as u32
    }

    /// Whether three waiting siblings a level fit into the usual stack.
    #[inline(always)]
    fn is_usual(&self) -> bool {
        3 * self.depth < USUAL_STACK
    }

    /// The first triangle before `most`.
    #[inline]
    pub fn closest(&self, from: Vec3A, direction: Vec3A, most: f32) -> Option<TriangleHit> {
        if self.is_usual() {
            self.closest_by::<USUAL_STACK>(from, direction, most)
        } else {
            self.closest_by::<LARGE_STACK>(from, direction, most)
        }
    }

    /// Whether any triangle is in the way.
    #[inline]
    pub fn blocks(&self, from: Vec3A, direction: Vec3A) -> bool {
        if self.is_usual() {
            self.blocks_by::<USUAL_STACK>(from, direction)
        } else {
            self.blocks_by::<LARGE_STACK>(from, direction)
        }
    }

    #[inline(always)]
    fn closest_by<const STACK: usize>(&self, from: Vec3A, direction: Vec3A, most: f32) -> Option<TriangleHit> {
        let ray = Ray4::new(from, direction);
        let mut best = most;
        let mut found = None;
        let mut stack = [(0u32, 0.0f32); STACK];
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let (at, distance) = stack[height];
            if distance >= best {
                continue;
            }
            if at & LEAF != 0 {
                let place = (at & !LEAF) as usize;
                let (t, u, v, mut met) = ray.triangles(&self.packs[place], best);
                while met != 0 {
                    let lane = met.trailing_zeros() as usize;
                    met &= met - 1;
                    if t[lane] < best {
                        best = t[lane];
                        found = Some((place, lane, [u[lane], v[lane]]));
                    }
                }
                continue;
            }
            let node = &self.nodes[at as usize];
            let (near, mut met) = ray.boxes(node, best);
            // The nearest goes on top.
            let bottom = height;
            while met != 0 {
                let lane = met.trailing_zeros() as usize;
                met &= met - 1;
                let entry = (node.children[lane], near[lane]);
                let mut place = height;
                while place > bottom && stack[place - 1].1 < entry.1 {
                    stack[place] = stack[place - 1];
                    place -= 1;
                }
                stack[place] = entry;
                height += 1;
            }
        }
        let (place, lane, weights) = found?;
        let pack = &self.packs[place];
        let vector = |axes: &[Vec4; 3]| Vec3A::new(axes[0][lane], axes[1][lane], axes[2][lane]);
        let (first, second) = (vector(&pack.first), vector(&pack.second));
        Some(TriangleHit {
            distance: best,
            triangle: pack.ids[lane] as usize,
            weights,
            point: vector(&pack.corner) + weights[0] * first + weights[1] * second,
            normal: first.cross(second),
        })
    }

    #[inline(always)]
    fn blocks_by<const STACK: usize>(&self, from: Vec3A, direction: Vec3A) -> bool {
        let ray = Ray4::new(from, direction);
        let mut stack = [0u32; STACK];
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let at = stack[height];
            if at & LEAF != 0 {
                if ray.triangles(&self.packs[(at & !LEAF) as usize], f32::MAX).3 != 0 {
                    return true;
                }
                continue;
            }
            let node = &self.nodes[at as usize];
            let (_, mut met) = ray.boxes(node, f32::MAX);
            while met != 0 {
                stack[height] = node.children[met.trailing_zeros() as usize];
                met &= met - 1;
                height += 1;
            }
        }
        false
    }
}

/// How many triangles are below each node.
fn counts(binary: &Bvh2) -> Vec<u32> {
    fn count(binary: &Bvh2, node: usize, counts: &mut [u32]) -> u32 {
        let found = &binary.nodes[node];
        let first = found.first_index as usize;
        counts[node] = if found.prim_count > 0 {
            found.prim_count
        } else {
            count(binary, first, counts) + count(binary, first + 1, counts)
        };
        counts[node]
    }
    let mut counts = vec![0; binary.nodes.len()];
    count(binary, 0, &mut counts);
    counts
}

/// The triangles below a node.
fn gather(binary: &Bvh2, node: usize, ids: &mut Vec<u32>) {
    let found = &binary.nodes[node];
    let first = found.first_index as usize;
    if found.prim_count > 0 {
        ids.extend(&binary.primitive_indices[first..first + found.prim_count as usize]);
    } else {
        gather(binary, first, ids);
        gather(binary, first + 1, ids);
    }
}

fn pack(triangles: &[Triangle], ids: &[u32]) -> Pack {
    let mut pack = Pack { corner: [Vec4::ZERO; 3], first: [Vec4::ZERO; 3], second: [Vec4::ZERO; 3], ids: [0; 4] };
    for (lane, &id) in ids.iter().take(4).enumerate() {
        let Triangle { v0, v1, v2 } = triangles[id as usize];
        for axis in 0..3 {
            pack.corner[axis][lane] = v0[axis];
            pack.first[axis][lane] = (v1 - v0)[axis];
            pack.second[axis][lane] = (v2 - v0)[axis];
        }
        pack.ids[lane] = id;
    }
    pack
}
