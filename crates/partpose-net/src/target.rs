//! What a training image shows: vehicles, what to ignore, and labels pixel by pixel.

/// Owner of a pixel that no vehicle covers.
pub const NO_OWNER: u16 = 0;
/// Owner of a pixel of a vehicle that is neither example nor counter-example.
pub const IGNORED_OWNER: u16 = u16::MAX;

/// The truth about one image, in pixels of the network's input (after scaling, cropping, flipping).
///
/// Boxes are `[x_min, y_min, x_max, y_max]` with pixel (i, j) covering `i..i+1`, `j..j+1`: the corner convention of
/// torchvision. A `Rect` of `partpose`, whose pixel centres are at integers, is shifted by half a pixel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Target {
    /// Width and height of the part of the input that holds the image (the rest is padding).
    pub size: [usize; 2],
    /// Vehicles to learn from.
    pub boxes: Vec<[f32; 4]>,
    /// Regions to learn nothing from: neither vehicle nor background.
    pub ignore: Vec<[f32; 4]>,
    /// Part of each pixel, 0 background, row by row, `size[0] * size[1]`.
    pub labels: Vec<u8>,
    /// Vehicle of each pixel: [`NO_OWNER`], `i + 1` for `boxes[i]`, or [`IGNORED_OWNER`].
    pub owner: Vec<u16>,
    /// Index of each vehicle's zoo model in `NetConfig::models`, where known; empty if no head asks.
    pub models: Vec<Option<usize>>,
    /// Width, height and length of each vehicle, metres; empty if no head asks.
    pub extents: Vec<[f32; 3]>,
}
