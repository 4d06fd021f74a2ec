"""A sweep of the line as the message of the bus: the wire's integers become SI units, radians and UTC."""

from math import pi

from noctule import messages_pb2 as messages
from noctule.bounds import AIR_C
from noctule.site import Site, Unit
from noctule_gateway.clock.boot_clocks import SweepTime
from noctule_gateway.clock.regression import TICK_S
from noctule_gateway.wire import frames
from noctule_gateway.wire.frames import FIRST_NO_ECHO, NO_TEMPERATURE, NO_WAYPOINT, NoEcho
from noctule_gateway.wire.units import BEARING_RAD, OFFSET_S, PER_KELVIN, TICKS_PER_OFFSET

_STATUSES: dict[int, messages.ReadingStatus] = {
    NoEcho.NO_ECHO: messages.READING_STATUS_NO_ECHO,
    NoEcho.TOO_EARLY: messages.READING_STATUS_TOO_EARLY,
    NoEcho.STUCK_HIGH: messages.READING_STATUS_STUCK_HIGH,
    NoEcho.NO_SENSOR: messages.READING_STATUS_NO_SENSOR,
}


def waypoint_of(sweep: frames.AnySweep) -> int | None:
    """The waypoint that the sweep was made at, if the unit has been given one."""
    return None if sweep.waypoint == NO_WAYPOINT else sweep.waypoint


def ticks_of(sweep: frames.AnySweep) -> tuple[int, int]:
    """The ticks of its boot at which it began and at which its last reading was made."""
    last_offset = sweep.readings[-1].offset if sweep.readings else 0
    return sweep.start, sweep.start + last_offset * TICKS_PER_OFFSET


def to_message(
    sweep: frames.AnySweep, site: Site, unit: Unit, when: SweepTime, pose: messages.Pose | None
) -> messages.Sweep:
    """The sweep as published, still without log_id and log_sequence."""
    message = messages.Sweep(
        site=site.name,
        unit=unit.name,
        life=sweep.life or None,
        boot=sweep.boot,
        sequence=sweep.sequence,
        clock_error_s=when.start.error_s,
        pose=pose,
        waypoint=waypoint_of(sweep),
        air_temperature_c=_air_temperature_c(sweep, site),
        sensor=unit.sensor.message(),
        readings=[_reading(reading, when) for reading in sweep.readings],
        clock_drift=when.drift,
    )
    message.start.FromNanoseconds(round(when.start.time_s * 1e9))
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


def _reading(reading: frames.Reading, when: SweepTime) -> messages.Reading:
    heard = reading.echo < FIRST_NO_ECHO
    # A kind of no echo that a newer firmware names is at least no echo.
    status = messages.READING_STATUS_ECHO if heard else _STATUSES.get(reading.echo, messages.READING_STATUS_NO_ECHO)
    return messages.Reading(
        bearing_rad=bearing_rad(reading.bearing),
        time_offset_s=reading.offset * OFFSET_S / when.pace,
        time_of_flight_s=reading.echo * TICK_S / (1.0 + (when.drift or 0.0)) if heard else None,
        status=status,
    )
