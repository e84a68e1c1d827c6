//! Light for every sample that is seen, and samples to pixels.
//!
//! Light is computed once for each material of each object in a pixel, not once a sample; that is what makes four samples
//! affordable. A pixel is the mean of the nine samples in and around it under a tent, about as soft as a camera's
//! mosaic.

use nalgebra::Vector3;
use partpose::geometry::Camera;
use rayon::prelude::*;

use super::raster::{NOTHING, Visibility};
use super::surface::{Facet, Light, Lighting, Spot};
use super::visible::{Seen, Triangle, Triangles};

type V = Vector3<f32>;

/// Linear RGB, pixel by pixel, and how much of each pixel's centre is a mirror of water: `None` for what is no ground.
pub(super) fn shade(
    camera: &Camera,
    seen: &[Seen],
    triangles: &Triangles,
    visibility: &Visibility,
    lighting: &Lighting,
) -> (Vec<[f32; 3]>, Vec<Option<f32>>) {
    let [width, height] = camera.size.map(|side| side as usize);
    let rate = visibility.rate;
    let sky = SkyGrid::new(camera, visibility, lighting);
    let to_sun = lighting.world_from_camera.tr_mul(&lighting.sky.to_sun);
    let view = View { camera, seen, triangles, visibility, lighting, sky: &sky, to_sun };
    let mut samples = vec![V::zeros(); visibility.ids.len()];
    let mut water = vec![None; width * height];
    let rows = samples.par_chunks_mut((visibility.size[0] * rate).max(1));
    rows.zip(water.par_chunks_mut(width.max(1))).enumerate().for_each(|(y, (rows, water))| {
        let mut recent = [Recent::default(), Recent::default()];
        for (x, water) in water.iter_mut().enumerate() {
            *water = view.pixel([x, y], rows, &mut recent);
        }
    });
    if rate == 1 {
        return (samples.into_iter().map(Into::into).collect(), water);
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
    (color, water)
}

struct View<'a> {
    camera: &'a Camera,
    seen: &'a [Seen<'a>],
    triangles: &'a Triangles,
    visibility: &'a Visibility,
    lighting: &'a Lighting<'a>,
    sky: &'a SkyGrid,
    /// Camera coordinates.
    to_sun: V,
}

/// The face that was seen last, by the number of its triangle: its neighbours often show it too.
#[derive(Default)]
struct Recent<'a> {
    triangle: Option<u32>,
    facet: Option<Facet<'a>>,
}

/// What a sample sees: object and material of the opaque surface, pane and number of panes.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Key {
    opaque: [u32; 2],
    glass: [u32; 2],
    panes: u8,
}

impl<'a> View<'a> {
    /// Sets a pixel's samples in `rows`, the rows of samples of its row of pixels; returns how much of its centre is
    /// water.
    fn pixel(
        &self,
        [x, y]: [usize; 2],
        rows: &mut [V],
        recent: &mut [Recent<'a>; 2],
    ) -> Option<f32> {
        let v = self.visibility;
        let [rate, columns] = [v.rate, v.size[0]];
        if rate == 1 {
            let Light { color, water } = self.sample(y * columns + x, [x as f32, y as f32], recent);
            rows[x] = color;
            return water;
        }
        let mut water = None;
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
            let light = self.sample(start + places[i], at, recent);
            if i == 0 {
                water = light.water;
            }
            for (j, place) in places.iter().enumerate() {
                if members >> j & 1 == 1 {
                    rows[*place] = light.color;
                }
            }
        }
        water
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
    fn sample(&self, sample: usize, at: [f32; 2], recent: &mut [Recent<'a>; 2]) -> Light {
        let ray = ray(self.camera, at);
        let v = self.visibility;
        let [opaque, glass] = recent;
        let behind = self.spot(v.ids[sample], &self.triangles.opaque, &ray, opaque);
        let Light { mut color, water } = match &behind {
            Some(spot) => {
                let light = spot.light(self.lighting);
                Light { color: spot.through_air(self.lighting, light.color), ..light }
            }
            None => Light { color: self.sky.at(at) + self.sun(&ray), water: None },
        };
        if let Some(spot) = self.spot(v.glass[sample], &self.triangles.glass, &ray, glass) {
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
        Light { color, water }
    }

    fn spot(
        &self,
        id: u32,
        list: &[Triangle],
        ray: &V,
        recent: &mut Recent<'a>,
    ) -> Option<Spot<'a>> {
        let triangle = list.get(id as usize)?;
        if recent.triangle != Some(id) {
            let seen = &self.seen[triangle.seen as usize];
            let facet = Facet::new(self.lighting, seen, triangle.face);
            *recent = Recent { triangle: Some(id), facet };
        }
        recent.facet.as_ref()?.spot(self.lighting, ray)
    }

    /// What the sun's disc adds to the sky.
    fn sun(&self, ray: &V) -> V {
        // Most of the sky is too far from it for its angle to be computed.
        let near = ray.dot(&self.to_sun);
        if near <= 0.0 || near * near < 0.98 * ray.norm_squared() {
            return V::zeros();
        }
        let direction = (self.lighting.world_from_camera * ray).normalize();
        let disc = self.lighting.sky.disc(&direction);
        disc * shown_through_fog(self.lighting, &direction)
    }
}

fn ray(camera: &Camera, [x, y]: [f32; 2]) -> V {
    V::new(
        (x - camera.principal_point[0] as f32) / camera.focal[0] as f32,
        (y - camera.principal_point[1] as f32) / camera.focal[1] as f32,
        1.0,
    )
}

/// Share of the sky's light that fog leaves: about 1.5 km of it above, longer where looking low.
fn shown_through_fog(lighting: &Lighting, direction: &V) -> f32 {
    let fog = lighting.air.fog.max(0.0) as f32;
    (-fog * 300.0 / (-direction.y).max(0.05)).exp()
}

/// Pixels between places at which the sky is computed; it is too soft for more.
const SKY_STEP: usize = 4;

/// The sky with its clouds behind a picture, where the picture shows any of it.
struct SkyGrid {
    columns: usize,
    values: Vec<V>,
}

impl SkyGrid {
    fn new(camera: &Camera, visibility: &Visibility, lighting: &Lighting) -> Self {
        let [width, height] = camera.size.map(|side| side as usize);
        let [columns, rows] = [width, height].map(|side| side.div_ceil(SKY_STEP) + 1);
        let mut wanted = vec![false; columns * rows];
        let step = SKY_STEP * visibility.rate;
        for (y, row) in visibility.ids.chunks(visibility.size[0].max(1)).enumerate() {
            for (x, samples) in row.chunks(step).enumerate() {
                if samples.contains(&NOTHING) {
                    let corner = y / step * columns + x;
                    for at in [corner, corner + 1, corner + columns, corner + columns + 1] {
                        wanted[at] = true;
                    }
                }
            }
        }
        let value = |(i, wanted): (usize, &bool)| {
            if !*wanted {
                return V::zeros();
            }
            let at = [i % columns, i / columns].map(|at| (at * SKY_STEP) as f32);
            let direction = (lighting.world_from_camera * ray(camera, at)).normalize();
            let color = lighting.sky.radiance_with_clouds(&direction);
            lighting.airlight.lerp(&color, shown_through_fog(lighting, &direction))
        };
        Self { columns, values: wanted.par_iter().enumerate().map(value).collect() }
    }

    /// Between four of its places, in pixels of the picture.
    fn at(&self, at: [f32; 2]) -> V {
        let [u, v] = at.map(|x| x.max(0.0) * (1.0 / SKY_STEP as f32));
        let [x, y] = [u as usize, v as usize];
        let [fx, fy] = [u - x as f32, v - y as f32];
        let i = y * self.columns + x;
        let row = |i: usize| self.values[i].lerp(&self.values[i + 1], fx);
        row(i).lerp(&row(i + self.columns), fy)
    }
}
