"""What holds for every test."""

from hypothesis import HealthCheck, settings

# The machines are noisy: how long an example takes, or takes to be drawn, tells nothing.
settings.register_profile("noisy machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("noisy machine")
