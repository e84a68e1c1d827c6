//! The masks of one vehicle of a labelled frame.

use crate::parts::rle::{Rle, RleBuilder};
use crate::parts::{PartClass, PartMap};

use super::{FrameLabels, LabeledVehicle};

/// What is seen of a vehicle, as runs over the whole image.
#[derive(Clone, Debug, PartialEq)]
pub struct VehicleMasks {
    /// The whole vehicle.
    pub vehicle: Rle,
    /// The parts that are seen.
    pub parts: PartMap<Rle>,
}

impl FrameLabels {
    /// The masks of a vehicle; `None` where nothing of it is seen.
    pub fn masks(&self, vehicle: &LabeledVehicle) -> Option<VehicleMasks> {
        if vehicle.visible_pixels == 0 {
            return None;
        }
        let mut whole = RleBuilder::new(self.size);
        let mut parts: PartMap<RleBuilder> = PartMap::default();
        let [[x0, y0], [width, height]] = vehicle.window;
        let stride = self.size[0] as usize;
        for x in x0..x0 + width {
            // The run that is open: part and first row.
            let mut run: Option<(PartClass, u32)> = None;
            for y in y0..=y0 + height {
                let at = y as usize * stride + x as usize;
                let inside = y < y0 + height && self.instances[at] == vehicle.id;
                let part = if inside { PartClass::from_id(self.parts[at]) } else { None };
                if run.map(|(part, _)| part) == part {
                    continue;
                }
                if let Some((part, first)) = run {
                    whole.push(x, first, y - first);
                    if parts.get(part).is_none() {
                        parts.insert(part, RleBuilder::new(self.size));
                    }
                    if let Some(builder) = parts.get_mut(part) {
                        builder.push(x, first, y - first);
                    }
                }
                run = part.map(|part| (part, y));
            }
        }
        let parts = parts.map(|_, builder| builder.clone().finish());
        Some(VehicleMasks { vehicle: whole.finish(), parts })
    }
}
