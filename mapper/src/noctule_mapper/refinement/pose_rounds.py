"""Rounds of fits between which the evidence goes along with the poses, until every unit is where it seems to be.

A unit whose stated pose is wrong hears nothing where the others' map has it, so no fit draws it to where it belongs. It
is sought there (module relocation), fitted with hardly any trust in what was stated, and then either its pose is as far
off as it was stated to be at most, or it is wrong and is named.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from noctule_mapper.contour.corners import Link, crossing
from noctule_mapper.contour.reflectors import Crossing, Line, Reflector
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.evidence import Evidence, with_stands
from noctule_mapper.readings.stands import Stands
from noctule_mapper.refinement.association import Claims, Scene
from noctule_mapper.refinement.em_fit import Settled
from noctule_mapper.refinement.joint_fit import Shared
from noctule_mapper.refinement.pose_errors import Errors
from noctule_mapper.refinement.poses import squares
from noctule_mapper.refinement.relocation import relocated

_MOST_ROUNDS = 3
_STILL = 1.0  # sigmas of the pose: what moves less leaves every echo with its reflector
_NEIGHBOURS = 8  # by whose map and plateaus a unit is sought: the cost stays bounded
_LEAST_STANDS = 3  # of two that disagree nobody can tell which is wrong
_SOUGHT_NATS = 15.0  # so much more a unit must hear elsewhere to be tried there
_PROOF_NATS = 3.0  # so much more the map must be worth with it there, all that was known beforehand counted
_WRONG_SQUARE = 25.0  # of a pose's deviation from the stated one: by chance in one of 65,000
_LEAST_KNOWN = (0.001, np.radians(0.2))  # metres and radians: labels may be wrong, so no fitted pose is exact
_SOUGHT = (0.03, np.radians(3.0))  # how well a pose is known that two plateaus tell
_FOLLOWS = 0.3  # sigmas of the pose: a scene whose poses move by less stays
_AS_KNOWN = 1.5  # nor does a scene follow if the poses are known as well as before, to within this factor
_EXCHANGED = (0.2, 0.2, np.radians(15.0))  # so near another's stated pose a unit may have been exchanged with it
_LEAST_SENSOR = np.array(
    [0.001, 0.001, 0.001]
)  # metres, a share, metres: changes below them leave every echo with its reflector


@dataclass(frozen=True)
class Final:
    """A fit to all evidence, ``data``, with the ``plateaus`` in it, the claims and the links that the fit
    rests on, and what its objects are worth in nats."""

    last: Settled
    data: Evidence
    plateaus: Evidence
    claims: Claims
    links: list[Link]
    worth: float


def posed(data: Evidence, fitted: Callable[[Evidence], Final]) -> tuple[Evidence, Final]:
    """The evidence with the units where they seem to be, and the fit to it; as it comes where no pose may move."""
    data, final = _still(data, fitted(data), fitted)
    square = squares(final.data.stands, final.last.shared, final.last.errors)
    if np.any(square > _WRONG_SQUARE):
        data = with_stands(data, replace(final.data.stands, is_doubted=square > _WRONG_SQUARE))
        data, final = _named(*_still(data, fitted(data), fitted), fitted)
    tried: set[int] = set()
    while (sought := _sought(final, tried)) is not None:
        number, pose = sought
        tried.add(number)
        elsewhere = with_stands(data, _put(final.data.stands, number, pose))
        elsewhere, other = _named(*_still(elsewhere, fitted(elsewhere), fitted), fitted)
        if other.worth > final.worth + _PROOF_NATS:
            data, final = elsewhere, other
    return with_stands(data, final.data.stands), final


def followed(scene: Scene, fitted: Settled) -> Scene:
    """The scene with poses and sensors as ``fitted``; itself where that leaves every echo with its reflector."""
    before = scene.data.stands
    if not before.may_move:
        return scene
    after = at_fitted(before, fitted.shared, fitted.errors)
    known = before.known[after.open] / after.known[after.open]
    if _farthest(before, after) < _FOLLOWS and np.all((known < _AS_KNOWN) & (known > 1 / _AS_KNOWN)):
        return scene
    return Scene(with_stands(scene.data, after), scene.config)


def with_poses_as_fitted(scene: Scene, fitted: Settled) -> Scene:
    """The scene with the poses exactly as ``fitted``."""
    after = known_as_fitted(at_fitted(scene.data.stands, fitted.shared, fitted.errors))
    return Scene(with_stands(scene.data, after), scene.config)


def known_as_fitted(stands: Stands) -> Stands:
    """The stands as if the fit knew their poses as well as any fit may."""
    known = stands.known.copy()
    known[stands.open] = _LEAST_KNOWN
    return replace(stands, known=known)


def _still(data: Evidence, final: Final, fitted: Callable[[Evidence], Final]) -> tuple[Evidence, Final]:
    """The evidence at the fitted poses and fitted once more from there, as long as that is worth more."""
    for _ in range(_MOST_ROUNDS if data.stands.may_move else 0):
        stands = at_fitted(final.data.stands, final.last.shared, final.last.errors)
        if _farthest(data.stands, stands) < _STILL:
            break
        there = with_stands(data, stands)
        other = fitted(there)
        if other.worth < final.worth:
            break
        data, final = there, other
    return data, final


def _put(stands: Stands, number: int, pose: np.ndarray) -> Stands:
    """The stands with one of them at ``pose``, hardly trusting in what is stated of it. If another is stated to be just
    there, the two have been exchanged, and both are put where the other is stated to be.
    """
    now, known, is_doubted = stands.now.copy(), stands.known.copy(), stands.is_doubted.copy()
    away = np.abs(np.column_stack([stands.stated[:, :2] - pose[:2], wrapped(stands.stated[:, 2] - pose[2])]))
    there = stands.fine[(away[stands.fine] < _EXCHANGED).all(axis=1) & (stands.fine != number)]
    now[number], moved = pose, [number]
    if len(there) == 1:
        other = int(there[0])
        now[number], now[other], moved = stands.stated[other], stands.stated[number], [number, other]
    known[moved], is_doubted[moved] = _SOUGHT, True
    return replace(stands, now=now, known=known, is_doubted=is_doubted)


def _named(data: Evidence, final: Final, fitted: Callable[[Evidence], Final]) -> tuple[Evidence, Final]:
    """The same with trust in the stated poses that are no farther off than they may be."""
    stands = final.data.stands
    square = squares(stands, final.last.shared, final.last.errors)
    is_doubted = stands.is_doubted & (square > _WRONG_SQUARE)
    if np.array_equal(is_doubted, stands.is_doubted):
        return data, final
    data = with_stands(data, replace(stands, is_doubted=is_doubted))
    return _still(data, fitted(data), fitted)


def _sought(final: Final, tried: set[int]) -> tuple[int, np.ndarray] | None:
    """Of the stands not yet ``tried`` the one that would hear most more elsewhere, and its pose there."""
    stands = final.data.stands
    if len(stands.fine) < _LEAST_STANDS:
        return None
    found = []
    for number in set(stands.fine.tolist()) - tried:
        heard = final.plateaus.take(final.plateaus.stand == number)
        elsewhere = relocated(heard, stands.now[number], _found_by_others(final, number), _SOUGHT_NATS)
        if elsewhere is not None:
            found.append((elsewhere[0], number, elsewhere[1]))
    if not found:
        return None
    _, number, pose = max(found, key=lambda one: one[0])
    return number, pose


def _found_by_others(final: Final, number: int) -> list[Reflector | Crossing]:
    """The reflectors that the stands nearest to ``number`` hear, and the walls that their plateaus may be of."""
    objects, claims, stands = final.last.fit.objects, final.claims, final.data.stands
    others = stands.fine[stands.fine != number]
    away_m = np.hypot(*(stands.now[others, :2] - stands.now[number, :2]).T)
    others = others[np.argsort(away_m)[:_NEIGHBOURS]]
    theirs = (final.last.share > 0.5) & np.isin(final.data.stand[claims.echo], others)
    heard = np.bincount(claims.maker[theirs], minlength=len(objects) + len(final.links)) > 0
    makers: list[Reflector | Crossing] = [*objects, *(crossing(objects, link) for link in final.links)]
    found = [one for one, is_heard in zip(makers, heard, strict=True) if is_heard]
    has_direction = np.isfinite(final.plateaus.direction_sigma_rad)
    echoes = final.plateaus.take(np.isin(final.plateaus.stand, others) & has_direction).echoes
    rho_m = echoes.x_m * np.cos(echoes.axis_rad) + echoes.y_m * np.sin(echoes.axis_rad) + echoes.range_m
    return [*found, *(Line(float(theta), float(rho)) for theta, rho in zip(echoes.axis_rad, rho_m, strict=True))]


def at_fitted(stands: Stands, shared: Shared, errors: Errors) -> Stands:
    """The stands with the poses and the sensors as fitted, known as well as the fit knows them beside one another."""
    now, known, sensor_now = stands.now.copy(), stands.known.copy(), stands.sensor_now.copy()
    now[errors.open] += shared.shift[errors.open]
    most = np.where(stands.is_doubted[errors.open, None], _SOUGHT, np.inf)
    variance = np.minimum(np.diag(errors.held()).reshape(-1, 3), (most**2)[:, [0, 0, 1]])
    known[errors.open, 0] = np.maximum(np.sqrt(np.maximum(variance[:, :2].mean(axis=1), 0)), _LEAST_KNOWN[0])
    known[errors.open, 1] = np.maximum(np.sqrt(np.maximum(variance[:, 2], 0)), _LEAST_KNOWN[1])
    sensor_now[np.any(stands.sensor_sigma > 0, axis=1)] += shared.error
    return replace(stands, now=now, known=known, sensor_now=sensor_now, sensor_known=np.zeros_like(sensor_now))


def _farthest(before: Stands, after: Stands) -> float:
    """How far the poses and the sensors lie apart at most, in their errors of ``after``."""
    away = np.abs(after.now - before.now)[after.open] / after.known[after.open][:, [0, 0, 1]]
    sensors = np.abs(after.sensor_now - before.sensor_now) / _LEAST_SENSOR
    return max(float(away.max(initial=0)), float(sensors.max(initial=0)))
