"""Noctule maps rooms by ultrasound; this package is the contract that its parts and any extra service share.

with noctule.Client("paper-room") as client:
    client.on_contour(lambda contour: print(len(contour.walls), "walls"))
"""

from noctule.client import Client
from noctule.errors import BusError, KeyFormatError, NoctuleError, SiteFileError, SurveyError
from noctule.follow import LogFollower

__all__ = ["BusError", "Client", "KeyFormatError", "LogFollower", "NoctuleError", "SiteFileError", "SurveyError"]
