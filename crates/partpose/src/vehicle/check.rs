//! What is wrong with a vehicle model, and what to do about it.
