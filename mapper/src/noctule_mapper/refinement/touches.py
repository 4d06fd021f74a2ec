"""Touches: what one place alone heard and no object explains; and the walls that right angles make of them.

A wall, a corner and a post all answer one place alike. A touch states where, how well that is known, and what it may
be: posts stop answering beyond some range, points lie more often far away than near, and a right-angled frame tells
walls from corners. Where a frame leaves hardly any doubt, its touches become walls and corners with that chance.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from noctule_mapper.config import RefinementConfig
from noctule_mapper.contour.contour import Contour, Touch, Wall
from noctule_mapper.contour.corners import Link
from noctule_mapper.contour.reflectors import Reflector, Spot
from noctule_mapper.readings.evidence import Evidence, with_stands
from noctule_mapper.readings.plateaus import Plateaus, of_fine_sweeps, voting_plateaus
from noctule_mapper.refinement.association import Scene
from noctule_mapper.refinement.frame_walls import FrameWalls, Support, against, sides_known, walls_of
from noctule_mapper.refinement.pose_errors import ranges_by_sensor
from noctule_mapper.refinement.pose_rounds import known_as_fitted
from noctule_mapper.refinement.right_angles import Heard, claimed, frames, weights

_UNEXPLAINED = 0.5  # by the objects, for a plateau to be a touch


def with_touches(
    contour: Contour,
    objects: Sequence[Reflector],
    links: Sequence[Link],
    data: Evidence,
    sensors: np.ndarray,
    units: Sequence[str],
    config: RefinementConfig,
) -> Contour:
    """``contour`` and what the plateaus of ``data`` tell beyond its ``objects`` and ``links``; ``sensors`` are the
    covariances of the units' sensors, (units, 3, 3), ``units`` the names of the units that the echoes number.
    """
    fine = of_fine_sweeps(data)
    if not fine.any():
        return contour
    heard = voting_plateaus(data.take(fine), config)
    scene = Scene(with_stands(heard.evidence, known_as_fitted(data.stands)), config)
    left = scene.explain(scene.claims(*_published(objects, links))).unexplained > _UNEXPLAINED
    for place in np.unique(heard.evidence.place[left]):
        here = np.nonzero(left & (heard.evidence.place == place))[0]
        sensor = sensors[heard.evidence.echoes.unit[here[0]]]
        contour = _with_place(contour, heard, here, sensor, units, config)
    return contour


def _published(objects: Sequence[Reflector], links: Sequence[Link]) -> tuple[list[Reflector], list[Link]]:
    """Without the points that are part of no contour: what they explain stays a touch."""
    order = [number for number, one in enumerate(objects) if not isinstance(one, Spot)]
    moved = [Link(order.index(link.first), order.index(link.second)) for link in links]
    return [objects[number] for number in order], moved


def _with_place(
    contour: Contour,
    heard: Plateaus,
    here: np.ndarray,
    sensor: np.ndarray,
    units: Sequence[str],
    config: RefinementConfig,
) -> Contour:
    """The contour with the plateaus number ``here``, all of one place, as touches, walls and corners; ``sensor`` is the
    covariance of its sensor, (3, 3).
    """
    data = heard.evidence.take(here)
    place_m = np.array([data.echoes.x_m[0], data.echoes.y_m[0]])
    asked = _asked(data, contour.walls, place_m)
    found = frames(asked, lambda frame: against(frame, place_m, heard.evidence, config))
    chance = weights(found, config.touches.frame_nats)
    known = int(asked.known.sum())
    wall, corner = (total[known:] for total in claimed(found, chance, known + len(here)))
    support = Support(data, heard.readings[here], wall, corner, sensor)
    made = walls_of(found[int(chance.argmax())], asked, support, contour, config) if found else FrameWalls()
    touches = tuple(
        _touch(heard, int(number), float(wall[index]), float(corner[index]), sensor, units, config)
        for index, number in enumerate(here)
        if index not in made.used
    )
    return replace(
        contour,
        walls=contour.walls + made.walls,
        corners=contour.corners + made.corners,
        touches=contour.touches + touches,
    )


def _asked(data: Evidence, walls: Sequence[Wall], place_m: np.ndarray) -> Heard:
    """The walls before the place, and what it heard; where it knows no wall, a frame turns with the unit's heading,
    whose error then parts no two directions.
    """
    theta_rad, theta_variance, distance_m, distance_variance = sides_known(walls, place_m).T
    before = (distance_m > 0) & (distance_m < data.span_m)
    count = int(before.sum())
    own_sigma_rad = data.turn_sigma_rad if count else data.direction_sigma_rad
    return Heard(
        direction_rad=np.concatenate([theta_rad[before], data.echoes.axis_rad]),
        direction_sigma_rad=np.concatenate([np.sqrt(theta_variance[before]), own_sigma_rad]),
        range_m=np.concatenate([distance_m[before], data.echoes.range_m]),
        range_sigma_m=np.concatenate([np.sqrt(distance_variance[before]), data.range_sigma_m]),
        known=np.arange(count + len(data.echoes)) < count,
        span_m=data.span_m,
    )


def _touch(
    heard: Plateaus,
    number: int,
    wall: float,
    corner: float,
    sensor: np.ndarray,
    units: Sequence[str],
    config: RefinementConfig,
) -> Touch:
    data = heard.evidence.take(np.array([number]))
    direction_rad, range_m = float(data.echoes.axis_rad[0]), float(data.echoes.range_m[0])
    towards = np.array([np.cos(direction_rad), np.sin(direction_rad)])
    across = np.array([-towards[1], towards[0]])
    by_sensor = ranges_by_sensor(np.array([range_m]))[0]
    covariance = (data.range_sigma_m[0] ** 2 + by_sensor @ sensor @ by_sensor) * np.outer(towards, towards)
    covariance += (range_m * data.turn_sigma_rad[0]) ** 2 * np.outer(across, across)
    covariance += data.echoes.sigma_position_m[0] ** 2 * np.eye(2)
    kinds = (1 - wall - corner) * kind_chances(range_m, config) + (wall, corner, 0)
    kinds = kinds / kinds.sum()
    unit = int(data.echoes.unit[0])
    return Touch(
        x_m=float(data.echoes.x_m[0] + range_m * towards[0]),
        y_m=float(data.echoes.y_m[0] + range_m * towards[1]),
        covariance=covariance,
        unit=units[unit] if unit < len(units) else "",
        readings=int(heard.readings[number]),
        width_rad=float(heard.width_rad[number]),
        direction_rad=direction_rad,
        chance_wall=float(kinds[0]),
        chance_corner=float(kinds[1]),
        chance_cylinder=float(kinds[2]),
    )


def kind_chances(range_m: float, config: RefinementConfig) -> np.ndarray:
    """Chance of wall, corner and cylinder by the range alone, (3,): what is there, and what answers from there."""
    beam = config.beam
    fades_m = (beam.cylinder_reach_m, config.touches.cylinders_fade_m)
    post = float(np.interp(range_m, fades_m, (beam.wall_chance, beam.faint_chance)))
    weight = np.array(
        [
            beam.wall_chance,
            config.touches.corners_per_wall * range_m * beam.corner_chance,
            config.touches.cylinders_per_wall * range_m * post,
        ]
    )
    return weight / weight.sum()
