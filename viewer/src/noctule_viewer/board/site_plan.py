"""What is planned of a site, from files: the paths of its carried units, and a floor plan."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from noctule import site as site_files
from noctule.errors import NoctuleError
from noctule.site import Pose2, WaypointPath
from noctule_viewer import floor_plan

_SITE_FILE = ".toml"


@dataclass(frozen=True)
class SitePlan:
    """``paths`` by unit; lines of the floor plan, each (points, 2), in the site's frame."""

    site: str
    paths: Mapping[str, Sequence[Pose2]] = field(default_factory=dict)
    floor_plan_m: Sequence[np.ndarray] = ()


class SitePlanError(NoctuleError):
    """Options that don't go together; the message says how to give them."""


def read(sites: Sequence[str], drawings: Sequence[str] = (), at: Sequence[str] = ()) -> list[SitePlan]:
    """``sites`` are sites' names or their site files; ``drawings`` their floor plans and ``at`` where those lie, as a
    user types them, each ``SITE=...`` where there are several sites. Raises SiteFileError, FloorPlanError,
    SitePlanError.
    """
    plans = [_of_file(Path(site)) if site.endswith(_SITE_FILE) else SitePlan(site) for site in sites]
    names = [plan.site for plan in plans]
    if len(set(names)) < len(names):
        raise SitePlanError(f"a site is named twice: {', '.join(names)}")
    files, places = _by_site("--floor-plan", drawings, names), _by_site("--floor-plan-at", at, names)
    if unplaced := places.keys() - files.keys():
        raise SitePlanError(f"--floor-plan-at places a floor plan of {min(unplaced)}: give --floor-plan too")
    return [_with_floor_plan(plan, files.get(plan.site), places.get(plan.site, "0,0,0")) for plan in plans]


def _of_file(path: Path) -> SitePlan:
    made = site_files.load(path)
    return SitePlan(
        made.name, {unit.name: unit.pose.poses for unit in made.units if isinstance(unit.pose, WaypointPath)}
    )


def _with_floor_plan(plan: SitePlan, drawing: str | None, at: str) -> SitePlan:
    if drawing is None:
        return plan
    return replace(plan, floor_plan_m=floor_plan.load(Path(drawing), floor_plan.placing(at)))


def _by_site(option: str, values: Sequence[str], sites: Sequence[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for value in values:
        site, mark, rest = value.partition("=")
        if mark and site in sites:
            found[site] = rest
        elif len(sites) == 1:
            found[sites[0]] = value
        else:
            raise SitePlanError(f"{option} {value}: of which site? Give {option} SITE=..., SITE as {', '.join(sites)}")
    return found
