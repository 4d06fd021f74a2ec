"""A survey's contour together with the reliability grid that it comes with."""

from collections.abc import Iterable

from noctule.errors import SurveyError
from noctule.messages_pb2 import Contour, Sweep
from noctule_mapper.config import MapperConfig, SensorConfig
from noctule_mapper.grid import GridTile
from noctule_mapper.mapper import Mapper
from noctule_mapper.report import contour_message
from noctule_mapper.sweep import from_message


def survey_map(
    sweeps: Iterable[Sweep], config: MapperConfig, sensor: SensorConfig | None = None
) -> tuple[Contour, list[GridTile]]:
    """The contour and the grid's tiles of one site's survey; ``sensor`` stands in for what the sweeps do not say of
    theirs.

    Raises SurveyError where the sweeps are of several sites, SweepError where one can't be mapped.
    """
    mapper = Mapper(config)
    site: str | None = None
    for sweep in sweeps:
        if site not in (None, sweep.site):
            raise SurveyError(f"the survey holds sweeps of several sites ({site}, {sweep.site}); export one at a time")
        site = sweep.site
        mapper.register_sweep(from_message(sweep, sensor or config.sensor))
    return contour_message(mapper.contour(), site=site or ""), mapper.grid.tiles()
