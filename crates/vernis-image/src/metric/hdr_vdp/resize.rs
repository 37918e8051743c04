//! MATLAB's `imresize` with its default, bicubic: the cubic of Keys 1981 (doi:10.1109/TASSP.1981.1163711) with a = -0.5; centres of
//! pixels correspond; the kernel is widened where the picture becomes smaller; beyond the border the picture is mirrored, the pixel at
//! the border included. Own code: `image` resizes with a clamped border and single precision.

use crate::metric::plane::Plane;

/// The plane at another size.
pub(super) fn resized(plane: &Plane, width: usize, height: usize) -> Plane {
    if (plane.width, plane.height) == (width, height) {
        return plane.clone();
    }
    let (across, down) = (Weights::new(plane.width, width), Weights::new(plane.height, height));
    let narrow = Plane::by_rows(width, plane.height, |y, out| {
        let row = plane.row(y);
        for (to, part) in out.iter_mut().zip(&across.0) {
            *to = part.iter().map(|(i, w)| w * row[*i]).sum();
        }
    });
    Plane::by_rows(width, height, |y, out| {
        for (i, w) in &down.0[y] {
            for (to, from) in out.iter_mut().zip(narrow.row(*i)) {
                *to += w * from;
            }
        }
    })
}

/// For each pixel of the result, pixels of the source and their weights.
struct Weights(Vec<Vec<(usize, f64)>>);

impl Weights {
    fn new(from: usize, to: usize) -> Self {
        let scale = to as f64 / from as f64;
        let shrink = scale.min(1.0);
        let width = 4.0 / shrink;
        let taps = width.ceil() as i64 + 2;
        let mirror = |i: i64| {
            let i = i.rem_euclid(2 * from as i64) as usize;
            if i < from { i } else { 2 * from - 1 - i }
        };
        let of_pixel = |x: usize| {
            // The place in the source, pixels counted from 0.
            let place = (x as f64 + 0.5) / scale - 0.5;
            let first = (place - width / 2.0).floor() as i64;
            let raw: Vec<(usize, f64)> = (first..first + taps)
                .map(|i| (mirror(i), cubic(shrink * (place - i as f64))))
                .filter(|(_, w)| *w != 0.0)
                .collect();
            let sum: f64 = raw.iter().map(|(_, w)| w).sum();
            raw.into_iter().map(|(i, w)| (i, w / sum)).collect()
        };
        Self((0..to).map(of_pixel).collect())
    }
}

/// The cubic of Keys with a = -0.5.
fn cubic(x: f64) -> f64 {
    let x = x.abs();
    if x <= 1.0 {
        (1.5 * x - 2.5) * x * x + 1.0
    } else if x <= 2.0 {
        ((-0.5 * x + 2.5) * x - 4.0) * x + 2.0
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A straight line stays one away from the border, at any size.
    #[test]
    fn lines_stay_lines() {
        for to in [20, 37, 80] {
            let line = Plane { width: 40, height: 1, values: (0..40).map(|x| f64::from(x) + 0.5).collect() };
            let found = resized(&line, to, 1);
            for x in to / 4..3 * to / 4 {
                let expected = (x as f64 + 0.5) * 40.0 / to as f64;
                assert!((found.values[x] - expected).abs() < 0.02, "{to} {x}: {} {expected}", found.values[x]);
            }
        }
    }

    /// At twice the size, the weights at a quarter of a pixel: cubic(0.25), cubic(0.75), cubic(1.25), cubic(1.75).
    #[test]
    fn an_impulse_shows_the_kernel() {
        let mut impulse = Plane { width: 8, height: 1, values: vec![0.0; 8] };
        impulse.values[3] = 1.0;
        let found = resized(&impulse, 16, 1).values;
        for (x, place) in [(6, 0.25), (8, 0.75), (4, 1.25), (10, 1.75)] {
            assert!((found[x] - cubic(place)).abs() < 1e-15, "{x}");
        }
        assert_eq!(cubic(0.25) + cubic(0.75) + cubic(1.25) + cubic(1.75), 1.0);
    }
}
