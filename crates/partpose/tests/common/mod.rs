//! A made-up car for tests and benches.

use partpose::geometry::{Extent, Point3, Vector3};
use partpose::parts::PartClass;
use partpose::vehicle::Mesh;

/// Width, height, length of the made-up car.
pub(crate) const EXTENT: Extent = Extent::new(1.8, 1.45, 4.4);

/// A closed, outward car-like mesh of `12 n²` faces that fills [`EXTENT`]; parts by position.
pub(crate) fn car(n: u32) -> Mesh {
    let mut mesh = Mesh::default();
    // Origin, first and second direction of the sides of a cube; first x second looks outwards.
    let sides = [
        ([1., -1., -1.], [0., 1., 0.], [0., 0., 1.]),
        ([-1., -1., -1.], [0., 0., 1.], [0., 1., 0.]),
        ([-1., 1., -1.], [0., 0., 1.], [1., 0., 0.]),
        ([-1., -1., -1.], [1., 0., 0.], [0., 0., 1.]),
        ([-1., -1., 1.], [1., 0., 0.], [0., 1., 0.]),
        ([-1., -1., -1.], [0., 1., 0.], [1., 0., 0.]),
    ];
    for (origin, first, second) in
        sides.map(|(a, b, c)| (Vector3::from(a), Vector3::from(b), Vector3::from(c)))
    {
        let outward = first.cross(&second);
        let at = |i: f64, j: f64| origin + (first * i + second * j) * (2.0 / f64::from(n));
        let start = mesh.vertices.len() as u32;
        for j in 0..=n {
            for i in 0..=n {
                mesh.vertices.push(shape(&at(f64::from(i), f64::from(j))));
            }
        }
        for j in 0..n {
            for i in 0..n {
                let v = |di: u32, dj: u32| start + (j + dj) * (n + 1) + i + di;
                let part = part(&at(f64::from(i) + 0.5, f64::from(j) + 0.5), &outward);
                mesh.faces.push([v(0, 0), v(1, 0), v(1, 1)]);
                mesh.faces.push([v(0, 0), v(1, 1), v(0, 1)]);
                mesh.parts.extend([part, part]);
            }
        }
    }
    mesh
}

/// Linear through the knots `(height, value)`.
fn profile(height: f64, knots: &[[f64; 2]]) -> f64 {
    let upper = knots.iter().position(|k| k[0] >= height).unwrap_or(knots.len() - 1).max(1);
    let ([h0, v0], [h1, v1]) = (knots[upper - 1], knots[upper]);
    v0 + (v1 - v0) * ((height - h0) / (h1 - h0)).clamp(0.0, 1.0)
}

fn height(cube: &Vector3) -> f64 {
    0.5 * (1.0 - cube.y)
}

fn shape(cube: &Vector3) -> Point3 {
    let h = height(cube);
    let front = profile(h, &[[0.0, 0.94], [0.12, 1.0], [0.5, 0.98], [0.6, 0.42], [1.0, 0.12]]);
    let rear = profile(h, &[[0.0, 0.94], [0.12, 1.0], [0.58, 0.98], [0.64, 0.72], [1.0, 0.46]]);
    let side = profile(h, &[[0.0, 0.94], [0.15, 1.0], [0.55, 1.0], [0.62, 0.93], [1.0, 0.7]]);
    let z = cube.z * if cube.z > 0.0 { front } else { rear };
    // Rounded in plan.
    let side = side * (1.0 - 0.12 * z * z * z * z);
    Point3::new(0.5 * EXTENT.width * cube.x * side, -EXTENT.height * h, 0.5 * EXTENT.length * z)
}

fn part(cube: &Vector3, outward: &Vector3) -> PartClass {
    use PartClass as P;
    let (h, z) = (height(cube), cube.z);
    let pick = |left: P, right: P| if cube.x < 0.0 { left } else { right };
    if outward.y < -0.5 {
        return P::Roof;
    }
    if outward.z > 0.5 {
        return match h {
            h if h > 0.6 => P::WindshieldFront,
            h if h > 0.5 => P::Hood,
            h if h > 0.32 && cube.x.abs() > 0.55 => pick(P::LightFrontLeft, P::LightFrontRight),
            _ => P::ApronFront,
        };
    }
    if outward.z < -0.5 {
        return match h {
            h if h > 0.64 => P::WindshieldRear,
            h if h > 0.36 && h < 0.55 && cube.x.abs() > 0.6 => {
                pick(P::LightRearLeft, P::LightRearRight)
            }
            h if h > 0.34 => P::Trunk,
            _ => P::ApronRear,
        };
    }
    if outward.y > 0.5 {
        return if z > 0.0 { P::ApronFront } else { P::ApronRear };
    }
    let wheel = |at: f64| (z - at).hypot((h - 0.2) * 0.66) < 0.17;
    match (h, z) {
        _ if wheel(0.62) => pick(P::WheelFrontLeft, P::WheelFrontRight),
        _ if wheel(-0.6) => pick(P::WheelRearLeft, P::WheelRearRight),
        (h, z) if h > 0.66 && h < 0.94 => match z {
            z if !(-0.9..=0.85).contains(&z) || z.abs() < 0.05 => pick(P::SideLeft, P::SideRight),
            z if z > 0.0 => pick(P::GlassFrontLeft, P::GlassFrontRight),
            z if z > -0.65 => pick(P::GlassRearLeft, P::GlassRearRight),
            _ => pick(P::GlassCornerLeft, P::GlassCornerRight),
        },
        (h, z) if h > 0.16 && h <= 0.62 && z > -0.42 && z <= 0.42 => {
            if z > 0.0 {
                pick(P::DoorFrontLeft, P::DoorFrontRight)
            } else {
                pick(P::DoorRearLeft, P::DoorRearRight)
            }
        }
        _ => pick(P::SideLeft, P::SideRight),
    }
}
