"""A unit's settings from the wire to the bus: plan, calibration and trim in SI units."""

from dataclasses import replace

from noctule.messages_pb2 import Calibration, SweepPlan, UnitSettings
from noctule_gateway.wire.frames import NO_TEMPERATURE, Calibrate, Configure, HomeKind, Settings
from noctule_gateway.wire.sweep_message import BEARING_RAD

HALF_STEP_PARTS = 256  # of the wire, to a half step

HOMES: dict[int, Calibration.Home] = {
    HomeKind.SWITCH: Calibration.HOME_SWITCH,
    HomeKind.STOP: Calibration.HOME_STOP,
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
        plan=SweepPlan(
            first_bearing_rad=settings.first_bearing * BEARING_RAD,
            bearing_step_rad=settings.bearing_step * BEARING_RAD,
            count=settings.count,
            ping_interval_s=settings.ping_interval_ms / 1000,
            top_speed_half_steps_s=settings.top_speed,
            ramp_s=settings.ramp_ms / 1000,
            settle_s=settings.settle_ms / 1000,
            pings=settings.pings,
        ),
        calibration=Calibration(
            half_steps_per_turn=settings.half_steps_per_turn / HALF_STEP_PARTS,
            backlash_half_steps=settings.backlash,
            home=HOMES.get(settings.home, Calibration.HOME_UNSPECIFIED),
            home_bearing_rad=settings.home_bearing * BEARING_RAD,
        ),
        temperature_trim_k=None if trim == NO_TEMPERATURE else trim / 100,
        stored=bool(settings.stored),
    )
