//! The procedural vehicles with materials.
