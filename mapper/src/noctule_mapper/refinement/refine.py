"""The refinement: robust maximum likelihood on the raw ranges, walls, cylinders and corners together."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from noctule_mapper.config import MapperConfig, RefinementConfig, for_rare_stops
from noctule_mapper.contacts.voting import Contacts, Kind, join_contacts
from noctule_mapper.contour.contour import Contour, Cylinder
from noctule_mapper.contour.corners import Link, contour_of, crossing, is_known
from noctule_mapper.contour.likelihood import gains
from noctule_mapper.contour.reflectors import Circle, Line, Reflector
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.evidence import Evidence, agreeing, evidence, joined, newest_of_each_beam, with_stands
from noctule_mapper.readings.looks import Looks
from noctule_mapper.readings.plateaus import of_fine_sweeps, voting_plateaus
from noctule_mapper.readings.spread import estimate_sigma_m
from noctule_mapper.readings.stands import with_sensors_as_now, with_sensors_stated_as
from noctule_mapper.readings.turning import reconciled
from noctule_mapper.refinement.association import Claims, Scene
from noctule_mapper.refinement.em_fit import Settled, settle
from noctule_mapper.refinement.map_search import best_map, links_of, made_by
from noctule_mapper.refinement.model_selection import determined, may_be_a_corner, sure_stretch
from noctule_mapper.refinement.pose_errors import sensors_of, with_poses_known
from noctule_mapper.refinement.pose_rounds import Final, at_fitted, posed
from noctule_mapper.refinement.poses import unit_poses
from noctule_mapper.refinement.touches import with_touches


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
    fit = replace(last.fit, objects=_as_sure(final, config.refinement))
    contour = contour_of(fit, final.links, [int(count) for count in readings], config.refinement)
    contour = replace(contour, cylinders=_surely_cylinders(contour.cylinders, final, config))
    spread_m = last.range_sigma_m[: len(data.echoes)]
    poses = unit_poses(data, last, units)
    stands = at_fitted(data.stands, last.shared, last.errors)
    placed = with_stands(replace(data, range_sigma_m=spread_m), stands)
    sensors = sensors_of(last.normal, data.stands, int(last.fit.offsets[-1]))
    contour = with_touches(contour, objects, final.links, placed, sensors, units, config.refinement)
    return replace(contour, poses=poses, range_sigma_m=float(np.median(spread_m))), spread_m


def _surely_cylinders(cylinders: Sequence[Cylinder], final: Final, config: MapperConfig) -> tuple[Cylinder, ...]:
    """The cylinders whose plateaus an acute corner does not explain as well (`may_be_a_corner`)."""
    walls = [one for one in final.last.fit.objects if isinstance(one, Line)]
    flat = final.plateaus.take(np.isfinite(final.plateaus.direction_sigma_rad))
    sure = []
    for one in cylinders:
        circle = Circle(one.x_m, one.y_m, one.radius_m)
        made = flat.take(gains(circle, flat, config.refinement) > 0)
        if not len(made.echoes) or not may_be_a_corner(circle, walls, made):
            sure.append(one)
    return tuple(sure)


def _as_sure(final: Final, config: RefinementConfig) -> list[Reflector]:
    """The objects, walls only as far as they were surely heard: the last foot may be the corner's echo. Along a dense
    path the foot before it is near, and `trimmed` has taken off a lone one.
    """
    fit = final.last.fit
    if final.data.looks is None:
        return list(fit.objects)
    sure = list(fit.objects)
    known = [link for link in final.links if is_known(fit, link, config)]
    for number, one in enumerate(fit.objects):
        if isinstance(one, Line):
            corners = [crossing(fit.objects, link).point for link in known if number in (link.first, link.second)]
            made = final.data.take(made_by(number, final.claims, final.last.share))
            sure[number] = sure_stretch(one, made, [float(one.tangent @ corner) for corner in corners])
    return sure


def _fitted(data: Evidence, found: Contacts, config: MapperConfig) -> Final:
    """The objects that explain the evidence, fitted to all of it, with the poses where the evidence has them."""
    settings = config.refinement
    weighed, contacts = _weighed(data, found, settings)
    # A few objects alone tell little of a sensor: their fits would draw it back to what was stated.
    best = best_map(replace(weighed, stands=with_sensors_as_now(weighed.stands)), contacts, config)
    stands = with_sensors_stated_as(weighed.stands, best.scene.data.stands)
    weighed, data = with_stands(weighed, stands), with_stands(data, stands)
    scene = Scene(joined(data, _directions(weighed)), settings)
    objects, links = best.objects, best.links
    while True:
        claims = scene.claims(objects, links)
        open_spread, steps = not data.echoes.calibrated.all(), settings.search.last_steps
        last = settle(objects, links, claims, scene.data, settings, steps, open_spread, wary=True)
        sure = _determined(last, links, claims, scene, config)
        if len(sure) == len(objects):
            return Final(last, scene.data, weighed, claims, links, best.worth)
        objects, links = sure, links_of(sure, scene, config)


def _about(echoes: Echoes, x_m: float, y_m: float) -> Echoes:
    return replace(echoes, x_m=echoes.x_m - x_m, y_m=echoes.y_m - y_m)


def _weighed(data: Evidence, found: Contacts, settings: RefinementConfig) -> tuple[Evidence, Contacts]:
    """The echoes by which objects are weighed, and their contacts: of fine sweeps the plateaus, of others the newest
    echo of each beam.
    """
    data, fine = _agreed(data, settings), of_fine_sweeps(data)
    beams = np.nonzero(~fine)[0][newest_of_each_beam(data.take(~fine))]
    flat = voting_plateaus(data.take(fine), settings).evidence
    none = np.zeros(len(flat.echoes))
    no_contacts = Contacts(none, none, np.full(len(none), Kind.NONE), none, none)
    return joined(data.take(beams), flat), join_contacts([found.take(beams), no_contacts])


def _agreed(data: Evidence, settings: RefinementConfig) -> Evidence:
    """Coarse sweeps from rare stops as evidence of which echoes are real: a false one is nowhere near the next sweep's,
    so an echo on which the sweeps of a stop agree is of a reflector, and the more stops there are, the less likely is
    it that no other one hears this.
    """
    if data.looks is None or data.has_fine:
        return data
    others = len(np.unique(data.place)) - 1
    lone_share = max((1 - settings.rare_stops.hears_too) ** others, settings.beam.false_share)
    return replace(data, lone_nats=np.where(agreeing(data) > 1, np.log(lone_share), 0.0))


def _directions(weighed: Evidence) -> Evidence:
    """The plateaus once more, for their directions: the readings themselves tell the ranges."""
    flat = weighed.take(np.isfinite(weighed.direction_sigma_rad))
    known = replace(flat.echoes, calibrated=np.ones(len(flat.echoes), bool))  # their spread is none of a reading's
    return replace(flat, echoes=known, range_sigma_m=np.full(len(flat.echoes), _LOOSE_M))


_LOOSE_M = 0.01  # so little a plateau's range weighs beside its readings


def _determined(
    last: Settled, links: Sequence[Link], claims: Claims, scene: Scene, config: MapperConfig
) -> list[Reflector]:
    """The fitted objects that the echoes determine well enough. A wall of fine sweeps is judged as if poses and sensors
    were known: their errors stay in its stated covariance.
    """
    posed = replace(last.fit, held=with_poses_known(last.normal, int(last.fit.offsets[-1])))
    return [
        one
        for number, one in enumerate(last.fit.objects)
        if determined(
            _to_its_corners(number, last.fit.objects, links),
            (posed if isinstance(one, Line) and scene.data.has_fine else last.fit).held_covariance_of(number),
            len(np.unique(scene.data.place[made_by(number, claims, last.share)])),
            scene.data,
            config,
        )
    ]


def _to_its_corners(number: int, objects: Sequence[Reflector], links: Sequence[Link]) -> Reflector:
    """The object of that ``number``; a wall that meets others at both ends reaches to both corners, however little of
    it was heard between them.
    """
    one = objects[number]
    before = [crossing(objects, link).point for link in links if link.second == number]
    after = [crossing(objects, link).point for link in links if link.first == number]
    if not (isinstance(one, Line) and before and after):
        return one
    low_m, high_m = float(one.tangent @ before[0]), float(one.tangent @ after[0])
    return replace(one, low_m=min(low_m, one.low_m), high_m=max(high_m, one.high_m))
