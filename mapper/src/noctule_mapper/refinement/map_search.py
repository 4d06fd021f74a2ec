"""The search for the map: which objects explain the evidence for the least price, and which walls meet.

A map grows by the objects that are worth more than they cost, is fitted, loses those that the others explain as well,
and grows again. Where poses are uncertain they are fitted with the objects, and all is weighed with the poses as
fitted: a map is worth what it is with the poses that suit it best, less what these cost beside the stated ones.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from noctule_mapper.config import MapperConfig
from noctule_mapper.contacts.voting import Contacts
from noctule_mapper.contour.corners import Link, link_ends
from noctule_mapper.contour.likelihood import is_told_by_two
from noctule_mapper.contour.reflectors import Circle, Line, Reflector, Spot
from noctule_mapper.readings.evidence import Evidence
from noctule_mapper.refinement.association import Claims, Scene
from noctule_mapper.refinement.candidates import Candidates, candidates
from noctule_mapper.refinement.em_fit import settle
from noctule_mapper.refinement.exchanges import met_walls, others_for
from noctule_mapper.refinement.model_selection import add_objects, is_heard_enough, trimmed
from noctule_mapper.refinement.one_sided import one_sided_cylinders
from noctule_mapper.refinement.pose_rounds import followed, with_poses_as_fitted
from noctule_mapper.refinement.poses import stated_nats
from noctule_mapper.refinement.state import State
from noctule_mapper.refinement.whole_map import MOST_FITTED, sure_map


def best_map(data: Evidence, found: Contacts, config: MapperConfig) -> State:
    """The objects that explain the echoes for the least price, and which walls meet."""
    state = State([], [], np.zeros(len(data.echoes), bool), 0.0, Scene(data, config.refinement), 0.0, 0.0)
    if not len(data.echoes):
        return state
    ways = _WAYS if data.has_fine and not data.stands.is_doubted.any() else _WAYS[:1]
    best, library = max((_grown(state, way, found, config) for way in ways), key=lambda grown: grown[0].fitted_worth)
    if data.has_fine:
        best = _improved(best, library, config)
    else:
        best = _exchanged(best, library, config)
        if data.looks is not None:
            best = _sure(_met(best, config), library, config)
    best = _confirmed(best, config) if len(data.stands.open) else best
    return _with_one_sided(best, config) if data.has_fine else best


def _with_one_sided(state: State, config: MapperConfig) -> State:
    """The state with the cylinders that two units hear from one side, the worthiest first. One that the poses must move
    to suit gains more than they lose.
    """
    for _ in range(_MOST_EXCHANGES):
        solid, scene = [one for one in state.objects if not isinstance(one, Spot)], state.scene
        free = scene.explain(scene.claims(solid, links_of(solid, scene, config))).unexplained >= 0.5
        found = [[*state.objects, one] for one in one_sided_cylinders(free, scene.data, config)]
        rough = sorted(((_rough_worth(one, state, config), one) for one in found), key=lambda one: -one[0])
        near = [objects for worth, objects in rough[:MOST_FITTED] if worth > state.worth - _NEAR_NATS]
        tried = [_state(one, scene, config) for one in near]
        unforced = [one for one in tried if one.worth - state.worth > state.of_poses - one.of_poses]
        better = max(unforced, key=lambda one: one.worth, default=state)
        if better.worth < state.worth + _LEAST_RISE_NATS:
            break
        state = better
    return state


def _met(state: State, config: MapperConfig) -> State:
    """The state after walls are turned to meet, two at a time, until that is worth nothing more."""
    for _ in range(_MOST_EXCHANGES):
        scene = state.scene
        met = _meetings(state.objects, list(range(len(state.objects))), scene, config)
        tries = [(_rough_worth(objects, state, config), objects) for objects in met]
        better = state
        for worth, objects in sorted(tries, key=lambda one: -one[0])[:MOST_FITTED]:
            if worth > state.worth - _NEAR_NATS:
                tried = _state(objects, scene, config)
                better = tried if tried.worth > better.worth + _LEAST_GAIN_NATS else better
        if better is state:
            break
        state = better
    return state


def _sure(state: State, library: Sequence[Candidates], config: MapperConfig) -> State:
    scene = state.scene
    return sure_map(
        *(state, library, scene),
        lambda objects: _state(objects, scene, config),
        lambda objects: links_of(objects, scene, config),
        config,
    )


def _confirmed(state: State, config: MapperConfig) -> State:
    """The state without what the map is worth hardly less without, the poses fitted once more: an object that is heard
    little may stand only because the poses have moved to suit it.
    """
    while True:
        claims = state.scene.claims(state.objects, state.links)
        share = state.scene.explain(claims).share
        alone = np.bincount(claims.maker, -np.log1p(-np.minimum(share, 1 - 1e-12)), minlength=len(state.objects))
        for number in np.argsort(alone[: len(state.objects)]):
            if alone[number] > _DOUBTFUL_NATS:
                return state
            fewer = [one for other, one in enumerate(state.objects) if other != number]
            tried = _state(fewer, state.scene, config)
            if tried.fitted_worth > state.fitted_worth - _LEAST_PROOF_NATS:
                state = tried
                break
        else:
            return state


_DOUBTFUL_NATS = 40.0  # that an object may explain alone and still be worth nothing when the poses move
_LEAST_PROOF_NATS = 2.0


@dataclass(frozen=True)
class _Step:
    """What a round of a map's growth may add: objects of some ``kinds``, ``most`` of them before all are fitted."""

    kinds: tuple[type[Reflector], ...] = (Line, Circle, Spot)
    most: int | None = None


_ALL = _Step()
# What comes first decides where the rest is sought, so of fine sweeps a map is grown in several ways: all at once;
# first the walls; first the four objects that are worth most, one after the other. A unit that is sought elsewhere is
# put where it fits what the others have found, so there one way will do.
_WAYS = ((), (_Step(kinds=(Line,)),), (_Step(most=1),) * 4)


def _grown(state: State, way: Sequence[_Step], found: Contacts, config: MapperConfig) -> tuple[State, list[Candidates]]:
    """The state with objects added, as the ``way`` has it and then all that are worth more than they cost, and the
    candidates that were left.
    """
    library = _library(state, found, config)
    for step in (*way, *(_ALL,) * config.refinement.search.rounds):
        chosen = [one for one in library if one.kind in step.kinds]
        added = add_objects(state.objects, state.explained, chosen, state.scene.data, config, step.most)
        tried = _state(added, state.scene, config)
        if tried.worth >= state.worth + _LEAST_RISE_NATS:
            if tried.scene is not state.scene:
                library = _library(tried, found, config)
            state = tried
        elif step is _ALL:
            break
    return state, library


def _library(state: State, found: Contacts, config: MapperConfig) -> list[Candidates]:
    return candidates(state.scene.data, found, config.contacts, config.cylinders, config.refinement)


_LEAST_RISE_NATS = 1.0  # a round that adds less only exchanges objects for their likes


def _state(objects: Sequence[Reflector], scene: Scene, config: MapperConfig) -> State:
    fit = _settled(objects, scene, config)
    explanation = fit.scene.explain(fit.scene.claims(fit.objects, fit.links))
    worth = fitted_worth = fit.scene.worth(fit.objects, fit.links, explanation) + fit.of_poses
    if fit.as_fitted is not fit.scene:
        fitted_worth = fit.as_fitted.worth_of(fit.objects, fit.links) + fit.of_poses
    explained = explanation.unexplained < 0.5
    return State(fit.objects, fit.links, explained, worth, fit.scene, fit.of_poses, fitted_worth)


def _exchanged(state: State, library: Sequence[Candidates], config: MapperConfig) -> State:
    """The state with points exchanged for walls or cylinders, and cylinders for walls, wherever that is worth more."""
    for kind, others in ((Spot, (Line, Circle)), (Circle, (Line,))):
        instead = [one for one in library if one.kind in others]
        for old in [one for one in state.objects if isinstance(one, kind)]:
            rest, scene = [one for one in state.objects if one is not old], state.scene
            unexplained = scene.explain(scene.claims(rest, links_of(rest, scene, config))).unexplained
            added = add_objects(rest, unexplained < 0.5, instead, scene.data, config)
            is_exchange = len(rest) < len(state.objects) and len(added) > len(rest)
            if is_exchange and _rough_worth(added, state, config) > state.worth - _HOPE_NATS:
                tried = _state(added, scene, config)
                state = tried if tried.worth > state.worth + _LEAST_RISE_NATS else state
    return state


def _rough_worth(objects: Sequence[Reflector], state: State, config: MapperConfig) -> float:
    """What the objects would be worth in place of the state's before they are fitted, the poses as they are."""
    return state.scene.worth_of(objects, links_of(objects, state.scene, config)) + state.of_poses


_HOPE_NATS = 40.0  # that fitting an exchange once more may bring at most


def _improved(state: State, library: Sequence[Candidates], config: MapperConfig) -> State:
    """The state after exchanges of any kind, one at a time, until none is worth more."""
    for _ in range(_MOST_EXCHANGES):
        tries = _tries(state, library, config)
        better = next((one for one in tries if one.fitted_worth > state.fitted_worth + _LEAST_GAIN_NATS), None)
        if better is None:
            break
        state = better
    return state


_MOST_EXCHANGES = 10
_LEAST_GAIN_NATS = 0.1
_NEAR_NATS = 12.0  # that fitting an exchange, or a corner of the wall that came with it, may bring


def _tries(state: State, library: Sequence[Candidates], config: MapperConfig) -> Iterator[State]:
    """What becomes of the state by one exchange, a new wall's corner with it, where that is worth a fit."""
    for objects in _exchanges(state, library, config):
        if _rough_worth(objects, state, config) > state.worth - _NEAR_NATS:
            yield _state(objects, state.scene, config)


def _exchanges(state: State, library: Sequence[Candidates], config: MapperConfig) -> Iterator[list[Reflector]]:
    """The objects with two walls turned to meet, with one more, or with another in place of one."""
    scene = state.scene
    yield from _meetings(state.objects, list(range(len(state.objects))), scene, config)
    for old in (None, *state.objects):
        rest = [one for one in state.objects if one is not old]
        unexplained = scene.explain(scene.claims(rest, links_of(rest, scene, config))).unexplained >= 0.5
        for other in others_for(old, rest, unexplained, library, scene.data, config):
            objects = [*rest, other]
            yield objects
            if isinstance(other, Line):
                yield from _meetings(objects, [len(rest)], scene, config)


def _meetings(
    objects: Sequence[Reflector], walls: Sequence[int], scene: Scene, config: MapperConfig
) -> Iterator[list[Reflector]]:
    """The objects with two walls turned to meet, one of which is among ``walls``."""
    claims = scene.claims(objects, links_of(objects, scene, config))
    explanation = scene.explain(claims)
    made = [_made_mask(number, claims, explanation.share, scene.data) for number in range(len(objects))]
    return met_walls(objects, walls, made, explanation.unexplained >= 0.5, scene.data, config)


@dataclass(frozen=True)
class _Fitted:
    """Objects as fitted, and which of their walls meet."""

    objects: list[Reflector]
    links: list[Link]
    scene: Scene  # which follows the fitted poses
    of_poses: float  # what these are worth in nats
    as_fitted: Scene  # with the poses exactly as fitted


def _settled(objects: Sequence[Reflector], scene: Scene, config: MapperConfig) -> _Fitted:
    """Fit and link; drop objects one by one while what is left explains the echoes for less; then fit again."""
    while True:
        fit = _fit_and_link(objects, scene, config)
        kept, links, scene = fit.objects, fit.links, fit.scene
        while (fewer := _without_one(kept, links, scene, config)) is not None:
            kept = fewer
            links = links_of(kept, scene, config)
        if len(kept) == len(fit.objects):
            return fit
        objects = kept


def _without_one(
    objects: list[Reflector], links: list[Link], scene: Scene, config: MapperConfig
) -> list[Reflector] | None:
    """The objects without one that is heard from too few places or that they are worth more without, None where there
    is none.
    """
    claims = scene.claims(objects, links)
    explanation = scene.explain(claims)
    for number in range(len(objects)):
        made = scene.data.take(made_by(number, claims, explanation.share))
        if not is_heard_enough(objects[number], made, config) and not is_told_by_two(objects[number], made):
            return objects[:number] + objects[number + 1 :]
    worth = scene.worth(objects, links, explanation)
    alone = np.bincount(claims.maker, -np.log1p(-np.minimum(explanation.share, 1 - 1e-12)), minlength=len(objects))
    for number in np.argsort(alone[: len(objects)])[:_SUSPECTS]:
        fewer = [one for other, one in enumerate(objects) if other != number]
        if scene.worth_of(fewer, links_of(fewer, scene, config)) > worth:
            return fewer
    return None


_SUSPECTS = 4  # the objects worth least, whose removal is tried


def _fit_and_link(objects: Sequence[Reflector], scene: Scene, config: MapperConfig) -> _Fitted:
    """Fit the objects, and with them the poses, which the scene follows."""
    objects, links, of_poses, as_fitted = list(objects), links_of(objects, scene, config), 0.0, scene
    for _ in range(2):
        claims = scene.claims(objects, links)
        fitted = settle(objects, links, claims, scene.data, config.refinement, iterations=2)
        of_poses = stated_nats(scene.data.stands, fitted.shared, fitted.errors)
        before, scene = scene, followed(scene, fitted)
        as_fitted = with_poses_as_fitted(before, fitted) if len(before.data.stands.open) else scene
        moved = fitted.fit.objects
        objects = [
            trimmed(one, _made_mask(number, claims, fitted.share, scene.data), moved, scene.data, config)
            for number, one in enumerate(moved)
        ]
        links = links_of(objects, scene, config)
    return _Fitted(objects, links, scene, of_poses, as_fitted)


def made_by(number: int, claims: Claims, share: np.ndarray) -> np.ndarray:
    """Numbers of the echoes that the object ``number`` made, more likely than not."""
    return claims.echo[(claims.maker == number) & (share > 0.5)]


def _made_mask(number: int, claims: Claims, share: np.ndarray, data: Evidence) -> np.ndarray:
    made = np.zeros(len(data.echoes), bool)
    made[made_by(number, claims, share)] = True
    return made


def links_of(objects: Sequence[Reflector], scene: Scene, config: MapperConfig) -> list[Link]:
    """Which walls meet, by their gaps and by the echoes that neither walls nor cylinders explain."""
    solid = [one for one in objects if not isinstance(one, Spot)]
    free = scene.explain(scene.claims(solid, [])).unexplained
    walls = {number: one for number, one in enumerate(objects) if isinstance(one, Line)}
    return link_ends(
        walls, scene.data, config.refinement, lambda corner: scene.support(corner, free), scene.heard_price, solid
    )
