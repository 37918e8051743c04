//! The energy of a function on the sphere by degree of its spherical harmonics.
//!
//!   E_l = sum_m (integral of f Y_lm)^2,   l = 0 .. degree, m = -l .. l
//!
//! f: values at the centres of the pixels of a latitude/longitude picture, theta from the pole down the rows, phi along the
//! columns; Y_lm: real, orthonormal, so that the sum of E_l is the integral of f^2 for a function of at most that degree.
//! Integrals are sums over pixels weighted by solid angle, good for degrees well below the number of rows.
//!
//! Source: P.-P. Sloan, "Stupid Spherical Harmonics (SH) Tricks", GDC 2008 (real basis); normalised Legendre functions by the
//! recurrence of W. Press et al., "Numerical Recipes", 3rd ed., section 6.7. Cost: degree x pixels.

use super::parallel;
use std::f64::consts::PI;

/// E_l for l = 0 to `degree`, of the picture whose pixel (column, row) is `value(column, row)`.
///
/// The orders m are shared out to threads and added up in their order: the bytes do not depend on the number of threads.
pub fn energy_by_degree(
    width: usize,
    height: usize,
    degree: usize,
    value: impl Fn(usize, usize) -> f64 + Sync,
) -> Vec<f64> {
    let of_order = |m: usize| -> Vec<f64> {
        let phi = |column: usize| 2.0 * PI * (column as f64 + 0.5) / width as f64;
        let waves: Vec<(f64, f64)> = (0..width).map(|column| (m as f64 * phi(column)).sin_cos()).collect();
        let mut coefficients = vec![[0.0; 2]; degree + 1 - m];
        for row in 0..height {
            let (mut odd, mut even) = (0.0, 0.0);
            for (column, (sin, cos)) in waves.iter().enumerate() {
                let f = value(column, row);
                odd += f * sin;
                even += f * cos;
            }
            let weight = solid_angle(width, height, row) * if m == 0 { 1.0 } else { 2f64.sqrt() };
            let legendre = normalised_legendre(m, degree, (row as f64 + 0.5) * PI / height as f64);
            for (coefficient, p) in coefficients.iter_mut().zip(legendre) {
                coefficient[0] += weight * p * even;
                coefficient[1] += weight * p * odd;
            }
        }
        coefficients.into_iter().map(|[even, odd]| even * even + odd * odd).collect()
    };
    let orders = parallel::map(degree + 1, of_order);
    let mut energy = vec![0.0; degree + 1];
    for (m, of_order) in orders.iter().enumerate() {
        energy[m..].iter_mut().zip(of_order).for_each(|(e, o)| *e += o);
    }
    energy
}

/// The integral of f^2 over the sphere, of the picture whose pixel (column, row) is `value(column, row)`: what E_l add up to
/// over all degrees. Rows are added up in their order, whatever the number of threads.
pub fn total_energy(width: usize, height: usize, value: impl Fn(usize, usize) -> f64 + Sync) -> f64 {
    let of_row = |row: usize| {
        let squares: f64 = (0..width).map(|column| value(column, row).powi(2)).sum();
        solid_angle(width, height, row) * squares
    };
    parallel::map(height, of_row).iter().sum()
}

/// Of a pixel in `row`.
fn solid_angle(width: usize, height: usize, row: usize) -> f64 {
    let edge = |row: usize| (row as f64 * PI / height as f64).cos();
    (edge(row) - edge(row + 1)) * 2.0 * PI / width as f64
}

/// N_lm P_lm(cos theta) for l = m to `degree`, with the integral over the sphere of its square, times cos^2 m phi, 1/2 (1 for
/// m = 0).
fn normalised_legendre(m: usize, degree: usize, theta: f64) -> Vec<f64> {
    let (sin, cos) = theta.sin_cos();
    let mut first = (0.25 / PI).sqrt();
    for k in 1..=m {
        first *= ((2 * k + 1) as f64 / (2 * k) as f64).sqrt() * sin;
    }
    let mut values = vec![first];
    for l in m + 1..=degree {
        let (l, m) = (l as f64, m as f64);
        let before = values[values.len() - 1];
        let earlier = if values.len() > 1 { values[values.len() - 2] } else { 0.0 };
        let a = ((4.0 * l * l - 1.0) / (l * l - m * m)).sqrt();
        let b = (((l - 1.0).powi(2) - m * m) / (4.0 * (l - 1.0).powi(2) - 1.0)).sqrt();
        values.push(a * (cos * before - b * earlier));
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 256;
    const HEIGHT: usize = 128;

    fn energy(f: impl Fn(f64, f64) -> f64 + Sync) -> Vec<f64> {
        energy_by_degree(WIDTH, HEIGHT, 12, |x, y| {
            f((y as f64 + 0.5) * PI / HEIGHT as f64, (x as f64 + 0.5) * 2.0 * PI / WIDTH as f64)
        })
    }

    #[test]
    fn a_harmonic_has_its_own_degree_alone() {
        // Y_00, Y_10, Y_22 and Y_3-1 written out: Sloan 2008, appendix A2.
        let y00 = |_: f64, _: f64| 0.5 / PI.sqrt();
        let y10 = |t: f64, _: f64| (0.75 / PI).sqrt() * t.cos();
        let y22 = |t: f64, p: f64| (15.0 / PI).sqrt() / 4.0 * t.sin().powi(2) * (2.0 * p).cos();
        let y31 = |t: f64, p: f64| (21.0 / (32.0 * PI)).sqrt() * t.sin() * p.sin() * (5.0 * t.cos().powi(2) - 1.0);
        for (l, found) in [(0, energy(y00)), (1, energy(y10)), (2, energy(y22)), (3, energy(y31))] {
            for (k, e) in found.iter().enumerate() {
                let expected = if k == l { 1.0 } else { 0.0 };
                assert!((e - expected).abs() < 1e-3, "{l} {k}: {e}");
            }
        }
    }

    #[test]
    fn the_whole_energy_holds_what_degrees_beyond_leave_out() {
        // (cos theta)^4 again: 4 pi/9. Of a constant c it is 4 pi c^2, whatever the number of pixels.
        let at = |y: usize| ((y as f64 + 0.5) * PI / HEIGHT as f64).cos().powi(4);
        assert!((total_energy(WIDTH, HEIGHT, |_, y| at(y)) - 4.0 * PI / 9.0).abs() < 1e-3);
        assert!((total_energy(5, 3, |_, _| 2.0) - 16.0 * PI).abs() < 1e-12);
        // One white pixel has most of its energy beyond degree 12.
        let spark = |x: usize, y: usize| if (x, y) == (100, 64) { 1.0 } else { 0.0 };
        let below: f64 = energy_by_degree(WIDTH, HEIGHT, 12, spark).iter().sum();
        let all = total_energy(WIDTH, HEIGHT, spark);
        assert!(below > 0.0 && below < 0.05 * all, "{below} {all}");
    }

    #[test]
    fn energies_add_up_to_the_integral_of_the_square() {
        // (cos theta)^4: the integral of its square over the sphere is 4 pi/9; its degree is 4.
        let found = energy(|t, _| t.cos().powi(4));
        assert!((found.iter().sum::<f64>() - 4.0 * PI / 9.0).abs() < 1e-3, "{found:?}");
        // A turn about the pole moves energy between orders, not between degrees.
        let bump = |shift: f64| energy(move |t, p| (2.0 * t.sin() * (p - shift).cos()).exp());
        bump(0.0).iter().zip(bump(PI / 8.0)).for_each(|(a, b)| assert!((a - b).abs() < 1e-9 * (1.0 + a), "{a} {b}"));
    }
}
