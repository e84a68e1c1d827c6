//! Light for every sample that is seen, and samples to pixels.
//!
//! Light is computed once for each material of each object in a pixel, not once a sample; that is what makes four samples
//! affordable. A pixel is the mean of the nine samples in and around it under a tent, about as soft as a camera's
//! mosaic.

use nalgebra::Vector3;
use partpose::geometry::Camera;
use rayon::prelude::*;

use crate::scene::SegmentClass;

use super::raster::{NOTHING, Visibility};
use super::surface::{Lighting, Spot};
use super::visible::{Seen, Triangle, Triangles};

type V = Vector3<f32>;

/// Linear RGB, pixel by pixel.
pub(super) fn shade(
    camera: &Camera,
    seen: &[Seen],
    triangles: &Triangles,
    visibility: &Visibility,
    lighting: &Lighting,
) -> Vec<[f32; 3]> {
    let [width, height] = camera.size.map(|side| side as usize);
    let rate = visibility.rate;
    let view = View { camera, seen, triangles, visibility, lighting };
    let mut samples = vec![V::zeros(); visibility.ids.len()];
    samples.par_chunks_mut((visibility.size[0] * rate).max(1)).enumerate().for_each(|(y, rows)| {
        for x in 0..width {
            view.pixel([x, y], rows);
        }
    });
    if rate == 1 {
        return samples.into_iter().map(Into::into).collect();
    }
    let mut color = vec![[0.0; 3]; width * height];
    let columns = visibility.size[0];
    color.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
        let rows = [(2 * y).saturating_sub(1), 2 * y, 2 * y + 1].map(|i| i * columns);
        for (x, value) in row.iter_mut().enumerate() {
            let places = [(2 * x).saturating_sub(1), 2 * x, 2 * x + 1];
            let mut sum = V::zeros();
            for (row, weight) in rows.into_iter().zip([0.25, 0.5, 0.25]) {
                let [a, b, c] = places.map(|place| samples[row + place]);
                sum += (a * 0.25 + b * 0.5 + c * 0.25) * weight;
            }
            *value = sum.into();
        }
    });
    color
}

/// 1 / z at pixel centres, and how much of each pixel is a mirror of water.
pub(super) fn wet(
    camera: &Camera,
    seen: &[Seen],
    triangles: &Triangles,
    visibility: &Visibility,
    lighting: &Lighting,
) -> (Vec<f32>, Vec<f32>) {
    let width = camera.size[0] as usize;
    let view = View { camera, seen, triangles, visibility, lighting };
    let pixel = |i: usize| {
        let [x, y] = [i % width, i / width];
        let sample = y * visibility.rate * visibility.size[0] + x * visibility.rate;
        let share = triangles
            .opaque
            .get(visibility.ids[sample] as usize)
            .filter(|triangle| is_ground(&seen[triangle.seen as usize]))
            .and_then(|triangle| {
                let ray = view.ray([x as f32, y as f32]);
                Spot::new(lighting, &seen[triangle.seen as usize], triangle.face, &ray)
            })
            .map_or(0.0, |spot| spot.water(lighting));
        (visibility.inverse_depths[sample], share)
    };
    let count = visibility.ids.len() / (visibility.rate * visibility.rate);
    (0..count).into_par_iter().map(pixel).unzip()
}

fn is_ground(seen: &Seen) -> bool {
    matches!(seen.object.class, SegmentClass::Road | SegmentClass::Terrain)
}

struct View<'a> {
    camera: &'a Camera,
    seen: &'a [Seen<'a>],
    triangles: &'a Triangles,
    visibility: &'a Visibility,
    lighting: &'a Lighting<'a>,
}

/// What a sample sees: object and material of the opaque surface, pane and number of panes.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Key {
    opaque: [u32; 2],
    glass: [u32; 2],
    panes: u8,
}

impl View<'_> {
    /// Sets a pixel's samples in `rows`, the rows of samples of its row of pixels.
    fn pixel(&self, [x, y]: [usize; 2], rows: &mut [V]) {
        let v = self.visibility;
        let [rate, columns] = [v.rate, v.size[0]];
        let mut places = [0; 4];
        for (i, place) in places.iter_mut().enumerate().take(rate * rate) {
            *place = (i / rate) * columns + x * rate + i % rate;
        }
        let places = &places[..rate * rate];
        let start = y * rate * columns;
        let first = start + places[0];
        let mut done = 0_u32;
        let is_plain = places.iter().all(|place| {
            v.ids[start + place] == v.ids[first] && v.glass[start + place] == v.glass[first]
        });
        let keys = if is_plain {
            [None; 4]
        } else {
            let mut keys = [None; 4];
            for (key, place) in keys.iter_mut().zip(places) {
                *key = Some(self.key(start + place));
            }
            keys
        };
        for i in 0..places.len() {
            if done >> i & 1 == 1 {
                continue;
            }
            let mut middle = [0.0_f32; 2];
            let mut members = 0_u32;
            for j in i..places.len() {
                if keys[j] == keys[i] {
                    members |= 1 << j;
                    middle[0] += (j % rate) as f32;
                    middle[1] += (j / rate) as f32;
                }
            }
            done |= members;
            let scale = 1.0 / (members.count_ones() as f32 * rate as f32);
            let at = [x as f32 + middle[0] * scale, y as f32 + middle[1] * scale];
            let color = self.sample(start + places[i], at);
            for (j, place) in places.iter().enumerate() {
                if members >> j & 1 == 1 {
                    rows[*place] = color;
                }
            }
        }
    }

    fn key(&self, sample: usize) -> Key {
        let surface = |id: u32, list: &[Triangle]| {
            if id == NOTHING {
                return [NOTHING; 2];
            }
            let triangle = &list[id as usize];
            let mesh = self.seen[triangle.seen as usize].mesh;
            let slot = mesh.materials.get(triangle.face as usize).copied().unwrap_or(0);
            [triangle.seen, u32::from(slot)]
        };
        let v = self.visibility;
        Key {
            opaque: surface(v.ids[sample], &self.triangles.opaque),
            glass: surface(v.glass[sample], &self.triangles.glass),
            panes: v.panes[sample],
        }
    }

    /// Light from a sample's surfaces at a place in the picture, pixels.
    fn sample(&self, sample: usize, [x, y]: [f32; 2]) -> V {
        let ray = self.ray([x, y]);
        let spot = |id: u32, list: &[Triangle]| {
            let triangle = list.get(id as usize)?;
            Spot::new(self.lighting, &self.seen[triangle.seen as usize], triangle.face, &ray)
        };
        let v = self.visibility;
        let behind = spot(v.ids[sample], &self.triangles.opaque);
        let mut color = match &behind {
            Some(spot) => spot.through_air(self.lighting, spot.radiance(self.lighting)),
            None => self.sky(&ray),
        };
        if let Some(spot) = spot(v.glass[sample], &self.triangles.glass) {
            let pane = spot.pane(self.lighting);
            let mut through = pane.tint;
            for _ in 1..v.panes[sample].min(4) {
                through = through.component_mul(&pane.tint);
            }
            color = color.component_mul(&through);
            color += spot.through_air(self.lighting, pane.reflected)
                - spot.through_air(self.lighting, V::zeros()).component_mul(&through);
            color = color.sup(&V::zeros());
        }
        color
    }

    fn ray(&self, [x, y]: [f32; 2]) -> V {
        let camera = self.camera;
        V::new(
            (x - camera.principal_point[0] as f32) / camera.focal[0] as f32,
            (y - camera.principal_point[1] as f32) / camera.focal[1] as f32,
            1.0,
        )
    }

    fn sky(&self, ray: &V) -> V {
        let direction = (self.lighting.world_from_camera * ray).normalize();
        let sky = self.lighting.sky;
        let color = sky.radiance_with_clouds(&direction) + sky.disc(&direction);
        // Fog hides the sky near the horizon: about 1.5 km of it above, longer where looking low.
        let fog = self.lighting.air.fog.max(0.0) as f32;
        let share = (-fog * 300.0 / (-direction.y).max(0.05)).exp();
        color * share + self.lighting.airlight * (1.0 - share)
    }
}
