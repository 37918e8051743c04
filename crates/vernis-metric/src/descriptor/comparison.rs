//! Descriptors of version 2: what comparisons use of one BRDF, the numbers that a pair gives, and which of them a column reads.
//!
//! Every column reads one number of [`Numbers`], or its mean over the layouts of the lamps. The reverse pass goes the same way: slopes
//! by the columns become slopes by these numbers ([`Place`]), and each of the parts takes them on to the candidate's table, pictures
//! and albedos. The context is of the reference alone and has no slope by the candidate.

use super::display::{self, DISPLAYED, Displayed};
use super::features::Stored;
use super::frame::Frame;
use super::names::{ABSOLUTE_REGIONS, DISPLAY, LIGHTS, NORMS, SIGNED_REGIONS, SLOT, SLOT_DETAIL};
use super::pair::{self, PAIR, PLAIN, PLAIN_NAMES};
use super::picture::Picture;
use super::regions::{REGIONS, region};
use super::set::Family;
use super::{angular, context};
use crate::light::node_table::NODES;
use crate::math::Rgb;
use crate::math::color::LUMINANCE_REC709;
use angular::Ratios;
use context::Context;

/// What comparisons use of one BRDF.
#[derive(Debug, Clone)]
pub(super) struct Derived {
    pictures: Vec<Picture>,
    displayed: Vec<Displayed>,
    logs: Vec<[f64; 3]>,
    context: Context,
}

impl Derived {
    pub fn new(stored: &Stored, frame: &Frame) -> Self {
        let of_light = |picture: &Vec<Rgb>| (Picture::new(frame, picture), Displayed::new(frame, picture));
        let (pictures, displayed) = stored.pictures.iter().map(of_light).unzip();
        let logs = angular::logs(&stored.table);
        let context = context::context((&stored.table, &logs), stored.albedo);
        Self { pictures, displayed, logs, context }
    }

    /// What kind of material it is, in the order of [`super::names::CONTEXT`].
    pub fn context(&self) -> Context {
        self.context
    }
}

/// A BRDF with what was derived from it.
pub(super) type Side<'a> = (&'a Stored, &'a Derived);

/// The derivative of a number by what the descriptors of a BRDF are made of.
pub(crate) struct Slopes {
    /// By the values of the node table, one a node.
    pub table: Vec<Rgb>,
    /// By the radiance of the pixels, `[light][pixel]`.
    pub pictures: Vec<Vec<Rgb>>,
    /// By the luminance albedo from 0 and 60 deg.
    pub albedo: [f64; 2],
}

/// The numbers that a pair gives, or the slopes by them. Those that no family asks for are 0.
struct Numbers {
    /// By light, those of [`pair::compare`].
    pictures: Vec<[f64; PAIR]>,
    /// By light, the plain norms.
    plain: Vec<[f64; PLAIN]>,
    /// By light, those of [`display::compare`].
    display: Vec<[f64; DISPLAYED]>,
    angular: [Ratios; REGIONS],
    context: Context,
    change: Context,
}

/// Where a column finds its number.
#[derive(Clone, Copy)]
enum Place {
    Picture(Under, usize),
    Plain(Under, usize),
    Display(Under, usize),
    Angular(usize, usize),
    Context(usize),
    Change(usize),
}

#[derive(Clone, Copy)]
enum Under {
    /// The mean over the layouts: all lights but the last.
    Lamps,
    /// The last light.
    Slot,
}

impl Under {
    /// The lights and the share of each.
    fn lights(self, lights: usize) -> (std::ops::Range<usize>, f64) {
        match self {
            Self::Lamps => (0..lights - 1, 1.0 / (lights - 1) as f64),
            Self::Slot => (lights - 1..lights, 1.0),
        }
    }
}

fn position(names: &[&str], name: &str) -> Option<usize> {
    names.iter().position(|n| *n == name)
}

/// Where the columns of a family find their numbers, in order. None for distances of value distributions.
fn places(family: Family) -> Vec<Place> {
    let picture = |under: Under, names: &[&str]| -> Vec<Place> {
        let index = |name: &&str| position(&LIGHTS, name).unwrap_or(PAIR - 1);
        names.iter().map(|name| Place::Picture(under, index(name))).collect()
    };
    let angular = |names: &[&str], kind: usize| -> Vec<Place> {
        names.iter().filter_map(|name| region(name)).map(|r| Place::Angular(r, kind)).collect()
    };
    match family {
        Family::Lights => picture(Under::Lamps, &LIGHTS),
        Family::Slot => picture(Under::Slot, &SLOT),
        Family::SlotDetail => picture(Under::Slot, &SLOT_DETAIL),
        Family::Angular => [angular(&SIGNED_REGIONS, 0), angular(&ABSOLUTE_REGIONS, 1)].concat(),
        Family::AngularFull => (0..REGIONS).flat_map(|r| (0..4).map(move |kind| Place::Angular(r, kind))).collect(),
        Family::Context => (0..10).map(Place::Context).collect(),
        Family::Change => (0..10).map(Place::Change).collect(),
        Family::Display => {
            let of_light = |under: Under| (0..DISPLAY.len()).map(move |k| Place::Display(under, k));
            of_light(Under::Lamps).chain(of_light(Under::Slot)).collect()
        }
        Family::Norms => NORMS.iter().filter_map(|name| plain_place(name)).collect(),
        Family::Wasserstein => Vec::new(),
    }
}

/// Number of columns of a family; 0 for distances of value distributions.
pub(super) fn width(family: Family) -> usize {
    places(family).len()
}

/// Where the plain form of `lights.dE` and the like stands.
fn plain_place(name: &str) -> Option<Place> {
    let (family, name) = name.split_once('.')?;
    let plain = |under: Under| Some(Place::Plain(under, position(&PLAIN_NAMES, name)?));
    match family {
        "lights" => plain(Under::Lamps),
        "slot" | "slot-detail" => plain(Under::Slot),
        "display" if name == "lamps.rms" => Some(Place::Display(Under::Lamps, DISPLAYED - 1)),
        "display" => Some(Place::Display(Under::Slot, DISPLAYED - 1)),
        _ => Some(Place::Angular(region(name.strip_prefix("aY.")?)?, 4)),
    }
}

impl Numbers {
    fn zero(lights: usize) -> Self {
        Self {
            pictures: vec![[0.0; PAIR]; lights],
            plain: vec![[0.0; PLAIN]; lights],
            display: vec![[0.0; DISPLAYED]; lights],
            angular: [[0.0; 5]; REGIONS],
            context: [0.0; 10],
            change: [0.0; 10],
        }
    }

    fn new(families: &[Family], a: Side<'_>, b: Side<'_>, frame: &Frame) -> Self {
        let uses = |wanted: &[Family]| families.iter().any(|f| wanted.contains(f));
        let mut numbers = Self::zero(a.1.pictures.len());
        let pictures = || a.1.pictures.iter().zip(&b.1.pictures);
        if uses(&[Family::Lights, Family::Slot, Family::SlotDetail]) {
            numbers.pictures = pictures().map(|(a, b)| pair::compare(frame, a, b)).collect();
        }
        if uses(&[Family::Norms]) {
            numbers.plain = pictures().map(|(a, b)| pair::compare_plainly(frame, a, b)).collect();
        }
        if uses(&[Family::Display, Family::Norms]) {
            let pairs = a.1.displayed.iter().zip(&b.1.displayed);
            numbers.display = pairs.map(|(a, b)| display::compare(frame, a, b)).collect();
        }
        if uses(&[Family::Angular, Family::AngularFull, Family::Norms]) {
            numbers.angular = angular::compare((&a.0.table, &a.1.logs), (&b.0.table, &b.1.logs));
        }
        numbers.context = a.1.context;
        numbers.change = std::array::from_fn(|k| b.1.context[k] - a.1.context[k]);
        numbers
    }

    fn read(&self, place: Place) -> f64 {
        let mean = |under: Under, of_light: &dyn Fn(usize) -> f64| {
            let (lights, share) = under.lights(self.pictures.len());
            lights.map(of_light).sum::<f64>() * share
        };
        match place {
            Place::Picture(under, k) => mean(under, &|l| self.pictures[l][k]),
            Place::Plain(under, k) => mean(under, &|l| self.plain[l][k]),
            Place::Display(under, k) => mean(under, &|l| self.display[l][k]),
            Place::Angular(region, kind) => self.angular[region][kind],
            Place::Context(k) => self.context[k],
            Place::Change(k) => self.change[k],
        }
    }

    /// Adds the slope by a column: the transpose of [`Numbers::read`].
    fn add(&mut self, place: Place, by: f64) {
        match place {
            Place::Picture(under, _) | Place::Plain(under, _) | Place::Display(under, _) => {
                let (lights, share) = under.lights(self.pictures.len());
                for l in lights {
                    match place {
                        Place::Picture(_, k) => self.pictures[l][k] += share * by,
                        Place::Plain(_, k) => self.plain[l][k] += share * by,
                        Place::Display(_, k) => self.display[l][k] += share * by,
                        _ => {}
                    }
                }
            }
            Place::Angular(region, kind) => self.angular[region][kind] += by,
            Place::Context(k) => self.context[k] += by,
            Place::Change(k) => self.change[k] += by,
        }
    }
}

/// The descriptors of `families` of a candidate against a reference, in order. Distances of value distributions have nothing to
/// do with the version, and none here.
pub(super) fn compare(families: &[Family], reference: Side<'_>, candidate: Side<'_>, frame: &Frame) -> Vec<Vec<f64>> {
    let numbers = Numbers::new(families, reference, candidate, frame);
    families.iter().map(|f| places(*f).into_iter().map(|place| numbers.read(place)).collect()).collect()
}

/// The derivative of a number by what the candidate's descriptors are made of, from its derivative by the descriptors of `families`,
/// in order: the reverse pass of [`compare`]. Distances of value distributions must not be among them.
pub(super) fn transpose(
    families: &[Family],
    reference: Side<'_>,
    candidate: Side<'_>,
    frame: &Frame,
    by_descriptor: &[f64],
) -> Slopes {
    let (a, b) = (reference.1, candidate.1);
    let mut by = Numbers::zero(a.pictures.len());
    let columns = families.iter().flat_map(|f| places(*f));
    columns.zip(by_descriptor).for_each(|(place, slope)| by.add(place, *slope));

    let mut slopes = Slopes { table: vec![[0.0; 3]; NODES], pictures: Vec::new(), albedo: [0.0; 2] };
    for (l, radiance) in candidate.0.pictures.iter().enumerate() {
        let used = by.pictures[l].iter().chain(&by.plain[l]).any(|slope| *slope != 0.0);
        let mut by_radiance = if used {
            let to = pair::transpose(frame, &a.pictures[l], &b.pictures[l], &by.pictures[l], &by.plain[l]);
            b.pictures[l].transpose(frame, radiance, to)
        } else {
            vec![[0.0; 3]; radiance.len()]
        };
        display::add_slopes(frame, &a.displayed[l], (&b.displayed[l], radiance), &by.display[l], &mut by_radiance);
        slopes.pictures.push(by_radiance);
    }
    let logged = ((&reference.0.table, &*a.logs), (&candidate.0.table, &*b.logs));
    angular::add_slopes(logged.0, logged.1, &by.angular, &mut slopes.table);
    context::add_slopes(&candidate.0.table, candidate.0.albedo, &by.change, &mut slopes.table, &mut slopes.albedo);
    slopes
}

/// The slopes by the two colours of the albedo from those by its luminance.
pub(super) fn albedo_slopes(by: [f64; 2]) -> Vec<Rgb> {
    by.map(|by| LUMINANCE_REC709.map(|l| l * by)).to_vec()
}
