"""The faults that sweeps can show: what to do about each, how many sweeps in a row name it, which spoil a sweep."""

from dataclasses import dataclass

from noctule import messages_pb2 as messages
from noctule.messages_pb2 import FaultKind


@dataclass(frozen=True)
class Fault:
    """How a fault is dealt with. It is named by the ``named_after``-th sweep in a row that shows it: the sweep in whose
    midst it began need not show it, so that of three sweeps two are sure to.
    """

    advice: str
    named_after: int = 2
    least_nats: float = 0.0  # of these sweeps together
    spoils: bool = True  # the sweeps made meanwhile are no good for a map
    most_sure: float = 0.99


FAULTS: dict[FaultKind, Fault] = {
    messages.FAULT_KIND_NO_SENSOR: Fault("check the sensor's plug, its 5 V, and the wires of TRIG and ECHO"),
    messages.FAULT_KIND_STUCK_HIGH: Fault("cut the sensor's power for a second; if it comes back, replace the sensor"),
    messages.FAULT_KIND_TOO_EARLY: Fault("check the wire of ECHO against that of TRIG, and the sensor's 5 V"),
    messages.FAULT_KIND_REPEATS: Fault("check the sensor's 5 V and its plug; if it stays so, replace the sensor"),
    messages.FAULT_KIND_MOTOR_STUCK: Fault(
        "check the motor's plug, its 5 V and what may hold it; then let it find home: noctule rpc SITE UNIT home",
        most_sure=0.95,
    ),
    messages.FAULT_KIND_BLOCKED: Fault("take away what stands or hangs before the sensor"),
    messages.FAULT_KIND_NO_ECHO_ANYWHERE: Fault(
        "nothing to do if all around it is farther than 4 m or soft; else check the sensor's face and its plug",
        named_after=3,
        spoils=False,
    ),
    messages.FAULT_KIND_SILENT: Fault(
        "check whether the sensor is covered or unplugged, and whether the motor turns: noctule rpc SITE UNIT home",
        most_sure=0.95,
    ),
    messages.FAULT_KIND_SLIPPED: Fault(
        "check the motor's 5 V and that nothing brakes it; lower its speed (configure --top-speed-half-steps-s), then "
        "let it find home: noctule rpc SITE UNIT home",
        named_after=1,
        most_sure=0.95,
    ),
    messages.FAULT_KIND_PLAY: Fault(
        "tighten the sensor on the motor's shaft, or measure the backlash again: noctule rpc SITE UNIT calibrate",
        named_after=1,
        most_sure=0.95,
    ),
    messages.FAULT_KIND_TURNED: Fault(
        "let it find home (noctule rpc SITE UNIT home): if its bearings come back, the motor has slipped once; else "
        "turn it back, or write its new heading into the site file",
        named_after=1,
        most_sure=0.95,
    ),
    messages.FAULT_KIND_MOVED: Fault(
        "put it back, or write its new pose into the site file; if the room was changed: "
        "noctule rpc SITE UNIT accept_room",
        most_sure=0.9,
    ),
    messages.FAULT_KIND_RANGES_JUMPED: Fault(
        "compare the air's temperature with the unit's (trim_temperature); if that is right, replace the sensor",
        named_after=1,
        most_sure=0.9,
    ),
    messages.FAULT_KIND_TOO_NOISY: Fault(
        "look for another ultrasonic device, a fan or an unsteady 5 V; fasten the sensor",
        most_sure=0.9,
    ),
    messages.FAULT_KIND_CLOCK_SLIPS: Fault(
        "update the unit's firmware; if it stays so, replace its board", named_after=1
    ),
    messages.FAULT_KIND_ARC_SILENT: Fault(
        "check whether something soft hangs there, and whether the sensor's wires are strained at those bearings; if "
        "the room was changed: noctule rpc SITE UNIT accept_room",
        most_sure=0.8,
    ),
    messages.FAULT_KIND_BEARING_SILENT: Fault(
        "check whether the sensor's wires are pinched at that bearing", named_after=1, spoils=False, most_sure=0.9
    ),
}
"""The gravest first: where a sweep shows several of the same rank, the first is believed."""
