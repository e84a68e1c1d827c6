//! Part labels for boxed data sets (paper, labelling pipeline).
