//! Roads, surroundings and traffic.
