"""The far ends of a log follower: units with a log, one that never answers, a store, a router that can die."""

import random
import subprocess
import sys
import threading

from system.processes import PATIENCE_S

from noctule import bus, keys
from noctule.messages_pb2 import Cursor, LogRecords, Sweep, UnitStatus

POLL_S = 0.3  # so that a test in which all signs are lost need not wait for the usual ten seconds


class LoggedUnit:
    """The bus side of a gateway: a log that keeps ``keep`` records, and publications of which a share gets lost."""

    def __init__(self, session, unit, log_id="a", keep=10_000, lose=0.0, dice=None):
        self._unit, self._lose, self._dice = unit, lose, dice or random.Random(0)
        self.log_id, self.keep, self.sweeps = log_id, keep, []
        self.asked = 0
        self.trouble = ""  # for which the log can't be read
        self._key = keys.log("room", unit)
        self._publisher = bus.declare_publisher(session, keys.sweep("room", unit), Sweep)
        self._status = bus.StatePublisher(session, keys.unit_status("room", unit), UnitStatus)
        self._queryable = session.declare_queryable(self._key, self._answer)
        self._token = session.liveliness().declare_token(keys.alive("room", unit))  # it ends with its last reference

    @property
    def head(self):
        return len(self.sweeps)

    @property
    def tail(self):
        return max(1, self.head - self.keep + 1)

    def end(self):
        self._queryable.undeclare()
        self._token.undeclare()

    def begin_log(self, log_id):
        self.log_id, self.sweeps = log_id, []

    def sweep(self, count=1):
        for _ in range(count):
            made = Sweep(site="room", unit=self._unit, log_id=self.log_id, log_sequence=self.head + 1)
            self.sweeps.append(made)
            if self._dice.random() >= self._lose:
                self._publisher.put(made.SerializeToString())

    def status(self):
        self._status.put(UnitStatus(unit=self._unit, log_id=self.log_id, log_head=self.head, log_tail=self.tail))

    def _answer(self, query):
        self.asked += 1
        if self.trouble:
            query.reply_err(self.trouble.encode())
            return
        head, tail = self.head, self.tail
        first = max(int(query.parameters.get("from")), tail)
        sweeps = self.sweeps[first - 1 : min(head, first - 1 + int(query.parameters.get("max")))]
        records = LogRecords(log_id=self.log_id, head=head, tail=tail, sweeps=sweeps)
        query.reply(self._key, records.SerializeToString())


class SilentUnit:
    """A unit whose log takes each question and never answers, as where its gateway's disk hangs."""

    def __init__(self, session, unit):
        self._queries = []  # a query that is let go of is at its end
        self.asked = threading.Semaphore(0)
        self._queryable = session.declare_queryable(keys.log("room", unit), self._keep)
        self._token = session.liveliness().declare_token(keys.alive("room", unit))

    def _keep(self, query):
        self._queries.append(query)
        self.asked.release()


class Store:
    """A reader's database: sweeps and cursors change together, or not at all when it fails."""

    def __init__(self, fail=lambda: False):
        self.sweeps, self.cursors, self.fail = [], {}, fail
        self._changed = threading.Condition()

    def deliver(self, sweeps):
        with self._changed:
            if self.fail():
                raise OSError("disk full")
            self.sweeps.extend(sweeps)
            last = sweeps[-1]
            self.cursors[last.unit] = Cursor(unit=last.unit, log_id=last.log_id, log_sequence=last.log_sequence)
            self._changed.notify_all()

    def of(self, unit):
        return [sweep.log_sequence for sweep in self.sweeps if sweep.unit == unit]

    def wait_for(self, condition):
        with self._changed:
            assert self._changed.wait_for(lambda: condition(self), PATIENCE_S), (
                f"{len(self.sweeps)} stored, {self.cursors}"
            )


ROUTER = """
import sys, threading
from noctule import bus
session = bus.open_session(listen=[sys.argv[1]])
print("up", flush=True)
threading.Event().wait()
"""


class RouterProcess:
    """A router that dies as a process does, at once, and comes back."""

    def __init__(self, endpoint):
        self.endpoint = endpoint
        self.start()

    def start(self):
        self._process = subprocess.Popen([sys.executable, "-c", ROUTER, self.endpoint], stdout=subprocess.PIPE)
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == b"up\n"

    @property
    def pid(self):
        return self._process.pid

    def stop(self):
        self._process.kill()
        self._process.communicate()

    def restart(self):
        self.stop()
        self.start()
