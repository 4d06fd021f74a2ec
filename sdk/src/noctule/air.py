"""Sound in air."""


def speed_of_sound_m_s(air_temperature_c: float) -> float:
    """Speed of sound in air, 331.3 + 0.606 T m/s."""
    return 331.3 + 0.606 * air_temperature_c
