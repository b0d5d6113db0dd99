"""One flight: equations of motion, launch, ends, the glide."""
