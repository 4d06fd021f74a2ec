"""What a reading says of the echo."""

from noctule.messages_pb2 import (
    READING_STATUS_ECHO,
    READING_STATUS_NO_ECHO,
    READING_STATUS_UNSPECIFIED,
    Reading,
)


def flight_s(reading: Reading) -> float | None:
    """The echo's time of flight, as it was told; None where there was no echo, or a fault."""
    echo = reading.status in (READING_STATUS_UNSPECIFIED, READING_STATUS_ECHO)
    return reading.time_of_flight_s if echo and reading.HasField("time_of_flight_s") else None


def heard_nothing(reading: Reading) -> bool:
    """Whether the sensor listened in vain."""
    unsaid = reading.status == READING_STATUS_UNSPECIFIED and not reading.HasField("time_of_flight_s")
    return unsaid or reading.status == READING_STATUS_NO_ECHO
