//! Vehicle models of others: glTF and GLB, OBJ with MTL, PLY.
