//! What a model takes, and which of its outputs mean what: plain data, written by hand in a small file.
//!
//! The default is what `partpose export onnx` writes.

use partpose::parts::{CHANNELS, PartClass};
use serde::{Deserialize, Serialize};

use crate::OnnxError;

/// Word for what is no part.
pub const BACKGROUND: &str = "background";
/// Word for a class whose boxes are whole vehicles.
pub const VEHICLE: &str = "vehicle";

/// What a model takes and what it puts out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mapping {
    /// What goes in.
    pub input: InputMapping,
    /// What comes out.
    pub output: OutputMapping,
    /// Names of the model's classes, first the one with number 0: of a part, `background`, `vehicle`, or empty for a
    /// class that is neither. Not given: `background`, then the 29 parts in their order.
    pub classes: Vec<String>,
    /// Names of the zoo models whose probabilities `output.models` holds.
    pub models: Vec<String>,
}

/// How an image goes in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct InputMapping {
    /// Name of the input; the model's first if empty.
    pub name: String,
    /// How images are brought to size.
    pub resize: Resize,
    /// Order of the channels.
    pub channels: ChannelOrder,
    /// Order of the axes.
    pub layout: Layout,
    /// Subtracted from the channels red, green, blue, which go from 0 to 255.
    pub mean: [f32; 3],
    /// Divisor after that.
    pub deviation: [f32; 3],
    /// Whether values are 8-bit integers, which are not normalised, instead of 32-bit floats.
    pub bytes: bool,
}

/// How images are brought to size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Resize {
    /// Kept in shape: the shorter side becomes `shorter` pixels, the longer one at most `longer`; 0 for as it is.
    Keep {
        /// The shorter side.
        shorter: u32,
        /// The longer side at most.
        longer: u32,
    },
    /// To this width and height, whatever the shape.
    Stretch {
        /// Width and height.
        size: [u32; 2],
    },
    /// Kept in shape, as large as fits in the middle of this width and height.
    Letterbox {
        /// Width and height.
        size: [u32; 2],
        /// Value around it, 0 to 255.
        fill: f32,
    },
}

/// Order of the channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ChannelOrder {
    /// Red, green, blue.
    #[default]
    Rgb,
    /// Blue, green, red.
    Bgr,
}

/// Order of the input's axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Layout {
    /// `[1, 3, height, width]`.
    #[default]
    Nchw,
    /// `[1, height, width, 3]`.
    Nhwc,
    /// `[3, height, width]`.
    Chw,
}

/// Which outputs mean what.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OutputMapping {
    /// Boxes, `[n, 4]` or `[1, n, 4]`.
    pub boxes: String,
    /// What the four numbers of a box are.
    pub box_format: BoxFormat,
    /// Whether they are shares of the input's width and height, not pixels of it.
    pub box_shares: bool,
    /// Where pixel 0 begins: boxes count from its edge (most programs), or from its middle.
    pub pixel_origin: PixelOrigin,
    /// Scores, `[n]`, 0 to 1.
    pub scores: String,
    /// Classes of the boxes, `[n]`; empty where all are vehicles.
    pub labels: String,
    /// Width, height, length in metres, `[n, 3]`; empty where the model does not say.
    pub extents: String,
    /// Standard deviations of their logarithms, `[n, 3]`; empty where sizes are exact.
    pub extent_sigmas: String,
    /// Probabilities of zoo models, `[n, models]`; empty where the model does not say.
    pub models: String,
    /// Boxes with a lower score are left out.
    pub min_score: f32,
    /// The parts.
    pub parts: PartsMapping,
}

/// What the four numbers of a box are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BoxFormat {
    /// Left, top, right, bottom.
    #[default]
    Corners,
    /// Top, left, bottom, right, as TensorFlow has it.
    CornersYx,
    /// Middle, width and height.
    Centre,
    /// Left, top, width and height.
    CornerAndSize,
}

/// Where pixel 0 begins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PixelOrigin {
    /// At 0: pixel i covers `i..i+1`.
    #[default]
    Corner,
    /// At -0.5: the middle of pixel i is i.
    Centre,
}

/// What says which pixel is which part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum PartsMapping {
    /// A grid over each box, `[n, classes, m, m]`, in the order of the boxes.
    Boxes {
        /// The output.
        name: String,
        /// What its values are.
        #[serde(default)]
        values: PartValues,
    },
    /// Every part is an instance of its own: a mask for each box, `[n, 1, height, width]` or `[n, height, width]`, over
    /// the whole input, and its label says which part it is. Boxes labelled `vehicle` are the vehicles.
    Instances {
        /// The output with the masks, 0 to 1.
        masks: String,
        /// Value from which a pixel belongs to a mask.
        #[serde(default = "half")]
        threshold: f32,
        /// Cells a side of the grids that are made of them.
        #[serde(default = "usual_kernel")]
        kernel: usize,
    },
    /// Classes of the whole input: `[1, classes, height, width]`, the greatest counts, or their numbers,
    /// `[1, height, width]`; at the input's resolution or a coarser one.
    Image {
        /// The output.
        name: String,
        /// Cells a side of the grids that are made of it.
        #[serde(default = "usual_kernel")]
        kernel: usize,
    },
}

/// What the values of part grids are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PartValues {
    /// Probabilities that sum to 1 over the classes.
    #[default]
    Probabilities,
    /// Any numbers, of which a soft-max makes probabilities.
    Logits,
}

fn half() -> f32 {
    0.5
}

fn usual_kernel() -> usize {
    28
}

/// What a class stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Meaning {
    Background,
    Part(PartClass),
    Vehicle,
    Nothing,
}

impl Default for InputMapping {
    fn default() -> Self {
        Self {
            name: String::new(),
            resize: Resize::Keep { shorter: 0, longer: 1408 },
            channels: ChannelOrder::Rgb,
            layout: Layout::Nchw,
            mean: [0.0; 3],
            deviation: [1.0; 3],
            bytes: false,
        }
    }
}

impl Default for OutputMapping {
    fn default() -> Self {
        Self {
            boxes: "boxes".to_owned(),
            box_format: BoxFormat::Corners,
            box_shares: false,
            pixel_origin: PixelOrigin::Corner,
            scores: "scores".to_owned(),
            labels: String::new(),
            extents: String::new(),
            extent_sigmas: String::new(),
            models: String::new(),
            min_score: 0.0,
            parts: PartsMapping::Boxes {
                name: "part_probabilities".to_owned(),
                values: PartValues::Probabilities,
            },
        }
    }
}

impl Mapping {
    /// What each class stands for, or what is wrong with the mapping.
    pub(crate) fn meanings(&self) -> Result<Vec<Meaning>, OnnxError> {
        let fault = |fault: String| OnnxError::Mapping { fault };
        if self.input.deviation.iter().any(|value| !(value.abs() > 0.0)) {
            return Err(fault("`input.deviation` holds a zero".to_owned()));
        }
        let is_empty = |size: [u32; 2]| size.contains(&0);
        if let Resize::Stretch { size } | Resize::Letterbox { size, .. } = self.input.resize
            && is_empty(size)
        {
            return Err(fault("`input.resize.size` holds a zero".to_owned()));
        }
        match &self.output.parts {
            PartsMapping::Instances { kernel, .. } | PartsMapping::Image { kernel, .. }
                if !(2..=512).contains(kernel) =>
            {
                return Err(fault("`output.parts.kernel` must be 2 to 512".to_owned()));
            }
            PartsMapping::Instances { .. } if self.output.labels.is_empty() => {
                let told = "parts as instances need `output.labels`";
                return Err(fault(told.to_owned()));
            }
            _ => {}
        }
        if self.classes.is_empty() {
            let class = |id| PartClass::from_id(id).map_or(Meaning::Background, Meaning::Part);
            return Ok((0..CHANNELS as u8).map(class).collect());
        }
        let meaning = |name: &String| match name.as_str() {
            BACKGROUND => Ok(Meaning::Background),
            VEHICLE => Ok(Meaning::Vehicle),
            "" => Ok(Meaning::Nothing),
            other => PartClass::from_name(other).map(Meaning::Part).ok_or_else(|| {
                let all: Vec<&str> = PartClass::ALL.iter().map(|class| class.name()).collect();
                let words = [VEHICLE, BACKGROUND, "an empty text"].join("`, `");
                fault(format!(
                    "`classes` names `{other}`, which is no part: `{words}` and {} are known",
                    all.join(", ")
                ))
            }),
        };
        let meanings: Vec<Meaning> = self.classes.iter().map(meaning).collect::<Result<_, _>>()?;
        let vehicles = meanings.contains(&Meaning::Vehicle);
        if !self.output.labels.is_empty() && !vehicles {
            let told = "`output.labels` is given, but none of `classes` is `vehicle`";
            return Err(fault(told.to_owned()));
        }
        Ok(meanings)
    }
}
