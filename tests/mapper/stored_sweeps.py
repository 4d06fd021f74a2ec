"""Sweeps of one log for tests of the mapper's store."""

from noctule.messages_pb2 import Cursor, Pose, Sweep
from noctule_mapper.live.store import SweepStore

LOG = "8c1f"


def sweep(number: int, start_s: float | None = None, x_m: float | None = None) -> Sweep:
    """The ``number``th sweep of a log; by default each from a place of its own, one second apart."""
    pose = Pose(x_m=number if x_m is None else x_m)
    message = Sweep(unit="u1", log_id=LOG, log_sequence=number, clock_epoch="one", pose=pose)
    message.start.FromNanoseconds(int((number if start_s is None else start_s) * 1e9))
    return message


def cursor(number: int) -> Cursor:
    return Cursor(unit="u1", log_id=LOG, log_sequence=number)


def sequences(store: SweepStore) -> list[int]:
    return [held.log_sequence for held in store.sweeps()]
