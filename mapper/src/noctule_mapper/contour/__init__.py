"""What a contour is made of: reflectors, what they make of echoes, corners, outlines."""
