"""A scene: what each reading would hear of walls, points, cylinders and the corners of walls that stand together.

A sensor reports the nearest thing that answers. So of the makers in a reading's beam, from near to far, each answers
with its chance unless one before it has; what no maker explains comes from anywhere, but hardly from behind a maker
that would have answered.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from noctule_mapper.config import RefinementConfig
from noctule_mapper.contour.corners import Link, crossing, heard_price, parting
from noctule_mapper.contour.likelihood import answering, hidden, price_beside
from noctule_mapper.contour.reflectors import Crossing, Line, Reflector, box_of_rays
from noctule_mapper.contour.silence import silence_of, silence_of_link
from noctule_mapper.readings.evidence import Evidence

_REMEMBERED = 8000  # rows of makers, pairs of a maker and a wall before it, corners


@dataclass(frozen=True)
class Claims:
    """Which maker may have made which echo; arrays (claims,), by echo and from near to far.

    ``maker`` numbers objects and then links, ``chance`` is that of an answer, were nothing nearer, and
    ``direction_gain`` what the echo's direction says for the maker, in nats.
    """

    maker: np.ndarray
    echo: np.ndarray
    predicted_m: np.ndarray
    chance: np.ndarray
    direction_gain: np.ndarray


@dataclass(frozen=True)
class Explanation:
    """How much likelier each echo is than from anywhere, in nats (n,), the share of each claim in its echo (claims,),
    and what is left to no maker, (n,).
    """

    gain: np.ndarray
    share: np.ndarray
    unexplained: np.ndarray


@dataclass(frozen=True)
class _Row:
    """One maker's claims: echoes, predicted ranges, chances, gains of the directions; the box of all its rays (least x,
    y, most x, y); its weight, the nats that it could explain.
    """

    echo: np.ndarray
    predicted_m: np.ndarray
    chance: np.ndarray
    direction_gain: np.ndarray
    box: np.ndarray
    weight: float


class Scene:
    """The echoes, before which any objects and links may be put; what has been worked out for a maker is remembered."""

    def __init__(self, data: Evidence, config: RefinementConfig) -> None:
        self.data, self.config = data, config
        self._row = lru_cache(_REMEMBERED)(self._worked_out_row)
        self._price = lru_cache(_REMEMBERED)(lambda one: price_beside(one, data, config))
        self._hidden = lru_cache(_REMEMBERED)(self._worked_out_hidden)
        self.heard_price = lru_cache(_REMEMBERED)(lambda corner: heard_price(corner, data, config))

    def claims(self, objects: Sequence[Reflector], links: Sequence[Link]) -> Claims:
        """Every claim that the geometry allows."""
        if not objects:
            return Claims(np.zeros(0, int), np.zeros(0, int), np.zeros(0), np.zeros(0), np.zeros(0))
        makers = _makers(objects, links, self.config.linking.growth_m)
        rows = [self._row(maker) for maker in makers]
        chances = [row.chance for row in rows]
        for number, other in np.argwhere(self._before(objects, links, rows)):
            chances[number] = np.where(self._hidden(makers[number], objects[other]), 0, chances[number])
        maker = np.repeat(np.arange(len(rows)), [len(row.echo) for row in rows])
        echo, predicted, direction_gain = (
            np.concatenate([getattr(row, name) for row in rows]) for name in ("echo", "predicted_m", "direction_gain")
        )
        chance = np.concatenate(chances)
        order = np.lexsort((predicted, echo))
        order = order[chance[order] > 0]
        return Claims(maker[order], echo[order], predicted[order], chance[order], direction_gain[order])

    def _before(self, objects: Sequence[Reflector], links: Sequence[Link], rows: Sequence[_Row]) -> np.ndarray:
        """Which walls may hide which makers, bool (makers, objects): weightier ones, about whose box the rays pass."""
        weight = np.array([row.weight for row in rows])
        weight[len(objects) :] = -1.0  # any wall hides a corner, but its own two
        before = weight[None, : len(objects)] > weight[:, None]
        for number, link in enumerate(links, len(objects)):
            before[number, [link.first, link.second]] = False
        rays = np.array([row.box for row in rows])
        walls = np.array([one.box if isinstance(one, Line) else _NOWHERE for one in objects])
        return (
            before
            & np.all(rays[:, None, :2] <= walls[None, :, 2:], axis=2)
            & np.all(rays[:, None, 2:] >= walls[None, :, :2], axis=2)
        )

    def explain(self, claims: Claims) -> Explanation:
        """What the claims make of the echoes."""
        data = self.data
        gain = data.gain(data.echoes.range_m[claims.echo] - claims.predicted_m, claims.echo)
        return explain(claims, gain, data, self.config)

    def support(self, corner: Crossing, free: np.ndarray) -> float:
        """What a corner explains of echoes that are ``free`` (n,) from 0 to 1, less a price for those that it would cut
        off, in nats.
        """
        row = self._row(_Maker(corner))
        gain = self.data.gain(self.data.echoes.range_m[row.echo] - row.predicted_m, row.echo)
        gain = np.maximum(gain + row.direction_gain + np.log(row.chance), 0)
        others = free.copy()
        others[row.echo[gain > 0]] = 0.0
        cut_off = others @ parting(corner, self.data, self.config)
        return float(free[row.echo] @ gain - self.config.linking.cut_off_nats * cut_off)

    def worth(self, objects: Sequence[Reflector], links: Sequence[Link], explanation: Explanation) -> float:
        """What the objects gain from all echoes, less their prices and those of the looks that did not hear them, in
        nats.
        """
        price = sum(self._price(one) for one in objects)
        price += sum(silence_of(one, self.data, self.config, objects) for one in objects)
        price += sum(silence_of_link(crossing(objects, link), self.data, self.config, objects) for link in links)
        return float(explanation.gain.sum()) - price

    def worth_of(self, objects: Sequence[Reflector], links: Sequence[Link]) -> float:
        """What the objects are worth where each echo is explained by them and the corners of ``links``, in nats."""
        return self.worth(objects, links, self.explain(self.claims(objects, links)))

    def _worked_out_row(self, maker: "_Maker") -> _Row:
        data, config = self.data, self.config
        chance = answering(maker.model, data, config)
        if isinstance(maker.model, Line):
            along = maker.model.along(data.echoes)
            beyond_m = np.maximum(maker.low_m - along, along - maker.high_m)
            open_m = np.where(along < maker.low_m, maker.low_open_m, maker.high_open_m)
            chance = np.where(
                beyond_m <= 0, chance, np.where(beyond_m <= open_m, config.beam.growth_chance * chance, 0)
            )
        echo = np.nonzero(chance > 0)[0]
        heard = data.echoes.take(echo)
        predicted = maker.model.ranges(heard)
        box = box_of_rays(maker.model, heard) if len(echo) else np.array(_NOWHERE)
        gain = data.gain(heard.range_m - predicted, echo)
        direction_gain = data.direction_gain(maker.model.directions(heard), echo)
        weight = float(np.maximum(gain + direction_gain, 0).sum())
        return _Row(echo, predicted, chance[echo], direction_gain, box, weight)

    def _worked_out_hidden(self, maker: "_Maker", wall: Line) -> np.ndarray:
        echo = self._row(maker).echo
        return hidden(maker.model, wall, self.data.echoes.take(echo), self.data.sigma_m[echo], self.config)


class _Maker(NamedTuple):
    """An object or a corner, and how far along itself a wall answers: surely from ``low_m`` to ``high_m``, perhaps by
    ``low_open_m`` and ``high_open_m`` beyond.
    """

    model: Reflector | Crossing
    low_m: float = 0.0
    high_m: float = 0.0
    low_open_m: float = 0.0
    high_open_m: float = 0.0


def _makers(objects: Sequence[Reflector], links: Sequence[Link], growth_m: float) -> list[_Maker]:
    """Objects, then links: a wall answers as far as its corners, or perhaps beyond its last foot where it has none."""
    makers = [
        _Maker(one, one.low_m, one.high_m, growth_m, growth_m) if isinstance(one, Line) else _Maker(one)
        for one in objects
    ]
    for link in links:
        corner = crossing(objects, link)
        first, second = makers[link.first], makers[link.second]
        makers[link.first] = first._replace(high_m=float(corner.first.tangent @ corner.point), high_open_m=0.0)
        makers[link.second] = second._replace(low_m=float(corner.second.tangent @ corner.point), low_open_m=0.0)
        makers.append(_Maker(corner))
    return makers


def explain(claims: Claims, gain: np.ndarray, data: Evidence, config: RefinementConfig) -> Explanation:
    """What ``claims``, whose ranges alone are worth ``gain`` nats (claims,), make of the echoes."""
    n = len(data.echoes)
    silent = np.log1p(-claims.chance)
    nearer = np.cumsum(silent) - silent
    first = np.searchsorted(claims.echo, claims.echo)
    nearer = nearer - nearer[first]
    heard = np.exp(nearer + np.minimum(gain + claims.direction_gain, _MOST_NATS))
    likelihood = (1 - config.beam.false_share) * claims.chance * heard
    behind = data.echoes.range_m[claims.echo] - claims.predicted_m > (
        config.beam.gate_sigmas * data.sigma_m[claims.echo] + config.beam.behind_m
    )
    unheard = np.bincount(claims.echo, np.where(behind, silent, 0), minlength=n)
    anywhere = np.maximum(np.exp(unheard), config.beam.false_share)
    total = anywhere + np.bincount(claims.echo, likelihood, minlength=n)
    return Explanation(np.log(total), likelihood / total[claims.echo], anywhere / total)


_MOST_NATS = 50.0  # of one echo, so that it can't overflow


_NOWHERE = (np.inf, np.inf, -np.inf, -np.inf)  # the box of what hides nothing
