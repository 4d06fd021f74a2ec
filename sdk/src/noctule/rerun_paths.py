"""The names of what is shown in Rerun, shared by those who log and those who lay out views."""

APPLICATION_ID = "noctule"
DEFAULT_RELAY = "rerun+http://127.0.0.1:9876/proxy"
# Behind a relay's address: it shows several sites, in one recording, each site's entities under its name.
SEVERAL_SITES = "#sites"
ALL_SITES = "sites"  # that recording; otherwise each site has one of its own name

# Timelines. Time is that of the data (a sweep's start), not of the logging.
TIME = "time"
SWEEP = "sweep"  # the sum of the units' log sequences

# The map, in the site's frame.
WORLD = "world"  # holds the transform that turns y upwards; a 2-D view's origin is its parent
GRID = "world/grid"
FEATURES = "world/features"
WALLS = "world/walls"
CORNERS = "world/corners"
CYLINDERS = "world/cylinders"
TOUCHES = "world/touches"
ERRORS = "world/errors"  # of walls, corners and cylinders
POSES = "world/poses"  # of the units, as the contour has them
LABELS = "world/labels"
UNITS = "world/units"
ECHOES = "world/echoes"  # of a whole survey, in a recording of it

LOG = "log"
HEARTBEAT = "mapper/heartbeat"  # a heading that bears the hour

# What the viewer's own process draws of a site that it watches.
ALARMS = "board/alarms"
UNITS_TABLE = "board/units"
SCALE = "world/scale"
SCALE_BETWEEN = "world/scale/between"
HEALTH = "world/health"  # of the units, where the map has them
CHANGES = "world/changes"  # what is new on the map, and what is gone
FLOOR_PLAN = "world/floor_plan"
MAP_ERRORS = "board/errors"  # that the contour states, by kind, over time
MAP_FIT = "board/fit"  # how well the contour explains what units hear, over time


def recording(url: str, site: str) -> str:
    """Which recording is drawn into by who draws ``site`` at the relay's address ``url``."""
    return ALL_SITES if url.endswith(SEVERAL_SITES) else site


def grid_tile(tile: str) -> str:
    """One tile of the reliability grid; ``tile`` as made by keys.tile_name()."""
    return f"{GRID}/{tile}"


def unit_pose(unit: str) -> str:
    """The unit's frame in the site's."""
    return f"{UNITS}/{unit}"


def unit_rays(unit: str) -> str:
    """The echoes of the unit's last sweep, as lines from the unit."""
    return f"{UNITS}/{unit}/rays"


def unit_trail(unit: str) -> str:
    """Where the unit has been."""
    return f"{UNITS}/{unit}/trail"


def unit_state(unit: str) -> str:
    """The unit's state over time."""
    return f"states/{unit}"


def unit_clock_error(unit: str) -> str:
    """Standard deviation of the unit's clock regression over time."""
    return f"units/{unit}/clock_error"


def unit_log(unit: str) -> str:
    """What the unit has to tell its operator."""
    return f"{LOG}/{unit}"


def mapper_counter(name: str) -> str:
    """One of the mapper's own figures over time."""
    return f"mapper/counters/{name}"


def unit_sheet(unit: str) -> str:
    """All that is known of the unit, in words."""
    return f"board/sheets/{unit}"


def unit_temperature(unit: str) -> str:
    """The temperature of the unit's chip over time."""
    return f"board/temperatures/{unit}"


def unit_polar(unit: str) -> str:
    """The unit's last sweep as the unit itself sees it: straight ahead is up."""
    return f"board/polar/{unit}"


def unit_rings(unit: str) -> str:
    """Circles of equal range and the bearings, under unit_polar()."""
    return f"board/polar/{unit}/rings"


def unit_echo_history(unit: str) -> str:
    """What the unit has heard at each bearing, sweep by sweep."""
    return f"board/echoes/{unit}"


def unit_echo_axes(unit: str) -> str:
    """Bearings, hours and the meaning of colours, beside unit_echo_history()."""
    return f"board/echoes/{unit}/axes"


def planned_path(unit: str) -> str:
    """The stops that a carried unit is to make."""
    return f"world/paths/{unit}"


def map_error(kind: str) -> str:
    """What the contour states of its errors of that kind, over time."""
    return f"{MAP_ERRORS}/{kind.replace(' ', '_')}"


def map_fit(figure: str) -> str:
    """One of the figures of how well the contour explains what units hear, over time."""
    return f"{MAP_FIT}/{figure}"


def under(site: str) -> str:
    """What the paths of a site begin with where a relay shows several."""
    return f"{site}/"
