//! How sure the parts of an annotated model are, from all sides.

use crate::annotate::Annotation;
use crate::files::RgbImage;
use crate::geometry::{Rect, Vector3};
use crate::render::Instance;
use crate::vehicle::Mesh;

use super::canvas::{Canvas, Pen, TextStyle};
use super::shade::{ShadeOptions, shade_colored};
use super::turntable::{
    FAINT, HEADER, INK, LEGEND, TurntableOptions, VIEWS, framing, header, longest, rules, view,
};

/// Colour of faces that had their part before.
const GIVEN: [u8; 3] = [176, 180, 188];
/// Colours of transferred faces, from unsure to sure, at even steps of confidence.
const COLORS: [[u8; 3]; 5] =
    [[190, 20, 40], [235, 120, 40], [245, 210, 70], [120, 190, 110], [30, 120, 190]];
/// Steps of confidence that are told apart.
const BINS: usize = 20;

/// The views of [`super::turntable`], grey where parts were given, from red to blue where they were transferred.
pub fn confidence_turntable(annotation: &Annotation, options: &TurntableOptions) -> RgbImage {
    let model = &annotation.model;
    let [width, height] = options.tile.map(|side| side.clamp(16, 2048));
    let mut canvas =
        Canvas::new([3 * width + LEGEND, 3 * height + HEADER], options.shade.background);
    let reach = longest(&model.mesh().vertices);
    let meshes = by_confidence(annotation);
    let whole = Instance {
        mesh: model.mesh(),
        scale: Vector3::repeat(1.0),
        camera_from_vehicle: view(model, None, 0.0),
        id: 0,
    };
    for (i, (name, eighth)) in VIEWS.iter().enumerate() {
        let at = [(i as u32 % 3 * width) as i32, (HEADER + i as u32 / 3 * height) as i32];
        let camera_from_vehicle = view(model, *eighth, options.elevation);
        let camera = framing(&Instance { camera_from_vehicle, ..whole }, [width, height], reach);
        let instances: Vec<Instance> = meshes
            .iter()
            .zip(1..)
            .map(|(mesh, id)| Instance { mesh, camera_from_vehicle, id, ..whole })
            .collect();
        // Steps of confidence are no seams.
        let shade = ShadeOptions { seam: 0.0, ..options.shade };
        let picture = shade_colored(&camera, &instances, &shade, &|_, id| color(id));
        canvas.paste(&picture, at);
        canvas.text([at[0] + 8, at[1] + 8], name, TextStyle::plain(FAINT));
    }
    rules(&mut canvas, [width, height]);
    header(&mut canvas, model);
    legend(&mut canvas, (3 * width) as i32);
    canvas.into_rgb()
}

/// Given faces, then those of each step of confidence.
fn by_confidence(annotation: &Annotation) -> Vec<Mesh> {
    let mesh = annotation.model.mesh();
    let mut meshes = vec![Mesh { vertices: mesh.vertices.clone(), ..Mesh::default() }; BINS + 1];
    for i in 0..mesh.faces.len() {
        let bin = if annotation.transferred[i] {
            1 + ((annotation.confidence[i] * BINS as f32) as usize).min(BINS - 1)
        } else {
            0
        };
        meshes[bin].faces.push(mesh.faces[i]);
        meshes[bin].parts.push(mesh.parts[i]);
    }
    meshes
}

/// Colour of an instance of [`by_confidence`]; ids begin at 1.
fn color(id: u16) -> [u8; 3] {
    match usize::from(id) {
        0 | 1 => GIVEN,
        bin => ramp((bin - 2) as f64 / (BINS - 1) as f64),
    }
}

fn ramp(share: f64) -> [u8; 3] {
    let at = share.clamp(0.0, 1.0) * (COLORS.len() - 1) as f64;
    let from = (at as usize).min(COLORS.len() - 2);
    let part = at - from as f64;
    std::array::from_fn(|i| {
        let [a, b] = [COLORS[from][i], COLORS[from + 1][i]].map(f64::from);
        (a + part * (b - a)).round() as u8
    })
}

fn legend(canvas: &mut Canvas, left: i32) {
    let mut entry = |row: i32, color: [u8; 3], text: &str| {
        let y = HEADER as i32 + 10 + row * 16;
        let x = f64::from(left + 12);
        let swatch = Rect::new(x, f64::from(y) - 1.0, x + 14.0, f64::from(y) + 8.0);
        canvas.fill_rectangle(&swatch, [color[0], color[1], color[2], 255]);
        canvas.rectangle(&swatch, Pen { color: [120, 124, 132, 255], width: 1.0 });
        canvas.text([left + 34, y], text, TextStyle::plain(INK));
    };
    entry(0, GIVEN, "given");
    for step in 0..=10 {
        let share = 1.0 - 0.1 * f64::from(step);
        let text = if step == 0 { "confidence 1.0".to_owned() } else { format!("{share:.1}") };
        entry(step + 2, ramp(share), &text);
    }
}
