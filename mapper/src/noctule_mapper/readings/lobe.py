"""The lobe: how far off its axis a sensor hears a reflector."""

import numpy as np

from noctule_mapper.config import RefinementConfig


def lobe_rad(range_m: np.ndarray, half_beam_rad: np.ndarray, config: RefinementConfig) -> np.ndarray:
    """Half width in which a reflector at ``range_m`` can answer: close by the lobe is wider than the stated beam."""
    near_rad = np.maximum(half_beam_rad, config.beam.near_lobe_rad)
    share = np.clip(
        (config.beam.near_lobe_ends_m - range_m) / (config.beam.near_lobe_ends_m - config.beam.near_lobe_m), 0, 1
    )
    return half_beam_rad + share * (near_rad - half_beam_rad)
