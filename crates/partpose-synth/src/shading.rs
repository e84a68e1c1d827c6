//! Images and labels of a scene: rasterised, shaded in linear light.
