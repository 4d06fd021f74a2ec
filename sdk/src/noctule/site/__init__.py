"""The site file: which units a site has, how each is reached, where it is, and what is known of its sensor.

Its quantities have the bounds of the messages that they go into.
"""

from noctule.site.model import FixedPose, Pose2, PoseKey, PoseSource, Sensor, Site, Unit, UnknownPose, WaypointPath
from noctule.site.site_file import PINGS, load

__all__ = [
    "PINGS",
    "FixedPose",
    "Pose2",
    "PoseKey",
    "PoseSource",
    "Sensor",
    "Site",
    "Unit",
    "UnknownPose",
    "WaypointPath",
    "load",
]
