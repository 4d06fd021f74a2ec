"""A sweep of the line as the message of the bus: the wire's integers become SI units, radians and UTC."""

from math import pi

from noctule import messages_pb2 as messages
from noctule.bounds import AIR_C
from noctule.site import Site, Unit
from noctule_gateway.clock.regression import TICK_S, HostTime
from noctule_gateway.wire import frames
from noctule_gateway.wire.frames import FIRST_NO_ECHO, NO_TEMPERATURE, NO_WAYPOINT, NoEcho
from noctule_gateway.wire.units import BEARING_RAD, OFFSET_S, PER_KELVIN

_STATUSES: dict[int, messages.ReadingStatus] = {
    NoEcho.NO_ECHO: messages.READING_STATUS_NO_ECHO,
    NoEcho.TOO_EARLY: messages.READING_STATUS_TOO_EARLY,
    NoEcho.STUCK_HIGH: messages.READING_STATUS_STUCK_HIGH,
    NoEcho.NO_SENSOR: messages.READING_STATUS_NO_SENSOR,
}


def waypoint_of(sweep: frames.AnySweep) -> int | None:
    """The waypoint that the sweep was made at, if the unit has been given one."""
    return None if sweep.waypoint == NO_WAYPOINT else sweep.waypoint


def to_message(
    sweep: frames.AnySweep, site: Site, unit: Unit, start: HostTime, pose: messages.Pose | None, drift: float | None
) -> messages.Sweep:
    """The sweep as published, still without log_id and log_sequence; ``start`` is in UTC.

    ``drift`` is by how much the unit's oscillator is fast, and is taken out of the readings' times; None is not known.
    """
    second = 1 + (drift or 0.0)  # of the unit's, in a true one
    message = messages.Sweep(
        site=site.name,
        unit=unit.name,
        life=sweep.life or None,
        boot=sweep.boot,
        sequence=sweep.sequence,
        clock_error_s=start.error_s,
        pose=pose,
        waypoint=waypoint_of(sweep),
        air_temperature_c=_air_temperature_c(sweep, site),
        sensor=unit.sensor.message(),
        readings=[_reading(reading, second) for reading in sweep.readings],
        clock_drift=drift,
    )
    message.start.FromNanoseconds(round(start.time_s * 1e9))
    return message


def bearing_rad(bearing: int) -> float:
    """A bearing of the wire in (-pi, pi]: -32768 is half a turn either way."""
    return pi if bearing == -32768 else bearing * BEARING_RAD


def celsius(temperature: int) -> float | None:
    """A temperature of the wire in degrees C; None if it was not measured."""
    return None if temperature == NO_TEMPERATURE else temperature / PER_KELVIN


def _air_temperature_c(sweep: frames.AnySweep, site: Site) -> float | None:
    """What the site file says takes the place of what the unit has measured; a broken thermometer tells nothing."""
    if site.air_temperature_c is not None:
        return site.air_temperature_c
    measured_c = celsius(sweep.temperature)
    return None if measured_c is None or AIR_C.fault(measured_c) else measured_c


def _reading(reading: frames.Reading, second: float) -> messages.Reading:
    heard = reading.echo < FIRST_NO_ECHO
    # A kind of no echo that a newer firmware names is at least no echo.
    status = messages.READING_STATUS_ECHO if heard else _STATUSES.get(reading.echo, messages.READING_STATUS_NO_ECHO)
    return messages.Reading(
        bearing_rad=bearing_rad(reading.bearing),
        time_offset_s=reading.offset * OFFSET_S / second,
        time_of_flight_s=reading.echo * TICK_S / second if heard else None,
        status=status,
    )
