"""The refinement: robust maximum likelihood on the raw ranges, walls, cylinders and corners together."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from noctule_mapper.candidates import candidates
from noctule_mapper.config import MapperConfig
from noctule_mapper.contacts import Contacts
from noctule_mapper.contour import contour_of, link_ends
from noctule_mapper.echoes import Echoes
from noctule_mapper.estimate import Contour
from noctule_mapper.joint_fit import Link, joint_fit
from noctule_mapper.likelihood import Evidence, evidence, newest_of_each_beam
from noctule_mapper.noise import estimate_sigma_m
from noctule_mapper.reflectors import Line, Reflector
from noctule_mapper.selection import add_objects, assign, own_worth, total_worth, trimmed


def refine(echoes: Echoes, found: Contacts, config: MapperConfig) -> Contour:
    """The contour that explains the echoes best; ``found`` are their contacts."""
    data = evidence(echoes, echoes.sigma_m, config.sensor.longest_range_m, config.refinement)
    kept = newest_of_each_beam(data)
    sigma_m = echoes.sigma_m
    if not echoes.calibrated.all():
        sigma_m = np.where(echoes.calibrated, sigma_m, estimate_sigma_m(echoes.take(kept), config.noise))
        data = evidence(echoes, sigma_m, config.sensor.longest_range_m, config.refinement)
    objects, links = _explain(data.take(kept), found.take(kept), config)
    made_by, _ = assign(objects, links, data, config)
    readings = [int((made_by == number).sum()) for number in range(len(objects))]
    contour = contour_of(joint_fit(objects, links, made_by, data), links, readings, config.refinement)
    return replace(contour, range_sigma_m=float(np.median(sigma_m)))


def _explain(data: Evidence, found: Contacts, config: MapperConfig) -> tuple[list[Reflector], list[Link]]:
    """The objects that explain the echoes for the least price, and which walls meet."""
    library = candidates(data, found, config.contacts, config.cylinders, config.refinement)
    objects: list[Reflector] = []
    links: list[Link] = []
    made_by, worth = np.full(len(data.echoes), -1), 0.0
    for _ in range(config.refinement.rounds):
        tried, tried_links = _settle(add_objects(objects, made_by >= 0, library, data, config), data, config)
        tried_by, table = assign(tried, tried_links, data, config)
        tried_worth = total_worth(tried, table, data, config)
        if tried_worth < worth + _LEAST_RISE_NATS:
            break
        objects, links, made_by, worth = tried, tried_links, tried_by, tried_worth
    return objects, links


_LEAST_RISE_NATS = 1.0  # a round that adds less only exchanges objects for their likes


def _settle(objects: Sequence[Reflector], data: Evidence, config: MapperConfig) -> tuple[list[Reflector], list[Link]]:
    """Fit, assign and link; drop objects one by one while what is left explains the echoes for less; then fit anew."""
    while True:
        objects, links = _fit_and_link(objects, data, config)
        kept = objects
        while (fewer := _without_one(kept, links, data, config)) is not None:
            kept = fewer
            links = _links(kept, data, config)
        if len(kept) == len(objects):
            return objects, links
        objects = kept


def _without_one(
    objects: list[Reflector], links: list[Link], data: Evidence, config: MapperConfig
) -> list[Reflector] | None:
    """The objects without one that is heard from too few places or that they are worth more without, None where there
    is none.
    """
    made_by, table = assign(objects, links, data, config)
    for number in range(len(objects)):
        if len(np.unique(data.place[made_by == number])) < config.refinement.least_places:
            return objects[:number] + objects[number + 1 :]
    worth = total_worth(objects, table, data, config)
    for number in np.argsort(own_worth(objects, table, data, config))[:_SUSPECTS]:
        fewer = [one for other, one in enumerate(objects) if other != number]
        if total_worth(fewer, assign(fewer, _links(fewer, data, config), data, config)[1], data, config) > worth:
            return fewer
    return None


_SUSPECTS = 4  # the objects worth least, whose removal is tried


def _fit_and_link(
    objects: Sequence[Reflector], data: Evidence, config: MapperConfig
) -> tuple[list[Reflector], list[Link]]:
    objects, links = list(objects), _links(objects, data, config)
    for _ in range(2):
        made_by, _ = assign(objects, links, data, config)
        objects = joint_fit(objects, links, made_by, data, iterations=2).objects
        objects = [trimmed(one, made_by == number, data, config) for number, one in enumerate(objects)]
        links = _links(objects, data, config)
    return objects, links


def _links(objects: Sequence[Reflector], data: Evidence, config: MapperConfig) -> list[Link]:
    walls = {number: one for number, one in enumerate(objects) if isinstance(one, Line)}
    return link_ends(walls, data, config.refinement)
