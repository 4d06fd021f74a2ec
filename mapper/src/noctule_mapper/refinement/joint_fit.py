"""The joint fit: one Gauss-Newton step of all objects to the raw ranges and directions, with what the echoes share.

Beside the objects' parameters t the fit has those of the sensors, q = (mean error b, share s by which ranges are too
long, da by which the face stands farther off the axis) of a unit, and of each place where echoes came from p = (dx, dy,
dheading). An echo of range R and axis z, of a reflector at the range r from the face, which stands off the axis by a
and sees it in direction f, all linearised, obeys

    R = r(t) + a + r'(dx, dy) + r'(u(z)) da + b + s r    u(z) the unit vector along z; of a wall r'(v) = -u(f) . v
    z = f(t) + f'(dx, dy) - dheading                     only where the sweep is fine: else the beam alone tells

and of q and p it is known beforehand to within which sigma they are what is stated. An error of a place moves all that
is heard there together, and one of a sensor all that its unit hears, so however many echoes there are, it stays. With
the weights W of the rows, the normal equations in (t, q) and p are

    [A   B ] [step in (t, q)]   [g]      A = sum W a a^T + priors    a the slopes by (t, q)
    [B^T C ] [step in p     ] = [h]      B = sum W a c^T             c the slopes by p
                                         C = sum W c c^T + priors    in blocks of 3, one for each place

C costs nothing to invert, so p is taken out place by place (Schur complement): S = A - B C^-1 B^T is the information in
(t, q), S^-1 their covariance, and p = C^-1 (h - B^T (t, q)). Of one place this is the same as to give its ranges the
covariance sigma^2 I + s^2 N N^T, N their directions.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from noctule_mapper.contour.corners import Link, crossing
from noctule_mapper.contour.reflectors import Reflector
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.evidence import Evidence
from noctule_mapper.readings.stands import deviation

_WEAK_PRIOR = 1e-2  # per square metre or radian: keeps what no echo determines where it is
_SURE = 1e-6  # metres or radians: a place stated as exact


@dataclass(frozen=True)
class Shared:
    """What echoes share: ``place`` (n,) numbers the places, ``sensor`` (n,) the sensors that nobody has measured, -1
    for others.

    Of places (places, 3) and of sensors (sensors, 3), as the equations of the module have them: what is known of them
    beforehand, ``stated`` and ``sigma``, and what the fit has, ``shift`` and ``error``.
    """

    place: np.ndarray
    stated: np.ndarray
    sigma: np.ndarray
    shift: np.ndarray
    sensor: np.ndarray
    sensor_stated: np.ndarray
    sensor_sigma: np.ndarray
    error: np.ndarray

    @property
    def is_exact(self) -> bool:
        """Whether every place is where it is stated."""
        return not np.any(self.sigma > 0)


def shared_by(data: Evidence) -> Shared:
    """What the echoes of ``data`` share, before any fit."""
    stands = data.stands
    measured = np.any(stands.sensor_sigma > 0, axis=1)
    number = np.where(measured, np.cumsum(measured) - 1, -1)
    return Shared(
        place=data.stand,
        stated=deviation(stands),
        sigma=stands.prior_sigma,
        shift=np.zeros_like(stands.sigma),
        sensor=number[data.echoes.unit],
        sensor_stated=-stands.sensor_now[measured],
        sensor_sigma=stands.sensor_sigma[measured],
        error=np.zeros((int(measured.sum()), 3)),
    )


@dataclass(frozen=True)
class Linear:
    """Claims linearised about the objects: rows (claims,) of slopes by the parameters in ``columns``, both (claims, 4)
    padded with zero slopes, and by the place, (claims, 2), predicted ranges, the directions of the echoes and their
    slopes by the same.
    """

    slopes: np.ndarray
    columns: np.ndarray
    slopes_by_place: np.ndarray
    predicted_m: np.ndarray
    direction_rad: np.ndarray
    direction_slopes: np.ndarray
    direction_slopes_by_place: np.ndarray


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
    turning, by_place, turning_by_place = np.zeros((len(maker), 4)), *np.zeros((2, len(maker), 2))
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
        by_place[rows], turning_by_place[rows] = model.slopes_by_place(heard), model.direction_slopes_by_place(heard)
    return Linear(slopes, columns, by_place, predicted, direction, turning, turning_by_place)


@dataclass(frozen=True)
class Rows:
    """The rows of one step: residuals of ranges and of directions, (claims,); their slopes by ``columns`` (claims, k)
    and by the place, (claims, 3).
    """

    columns: np.ndarray
    residual_m: np.ndarray
    slopes: np.ndarray
    by_place: np.ndarray
    turn_rad: np.ndarray
    turn_slopes: np.ndarray
    turn_by_place: np.ndarray


def rows_of(linear: Linear, echo: np.ndarray, echoes: Echoes, shared: Shared, parameters: int) -> Rows:
    """The rows of claims on echoes number ``echo`` (claims,); the sensors' columns come after the objects'."""
    place = shared.place[echo]
    none = np.zeros(len(echo))
    axis_rad, face_m = echoes.axis_rad[echo], echoes.face_offset_m[echo]
    by_face = (linear.slopes_by_place * np.column_stack([np.cos(axis_rad), np.sin(axis_rad)])).sum(axis=1)
    by_turn = (linear.slopes_by_place * np.column_stack([-np.sin(axis_rad), np.cos(axis_rad)])).sum(axis=1)
    away = np.column_stack([linear.slopes_by_place, face_m * by_turn])  # the face goes round with the heading
    turn_away = np.column_stack([linear.direction_slopes_by_place, none - 1])
    residual = echoes.range_m[echo] - linear.predicted_m - (away * shared.shift[place]).sum(axis=1)
    turn = wrapped(echoes.axis_rad[echo] - linear.direction_rad - (turn_away * shared.shift[place]).sum(axis=1))
    columns, slopes, turn_slopes = linear.columns, linear.slopes, linear.direction_slopes
    if len(shared.error):
        sensor = shared.sensor[echo]
        by_sensor = np.where(
            sensor[:, None] >= 0, np.column_stack([none + 1, linear.predicted_m - face_m, by_face]), 0.0
        )
        at = np.maximum(sensor, 0)
        residual = residual - (by_sensor * shared.error[at]).sum(axis=1)
        columns = np.column_stack([columns, *(parameters + 3 * at + which for which in range(3))])
        slopes, turn_slopes = np.column_stack([slopes, by_sensor]), np.column_stack([turn_slopes, 0 * by_sensor])
    return Rows(columns, residual, slopes, away, turn, turn_slopes, turn_away)


def placing_nothing(rows: Rows, which: np.ndarray) -> Rows:
    """The rows, those of ``which``, bool (claims,), telling nothing of the places: objects are fitted to them with the
    places as the others have them.
    """
    return replace(
        rows,
        by_place=np.where(which[:, None], 0.0, rows.by_place),
        turn_by_place=np.where(which[:, None], 0.0, rows.turn_by_place),
    )


@dataclass(frozen=True)
class Normal:
    """Normal equations of one step: its ``step`` in the objects and the sensors, what the fit then has of places and
    sensors, the covariance of objects and sensors, how many parameters the echoes have determined, the places' shares
    counted, and A, B and C of the module's equations.
    """

    step: np.ndarray
    shift: np.ndarray
    error: np.ndarray
    covariance: np.ndarray
    freedom: float
    own: np.ndarray
    between: np.ndarray
    theirs: np.ndarray


def solve(
    rows: Rows,
    residual_m: np.ndarray,
    information: np.ndarray,
    turn_information: np.ndarray,
    echo: np.ndarray,
    shared: Shared,
    parameters: int,
) -> Normal:
    """Weighted least squares for ``residual_m`` (claims,), each of ``information`` (claims,) per square metre, and for
    the directions that ``turn_information`` (claims,), per radian squared, says anything of.
    """
    own, pull = _objects_and_sensors(rows, residual_m, information, turn_information, shared, parameters)
    if shared.is_exact:
        covariance = np.linalg.inv(own)
        step = covariance @ pull
        error = shared.error + step[parameters:].reshape(-1, 3)
        between, theirs = np.zeros((len(own), 0, 3)), np.zeros((0, 3, 3))
        return Normal(step, shared.shift, error, covariance, float(parameters), own, between, theirs)
    between, theirs, tug, known = _places(rows, residual_m, information, turn_information, echo, shared, len(own))
    spread = np.linalg.inv(theirs)
    through = np.einsum("pgi,gij->pgj", between, spread)
    covariance = np.linalg.inv(own - np.einsum("pgi,qgi->pq", through, between))
    step = covariance @ (pull - np.einsum("pgi,gi->p", through, tug))
    shift = shared.shift + np.einsum("gij,gj->gi", spread, tug - np.einsum("pgi,p->gi", between, step))
    error = shared.error + step[parameters:].reshape(-1, 3)
    variance = np.einsum("gii->gi", spread) + np.einsum("pgi,pq,qgi->gi", through, covariance, through)
    freedom = float(parameters + (1 - known * variance).sum())
    return Normal(step, shift, error, covariance, freedom, own, between, theirs)


def _objects_and_sensors(
    rows: Rows,
    residual_m: np.ndarray,
    information: np.ndarray,
    turn_information: np.ndarray,
    shared: Shared,
    parameters: int,
) -> tuple[np.ndarray, np.ndarray]:
    """A and g."""
    known = _sensors_known(shared.sensor_sigma)
    own = np.diag(np.full(parameters + len(known), _WEAK_PRIOR))
    own[parameters:, parameters:] = known
    pull = np.concatenate([np.zeros(parameters), known @ (shared.sensor_stated - shared.error).ravel()])
    at = np.nonzero(turn_information)[0]
    for columns, slopes, weight, residual in (
        (rows.columns, rows.slopes, information, residual_m),
        (rows.columns[at], rows.turn_slopes[at], turn_information[at], rows.turn_rad[at]),
    ):
        weighted = slopes * weight[:, None]
        np.add.at(own, (columns[:, :, None], columns[:, None, :]), weighted[:, :, None] * slopes[:, None, :])
        np.add.at(pull, columns, weighted * residual[:, None])
    return own, pull


def _sensors_known(sigma: np.ndarray) -> np.ndarray:
    """The information on the sensors' errors before any fit, (3 sensors, 3 sensors), of their ``sigma`` (sensors, 3).

    Each sensor errs by itself, but all units hear the same air, but for a kelvin or so.
    """
    sure = np.maximum(sigma, _SURE)
    covariance = np.diag(sure.ravel() ** 2)
    share = sure[:, 1]
    covariance[1::3, 1::3] = np.where(np.eye(len(share)) > 0, 1.0, _ONE_AIR) * np.outer(share, share)
    return np.linalg.inv(covariance)


_ONE_AIR = 0.96  # correlation: of 5 K that nobody has measured 1 K is a unit's own


def _places(
    rows: Rows,
    residual_m: np.ndarray,
    information: np.ndarray,
    turn_information: np.ndarray,
    echo: np.ndarray,
    shared: Shared,
    width: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """B, C and h, and the priors in C, (places, 3)."""
    known = 1 / np.maximum(shared.sigma, _SURE) ** 2
    between = np.zeros((width, len(known), 3))
    theirs = known[:, :, None] * np.eye(3)
    tug = known * (shared.stated - shared.shift)
    at, place = np.nonzero(turn_information)[0], shared.place[echo]
    for of, columns, slopes, by_place, weight, residual in (
        (place, rows.columns, rows.slopes, rows.by_place, information, residual_m),
        (
            place[at],
            rows.columns[at],
            rows.turn_slopes[at],
            rows.turn_by_place[at],
            turn_information[at],
            rows.turn_rad[at],
        ),
    ):
        weighted = by_place * weight[:, None]
        np.add.at(between, (columns, of[:, None]), slopes[:, :, None] * weighted[:, None, :])
        np.add.at(theirs, of, weighted[:, :, None] * by_place[:, None, :])
        np.add.at(tug, of, weighted * residual[:, None])
    return between, theirs, tug, known


def moved(objects: Sequence[Reflector], step: np.ndarray) -> list[Reflector]:
    """The objects with ``step`` (parameters,) added."""
    offsets = offsets_of(objects)
    return [one.moved(step[offsets[i] : offsets[i + 1]]) for i, one in enumerate(objects)]
