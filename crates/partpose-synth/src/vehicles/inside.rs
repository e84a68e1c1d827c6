//! What is seen through the windows: seats, dashboard, steering wheel, and the places of people.
//!
//! Boxes, placed by the windows and doors; they lie inside the shell, so labels know nothing of them. The shell's inner
//! side itself is drawn in the colour of the lining.

use nalgebra::Vector3;
use partpose::parts::PartClass as P;

use super::patchwork::{Corner, Facet, Patchwork};
use super::riders;
use super::slots::Slot;

type V = Vector3<f32>;

/// Adds what is inside; nothing where there are no windows.
pub(super) fn furnish(work: &mut Patchwork) {
    let (Some([screen_low, screen_high]), Some([front_low, front_high])) =
        (work.bounds(&[P::WindshieldFront]), work.bounds(&[P::GlassFrontLeft]))
    else {
        return;
    };
    let belt = -front_high.y;
    let roof = -front_low.y;
    let half = (-front_low.x).max(0.5) - 0.09;
    // Behind the front side window stands the B-pillar, with the front seats' backs ahead of it.
    let back = front_low.z + 0.08;
    let seat = 0.42 * half;
    for side in [-1.0, 1.0] {
        seat_at(work, [side * 0.52 * half, seat], back, belt, roof);
    }
    let head = (belt + 0.29).min(roof - 0.17);
    let wheel = V::new(-0.52 * half, screen_high.y + 0.01 + 0.02, screen_high.z - 0.10 - 0.66);
    let place = |x: f32, wheel| riders::Place { x, back: back + 0.07, head, wheel };
    riders::sit(work, &place(-0.52 * half, Some(wheel)), Slot::DRIVER);
    riders::sit(work, &place(0.52 * half, None), Slot::BESIDE);
    let rear = work.bounds(&[P::GlassRearLeft]).map(|[low, high]| [low.z, high.z]);
    if let Some([low, high]) = rear
        && high - low > 0.4
    {
        let back = (low + 0.05).min(back - 0.75);
        for place in [-0.58, 0.0, 0.58] {
            seat_at(work, [place * half, 0.30 * half], back, belt - 0.02, roof);
        }
        let behind =
            riders::Place { x: 0.58 * half, back: back + 0.07, head: head - 0.06, wheel: None };
        riders::sit(work, &behind, Slot::BEHIND);
    }
    let dash = -screen_high.y - 0.01;
    let foot = screen_high.z - 0.10;
    add_box(
        work,
        Slot::Dashboard,
        [V::new(-half, -dash, foot - 0.55), V::new(half, -0.45, foot - 0.02)],
    );
    // Before the driver the instruments' hood, and the wheel.
    let driver = -0.52 * half;
    add_box(
        work,
        Slot::Dashboard,
        [
            V::new(driver - 0.18, -dash - 0.05, foot - 0.56),
            V::new(driver + 0.18, -dash, foot - 0.36),
        ],
    );
    ring(work, wheel, 0.185);
    let mirror = V::new(0.0, screen_low.y.max(-roof) + 0.10, screen_low.z + 0.16);
    if screen_high.z > screen_low.z {
        let half_size = V::new(0.11, 0.03, 0.012);
        add_box(work, Slot::Dashboard, [mirror - half_size, mirror + half_size]);
    }
}

/// A seat's back with its head rest: lateral middle and half width, position and heights.
fn seat_at(work: &mut Patchwork, [x, half]: [f32; 2], back: f32, belt: f32, roof: f32) {
    let top = (belt + 0.04).min(roof - 0.25);
    let low = (belt - 0.55).max(0.3);
    // The back leans; the head rest stands on it.
    leaning_box(work, [x, half], [low, top], [back + 0.22, back + 0.02], 0.14);
    leaning_box(
        work,
        [x, 0.55 * half],
        [top + 0.035, (top + 0.20).min(roof - 0.07)],
        [back + 0.03, back - 0.02],
        0.09,
    );
}

/// A box that leans from the first position at its foot to the second at its head.
fn leaning_box(
    work: &mut Patchwork,
    [x, half]: [f32; 2],
    heights: [f32; 2],
    positions: [f32; 2],
    depth: f32,
) {
    let mut corners = [V::zeros(); 8];
    for (i, corner) in corners.iter_mut().enumerate() {
        let [right, up, ahead] = [i & 1, (i >> 1) & 1, (i >> 2) & 1];
        // Narrower above.
        let half = half * if up == 1 { 0.88 } else { 1.0 };
        *corner = V::new(
            x + if right == 1 { half } else { -half },
            -heights[up],
            positions[up] + if ahead == 1 { depth } else { 0.0 },
        );
    }
    add_hexahedron(work, Slot::Seat, &corners);
}

fn add_box(work: &mut Patchwork, slot: Slot, [a, b]: [V; 2]) {
    let (low, high) = a.inf_sup(&b);
    let mut corners = [V::zeros(); 8];
    for (i, corner) in corners.iter_mut().enumerate() {
        let pick = |bit: usize, low: f32, high: f32| if (i >> bit) & 1 == 1 { high } else { low };
        // Bit 1 counts upwards, which is towards smaller y.
        *corner = V::new(pick(0, low.x, high.x), pick(1, high.y, low.y), pick(2, low.z, high.z));
    }
    add_hexahedron(work, slot, &corners);
}

/// Corners by bits: right, up, ahead.
fn add_hexahedron(work: &mut Patchwork, slot: Slot, corners: &[V; 8]) {
    let middle = corners.iter().sum::<V>() / 8.0;
    let sides =
        [[0, 1, 3, 2], [4, 5, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5], [2, 3, 7, 6], [0, 1, 5, 4]];
    for [a, b, c, d] in sides {
        for [i, j, k] in [[a, b, c], [a, c, d]] {
            add_triangle(work, slot, [corners[i], corners[j], corners[k]], middle);
        }
    }
}

/// Turned so that it looks away from a point.
fn add_triangle(work: &mut Patchwork, slot: Slot, [a, b, c]: [V; 3], inner: V) {
    let normal = (b - a).cross(&(c - a));
    let (b, c, normal) =
        if normal.dot(&(a - inner)) < 0.0 { (c, b, -normal) } else { (b, c, normal) };
    let normal = normal.try_normalize(0.0).unwrap_or_default();
    let start = work.points.len() as u32;
    work.points.extend([a, b, c]);
    let corner = |i: u32| Corner { point: start + i, normal };
    work.facets.push(Facet { corners: [corner(0), corner(1), corner(2)], part: None, slot });
}

/// A steering wheel, leaning towards the driver.
fn ring(work: &mut Patchwork, middle: V, radius: f32) {
    let at = |step: usize, radius: f32| {
        let (sin, cos) = (std::f32::consts::TAU * step as f32 / 14.0).sin_cos();
        middle + V::new(radius * cos, -0.9 * radius * sin, 0.43 * radius * sin)
    };
    let ahead = V::new(0.0, 0.3, 1.0);
    for step in 0..14 {
        let [a, b] = [at(step, radius), at(step + 1, radius)];
        let [c, d] = [at(step + 1, radius - 0.035), at(step, radius - 0.035)];
        add_triangle(work, Slot::Dashboard, [a, b, c], a + ahead);
        add_triangle(work, Slot::Dashboard, [a, c, d], a + ahead);
    }
}
