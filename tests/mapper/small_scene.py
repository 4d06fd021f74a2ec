"""Scenes of a few echoes, for what can be worked out by hand."""

import math
from collections.abc import Sequence

import numpy as np

from noctule_mapper.config import RefinementConfig
from noctule_mapper.readings.echoes import echoes_of, join
from noctule_mapper.readings.evidence import Evidence, evidence
from noctule_mapper.readings.sweep import SweepReadings
from noctule_mapper.refinement.association import Claims

SIGMA_M = 0.003
SPAN_M = 4.0
# What an echo at the very range of its maker gains over one from anywhere: 6.277 nats.
MOST_GAIN_NATS = math.log(SPAN_M / (SIGMA_M * math.sqrt(2 * math.pi)))

Heard = tuple[float, float, float, float]  # x_m, y_m, axis_rad, range_m


def evidence_of(
    heard: Sequence[Heard], sigma_position_m: float = 0.0, calibrated: bool = True, span_m: float = SPAN_M
) -> Evidence:
    """The echoes as evidence; each is a sweep of its own with one bearing and a beam of 22.5 degrees."""
    echoes = join(
        [
            echoes_of(_sweep(number, one, sigma_position_m, SIGMA_M if calibrated else None), number, SIGMA_M)
            for number, one in enumerate(heard)
        ]
    )
    return evidence(echoes, echoes.sigma_m, span_m, RefinementConfig())


def claims_of(maker: Sequence[int], data: Evidence, predicted_m: float, chance: float = 0.95) -> Claims:
    """One claim for each echo, by the maker of that number."""
    n = len(data.echoes)
    assert len(maker) == n
    return Claims(np.array(maker), np.arange(n), np.full(n, predicted_m), np.full(n, chance), np.zeros(n))


def _sweep(number: int, heard: Heard, sigma_position_m: float, sigma_m: float | None) -> SweepReadings:
    x_m, y_m, axis_rad, range_m = heard
    return SweepReadings(
        identity=("log", number),
        unit="u1",
        time_s=float(number),
        x_m=x_m,
        y_m=y_m,
        heading_rad=0.0,
        sigma_position_m=sigma_position_m,
        sigma_heading_rad=0.0,
        bearing_rad=np.array([axis_rad]),
        range_m=np.array([range_m]),
        no_echo=np.array([False]),
        beam_width_rad=math.radians(22.5),
        range_sigma_m=sigma_m,
    )
