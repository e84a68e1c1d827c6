//! COCO instance annotations.
