//! The sums over one block, compiled once for every x86-64 processor and once for those with AVX2.
//!
//! Loops run over fixed groups of [`LANES`] azimuths with one partial sum a lane, so that the order of additions, and
//! with it every bit of the result, is the same whatever the instruction set. Two BRDFs that are their own mirror images
//! at the plane of incidence are folded ([`Extent::FOLDED`]): half the cells, counted twice.
//!
//! Colour spaces are chosen by constants and not passed as closures: one that the compiler leaves out of line would be
//! compiled without AVX2, at five times the cost.

use super::block::{Block, Extent, Plane};
use super::elementary::{abs_ln_ratio, cbrt, cbrt_of_square};
use super::variant::{Formula, LpVariant};
use super::{AZIMUTHS, EPSILON, POLAR, POLAR_CLAMPED};
use crate::math::color::{CIELAB_LINEAR_BELOW, CIELAB_SLOPE, WHITE_D65, XYZ_FROM_REC709};
use multiversion::multiversion;

const LANES: usize = 4;

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

impl BlockSums {
    /// Those that a formula weighs.
    pub fn of(&self, formula: Formula) -> &[f64; 3] {
        match formula {
            Formula::D1 | Formula::D2 | Formula::D4 => &self.square,
            Formula::D5 => &self.absolute,
            Formula::D3 | Formula::D7 => &self.root,
            Formula::D8 => &self.log,
            Formula::D9 => &self.log_square,
            Formula::D6 => &self.study_lab,
            Formula::Lab => &self.lab,
        }
    }
}

/// Three channels, or three colour coordinates.
type Planes = [Plane; 3];

const BLACK: Planes = [[0.0; AZIMUTHS]; 3];

/// What is computed from the reference alone, for any number of candidates: reused by the blocks of a row.
pub(super) struct ReferenceSide {
    /// Black where nothing is valid.
    pub block: Block,
    roots: Planes,
    /// L*, a*, b* of the values and of their cube roots.
    lab: [Planes; 2],
    /// The study's colour coordinates, and their signed cube roots.
    study_lab: [Planes; 2],
}

impl ReferenceSide {
    pub fn new() -> Box<Self> {
        Box::new(Self { block: Block::new(), roots: BLACK, lab: [BLACK; 2], study_lab: [BLACK; 2] })
    }

    /// Computes what `work` needs of the block.
    pub fn prepare(&mut self, extent: Extent, work: &Work) {
        match extent == Extent::FOLDED {
            true => prepare::<true>(self, work),
            false => prepare::<false>(self, work),
        }
    }
}

/// The block of a candidate and room for what is computed from it: reused by the blocks of a row.
pub(super) struct Workspace {
    pub candidate: Block,
    /// Cube roots of the candidate.
    roots: Planes,
    /// Colour coordinates of the candidate.
    colours: Planes,
    /// Differences or logarithms, whose powers are summed.
    terms: Plane,
}

impl Workspace {
    pub fn new() -> Box<Self> {
        Box::new(Self { candidate: Block::new(), roots: BLACK, colours: BLACK, terms: [0.0; AZIMUTHS] })
    }

    /// The sums of the candidate against the reference, as they are and of their cube roots, `cosine` being c(theta_i, theta_o) of
    /// the logarithms.
    pub fn sums(&mut self, reference: &ReferenceSide, extent: Extent, cosine: f64, work: &Work) -> [BlockSums; 2] {
        match extent == Extent::FOLDED {
            true => sums::<true>(self, reference, cosine, work),
            false => sums::<false>(self, reference, cosine, work),
        }
    }
}

/// The very code of [`prepare_in_place`], as [`sums`] is of [`sums_in_place`].
#[multiversion(targets("x86_64+avx2"))]
fn prepare<const FOLDED: bool>(side: &mut ReferenceSide, work: &Work) {
    prepare_in_place::<FOLDED>(side, work);
}

#[inline(always)]
fn prepare_in_place<const FOLDED: bool>(side: &mut ReferenceSide, work: &Work) {
    let extent = if FOLDED { Extent::FOLDED } else { Extent::WHOLE };
    let ReferenceSide { block, roots, lab, study_lab } = side;
    if work.needs_cube_roots() {
        cube_roots(&block.rgb, roots, extent);
    }
    if work.needs(0, Group::Lab) {
        colour_coordinates::<false>(&block.rgb, &mut lab[0], extent, &RADIANCE_FACTOR);
    }
    if work.needs(1, Group::Lab) {
        colour_coordinates::<false>(roots, &mut lab[1], extent, &RADIANCE_FACTOR_ROOT);
    }
    if work.needs(0, Group::StudyLab) || work.needs(1, Group::StudyLab) {
        let [plain, rooted] = study_lab;
        colour_coordinates::<true>(&block.rgb, plain, extent, &STUDY_XYZ);
        if work.needs(1, Group::StudyLab) {
            for (from, to) in plain.iter().zip(rooted) {
                to[..extent.cells].iter_mut().zip(from).for_each(|(to, x)| *to = signed_cbrt(*x));
            }
        }
    }
}

/// The very code of [`sums_in_place`]; AVX2 lets the compiler use registers of four f64.
#[multiversion(targets("x86_64+avx2"))]
fn sums<const FOLDED: bool>(
    space: &mut Workspace,
    reference: &ReferenceSide,
    cosine: f64,
    work: &Work,
) -> [BlockSums; 2] {
    sums_in_place::<FOLDED>(space, reference, cosine, work)
}

#[inline(always)]
fn sums_in_place<const FOLDED: bool>(
    space: &mut Workspace,
    reference: &ReferenceSide,
    cosine: f64,
    work: &Work,
) -> [BlockSums; 2] {
    // A constant, so that every loop has a known length.
    let extent = if FOLDED { Extent::FOLDED } else { Extent::WHOLE };
    let Workspace { candidate, roots, colours, terms } = space;
    let mut sums = [BlockSums::default(); 2];
    if work.needs_cube_roots() {
        cube_roots(&candidate.rgb, roots, extent);
    }
    let forms =
        [(&reference.block.rgb, &candidate.rgb, &RADIANCE_FACTOR), (&reference.roots, &*roots, &RADIANCE_FACTOR_ROOT)];
    for (form, (of_reference, of_candidate, relative_xyz)) in forms.into_iter().enumerate() {
        let sums = &mut sums[form];
        for channel in 0..3 {
            let (r, a) = (&of_reference[channel], &of_candidate[channel]);
            if work.needs(form, Group::Powers) {
                cellwise(r, a, terms, extent, |r, a| (a - r).abs());
                sums.square[channel] = sum_of_squares(terms, extent);
                sums.absolute[channel] = sum(terms, extent, |d| d);
            }
            if work.needs(form, Group::Roots) {
                cellwise(r, a, terms, extent, |r, a| cbrt_of_square((a - r).abs()));
                sums.root[channel] = sum(terms, extent, |t| t);
            }
            if work.needs(form, Group::Logs) {
                cellwise(r, a, terms, extent, |r, a| abs_ln_ratio(r * cosine + EPSILON, a * cosine + EPSILON));
                sums.log[channel] = sum(terms, extent, |l| l);
                sums.log_square[channel] = sum_of_squares(terms, extent);
            }
        }
        if work.needs(form, Group::Lab) {
            colour_coordinates::<false>(of_candidate, colours, extent, relative_xyz);
            sums.lab = colour_squares(&reference.lab[form], colours, terms, extent, |a| a);
        }
    }
    if work.needs(0, Group::StudyLab) || work.needs(1, Group::StudyLab) {
        let [plain, rooted] = &reference.study_lab;
        colour_coordinates::<true>(&candidate.rgb, colours, extent, &STUDY_XYZ);
        sums[0].study_lab = colour_squares(plain, colours, terms, extent, |a| a);
        if work.needs(1, Group::StudyLab) {
            sums[1].study_lab = colour_squares(rooted, colours, terms, extent, signed_cbrt);
        }
    }
    sums
}

/// Sum of `term(value)` over a plane, [`LANES`] partial sums at a time.
#[inline(always)]
fn sum(plane: &Plane, extent: Extent, term: impl Fn(f64) -> f64) -> f64 {
    let mut lanes = [0.0; LANES];
    add_to(&mut lanes, &plane[..extent.doubled], &term);
    add_to(&mut lanes, &plane[..extent.cells], &term);
    // The halves of a register first.
    (lanes[0] + lanes[2]) + (lanes[1] + lanes[3])
}

#[inline(always)]
fn add_to(lanes: &mut [f64; LANES], cells: &[f64], term: &impl Fn(f64) -> f64) {
    for group in cells.as_chunks::<LANES>().0 {
        for (lane, value) in lanes.iter_mut().zip(group) {
            *lane += term(*value);
        }
    }
}

#[inline(always)]
fn sum_of_squares(plane: &Plane, extent: Extent) -> f64 {
    sum(plane, extent, |x| x * x)
}

/// `terms = combine(r, a)`, cell by cell.
#[inline(always)]
fn cellwise(r: &Plane, a: &Plane, terms: &mut Plane, extent: Extent, combine: impl Fn(f64, f64) -> f64) {
    for ((term, r), a) in terms[..extent.cells].iter_mut().zip(r).zip(a) {
        *term = combine(*r, *a);
    }
}

#[inline(always)]
fn signed_cbrt(x: f64) -> f64 {
    cbrt(x.abs()).copysign(x)
}

#[inline(always)]
fn cube_roots(from: &Planes, to: &mut Planes, extent: Extent) {
    for (from, to) in from.iter().zip(to) {
        to[..extent.cells].iter_mut().zip(from).for_each(|(to, x)| *to = cbrt(*x));
    }
}

/// The colour coordinates of every cell: of the study, or of CIELAB.
#[inline(always)]
fn colour_coordinates<const OF_STUDY: bool>(
    from: &Planes,
    to: &mut Planes,
    extent: Extent,
    relative_xyz: &[[f64; 3]; 3],
) {
    let n = extent.cells;
    // Slices of one length, so that no index below needs a check.
    let [red, green, blue] = from.each_ref().map(|plane| &plane[..n]);
    let [x, y, z] = to.each_mut().map(|plane| &mut plane[..n]);
    for k in 0..n {
        let rgb = [red[k], green[k], blue[k]];
        [x[k], y[k], z[k]] = if OF_STUDY { study_lab(rgb, relative_xyz) } else { cielab(rgb, relative_xyz) };
    }
}

/// Sums of the squares of `of(a) - r`, for the three colour coordinates.
#[inline(always)]
fn colour_squares(
    reference: &Planes,
    candidate: &Planes,
    terms: &mut Plane,
    extent: Extent,
    of: impl Fn(f64) -> f64,
) -> [f64; 3] {
    let mut squares = [0.0; 3];
    for ((square, r), a) in squares.iter_mut().zip(reference).zip(candidate) {
        cellwise(r, a, terms, extent, |r, a| of(a) - r);
        *square = sum_of_squares(terms, extent);
    }
    squares
}

#[inline(always)]
fn select(condition: bool, yes: f64, no: f64) -> f64 {
    if condition { yes } else { no }
}

#[inline(always)]
fn transform(matrix: &[[f64; 3]; 3], c: [f64; 3]) -> [f64; 3] {
    let row = |m: &[f64; 3]| m[0] * c[0] + m[1] * c[1] + m[2] * c[2];
    [row(&matrix[0]), row(&matrix[1]), row(&matrix[2])]
}

/// The matrix of the study's program over its white: RGB is multiplied from the left, so that the columns of the
/// usual matrix weigh the channels; the white is that of values up to 100.
pub(super) const STUDY_XYZ: [[f64; 3]; 3] = [
    [0.412453 / 95.047, 0.212671 / 95.047, 0.019334 / 95.047],
    [0.357580 / 100.0, 0.715160 / 100.0, 0.119193 / 100.0],
    [0.180423 / 108.883, 0.072169 / 108.883, 0.950227 / 108.883],
];

/// The study's colour coordinates: f takes the cube root where it should be a line, and a line of slope 84/108 (for
/// 841/108) where it should be a cube root; L* is linear throughout.
#[inline(always)]
pub(super) fn study_lab(rgb: [f64; 3], relative_xyz: &[[f64; 3]; 3]) -> [f64; 3] {
    let [x, y, z] = transform(relative_xyz, rgb);
    // Both branches are computed, so that the loop has none.
    let f = |t: f64| select(t < CIELAB_LINEAR_BELOW, cbrt(t), 84.0 / 108.0 * t + 16.0 / 116.0);
    let (fx, fy, fz) = (f(x), f(y), f(z));
    [116.0 * y - 16.0, 500.0 * (fx - fy), 200.0 * (fy - fz)]
}

/// Matrix from the BRDF (1/sr) to X/Xn, Y/Yn, Z/Zn of the radiance factor pi f, and from cbrt(f) to those of
/// cbrt(pi f); a perfect white diffuser gives (1, 1, 1) in both.
const RADIANCE_FACTOR: [[f64; 3]; 3] = relative_xyz(std::f64::consts::PI);
const RADIANCE_FACTOR_ROOT: [[f64; 3]; 3] = relative_xyz(1.464_591_887_561_523_2);

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
    let [x, y, z] = transform(relative_xyz, rgb);
    let f = |t: f64| select(t > CIELAB_LINEAR_BELOW, cbrt(t), CIELAB_SLOPE * t + 4.0 / 29.0);
    let (fx, fy, fz) = (f(x), f(y), f(z));
    [116.0 * fy - 16.0, 500.0 * (fx - fy), 200.0 * (fy - fz)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::seed::stream;
    use rand::Rng;

    /// Nothing here is multiplied and added in one instruction. On a processor without AVX2 both sides are the same code.
    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let work = Work::for_variants(LpVariant::every());
        let mut rng = stream(3, "lp kernel", 0);
        for cosine in [1.0, 0.3, EPSILON] {
            let (mut space, mut side, mut plain) = (Workspace::new(), ReferenceSide::new(), ReferenceSide::new());
            for plane in side.block.rgb.iter_mut().chain(&mut space.candidate.rgb) {
                plane.iter_mut().for_each(|x| *x = 10f64.powf(rng.random_range(-6.0..5.0)));
            }
            plain.block = side.block.clone();
            for extent in [Extent::WHOLE, Extent::FOLDED] {
                let (prepare, sums): (fn(&mut _, &_), fn(&mut _, &_, _, &_) -> _) = match extent == Extent::FOLDED {
                    true => (prepare_in_place::<true>, sums_in_place::<true>),
                    false => (prepare_in_place::<false>, sums_in_place::<false>),
                };
                side.prepare(extent, &work);
                prepare(&mut plain, &work);
                let expected: [BlockSums; 2] = sums(&mut space, &plain, cosine, &work);
                assert_eq!(space.sums(&side, extent, cosine, &work), expected);
            }
        }
    }
}
