//! Small images with coloured boxes for vehicles, and their truth.

use burn::Tensor;
use burn::tensor::{Device, TensorData};
use partpose_net::Target;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Width and height of the images.
pub(crate) const SIZE: [usize; 2] = [160, 96];

/// A batch of `count` images with two vehicles each.
pub(crate) fn batch(count: usize, device: &Device) -> (Tensor<4>, Vec<Target>) {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let [width, height] = SIZE;
    let mut values = Vec::new();
    let mut targets = Vec::new();
    for n in 0..count {
        let mut target = empty();
        let mut image: Vec<f32> =
            (0..3 * width * height).map(|_| rng.random::<f32>() - 0.5).collect();
        for (i, [x, y, w, h]) in
            [[12 + 8 * n, 20, 60, 36], [96, 40 - 9 * n, 44, 30]].into_iter().enumerate()
        {
            target.boxes.push([x, y, x + w, y + h].map(|v| v as f32));
            target.models.push(Some(i));
            target.extents.push([1.7, 1.4 + i as f32 / 5.0, 4.0 + i as f32]);
            for (v, u) in (0..h).flat_map(|v| (0..w).map(move |u| (v, u))) {
                let at = (y + v) * width + x + u;
                let part = 1 + 2 * (v * 2 / h) + u * 2 / w;
                target.owner[at] = i as u16 + 1;
                target.labels[at] = part as u8;
                for c in 0..3 {
                    image[c * width * height + at] =
                        if c == 0 { 1.5 } else { part as f32 / 2.0 - 1.0 };
                }
            }
        }
        values.extend(image);
        targets.push(target);
    }
    (Tensor::from_data(TensorData::new(values, [count, 3, height, width]), device), targets)
}

/// An image without vehicles.
pub(crate) fn empty() -> Target {
    let pixels = SIZE[0] * SIZE[1];
    Target { size: SIZE, labels: vec![0; pixels], owner: vec![0; pixels], ..Target::default() }
}
