"""The echoes as evidence: with their spread, with the places that share an error, weighed against "from anywhere"."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from noctule_mapper.config import RefinementConfig
from noctule_mapper.readings.echoes import Echoes


@dataclass(frozen=True)
class Evidence:
    """The echoes of a refinement; arrays (n,)."""

    echoes: Echoes
    range_sigma_m: np.ndarray  # of a range from a place that is exactly known
    place: np.ndarray  # a number that the echoes from one place share
    span_m: float  # ranges that an echo of nothing may have

    def take(self, index: np.ndarray) -> "Evidence":
        """The evidence at ``index`` (numbers or a mask)."""
        return replace(
            self,
            echoes=self.echoes.take(index),
            range_sigma_m=self.range_sigma_m[index],
            place=self.place[index],
        )

    @cached_property
    def sigma_m(self) -> np.ndarray:
        """Of a range, the place's error in it, (n,)."""
        return np.hypot(self.range_sigma_m, self.echoes.sigma_position_m)

    def respread(self, factor: np.ndarray | float) -> "Evidence":
        """The same with ``factor`` times the spread of ranges."""
        return replace(self, range_sigma_m=factor * self.range_sigma_m)

    def gain(self, residual_m: np.ndarray, at: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Gain in nats of residuals (..., m) of the echoes ``at`` (all of them if not told); negative where the outlier
        model explains an echo better.
        """
        sigma_m = self.sigma_m[at]
        return np.log(self.span_m / (sigma_m * np.sqrt(2 * np.pi))) - 0.5 * (residual_m / sigma_m) ** 2


def evidence(echoes: Echoes, sigma_m: np.ndarray, span_m: float, config: RefinementConfig) -> Evidence:
    """Evidence of ``echoes`` whose ranges have the spread ``sigma_m``, (n,), in a span of ``span_m``."""
    cell = np.rint(np.stack([echoes.x_m, echoes.y_m], axis=1) / config.same_place_m).astype(int)
    _, place = np.unique(cell, axis=0, return_inverse=True)
    return Evidence(echoes, sigma_m, place.ravel(), span_m)


def newest_of_each_beam(data: Evidence) -> np.ndarray:
    """Numbers of the echoes that stand for all when objects are weighed: of one place and direction the newest.

    Such echoes share their errors: of pose, of clutter, of what passes by. A thousand of them prove no more than one.
    """
    beam = np.rint(data.echoes.axis_rad % (2 * np.pi) / data.echoes.half_beam_rad).astype(int)
    groups = np.stack([data.place, beam], axis=1)[::-1]
    _, last = np.unique(groups, axis=0, return_index=True)
    return np.sort(len(groups) - 1 - last)
