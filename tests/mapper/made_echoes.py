"""Echoes as a test makes them: of a sensor without errors but its ranges', at places that are known exactly."""

import numpy as np
from mapper.room import HALF_BEAM_RAD

from noctule_mapper.readings.echoes import Echoes


def made_echoes(
    places: np.ndarray,
    range_m: np.ndarray,
    axis_rad: np.ndarray,
    sigma_m: float | np.ndarray,
    half_beam_rad: float = HALF_BEAM_RAD,
    face_offset_m: float = 0.0,
) -> Echoes:
    """One echo from each of ``places`` (n, 2), each of a sweep of its own with bearings of 22.5 degrees."""
    one, number = np.ones(len(places)), np.arange(len(places))
    return Echoes(
        sweep=number,
        x_m=places[:, 0],
        y_m=places[:, 1],
        axis_rad=axis_rad,
        half_beam_rad=half_beam_rad * one,
        range_m=range_m,
        sigma_m=sigma_m * one,
        calibrated=one > 0,
        sigma_position_m=0 * one,
        sigma_heading_rad=0 * one,
        step_rad=np.radians(22.5) * one,
        unit=0 * number,
        heading_rad=0 * one,
        sigma_bias_m=0 * one,
        sigma_scale=0 * one,
        face_offset_m=face_offset_m * one,
        sigma_face_m=0 * one,
        sense=0 * number,
    )
