"""The joint fit: a step of all objects at once to the raw ranges, each place's own error fitted along.

An error of a place moves all ranges from there together, be they of one sweep or of many by a unit that stands still.
It is two more unknowns for each place, known beforehand to within s, and taken out of the normal equations place by
place (Schur complement): among the echoes from there that is the covariance sigma^2 I + s^2 N N^T, N their directions.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noctule_mapper.contour.corners import Link, crossing
from noctule_mapper.contour.reflectors import Reflector
from noctule_mapper.readings.echoes import Echoes

_WEAK_PRIOR = 1e-2  # per square metre or radian: keeps what no echo determines where it is


@dataclass(frozen=True)
class Places:
    """Where the echoes came from: ``of`` (n,) numbers the places, ``sigma_m`` (places,) is how well each is known, and
    ``shift_m`` (places, 2) how far from the stated place the fit has it.
    """

    of: np.ndarray
    sigma_m: np.ndarray
    shift_m: np.ndarray

    def along(self, direction_rad: np.ndarray, echo: np.ndarray) -> np.ndarray:
        """How far the places of echoes number ``echo`` (m,) lie towards ``direction_rad`` of where they are stated."""
        shift = self.shift_m[self.of[echo]]
        return shift[:, 0] * np.cos(direction_rad) + shift[:, 1] * np.sin(direction_rad)


def places_of(echoes: Echoes) -> Places:
    """The places of ``echoes``, where they are stated to be; echoes of the very same place share it."""
    _, first, of = np.unique(echoes.x_m + 1j * echoes.y_m, return_index=True, return_inverse=True)
    return Places(of.ravel(), echoes.sigma_position_m[first], np.zeros((len(first), 2)))


@dataclass(frozen=True)
class Linear:
    """Claims linearised about the objects: rows (claims,) of slopes by the parameters in ``columns``, both (claims, 4)
    padded with zero slopes, predicted ranges, the directions of the echoes and their slopes by the same ``columns``.
    """

    slopes: np.ndarray
    columns: np.ndarray
    predicted_m: np.ndarray
    direction_rad: np.ndarray
    direction_slopes: np.ndarray


def offsets_of(objects: Sequence[Reflector]) -> np.ndarray:
    """Where each object's parameters start among all, and their number at the end; (objects + 1,)."""
    return np.concatenate([[0], np.cumsum([len(one.parameters) for one in objects])]).astype(int)


def linearise(
    objects: Sequence[Reflector], links: Sequence[Link], maker: np.ndarray, echo: np.ndarray, echoes: Echoes
) -> Linear:
    """Claims of ``maker`` (claims,), objects and then links, on echoes number ``echo`` (claims,)."""
    offsets = offsets_of(objects)
    slopes, columns = np.zeros((len(maker), 4)), np.zeros((len(maker), 4), int)
    predicted, direction = np.zeros(len(maker)), np.zeros(len(maker))
    turning = np.zeros((len(maker), 4))
    order = np.argsort(maker, kind="stable")
    for rows in np.split(order, np.nonzero(np.diff(maker[order]))[0] + 1) if len(order) else []:
        number = int(maker[rows[0]])
        if number < len(objects):
            model, owners = objects[number], (number,)
        else:
            link = links[number - len(objects)]
            model, owners = crossing(objects, link), (link.first, link.second)
        own = np.concatenate([np.arange(int(offsets[i]), int(offsets[i + 1])) for i in owners])
        heard = echoes.take(echo[rows])
        slopes[rows, : len(own)], columns[rows, : len(own)] = model.slopes(heard), own
        predicted[rows], direction[rows] = model.ranges(heard), model.directions(heard)
        turning[rows, : len(own)] = model.direction_slopes(heard)
    return Linear(slopes, columns, predicted, direction, turning)


@dataclass(frozen=True)
class Turns:
    """How far the echoes' directions are from their claims' (claims,), and the information that each is, per radian
    squared; 0 where only the beam tells the direction.
    """

    residual_rad: np.ndarray
    information: np.ndarray


@dataclass(frozen=True)
class Normal:
    """Normal equations of one step: the objects' and the places' steps, the covariance of the objects' parameters, and
    how many parameters the echoes have determined, the places' shares counted.
    """

    step: np.ndarray
    shift_m: np.ndarray
    covariance: np.ndarray
    freedom: float


def solve(
    linear: Linear,
    residual_m: np.ndarray,
    information: np.ndarray,
    echo: np.ndarray,
    places: Places,
    parameters: int,
    turns: Turns,
) -> Normal:
    """Weighted least squares for ``residual_m`` (claims,), each of ``information`` (claims,) per square metre, and for
    ``turns``.

    A place's shift along a direction shortens the range as much, hence its slopes are minus the direction's.
    """
    weighted = linear.slopes * information[:, None]
    own = _WEAK_PRIOR * np.eye(parameters)
    np.add.at(
        own, (linear.columns[:, :, None], linear.columns[:, None, :]), weighted[:, :, None] * linear.slopes[:, None, :]
    )
    pull = np.zeros(parameters)
    np.add.at(pull, linear.columns, weighted * residual_m[:, None])
    at = np.nonzero(turns.information)[0]
    columns, slopes = linear.columns[at], linear.direction_slopes[at]
    turned = slopes * turns.information[at, None]
    np.add.at(own, (columns[:, :, None], columns[:, None, :]), turned[:, :, None] * slopes[:, None, :])
    np.add.at(pull, columns, turned * turns.residual_rad[at, None])
    if not np.any(places.sigma_m > 0):
        covariance = np.linalg.inv(own)
        return Normal(covariance @ pull, places.shift_m, covariance, float(parameters))
    away = -np.stack([np.cos(linear.direction_rad), np.sin(linear.direction_rad)], axis=1)
    of, known = places.of[echo], 1 / np.maximum(places.sigma_m, _SURE_M) ** 2
    shared = np.zeros((parameters, len(known), 2))
    np.add.at(shared, (linear.columns, of[:, None]), weighted[:, :, None] * away[:, None, :])
    theirs = known[:, None, None] * np.eye(2)
    np.add.at(theirs, of, information[:, None, None] * away[:, :, None] * away[:, None, :])
    tug = -known[:, None] * places.shift_m
    np.add.at(tug, of, (information * residual_m)[:, None] * away)
    spread = np.linalg.inv(theirs)
    through = np.einsum("pgi,gij->pgj", shared, spread)
    covariance = np.linalg.inv(own - np.einsum("pgi,qgi->pq", through, shared))
    step = covariance @ (pull - np.einsum("pgi,gi->p", through, tug))
    shift = places.shift_m + np.einsum("gij,gj->gi", spread, tug - np.einsum("pgi,p->gi", shared, step))
    left = np.einsum("gii->g", spread) + np.einsum("pgi,pq,qgi->g", through, covariance, through)
    return Normal(step, shift, covariance, float(parameters + (2 - known * left).sum()))


_SURE_M = 1e-6  # a place stated as exact


def moved(objects: Sequence[Reflector], step: np.ndarray) -> list[Reflector]:
    """The objects with ``step`` (parameters,) added."""
    offsets = offsets_of(objects)
    return [one.moved(step[offsets[i] : offsets[i + 1]]) for i, one in enumerate(objects)]
