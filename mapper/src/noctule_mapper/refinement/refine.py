"""The refinement: robust maximum likelihood on the raw ranges, walls, cylinders and corners together."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from noctule_mapper.config import MapperConfig, RefinementConfig, for_rare_stops
from noctule_mapper.contacts.voting import Contacts, Kind, join_contacts
from noctule_mapper.contour.contour import Contour
from noctule_mapper.contour.corners import Link, contour_of, link_ends
from noctule_mapper.contour.reflectors import Circle, Line, Reflector, Spot
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.evidence import Evidence, evidence, joined, newest_of_each_beam
from noctule_mapper.readings.looks import Looks
from noctule_mapper.readings.plateaus import of_fine_sweeps, plateaus
from noctule_mapper.readings.spread import estimate_sigma_m
from noctule_mapper.readings.turning import reconciled
from noctule_mapper.refinement.association import Claims, Scene
from noctule_mapper.refinement.candidates import Candidates, candidates
from noctule_mapper.refinement.em_fit import Settled, settle
from noctule_mapper.refinement.model_selection import add_objects, determined, least_places, trimmed
from noctule_mapper.refinement.pose_rounds import Final, posed
from noctule_mapper.refinement.poses import unit_poses
from noctule_mapper.refinement.state import State
from noctule_mapper.refinement.touches import with_touches
from noctule_mapper.refinement.whole_map import sure_map


def refine(
    echoes: Echoes, found: Contacts, looks: Looks | None, config: MapperConfig, units: Sequence[str] = ()
) -> Contour:
    """The contour that explains the echoes best; ``found`` are their contacts, ``looks`` those of fine sweeps,
    ``units`` the names of the units by their numbers.

    Worked out about the middle of the echoes' places: far from the origin theta and rho would be nearly one.
    """
    if looks is not None and not echoes.is_fine.any():
        config = for_rare_stops(config)
    x_m, y_m = float(np.median(echoes.x_m)), float(np.median(echoes.y_m))
    middle = _about(echoes, x_m, y_m)
    if looks is not None:
        looks = replace(looks, echoes=_about(looks.echoes, x_m, y_m))
    data = evidence(middle, middle.sigma_m, config.sensor.longest_range_m, config.refinement, looks)
    data = reconciled(data, config.refinement)
    middle = data.echoes
    if echoes.calibrated.all():
        return _refined(data, found, config, units)[0].shifted(x_m, y_m)
    sigma_m = estimate_sigma_m(middle.take(newest_of_each_beam(data)), config.noise)
    for _ in range(_MOST_GUESSES):
        data = replace(data, range_sigma_m=np.where(echoes.calibrated, middle.sigma_m, sigma_m))
        contour, spread_m = _refined(data, found, config, units)
        guessed_m, sigma_m = sigma_m, float(np.median(spread_m[~echoes.calibrated]))
        if abs(sigma_m / guessed_m - 1) < _GOOD_GUESS:
            break
    return contour.shifted(x_m, y_m)


_MOST_GUESSES = 2  # of an unknown spread: the first knows no objects yet
_GOOD_GUESS = 0.25  # how far off a guess may be for the choice of objects to stand


def _refined(data: Evidence, found: Contacts, config: MapperConfig, units: Sequence[str]) -> tuple[Contour, np.ndarray]:
    """The contour, and the spread of each range that it went by, which is fitted where nobody has calibrated it."""
    data, final = posed(data, lambda moved: _fitted(moved, found, config))
    last, claims, objects = final.last, final.claims, final.last.fit.objects
    read = claims.echo < len(data.echoes)  # the rest are the plateaus that these readings make
    readings = np.rint(np.bincount(claims.maker[read], last.share[read], minlength=len(objects))).astype(int)
    contour = contour_of(last.fit, final.links, [int(count) for count in readings], config.refinement)
    spread_m = last.range_sigma_m[: len(data.echoes)]
    poses = unit_poses(data, last, units)
    placed = replace(data, range_sigma_m=spread_m)
    contour = with_touches(contour, objects, final.links, placed, units, config.refinement)
    return replace(contour, poses=poses, range_sigma_m=float(np.median(spread_m))), spread_m


def _fitted(data: Evidence, found: Contacts, config: MapperConfig) -> Final:
    """The objects that explain the evidence, fitted to all of it, with the poses where the evidence has them."""
    settings = config.refinement
    weighed, contacts = _weighed(data, found, settings)
    best, scene = _explain(weighed, contacts, config), Scene(joined(data, _directions(weighed)), settings)
    objects, links = best.objects, best.links
    while True:
        claims = scene.claims(objects, links)
        last = settle(
            objects, links, claims, scene.data, settings, settings.search.last_steps, not data.echoes.calibrated.all()
        )
        sure = _determined(last, claims, scene, config)
        if len(sure) == len(objects):
            return Final(last, scene.data, weighed, claims, links, best.worth)
        objects, links = sure, _links(sure, scene, config)


def _about(echoes: Echoes, x_m: float, y_m: float) -> Echoes:
    return replace(echoes, x_m=echoes.x_m - x_m, y_m=echoes.y_m - y_m)


def _weighed(data: Evidence, found: Contacts, settings: RefinementConfig) -> tuple[Evidence, Contacts]:
    """The echoes by which objects are weighed, and their contacts: of fine sweeps the plateaus, of others the newest
    echo of each beam.
    """
    fine = of_fine_sweeps(data)
    beams = np.nonzero(~fine)[0][newest_of_each_beam(data.take(~fine))]
    flat = plateaus(data.take(fine), settings)
    none = np.zeros(len(flat.echoes))
    no_contacts = Contacts(none, none, np.full(len(none), Kind.NONE), none, none)
    return joined(data.take(beams), flat), join_contacts([found.take(beams), no_contacts])


def _directions(weighed: Evidence) -> Evidence:
    """The plateaus once more, for their directions: the readings themselves tell the ranges."""
    flat = weighed.take(np.isfinite(weighed.direction_sigma_rad))
    known = replace(flat.echoes, calibrated=np.ones(len(flat.echoes), bool))  # their spread is none of a reading's
    return replace(flat, echoes=known, range_sigma_m=np.full(len(flat.echoes), _LOOSE_M))


_LOOSE_M = 0.01  # so little a plateau's range weighs beside its readings


def _determined(last: Settled, claims: Claims, scene: Scene, config: MapperConfig) -> list[Reflector]:
    """The fitted objects that the echoes determine well enough."""
    places = [
        len(np.unique(scene.data.place[_made(number, claims, last.share)])) for number in range(len(last.fit.objects))
    ]
    return [
        one
        for number, one in enumerate(last.fit.objects)
        if determined(one, last.fit.held_covariance_of(number), places[number], scene.data, config)
    ]


def _explain(data: Evidence, found: Contacts, config: MapperConfig) -> State:
    """The objects that explain the echoes for the least price, and which walls meet."""
    state = State([], [], np.zeros(len(data.echoes), bool), 0.0)
    if not len(data.echoes):
        return state
    library = candidates(data, found, config.contacts, config.cylinders, config.refinement)
    scene = Scene(data, config.refinement)
    for _ in range(config.refinement.search.rounds):
        added = add_objects(state.objects, state.explained, library, data, config)
        tried = _state(added, scene, config)
        if tried.worth < state.worth + _LEAST_RISE_NATS:
            break
        state = tried
    state = _exchanged(state, library, scene, config)
    if data.looks is None or data.echoes.is_fine.any():
        return state

    def fitted(some: Sequence[Reflector]) -> State:
        return _state(some, scene, config)

    return sure_map(state, library, scene, fitted, lambda some: _links(some, scene, config), config)


_LEAST_RISE_NATS = 1.0  # a round that adds less only exchanges objects for their likes


def _state(objects: Sequence[Reflector], scene: Scene, config: MapperConfig) -> State:
    objects, links = _settled(objects, scene, config)
    explanation = scene.explain(scene.claims(objects, links))
    return State(objects, links, explanation.unexplained < 0.5, scene.worth(objects, links, explanation))


def _exchanged(state: State, library: Sequence[Candidates], scene: Scene, config: MapperConfig) -> State:
    """The state with points exchanged for walls or cylinders, and cylinders for walls, wherever that is worth more."""
    for kind, others in ((Spot, (Line, Circle)), (Circle, (Line,))):
        instead = [one for one in library if one.kind in others]
        for old in [one for one in state.objects if isinstance(one, kind)]:
            rest = [one for one in state.objects if one is not old]
            unexplained = scene.explain(scene.claims(rest, _links(rest, scene, config))).unexplained
            added = add_objects(rest, unexplained < 0.5, instead, scene.data, config)
            if len(rest) < len(state.objects) and len(added) > len(rest):
                links = _links(added, scene, config)
                if scene.worth(added, links, scene.explain(scene.claims(added, links))) > state.worth - _HOPE_NATS:
                    tried = _state(added, scene, config)
                    state = tried if tried.worth > state.worth + _LEAST_RISE_NATS else state
    return state


_HOPE_NATS = 40.0  # that fitting an exchange anew may bring at most


def _settled(objects: Sequence[Reflector], scene: Scene, config: MapperConfig) -> tuple[list[Reflector], list[Link]]:
    """Fit and link; drop objects one by one while what is left explains the echoes for less; then fit anew."""
    while True:
        objects, links = _fit_and_link(objects, scene, config)
        kept = objects
        while (fewer := _without_one(kept, links, scene, config)) is not None:
            kept = fewer
            links = _links(kept, scene, config)
        if len(kept) == len(objects):
            return objects, links
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
        if len(np.unique(scene.data.place[_made(number, claims, explanation.share)])) < least_places(
            type(objects[number]), scene.data, config
        ):
            return objects[:number] + objects[number + 1 :]
    worth = scene.worth(objects, links, explanation)
    alone = np.bincount(claims.maker, -np.log1p(-np.minimum(explanation.share, 1 - 1e-12)), minlength=len(objects))
    for number in np.argsort(alone[: len(objects)])[:_SUSPECTS]:
        fewer = [one for other, one in enumerate(objects) if other != number]
        left = _links(fewer, scene, config)
        if scene.worth(fewer, left, scene.explain(scene.claims(fewer, left))) > worth:
            return fewer
    return None


_SUSPECTS = 4  # the objects worth least, whose removal is tried


def _fit_and_link(
    objects: Sequence[Reflector], scene: Scene, config: MapperConfig
) -> tuple[list[Reflector], list[Link]]:
    objects, links = list(objects), _links(objects, scene, config)
    for _ in range(2):
        claims = scene.claims(objects, links)
        fitted = settle(objects, links, claims, scene.data, config.refinement, iterations=2)
        objects = [
            trimmed(one, _made_mask(number, claims, fitted.share, scene.data), scene.data, config)
            for number, one in enumerate(fitted.fit.objects)
        ]
        links = _links(objects, scene, config)
    return objects, links


def _made(number: int, claims: Claims, share: np.ndarray) -> np.ndarray:
    """Numbers of the echoes that the object ``number`` made, more likely than not."""
    return claims.echo[(claims.maker == number) & (share > 0.5)]


def _made_mask(number: int, claims: Claims, share: np.ndarray, data: Evidence) -> np.ndarray:
    made = np.zeros(len(data.echoes), bool)
    made[_made(number, claims, share)] = True
    return made


def _links(objects: Sequence[Reflector], scene: Scene, config: MapperConfig) -> list[Link]:
    """Which walls meet, by their gaps and by the echoes that neither walls nor cylinders explain."""
    solid = [one for one in objects if not isinstance(one, Spot)]
    free = scene.explain(scene.claims(solid, [])).unexplained
    walls = {number: one for number, one in enumerate(objects) if isinstance(one, Line)}
    return link_ends(
        walls, scene.data, config.refinement, lambda corner: scene.support(corner, free), scene.heard_price, solid
    )
