//! Part labels for unlabelled meshes, transferred from labelled models.
