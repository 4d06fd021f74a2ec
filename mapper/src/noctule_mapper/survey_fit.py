"""A survey in, a contour out: what ``noctule-mapper fit`` computes."""

from collections.abc import Iterable

from noctule import messages_pb2
from noctule.errors import SurveyError
from noctule_mapper.config import MapperConfig, SensorConfig
from noctule_mapper.mapper import Mapper
from noctule_mapper.messages import contour_message
from noctule_mapper.readings.sweep import from_message


def fit(
    sweeps: Iterable[messages_pb2.Sweep], config: MapperConfig | None = None, sensor: SensorConfig | None = None
) -> messages_pb2.Contour:
    """The contour of one site's survey; ``sensor`` stands in for what the sweeps do not say of theirs.

    Raises SurveyError where the sweeps are of several sites, SweepError where one can't be mapped.
    """
    mapper, site = map_survey(sweeps, config, sensor)
    return contour_message(mapper.contour(), site=site)


def map_survey(
    sweeps: Iterable[messages_pb2.Sweep], config: MapperConfig | None = None, sensor: SensorConfig | None = None
) -> tuple[Mapper, str]:
    """The map of one site's survey and the site, "" where there are no sweeps; arguments and errors as of ``fit``."""
    config = config or MapperConfig()
    mapper = Mapper(config)
    sites: set[str] = set()
    for sweep in sweeps:
        sites.add(sweep.site)
        if len(sites) > 1:
            raise SurveyError(
                f"the survey holds sweeps of several sites ({', '.join(sorted(sites))}); fit one site at a time"
            )
        mapper.register_sweep(from_message(sweep, sensor or config.sensor))
    return mapper, next(iter(sites), "")
