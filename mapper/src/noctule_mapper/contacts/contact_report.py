"""What is known of each reading's contact: by its tangent circle, and beside it by the paper's R2d test."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from noctule_mapper.config import ContactConfig, MapperConfig
from noctule_mapper.contacts.r2d import R2dTest, r2d_test
from noctule_mapper.contacts.tangent_circle import TangentCircles, tangent_circles
from noctule_mapper.contacts.voting import Contacts, Kind
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.spread import distinct_echoes, with_spread

_COLUMNS = (
    "sweep,x_m,y_m,axis_rad,range_m,range_sigma_m,kind,direction_rad,direction_sigma_rad,radius_m,radius_sigma_m,"
    "supporters,r2d_kind,r2d_deviation_m,r2d_threshold_m,d12_m,d13_m"
)


@dataclass(frozen=True)
class ContactReport:
    """What each echo, (n,), touched: its tangent circle, sought among the ``others``, and the R2d test."""

    echoes: Echoes
    others: Echoes
    circles: TangentCircles
    config: ContactConfig

    @cached_property
    def r2d(self) -> R2dTest:
        """The R2d test with each echo as position 2; made when it is first asked for."""
        return r2d_test(self.echoes, self.others, self.config)

    @property
    def touched(self) -> TangentCircles:
        """The tangent circles, under the kind by the classifier that the configuration names."""
        if self.config.classifier == "tangent-circle":
            return self.circles
        return replace(self.circles, kind=np.where(self.circles.kind == Kind.NONE, Kind.NONE, self.r2d.kind))

    def csv(self) -> str:
        """A line for each echo: where, how far, and both verdicts; "nan" and "none" where there is none."""
        names = np.array([kind.name.lower() for kind in Kind])
        e, c, t = self.echoes, self.circles, self.r2d
        columns = (e.sweep, e.x_m, e.y_m, e.axis_rad, e.range_m, e.sigma_m, names[c.kind], c.direction_rad)
        columns += (c.direction_sigma_rad, c.radius_m, c.radius_sigma_m, c.supporters)
        columns += (names[t.kind], t.deviation_m, t.threshold_m, t.d12_m, t.d13_m)
        rows = (
            ",".join(f"{v:.6g}" if isinstance(v, float) else str(v) for v in row) for row in zip(*columns, strict=True)
        )
        return "\n".join((_COLUMNS, *rows)) + "\n"


def contact_report(echoes: Echoes, found: Contacts, config: MapperConfig) -> ContactReport:
    """The report on ``echoes`` (n,) whose contacts by the votes are ``found`` (n,)."""
    echoes = with_spread(echoes, config)
    others = distinct_echoes(echoes, config)
    by_plateau = np.isfinite(found.direction_sigma_rad)
    voted = replace(found, kind=np.where(by_plateau, Kind.NONE, found.kind))
    circles = _or_plateaus(tangent_circles(echoes, others, voted, config.contacts), found, by_plateau)
    return ContactReport(echoes, others, circles, config.contacts)


def _or_plateaus(circles: TangentCircles, found: Contacts, by_plateau: np.ndarray) -> TangentCircles:
    """``circles`` (n,), in place of those ``by_plateau``, bool (n,), the contacts ``found`` with a radius that one
    place leaves open.
    """
    return TangentCircles(
        direction_rad=np.where(by_plateau, found.direction_rad, circles.direction_rad),
        direction_sigma_rad=np.where(by_plateau, found.direction_sigma_rad, circles.direction_sigma_rad),
        radius_m=np.where(by_plateau, np.inf, circles.radius_m),
        radius_sigma_m=np.where(by_plateau, np.inf, circles.radius_sigma_m),
        kind=np.where(by_plateau, found.kind, circles.kind),
        supporters=np.where(by_plateau, 0, circles.supporters),
    )
