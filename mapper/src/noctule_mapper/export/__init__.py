"""A contour in the formats of other programs: maps (GeoJSON), drawings (DXF), robots (the ROS map of nav2)."""
