//! What a camera makes of light: exposure, noise, blur, flare, drops, JPEG.
