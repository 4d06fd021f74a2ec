"""A contour as a DXF drawing in metres, a layer for each kind of object."""

import io

from noctule import poses
from noctule.messages_pb2 import Contour
from noctule_mapper.export.shapes import rings

WALLS, CORNERS, CYLINDERS, TOUCHES = "WALLS", "CORNERS", "CYLINDERS", "TOUCHES"
OUTLINE, UNITS = "OUTLINE", "UNITS"
# AutoCAD's: white, red, cyan, magenta, grey, green.
_COLOURS = {WALLS: 7, CORNERS: 1, CYLINDERS: 4, TOUCHES: 6, OUTLINE: 8, UNITS: 3}
_CROSS = 3  # $PDMODE: a point is drawn as an X, not as one dot
_CROSS_M = 0.05


def dxf(contour: Contour) -> bytes:
    """LINEs of walls, POINTs of corners, touches and units, CIRCLEs of cylinders, closed LWPOLYLINEs of outlines."""
    from ezdxf.filemanagement import new  # takes half a second that the other commands need not wait
    from ezdxf.units import M

    drawing = new("R2010", units=M)
    drawing.header["$PDMODE"], drawing.header["$PDSIZE"] = _CROSS, _CROSS_M
    for name, colour in _COLOURS.items():
        drawing.layers.add(name, color=colour)
    space = drawing.modelspace()
    for wall in contour.walls:
        ends = (wall.start.x_m, wall.start.y_m), (wall.end.x_m, wall.end.y_m)
        space.add_line(*ends, dxfattribs={"layer": WALLS})
    for corner in contour.corners:
        space.add_point((corner.x_m, corner.y_m), dxfattribs={"layer": CORNERS})
    for cylinder in contour.cylinders:
        space.add_circle((cylinder.x_m, cylinder.y_m), cylinder.radius_m, dxfattribs={"layer": CYLINDERS})
    for touch in contour.touches:
        space.add_point((touch.x_m, touch.y_m), dxfattribs={"layer": TOUCHES})
    for pose in contour.poses:
        if poses.is_placed(pose):
            space.add_point((pose.x_m, pose.y_m), dxfattribs={"layer": UNITS})
    for ring in rings(contour):
        space.add_lwpolyline(ring.points.tolist(), close=True, dxfattribs={"layer": OUTLINE})
    text = io.StringIO()
    drawing.write(text)
    return text.getvalue().encode(drawing.output_encoding, errors="dxfreplace")
