//! Small pictures of materials for people to look at: a sphere under one light, seen from the front.
//!
//!   pixel = sRGB(EXPOSURE * picture),   picture as in [`crate::light::operator`]
//!
//! Radiance above 1 / [`EXPOSURE`] is cut off. The exposure is the same for every material, so that bright and dark ones can
//! be told apart. The picture is that of the BRDF's node table, as the descriptors see it: the finest highlights of mirrors
//! are blunted. Source of the curve: IEC 61966-2-1. Cost: [`Sphere::new`] takes about 1 ms and 10 kB a normal, and then a sphere of
//! 48 pixels a side 1 ms a BRDF: keep it.

use super::{Light, LightError, NodeTable, Operator, Sampling};
use crate::brdf::Brdf;
use crate::math::color::srgb;
use crate::math::{Rgb, Vec3};

/// White paper under the lights of mean luminance 3 that [`Light`] makes comes out at about 1.
pub const EXPOSURE: f64 = 0.3;
/// Pixels a side of the largest picture with several normals a pixel; in larger ones a pixel spans little of the sphere.
const SMALL: usize = 48;

/// Normals a pixel, along each axis.
fn sub_samples(side: usize) -> usize {
    if side <= SMALL { 2 } else { 1 }
}

/// A sphere under a light, ready for any BRDF.
pub struct Sphere {
    side: usize,
    /// Positions of the pixels that show the sphere, row by row.
    pixels: Vec<usize>,
    operator: Operator,
}

impl Sphere {
    /// A picture of `side` x `side` pixels that the sphere fills.
    pub fn new(side: usize, light: &Light) -> Self {
        let subs = sub_samples(side);
        let normals = |pixel: usize| -> Vec<Vec3> {
            let at =
                |cell: usize, sub: usize| (cell as f64 + (sub as f64 + 0.5) / subs as f64) / side as f64 * 2.0 - 1.0;
            (0..subs * subs)
                .filter_map(|s| {
                    let (x, y) = (at(pixel % side, s % subs), -at(pixel / side, s / subs));
                    let z2 = 1.0 - x * x - y * y;
                    (z2 > 0.0).then(|| Vec3::new(x, y, z2.sqrt()))
                })
                .collect()
        };
        let shown: Vec<(usize, Vec<Vec3>)> =
            (0..side * side).map(|p| (p, normals(p))).filter(|(_, n)| n.len() == subs * subs).collect();
        let (pixels, normals): (Vec<usize>, Vec<Vec<Vec3>>) = shown.into_iter().unzip();
        Self { side, pixels, operator: Operator::build(&normals, std::slice::from_ref(light), Sampling::Averages) }
    }

    /// Linear radiance of every pixel of the picture; `None` beside the sphere.
    ///
    /// # Errors
    /// A BRDF without measured values.
    pub fn radiance(&self, brdf: &dyn Brdf) -> Result<Vec<Option<Rgb>>, LightError> {
        let table = NodeTable::sample(brdf, Sampling::Averages)?;
        let mut picture = vec![None; self.side * self.side];
        let shown = self.operator.apply(table.values());
        let values = shown.into_iter().flatten();
        self.pixels.iter().zip(values).for_each(|(&pixel, value)| picture[pixel] = Some(value));
        Ok(picture)
    }

    /// The picture as a PNG file, transparent beside the sphere.
    ///
    /// # Errors
    /// A BRDF without measured values.
    pub fn png(&self, brdf: &dyn Brdf) -> Result<Vec<u8>, LightError> {
        let pixel = |value: Option<Rgb>| match value {
            Some([r, g, b]) => [byte(r), byte(g), byte(b), 255],
            None => [0; 4],
        };
        let bytes: Vec<u8> = self.radiance(brdf)?.into_iter().flat_map(pixel).collect();
        let mut file = Vec::new();
        let encoder = image::codecs::png::PngEncoder::new(&mut file);
        let side = self.side as u32;
        image::ImageEncoder::write_image(encoder, &bytes, side, side, image::ColorType::Rgba8)
            .map_err(|e| LightError::Encode(e.to_string()))?;
        Ok(file)
    }
}

/// The byte of a linear value after exposure.
fn byte(radiance: f64) -> u8 {
    (255.0 * srgb((EXPOSURE * radiance).clamp(0.0, 1.0))).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::models::Lambert;

    #[test]
    fn a_white_sphere_under_even_light_is_evenly_bright() {
        // Radiance of a Lambertian of albedo 1 under radiance 1 is the share of the sky that a normal sees: all of it
        // for the one towards the viewer, whose hemisphere is the viewer's; the light from behind is not there for others.
        let sphere = Sphere::new(32, &Light::constant(1.0));
        let picture = sphere.radiance(&Lambert { kd: [1.0, 0.5, 0.0] }).unwrap();
        let centre = picture[16 * 32 + 16].unwrap();
        assert!((centre[0] - 1.0).abs() < 0.02 && (centre[1] - 0.5).abs() < 0.01 && centre[2] == 0.0, "{centre:?}");
        assert_eq!(picture[0], None);
        let shown = picture.iter().flatten().count() as f64;
        assert!((shown / 1024.0 - std::f64::consts::PI / 4.0).abs() < 0.05);
    }

    #[test]
    fn one_normal_in_a_large_picture_is_one_of_four_in_a_small_one() {
        let brdf = Lambert { kd: [0.5, 0.3, 0.1] };
        let pictures = [25, 50].map(|side| Sphere::new(side, &Light::lamps(1)).radiance(&brdf).unwrap());
        let mut compared = 0;
        for (pixel, small) in pictures[0].iter().enumerate() {
            let (x, y) = (2 * (pixel % 25), 2 * (pixel / 25));
            let four = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| pictures[1][y * 50 + x]);
            let all = four.iter().all(Option::is_some);
            assert_eq!(small.is_some(), all);
            let Some(small) = small else { continue };
            let mean: f64 = four.iter().flatten().map(|rgb| rgb[0] / 4.0).sum();
            assert!((mean / small[0] - 1.0).abs() < 1e-5, "{mean} {small:?}");
            compared += 1;
        }
        assert!(compared > 400);
    }

    #[test]
    fn bytes_follow_the_curve() {
        // IEC 61966-2-1: 0.18 is 118 of 255, 0.5 is 188.
        assert_eq!([0.0, 0.18, 0.5, 1.0, 9.0].map(|v| byte(v / EXPOSURE)), [0, 118, 188, 255, 255]);
    }

    #[test]
    fn the_file_is_a_picture_with_a_transparent_corner() {
        let png = Sphere::new(16, &Light::lamps(1)).png(&Lambert { kd: [0.5; 3] }).unwrap();
        let picture = image::load_from_memory(&png).unwrap().to_rgba8();
        assert_eq!((picture.width(), picture.height()), (16, 16));
        assert_eq!(picture.get_pixel(0, 0).0, [0; 4]);
        assert_eq!(picture.get_pixel(8, 8).0[3], 255);
    }
}
