"""How far an update is, and how it ends, also in words."""

from dataclasses import dataclass
from enum import Enum

from noctule_gateway.errors import GatewayError
from noctule_gateway.update.image import Image


class Step(Enum):
    """How far an update is."""

    GREETING = "looking for the unit"
    ENTERING = "into the loader"
    SENDING = "sending"
    INSTALLING = "installing"
    STARTING = "starting"


@dataclass(frozen=True)
class Progress:
    """The step, and how many pages the unit is known to hold of all that it is to hold."""

    step: Step
    pages: int
    of_pages: int

    def __str__(self) -> str:
        if self.step is Step.SENDING:
            return f"{self.step.value}, {self.pages} of {self.of_pages} pages"
        return self.step.value


@dataclass(frozen=True)
class Updated:
    """The unit runs the image; ``before`` is the version that it had, None if it had no sound application."""

    before: str | None


@dataclass(frozen=True)
class Current:
    """The unit has the image's version already, and was left alone."""


Ending = Updated | Current | GatewayError


def describe(outcome: Ending, image: Image) -> str:
    """What became of an update to ``image``."""
    match outcome:
        case Updated(before=before):
            return f"{before or 'no application'} -> {image.version_text}"
        case Current():
            return f"has {image.version_text}; --force sends it again"
        case error:
            return str(error)
