"""The search by the worth of the whole map, where so few echoes tell of each wall that none earns its price alone.

From rare stops a coarse sweep hears each wall once, and the two or three echoes of a wall are worth hardly more than
its price. Its corners pay for it: their echoes have no other maker. So each candidate line is put into the map, linked
with the walls that are there, freed of the points that its corners replace, and kept if the whole map is worth more
with it. In the end a wall of few echoes, or a cylinder, stands only if the best map without it is worth clearly less.
"""

from collections.abc import Callable, Container, Iterator, Sequence

import numpy as np

from noctule_mapper.config import MapperConfig
from noctule_mapper.contour.corners import Link
from noctule_mapper.contour.likelihood import gains
from noctule_mapper.contour.reflectors import Circle, Line, Reflector, Spot
from noctule_mapper.contour.silence import silence_of
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.refinement.association import Scene
from noctule_mapper.refinement.candidates import Candidates, line_candidates
from noctule_mapper.refinement.corner_lines import corner_lines
from noctule_mapper.refinement.model_selection import add_objects, trimmed
from noctule_mapper.refinement.state import State

_MOST_TRIED = 40  # lines of a round, of each kind of candidates
MOST_FITTED = 3  # of the maps that are one step away, the best
_LEAST_PLACES = 2
_LEAST_LINE_NATS = 1.0  # that a line gains from what no object explains, roughly
_LEAST_RISE_NATS = 1.0
_HOPE_NATS = 8.0  # that fitting a map may bring at most
_MOST_EXCHANGES = 12  # walls and cylinders without which a map is tried
_ALIKE_RAD, _ALIKE_M = np.radians(2.5), 0.05  # lines that are one wall

Fitted = Callable[[Sequence[Reflector]], State]
Completed = Callable[[State, Sequence[Line]], State]
Linked = Callable[[Sequence[Reflector]], list[Link]]


def sure_map(
    state: State, library: Sequence[Candidates], scene: Scene, fitted: Fitted, linked: Linked, config: MapperConfig
) -> State:
    """The map that is worth most of those about ``state``, without what it may as well be without."""
    rare = config.refinement.rare_stops
    if len(np.unique(scene.data.place)) > rare.most_places:
        return state

    def completed(start: State, barred: Sequence[Line] = ()) -> State:
        return _completed(start, library, scene, fitted, linked, config, barred)

    state, margins = _judged(completed(state), completed, scene, fitted, rare.weak_echoes)
    left_out: list[Line] = []
    for _ in range(_MOST_EXCHANGES):
        unsure = sorted((margin, number) for number, margin in margins.items() if margin < rare.sure_nats)
        if not unsure:
            break
        # Two may each be doubtful and yet not both be missing: if others are doubtful, all are judged once more.
        weakest = state.objects[unsure[0][1]]
        left_out += [weakest] if isinstance(weakest, Line) else []
        state = fitted([one for one in state.objects if one is not weakest])
        if len(unsure) == 1:
            break
        margins = _margins(state, left_out, completed, scene, fitted, rare.weak_echoes)
    return state


def _judged(
    state: State, completed: Completed, scene: Scene, fitted: Fitted, weak_echoes: float
) -> tuple[State, dict[int, float]]:
    """The map that is worth most about ``state``, and by how much the best map without each weak wall, or cylinder, of
    it is worth less.
    """
    margins: dict[int, float] = {}
    for _ in range(_MOST_EXCHANGES):
        number = _weakest(state, margins, scene, weak_echoes)
        if number is None:
            break
        other = _best_without(state, number, [], completed, fitted)
        if other.worth > state.worth + _LEAST_RISE_NATS:
            # The wall taken out may stand beside the one found.
            state, margins = completed(other, []), {}
        else:
            margins[number] = state.worth - other.worth
    return state, margins


def _margins(
    state: State, left_out: Sequence[Line], completed: Completed, scene: Scene, fitted: Fitted, weak_echoes: float
) -> dict[int, float]:
    """By how much the best map without each weak wall, or cylinder, of ``state`` is worth less, all without what is
    ``left_out``. What would take the place of that is no surer, so the state takes none of it.
    """
    best, margins = completed(state, left_out).worth, dict[int, float]()
    for _ in range(_MOST_EXCHANGES):
        number = _weakest(state, margins, scene, weak_echoes)
        if number is None:
            break
        margins[number] = best - _best_without(state, number, left_out, completed, fitted).worth
    return margins


def _best_without(state: State, number: int, left_out: Sequence[Line], completed: Completed, fitted: Fitted) -> State:
    """The best map about the state without its object ``number`` and without what is ``left_out``."""
    one = state.objects[number]
    rest = fitted([other for other in state.objects if other is not one])
    return completed(rest, [*left_out, one] if isinstance(one, Line) else left_out)


def _completed(
    state: State,
    library: Sequence[Candidates],
    scene: Scene,
    fitted: Fitted,
    linked: Linked,
    config: MapperConfig,
    barred: Sequence[Line],
) -> State:
    """The state with more walls, none of them ``barred``, as long as the whole map is worth more with one."""
    while True:
        best, before = state, [_likes(state.objects, wall, scene, config) for wall in barred]
        for worth, objects in _with_one_wall_more(state, library, scene, linked, config, barred)[:MOST_FITTED]:
            if worth + state.of_poses < best.worth - _HOPE_NATS:
                break
            tried = fitted(objects)
            after = [_likes(tried.objects, wall, scene, config) for wall in barred]
            # Those that were there before may stay: the rest has other walls near a barred one.
            is_barred = any(now > then for now, then in zip(after, before, strict=True))
            best = tried if tried.worth > best.worth and not is_barred else best
        if best.worth < state.worth + _LEAST_RISE_NATS:
            return _with_points(state, library, scene, fitted, config)
        state = best


def _with_points(
    state: State, library: Sequence[Candidates], scene: Scene, fitted: Fitted, config: MapperConfig
) -> State:
    """The state with points for what its walls and cylinders leave, where it is worth more so: corners of walls that
    nobody has heard.
    """
    points = [one for one in library if one.kind is Spot]
    more = add_objects(state.objects, state.explained, points, scene.data, config)
    tried = fitted(more) if len(more) > len(state.objects) else state
    return tried if tried.worth > state.worth else state


def _with_one_wall_more(
    state: State,
    library: Sequence[Candidates],
    scene: Scene,
    linked: Linked,
    config: MapperConfig,
    barred: Sequence[Line],
) -> list[tuple[float, list[Reflector]]]:
    """Objects with one line more, and what each such map is worth in nats, the best first."""
    solid = [one for one in state.objects if not isinstance(one, Spot)]
    free = scene.explain(scene.claims(solid, linked(solid))).unexplained > 0.5
    walls = [one for one in solid if isinstance(one, Line)]
    found = [one.promising(free, _LEAST_LINE_NATS) for one in library if one.kind is Line]
    turned = line_candidates(corner_lines(walls, free, scene.data.echoes, config.refinement), scene.data, config)
    lines = [one for of in (*found, turned) for one in _lines(of, solid, free, scene, config)]
    allowed = [line for line in lines if not any(_likes([line], wall, scene, config) for wall in barred)]
    tried = [_without_needless_points([*state.objects, line], scene, linked) for line in allowed]
    return sorted(tried, key=lambda one: -one[0])


def _lines(
    lines: Candidates, solid: Sequence[Reflector], free: np.ndarray, scene: Scene, config: MapperConfig
) -> Iterator[Line]:
    """The lines that gain most from the ``free`` echoes, bool (n,), each from others, cut to what was heard of them
    beside the ``solid`` objects.
    """
    data, found = scene.data, []
    for theta_rad, rho_m in lines.parameters[np.argsort(-(lines.gains @ free.astype(np.float32)))[: 4 * _MOST_TRIED]]:
        line = Line(float(theta_rad), float(rho_m))
        line = trimmed(line, (gains(line, data, config.refinement) > 0) & free, solid, data, config)
        gain = gains(line, data, config.refinement) * free
        if len(np.unique(data.place[gain > 0])) >= _LEAST_PLACES:
            worth = float(gain.sum()) - silence_of(line, data, config.refinement, solid)
            found.append((worth, line, frozenset(np.nonzero(gain)[0].tolist())))
    seen: set[frozenset[int]] = set()
    for _, line, echoes in sorted(found, key=lambda one: -one[0]):
        if echoes not in seen and len(seen) < _MOST_TRIED:
            seen.add(echoes)
            yield line


def _without_needless_points(objects: list[Reflector], scene: Scene, linked: Linked) -> tuple[float, list[Reflector]]:
    """The objects less the points without which they are worth more, and their worth."""
    worth = scene.worth_of(objects, linked(objects))
    for point in [one for one in objects if isinstance(one, Spot)]:
        fewer = [one for one in objects if one is not point]
        if (other := scene.worth_of(fewer, linked(fewer))) > worth:
            objects, worth = fewer, other
    return worth, objects


def _weakest(state: State, judged: Container[int], scene: Scene, most_echoes: float) -> int | None:
    """The number of the wall or cylinder of fewest echoes that is not yet ``judged``, None where none is left. Walls of
    ``most_echoes`` or more are sure; a cylinder never is, for two walls may look like a wide one.
    """
    claims = scene.claims(state.objects, state.links)
    share = np.bincount(claims.maker, scene.explain(claims).share, minlength=len(state.objects))
    left = [
        (float(share[number]), number)
        for number, one in enumerate(state.objects)
        if (isinstance(one, Circle) or (isinstance(one, Line) and share[number] < most_echoes)) and number not in judged
    ]
    return min(left)[1] if left else None


def _likes(objects: Sequence[Reflector], wall: Line, scene: Scene, config: MapperConfig) -> int:
    """How many of the objects are the wall, or the wall turned: they lie nearly where the wall does, or explain no echo
    that the wall does not explain.
    """
    data, refinement = scene.data, config.refinement
    of_wall = gains(wall, data, refinement, refinement.linking.growth_m) > 0

    def is_like(one: Line) -> bool:
        return _are_alike(one, wall) or not np.any((gains(one, data, refinement) > 0) & ~of_wall)

    return sum(isinstance(one, Line) and is_like(one) for one in objects)


def _are_alike(one: Line, wall: Line) -> bool:
    turn_rad = float(wrapped(np.array(one.theta_rad - wall.theta_rad)))
    away_m = float(one.normal @ wall.at((wall.low_m + wall.high_m) / 2)) - one.rho_m
    return abs(turn_rad) < _ALIKE_RAD and abs(away_m) < _ALIKE_M
