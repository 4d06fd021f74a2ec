"""The refinement: all reflectors together, fitted to the raw ranges, and the contour that they make."""
