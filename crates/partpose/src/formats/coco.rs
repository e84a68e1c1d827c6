//! COCO instance annotations: one object a vehicle, and one a part of it that is seen.
//!
//! Lin et al.: *Microsoft COCO: Common Objects in Context*, ECCV 2014; the fields are those of its JSON, and what COCO
//! has no field for stands beside them under names of our own, which its tools pass over.

use std::io::{self, Write};

use serde::Serialize;

use crate::parts::PartClass;
use crate::parts::rle::{CocoRle, Rle};

/// The category of whole vehicles; those of parts are the parts' ids, 1 to 29.
pub const VEHICLE_CATEGORY: u8 = PartClass::COUNT as u8 + 1;
/// Distance of the annotation ids of neighbouring vehicles: one for the vehicle, one for each part, and a rest.
const IDS_PER_VEHICLE: u64 = 32;
/// Distance of the annotation ids of neighbouring frames: a frame has up to 65,534 vehicles.
const IDS_PER_FRAME: u64 = IDS_PER_VEHICLE << 16;

/// An image.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CocoImage {
    /// The frame's index + 1: ids are unique in their file.
    pub id: u64,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The picture, relative to the data set's folder.
    pub file_name: String,
    /// World of the frame.
    pub world: String,
    /// Variation of the frame.
    pub variation: String,
    /// Index of the frame.
    pub frame: u32,
    /// The part mask, relative to the folder of the labels.
    pub parts_file: String,
    /// The instance mask, relative to the folder of the labels.
    pub instances_file: String,
}

/// A vehicle or one of its parts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CocoAnnotation {
    /// Its own id.
    pub id: u64,
    /// The image's id.
    pub image_id: u64,
    /// [`VEHICLE_CATEGORY`] or the part's id.
    pub category_id: u8,
    /// The visible pixels.
    pub segmentation: CocoRle,
    /// How many there are.
    pub area: u64,
    /// `x, y, width, height` of the visible pixels, from the upper left corner of the first pixel.
    pub bbox: [u32; 4],
    /// 1 for what is to be ignored, neither demanded nor forbidden.
    pub iscrowd: u8,
    /// The same, for tools that read this name.
    pub ignore: u8,
    /// A part's vehicle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parent_id: Option<u64>,
    /// What is known of a vehicle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vehicle: Option<VehicleFacts>,
}

/// What COCO has no field for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VehicleFacts {
    /// Value of its pixels in the instance mask.
    pub instance_id: u16,
    /// Track id.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub track_id: Option<u32>,
    /// The data set's category.
    pub category: String,
    /// The model that was drawn.
    pub model: String,
    /// Whether the model stands in for one that the zoo lacks: `name` or `category`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stand_in: Option<&'static str>,
    /// Whether the data set asks to ignore it.
    pub dont_care: bool,
    /// 0 none, 1 truncated, 2 heavily.
    pub truncated: u8,
    /// 0 none, 1 occluded, 2 heavily.
    pub occluded: u8,
    /// Pixels of the image that would show it if nothing stood before it.
    pub total_pixels: u32,
    /// Width, height, length in metres.
    pub extent: [f64; 3],
    /// Bottom-face centre in the camera frame, metres.
    pub translation: [f64; 3],
    /// Rows of the rotation that takes the vehicle frame to the camera frame.
    pub rotation: [[f64; 3]; 3],
}

/// The id of the annotation of a vehicle (`part` `None`) or a part; unique in a file, whatever else it holds.
pub fn annotation_id(frame: u32, row: usize, part: Option<PartClass>) -> u64 {
    let part = part.map_or(0, |part| u64::from(part.id()));
    u64::from(frame) * IDS_PER_FRAME + row as u64 * IDS_PER_VEHICLE + part + 1
}

/// An annotation of a mask.
pub fn annotation(id: u64, image_id: u64, category_id: u8, mask: &Rle) -> CocoAnnotation {
    CocoAnnotation {
        id,
        image_id,
        category_id,
        segmentation: mask.to_coco(),
        area: mask.area(),
        bbox: mask.bounds(),
        iscrowd: 0,
        ignore: 0,
        parent_id: None,
        vehicle: None,
    }
}

#[derive(Serialize)]
struct Category {
    id: u8,
    name: &'static str,
    supercategory: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    color: Option<[u8; 3]>,
}

/// Writes the beginning of a file, up to the first image.
pub fn write_start(out: &mut dyn Write, info: &impl Serialize) -> io::Result<()> {
    let parts = PartClass::ALL.into_iter().map(|part| Category {
        id: part.id(),
        name: part.name(),
        supercategory: "part",
        color: Some(part.color()),
    });
    let vehicle =
        Category { id: VEHICLE_CATEGORY, name: "vehicle", supercategory: "vehicle", color: None };
    let categories: Vec<Category> = parts.chain([vehicle]).collect();
    write!(out, "{{\"info\":{}", serde_json::to_string(info)?)?;
    write!(out, ",\n\"licenses\":[],\n\"categories\":{}", serde_json::to_string(&categories)?)
}

/// Writes a list of that file, of records that are JSON already.
pub fn write_list(
    out: &mut dyn Write,
    name: &str,
    records: &mut dyn Iterator<Item = io::Result<String>>,
) -> io::Result<()> {
    write!(out, ",\n\"{name}\":[")?;
    for (at, record) in records.enumerate() {
        out.write_all(if at == 0 { b"\n" } else { b",\n" })?;
        out.write_all(record?.as_bytes())?;
    }
    out.write_all(b"\n]")
}

/// Writes the end of the file.
pub fn write_end(out: &mut dyn Write) -> io::Result<()> {
    out.write_all(b"}\n")
}
