"""The paper's own chain: feature points, then walls and cylinders by Hough transforms and least squares."""
