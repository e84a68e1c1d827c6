//! Run-length encoding of masks as COCO has it.
