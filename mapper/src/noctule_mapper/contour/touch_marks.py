"""How a touch is drawn, in the viewer and on paper: a bar across its direction, and what it most likely is."""

from math import cos, sin, sqrt

from noctule.messages_pb2 import Touch

_LEAST_HALF_M = 0.03  # of the bar of a touch that is known exactly


def bar_m(touch: Touch) -> tuple[tuple[float, float], tuple[float, float]]:
    """The ends of a bar across the direction of the echo, one standard deviation to either side."""
    x, y = -sin(touch.direction_rad), cos(touch.direction_rad)
    half_m = _LEAST_HALF_M
    if len(touch.covariance) == 4:
        xx, xy, yx, yy = touch.covariance
        half_m = max(half_m, sqrt(max(0.0, x * x * xx + x * y * (xy + yx) + y * y * yy)))
    return (touch.x_m - half_m * x, touch.y_m - half_m * y), (touch.x_m + half_m * x, touch.y_m + half_m * y)


def label(touch: Touch) -> str:
    """The likeliest kind and its chance."""
    kinds = {"wall": touch.chance_wall, "corner": touch.chance_corner, "cylinder": touch.chance_cylinder}
    kind = max(kinds, key=lambda one: kinds[one])
    return f"{kind}? {100 * kinds[kind]:.0f} %"
