//! A pinhole camera.

/// A pinhole camera that stands upright: +y is up in the picture. One that looks straight up or down has -z up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Where it is.
    pub from: [f64; 3],
    /// The point in the middle of the picture.
    pub to: [f64; 3],
    /// Full vertical angle of the picture, degrees, more than 0 and less than 180.
    pub fov_deg: f64,
}

/// Unit vectors of a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axes {
    /// To the right of the picture.
    pub right: [f64; 3],
    /// Up in the picture.
    pub up: [f64; 3],
    /// Into the picture.
    pub forward: [f64; 3],
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn length(a: [f64; 3]) -> f64 {
    a.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    let length = length(a);
    a.map(|x| x / length)
}

impl Camera {
    /// What is wrong with it: name, finding and what is allowed.
    pub fn flaw(&self) -> Option<(&'static str, String, &'static str)> {
        let distance = length([0, 1, 2].map(|k| self.to[k] - self.from[k]));
        if !self.from.iter().chain(&self.to).all(|x| x.abs() <= 1e6) {
            return Some(("camera", format!("from {:?} to {:?}", self.from, self.to), "of numbers from -1e6 to 1e6"));
        }
        if distance < 1e-6 {
            return Some(("camera.to", "where camera.from is".to_owned(), "another point"));
        }
        if !(self.fov_deg >= 0.01 && self.fov_deg <= 179.0) {
            return Some(("camera.fov_deg", self.fov_deg.to_string(), "0.01 to 179 degrees"));
        }
        None
    }

    /// Its unit vectors.
    pub fn axes(&self) -> Axes {
        let forward = unit([0, 1, 2].map(|k| self.to[k] - self.from[k]));
        let sideways = cross(forward, [0.0, 1.0, 0.0]);
        let right = if length(sideways) > 1e-9 { unit(sideways) } else { [1.0, 0.0, 0.0] };
        Axes { right, up: cross(right, forward), forward }
    }

    /// The camera turned about the vertical through the point that it looks at; positive moves it to its right.
    pub fn turned(&self, degrees: f64) -> Self {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let [x, y, z] = [0, 1, 2].map(|k| self.from[k] - self.to[k]);
        let from = [self.to[0] + cos * x + sin * z, self.to[1] + y, self.to[2] + cos * z - sin * x];
        Self { from, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plus_x_is_right_where_the_camera_looks_along_minus_z() {
        let camera = Camera { from: [0.0, 0.0, 5.0], to: [0.0; 3], fov_deg: 30.0 };
        assert_eq!(camera.axes(), Axes { right: [1.0, 0.0, 0.0], up: [0.0, 1.0, 0.0], forward: [0.0, 0.0, -1.0] });
        let down = Camera { from: [0.0, 3.0, 0.0], ..camera };
        assert_eq!(down.axes().up, [0.0, 0.0, -1.0]);
        let right = camera.turned(90.0).from;
        assert!((right[0] - 5.0).abs() < 1e-12 && right[2].abs() < 1e-12);
    }

    #[test]
    fn what_cannot_see_is_found() {
        let camera = Camera { from: [0.0, 0.0, 5.0], to: [0.0; 3], fov_deg: 30.0 };
        assert_eq!(camera.flaw(), None);
        for wrong in [
            Camera { to: camera.from, ..camera },
            Camera { fov_deg: 180.0, ..camera },
            Camera { fov_deg: f64::NAN, ..camera },
            Camera { from: [f64::NAN, 0.0, 0.0], ..camera },
        ] {
            assert!(wrong.flaw().is_some(), "{wrong:?}");
        }
    }
}
