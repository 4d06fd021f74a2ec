"""The paper's chain: feature points, Hough transforms, least squares."""
