"""The protocol of the line: frames, their bytes, and what they mean in SI units."""
