"""What a contour says of its walls' errors."""

from math import cos, sin, sqrt

from noctule.messages_pb2 import Wall


def sigma_m(wall: Wall, x_m: float, y_m: float) -> float | None:
    """Standard deviation across the wall at a place on it; None if not stated. rho = x cos(theta) + y sin(theta) moves
    by its own error and by theta's times the way along the wall.
    """
    if len(wall.covariance) != 4:
        return None
    turning_m = x_m * sin(wall.theta_rad) - y_m * cos(wall.theta_rad)
    theta, theta_rho, rho_theta, rho = wall.covariance
    return sqrt(max(0.0, turning_m * turning_m * theta + turning_m * (theta_rho + rho_theta) + rho))


def middle_sigma_m(wall: Wall) -> float | None:
    """Standard deviation across the wall at its middle; None if not stated."""
    return sigma_m(wall, (wall.start.x_m + wall.end.x_m) / 2, (wall.start.y_m + wall.end.y_m) / 2)
