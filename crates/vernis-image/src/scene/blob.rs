//! A curved, folded shape by formula, for where there is no mesh.
//!
//!   r(d) = 1 + 0.16 sin(3.1 x + 0.4) sin(2.7 y + 1.1) + 0.10 sin(4.3 z - 0.7 + 2 x) + 0.055 fold(5 x - 3 y + 2 z) + 0.045 fold(7 y + 3 z)
//!
//! for unit directions d = (x, y, z); fold(u) = sqrt(sin^2 u + 0.002) is a crease, rounded so that it has a normal everywhere.
//! Broad bumps show the light, creases and hollows show interreflection; Vangorp et al. 2007 (doi:10.1145/1276377.1276473) found
//! such shapes better than spheres for telling materials apart.

use super::Mesh;

/// Squares along an edge of the cube that is blown up to the blob.
const SQUARES: usize = 96;

fn fold(u: f64) -> f64 {
    (u.sin() * u.sin() + 0.002).sqrt()
}

fn radius([x, y, z]: [f64; 3]) -> f64 {
    1.0 + 0.16 * (3.1 * x + 0.4).sin() * (2.7 * y + 1.1).sin()
        + 0.10 * (4.3 * z - 0.7 + 2.0 * x).sin()
        + 0.055 * fold(5.0 * x - 3.0 * y + 2.0 * z)
        + 0.045 * fold(7.0 * y + 3.0 * z)
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    let length = a.iter().map(|x| x * x).sum::<f64>().sqrt();
    a.map(|x| x / length)
}

/// The surface is where |p| = r(p / |p|); its normal is the gradient of the difference.
fn normal(p: [f64; 3]) -> [f64; 3] {
    const STEP: f64 = 1e-5;
    let level = |p: [f64; 3]| p.iter().map(|x| x * x).sum::<f64>().sqrt() - radius(unit(p));
    unit([0, 1, 2].map(|k| {
        let moved = |by: f64| level([0, 1, 2].map(|c| if c == k { p[c] + by } else { p[c] }));
        moved(STEP) - moved(-STEP)
    }))
}

/// The blob: 110,592 faces with true normals at their corners, on the table.
pub fn blob() -> Mesh {
    let (mut positions, mut normals, mut faces) = (Vec::new(), Vec::new(), Vec::new());
    for side in 0..6 {
        let first = positions.len();
        for row in 0..=SQUARES {
            for column in 0..=SQUARES {
                // Equal angles rather than equal lengths on the cube.
                let [u, v] = [column, row]
                    .map(|k| (std::f64::consts::FRAC_PI_4 * (2.0 * k as f64 / SQUARES as f64 - 1.0)).tan());
                let direction = unit(match side {
                    0 => [1.0, v, -u],
                    1 => [-1.0, v, u],
                    2 => [u, 1.0, -v],
                    3 => [u, -1.0, v],
                    4 => [u, v, 1.0],
                    _ => [-u, v, -1.0],
                });
                let position = direction.map(|x| x * radius(direction));
                positions.push(position);
                normals.push(normal(position));
            }
        }
        for row in 0..SQUARES {
            for column in 0..SQUARES {
                let corner = |r: usize, c: usize| (first + (row + r) * (SQUARES + 1) + column + c) as u32;
                faces.push([corner(0, 0), corner(0, 1), corner(1, 1)]);
                faces.push([corner(0, 0), corner(1, 1), corner(1, 0)]);
            }
        }
    }
    Mesh { positions, normal_faces: faces.clone(), faces, normals }.on_the_table()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_stands_on_the_table_and_its_normals_are_those_of_its_faces() {
        let mesh = blob();
        let (low, high) = mesh.bounds();
        assert!(low[1].abs() < 1e-12 && (1.0..=2.0).contains(&high[1]));
        assert_eq!(mesh.flaws().without_area, 0);
        let agree = (0..mesh.len()).filter(|&face| {
            let area = unit(mesh.area_vector(face));
            mesh.corner_normals(face).unwrap().iter().all(|n| (0..3).map(|k| n[k] * area[k]).sum::<f64>() > 0.8)
        });
        // All but a few at creases.
        assert!(agree.count() > mesh.len() * 99 / 100);
        assert!(mesh.contains([0.0, 0.75, 0.0]) && !mesh.contains([0.0, 0.01, 0.74]));
    }
}
