//! All models of a zoo on one sheet, at one scale.

use crate::files::RgbImage;
use crate::geometry::Vector3;
use crate::render::Instance;
use crate::vehicle::VehicleModel;

use super::canvas::{Canvas, TextStyle};
use super::shade::{ShadeOptions, shade};
use super::turntable::{FAINT, INK, framing, longest, view};

/// How a contact sheet is laid out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactSheetOptions {
    /// Width and height of a model's picture in pixels.
    pub tile: [u32; 2],
    /// Most models in a row.
    pub columns: u32,
    /// From where models are seen: eighths of a turn from the front towards the vehicle's left.
    pub eighth: u8,
    /// How far above the horizon the camera stands, in radians.
    pub elevation: f64,
    /// How each picture is shaded.
    pub shade: ShadeOptions,
}

impl Default for ContactSheetOptions {
    fn default() -> Self {
        Self {
            tile: [264, 176],
            columns: 5,
            eighth: 1,
            elevation: 0.24,
            shade: ShadeOptions::default(),
        }
    }
}

/// Rows of pixels below a picture for name and size.
const CAPTION: u32 = 34;

/// Every model from the same side and at the same scale, with its name, body style and size.
pub fn contact_sheet(models: &[VehicleModel], options: &ContactSheetOptions) -> RgbImage {
    let [width, height] = options.tile.map(|side| side.clamp(16, 2048));
    let columns = options.columns.clamp(1, 64).min(models.len().max(1) as u32);
    let rows = (models.len() as u32).div_ceil(columns).clamp(1, 64);
    let size = [columns * width, rows * (height + CAPTION)];
    let mut canvas = Canvas::new(size, options.shade.background);
    let reach = models.iter().map(|model| longest(&model.mesh().vertices)).fold(0.0, f64::max);
    for (i, model) in models.iter().enumerate().take((columns * rows) as usize) {
        let [column, row] = [i as u32 % columns, i as u32 / columns];
        let at = [(column * width) as i32, (row * (height + CAPTION)) as i32];
        let instance = Instance {
            mesh: model.mesh(),
            scale: Vector3::repeat(1.0),
            camera_from_vehicle: view(model, Some(options.eighth), options.elevation),
            id: 1,
        };
        let camera = framing(&instance, [width, height], reach);
        canvas.paste(&shade(&camera, &[instance], &options.shade), at);
        let extent = model.extent();
        let facts = format!(
            "{}  {:.2} x {:.2} x {:.2} m",
            model.body_style(),
            extent.length,
            extent.width,
            extent.height
        );
        let below = at[1] + height as i32;
        canvas.text([at[0] + 10, below + 2], model.name(), TextStyle::plain(INK));
        canvas.text([at[0] + 10, below + 15], &facts, TextStyle::plain(FAINT));
    }
    canvas.into_rgb()
}
