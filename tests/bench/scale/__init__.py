"""What units, gateways, routers and mappers of a large fleet cost, and how long a sweep takes through them.

Run by hand, for it wants the whole machine: ``PYTHONPATH=tests python tests/bench/run.py scale --units 1000``.
"""
