//! The sums over one block, compiled once for every x86-64 processor and once for those with AVX2.
//!
//! Loops run over fixed groups of [`LANES`] azimuths with one partial sum a lane, so that the order of additions, and
//! with it every bit of the result, is the same whatever the instruction set.

use super::block::{Block, Plane};
use super::elementary::{abs_ln_ratio, cbrt, cbrt_of_square};
use super::variant::{Formula, LpVariant};
use super::{EPSILON, POLAR, POLAR_CLAMPED};
use crate::math::color::{CIELAB_LINEAR_BELOW, CIELAB_SLOPE, WHITE_D65, XYZ_FROM_REC709};

const LANES: usize = 4;

/// A partial sum a lane.
type Lanes = [f64; LANES];

/// The groups of sums that share their expensive parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Group {
    /// Sums of d^2 and |d|: D1, D2, D4, D5.
    Powers,
    /// Sum of cbrt(d^2): D3, D7.
    Roots,
    /// Sums of |ln| and ln^2: D8, D9.
    Logs,
    /// D6.
    StudyLab,
    /// The correct CIELAB.
    Lab,
}

impl Group {
    fn of(formula: Formula) -> Self {
        match formula {
            Formula::D1 | Formula::D2 | Formula::D4 | Formula::D5 => Self::Powers,
            Formula::D3 | Formula::D7 => Self::Roots,
            Formula::D8 | Formula::D9 => Self::Logs,
            Formula::D6 => Self::StudyLab,
            Formula::Lab => Self::Lab,
        }
    }
}

/// What has to be computed for a set of variants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Work {
    /// By form (0 as it is, 1 cube root) and group.
    needed: [[bool; 5]; 2],
    /// Polar angles below this many degrees.
    pub limit: usize,
}

impl Work {
    pub fn for_variants(variants: impl IntoIterator<Item = LpVariant>) -> Self {
        let mut work = Self { needed: [[false; 5]; 2], limit: POLAR_CLAMPED };
        for variant in variants {
            work.needed[usize::from(variant.cube_root)][Group::of(variant.formula) as usize] = true;
            work.limit = if variant.clamped { work.limit } else { POLAR };
        }
        work
    }

    fn needs(&self, form: usize, group: Group) -> bool {
        self.needed[form][group as usize]
    }

    fn needs_cube_roots(&self) -> bool {
        [Group::Powers, Group::Roots, Group::Logs, Group::Lab].iter().any(|&group| self.needs(1, group))
    }
}

/// Sums over the azimuths of a block in one form, without the weights that are constant in a block. Three entries
/// are the channels, or L*, a* and b*.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct BlockSums {
    pub square: [f64; 3],
    pub absolute: [f64; 3],
    pub root: [f64; 3],
    pub log: [f64; 3],
    pub log_square: [f64; 3],
    pub study_lab: [f64; 3],
    pub lab: [f64; 3],
}

/// Both blocks and room for their cube roots: reused by the blocks of a row.
pub(super) struct Workspace {
    pub reference: Block,
    pub candidate: Block,
    reference_root: [Plane; 3],
    candidate_root: [Plane; 3],
}

impl Workspace {
    pub fn new() -> Box<Self> {
        let (reference, candidate) = (Block::new(), Block::new());
        Box::new(Self { reference_root: reference.rgb, candidate_root: candidate.rgb, reference, candidate })
    }

    /// The sums of the two blocks as they are and of their cube roots, `cosine` being c(theta_i, theta_o) of the
    /// logarithms.
    pub fn sums(&mut self, cosine: f64, work: &Work) -> [BlockSums; 2] {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the function is safe but for its need of AVX2, which the processor has.
            return unsafe { sums_avx2(self, cosine, work) };
        }
        sums(self, cosine, work)
    }
}

/// The very code of [`sums`]; the attribute lets the compiler use registers of four f64.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn sums_avx2(space: &mut Workspace, cosine: f64, work: &Work) -> [BlockSums; 2] {
    sums(space, cosine, work)
}

#[inline(always)]
fn sums(space: &mut Workspace, cosine: f64, work: &Work) -> [BlockSums; 2] {
    let mut sums = [BlockSums::default(); 2];
    if work.needs_cube_roots() {
        cube_roots(&space.reference.rgb, &mut space.reference_root);
        cube_roots(&space.candidate.rgb, &mut space.candidate_root);
    }
    let forms = [
        (&space.reference.rgb, &space.candidate.rgb, PI_LAB),
        (&space.reference_root, &space.candidate_root, CBRT_PI_LAB),
    ];
    for (form, (reference, candidate, xyz)) in forms.into_iter().enumerate() {
        let sums = &mut sums[form];
        for channel in 0..3 {
            let (r, a) = (&reference[channel], &candidate[channel]);
            if work.needs(form, Group::Powers) {
                (sums.square[channel], sums.absolute[channel]) = powers(r, a);
            }
            if work.needs(form, Group::Roots) {
                sums.root[channel] = roots(r, a);
            }
            if work.needs(form, Group::Logs) {
                (sums.log[channel], sums.log_square[channel]) = logs(r, a, cosine);
            }
        }
        if work.needs(form, Group::Lab) {
            sums.lab = lab_squares(reference, candidate, |rgb| cielab(rgb, &xyz), |component| component);
        }
    }
    let (reference, candidate) = (&space.reference.rgb, &space.candidate.rgb);
    if work.needs(0, Group::StudyLab) {
        sums[0].study_lab = lab_squares(reference, candidate, study_lab, |component| component);
    }
    if work.needs(1, Group::StudyLab) {
        sums[1].study_lab =
            lab_squares(reference, candidate, study_lab, |component| cbrt(component.abs()).copysign(component));
    }
    sums
}

#[inline(always)]
fn total(lanes: Lanes) -> f64 {
    (lanes[0] + lanes[1]) + (lanes[2] + lanes[3])
}

#[inline(always)]
fn pairs<'a>(r: &'a Plane, a: &'a Plane) -> impl Iterator<Item = (&'a Lanes, &'a Lanes)> {
    r.as_chunks::<LANES>().0.iter().zip(a.as_chunks::<LANES>().0)
}

#[inline(always)]
fn cube_roots(from: &[Plane; 3], to: &mut [Plane; 3]) {
    for (from, to) in from.iter().zip(to) {
        for (from, to) in from.iter().zip(to) {
            *to = cbrt(*from);
        }
    }
}

/// Sums of d^2 and |d|.
#[inline(always)]
fn powers(r: &Plane, a: &Plane) -> (f64, f64) {
    let (mut square, mut absolute) = ([0.0; LANES], [0.0; LANES]);
    for (r, a) in pairs(r, a) {
        for k in 0..LANES {
            let d = a[k] - r[k];
            square[k] += d * d;
            absolute[k] += d.abs();
        }
    }
    (total(square), total(absolute))
}

/// Sum of cbrt(d^2).
#[inline(always)]
fn roots(r: &Plane, a: &Plane) -> f64 {
    let mut root = [0.0; LANES];
    for (r, a) in pairs(r, a) {
        for k in 0..LANES {
            root[k] += cbrt_of_square((a[k] - r[k]).abs());
        }
    }
    total(root)
}

/// Sums of |ln((r c + eps)/(a c + eps))| and of its square.
#[inline(always)]
fn logs(r: &Plane, a: &Plane, cosine: f64) -> (f64, f64) {
    let (mut log, mut log_square) = ([0.0; LANES], [0.0; LANES]);
    for (r, a) in pairs(r, a) {
        for k in 0..LANES {
            let l = abs_ln_ratio(r[k] * cosine + EPSILON, a[k] * cosine + EPSILON);
            log[k] += l;
            log_square[k] += l * l;
        }
    }
    (total(log), total(log_square))
}

/// Sums of the squared differences of three colour coordinates, each passed through `curve`.
#[inline(always)]
fn lab_squares(
    reference: &[Plane; 3],
    candidate: &[Plane; 3],
    lab: impl Fn([f64; 3]) -> [f64; 3],
    curve: impl Fn(f64) -> f64,
) -> [f64; 3] {
    let mut squares = [[0.0; LANES]; 3];
    let groups = |planes: &[Plane; 3], group: usize, k: usize| planes.each_ref().map(|plane| plane[group * LANES + k]);
    for group in 0..super::AZIMUTHS / LANES {
        for k in 0..LANES {
            let (r, a) = (lab(groups(reference, group, k)), lab(groups(candidate, group, k)));
            for component in 0..3 {
                let d = curve(a[component]) - curve(r[component]);
                squares[component][k] += d * d;
            }
        }
    }
    squares.map(total)
}

#[inline(always)]
fn transform(matrix: &[[f64; 3]; 3], c: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| matrix[i][0] * c[0] + matrix[i][1] * c[1] + matrix[i][2] * c[2])
}

/// The study's colour coordinates: the program multiplies the row vector RGB by the matrix from the left, so that its
/// columns weigh the channels, and divides by a white of 100; f takes the cube root where it should be linear and a
/// line of slope 84/108 (for 841/108) where it should be a cube root; L* is linear throughout.
#[inline(always)]
fn study_lab(rgb: [f64; 3]) -> [f64; 3] {
    const COLUMNS: [[f64; 3]; 3] = [
        [0.412453 / 95.047, 0.212671 / 95.047, 0.019334 / 95.047],
        [0.357580 / 100.0, 0.715160 / 100.0, 0.119193 / 100.0],
        [0.180423 / 108.883, 0.072169 / 108.883, 0.950227 / 108.883],
    ];
    let xyz = transform(&COLUMNS, rgb);
    let [fx, fy, fz] = xyz.map(|t| if t < CIELAB_LINEAR_BELOW { cbrt(t) } else { 84.0 / 108.0 * t + 16.0 / 116.0 });
    [116.0 * xyz[1] - 16.0, 500.0 * (fx - fy), 200.0 * (fy - fz)]
}

/// Matrix from the BRDF (1/sr) to X/Xn, Y/Yn, Z/Zn of the radiance factor pi f, and from cbrt(f) to those of
/// cbrt(pi f); a perfect white diffuser gives (1, 1, 1) in both.
const PI_LAB: [[f64; 3]; 3] = relative_xyz(std::f64::consts::PI);
const CBRT_PI_LAB: [[f64; 3]; 3] = relative_xyz(1.464_591_887_561_523_2);

const fn relative_xyz(scale: f64) -> [[f64; 3]; 3] {
    let mut matrix = XYZ_FROM_REC709;
    let mut i = 0;
    while i < 9 {
        matrix[i / 3][i % 3] *= scale / WHITE_D65[i / 3];
        i += 1;
    }
    matrix
}

/// L*, a*, b* as [`crate::math::color::cielab`] defines them.
#[inline(always)]
fn cielab(rgb: [f64; 3], relative_xyz: &[[f64; 3]; 3]) -> [f64; 3] {
    let [fx, fy, fz] = transform(relative_xyz, rgb)
        .map(|t| if t > CIELAB_LINEAR_BELOW { cbrt(t) } else { CIELAB_SLOPE * t + 4.0 / 29.0 });
    [116.0 * fy - 16.0, 500.0 * (fx - fy), 200.0 * (fy - fz)]
}
