"""A unit's settings from the wire to the bus: plan, calibration and trim in SI units."""

from dataclasses import replace
from typing import Any

from noctule.messages_pb2 import Calibration, SweepPlan, UnitSettings
from noctule_gateway.wire.frames import NO_TEMPERATURE, Calibrate, Configure, HomeKind, Settings
from noctule_gateway.wire.units import CALIBRATION, PER_KELVIN, PLAN, Scale

HOMES: dict[int, Calibration.Home] = {
    HomeKind.SWITCH: Calibration.HOME_SWITCH,
    HomeKind.STOP: Calibration.HOME_STOP,
    HomeKind.OPENING_SWITCH: Calibration.HOME_OPENING_SWITCH,
}


def plan_of(settings: Settings) -> Configure:
    """The order that gives a unit this plan."""
    return Configure(
        request=0,
        first_bearing=settings.first_bearing,
        bearing_step=settings.bearing_step,
        count=settings.count,
        ping_interval_ms=settings.ping_interval_ms,
        top_speed=settings.top_speed,
        ramp_ms=settings.ramp_ms,
        settle_ms=settings.settle_ms,
        pings=settings.pings,
    )


def with_plan(settings: Settings, plan: Configure) -> Settings:
    """The settings of a unit that goes by ``plan``."""
    return replace(settings, **{name: value for name, value in vars(plan).items() if name != "request"})


def calibration_of(settings: Settings) -> Calibrate:
    """The order that gives a unit this calibration."""
    return Calibrate(
        request=0,
        half_steps_per_turn=settings.half_steps_per_turn,
        backlash=settings.backlash,
        home=settings.home,
        home_bearing=settings.home_bearing,
    )


def to_message(settings: Settings) -> UnitSettings:
    """The settings as the bus is told them."""
    trim = settings.temperature_trim
    return UnitSettings(
        plan=SweepPlan(**_values(settings, PLAN)),
        calibration=Calibration(
            home=HOMES.get(settings.home, Calibration.HOME_UNSPECIFIED), **_values(settings, CALIBRATION)
        ),
        temperature_trim_k=None if trim == NO_TEMPERATURE else trim / PER_KELVIN,
        stored=bool(settings.stored),
    )


def _values(settings: Settings, scales: dict[str, Scale]) -> dict[str, Any]:
    return {scale.field: scale.from_wire(getattr(settings, wire)) for wire, scale in scales.items()}
