"""What is planned of a site, from files: the paths of its carried units, and a floor plan."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from noctule import site as site_files
from noctule.site import Pose2, WaypointPath
from noctule_viewer import floor_plan
from noctule_viewer.floor_plan import FloorPlanError

_SITE_FILE = ".toml"


@dataclass(frozen=True)
class SitePlan:
    """``paths`` by unit; lines of the floor plan, each (points, 2), in the site's frame."""

    site: str
    paths: Mapping[str, Sequence[Pose2]] = field(default_factory=dict)
    floor_plan_m: Sequence[np.ndarray] = ()


def read(site: str, drawing: Path | None = None, at: str | None = None) -> SitePlan:
    """``site`` is a site's name or its site file, ``drawing`` its floor plan, and ``at`` where that lies, as a user
    types it. Raises SiteFileError, FloorPlanError.
    """
    if at is not None and drawing is None:
        raise FloorPlanError("--floor-plan-at places a floor plan: give --floor-plan too")
    lines_m = floor_plan.load(drawing, floor_plan.placing(at or "0,0,0")) if drawing is not None else []
    if not site.endswith(_SITE_FILE):
        return SitePlan(site, floor_plan_m=lines_m)
    made = site_files.load(Path(site))
    paths = {unit.name: unit.pose.poses for unit in made.units if isinstance(unit.pose, WaypointPath)}
    return SitePlan(made.name, paths, lines_m)
