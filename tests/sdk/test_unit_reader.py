"""A unit's log is read once and in order, whatever comes live and whatever the log has let go of."""

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from noctule.errors import BusError
from noctule.messages_pb2 import Cursor, LogGap, LogRecords, Sweep
from noctule.unit_reader import MAX_LOGS_LEFT, UnitReader


class Log:
    """A unit's log: records from ``tail`` to ``head``, read at most ``most`` at a time."""

    def __init__(self, log_id: str = "a", head: int = 0, tail: int = 1, most: int = 3) -> None:
        self.log_id, self.head, self.tail, self.most = log_id, head, tail, most

    def sweep(self, sequence: int) -> Sweep:
        return Sweep(unit="u1", log_id=self.log_id, log_sequence=sequence)

    def __call__(self, _unit: str, first: int) -> LogRecords:
        held = range(max(first, self.tail), self.head + 1)[: self.most]
        return LogRecords(log_id=self.log_id, head=self.head, tail=self.tail, sweeps=map(self.sweep, held))


class Asking(UnitReader):
    """A reader, and the log that it asks."""

    def __init__(self, log, deliver, counts, cursor=None):
        super().__init__("u1", cursor, deliver, counts)
        self._log = log

    def came(self, *live):
        for sweep in live:
            self.strangers.note(sweep)
        self.strangers.ask()
        return any(self.is_behind(sweep.log_id, sweep.log_sequence) for sweep in live)

    def ask_log(self):
        return self.read(self._log(self.unit, self.cursor.log_sequence + 1))


def reader(log, delivered, cursor=None):
    counts = Counter()
    return Asking(log, delivered.extend, counts, cursor), counts


def sequences(delivered):
    return [sweep.log_sequence for sweep in delivered]


def read_to_head(unit):
    while unit.ask_log():
        pass


def test_the_first_answer_of_a_log_that_was_never_read_is_read_at_once_from_its_tail():
    delivered = []
    unit, counts = reader(Log(head=6, tail=4, most=2), delivered)
    assert unit.ask_log()
    assert sequences(delivered) == [4, 5]
    assert not unit.ask_log()
    assert sequences(delivered) == [4, 5, 6]
    assert counts == Counter(delivered=3)


def test_a_live_sweep_has_the_log_asked_and_what_lies_between_comes_too():
    delivered, log = [], Log(head=9)
    unit, counts = reader(log, delivered, Cursor(unit="u1", log_id="a", log_sequence=2))
    assert not unit.came(log.sweep(1), log.sweep(2))
    assert unit.came(log.sweep(3), log.sweep(9))
    assert delivered == []
    read_to_head(unit)
    assert sequences(delivered) == [3, 4, 5, 6, 7, 8, 9]
    assert counts == Counter(delivered=7)


def test_a_log_seen_for_the_first_time_is_read_from_its_tail_and_nothing_counts_as_lost():
    delivered = []
    unit, counts = reader(Log(head=12, tail=8), delivered)
    read_to_head(unit)
    assert sequences(delivered) == [8, 9, 10, 11, 12]
    assert counts["lost"] == 0


def test_what_was_removed_unread_is_counted_as_lost(caplog):
    delivered = []
    unit, counts = reader(Log(head=12, tail=8), delivered, Cursor(unit="u1", log_id="a", log_sequence=5))
    read_to_head(unit)
    assert sequences(delivered) == [8, 9, 10, 11, 12]
    assert counts["lost"] == 2
    assert "unit u1: sweeps 6 to 7 were removed from its log unread" in caplog.text


@pytest.mark.parametrize("tail", [13, 0])  # how a log without records shows its tail is its gateway's affair
def test_a_log_that_has_let_go_of_everything_is_passed_over(tail):
    delivered, log = [], Log(head=12, tail=13)
    log.tail = tail
    unit, counts = reader(
        lambda *_: LogRecords(log_id="a", head=12, tail=tail), delivered, Cursor(log_id="a", log_sequence=5)
    )
    assert not unit.ask_log()
    assert (delivered, counts["lost"], unit.cursor.log_sequence) == ([], 7, 12)
    log.head = 13
    assert not unit.read(log("u1", 13))
    assert sequences(delivered) == [13]


def test_a_new_log_is_read_from_its_tail_and_an_old_one_from_where_it_was_left():
    delivered, old = [], Log("old", head=3)
    logs = [old]
    unit, counts = reader(lambda *query: logs[0](*query), delivered)
    read_to_head(unit)
    logs[0] = Log("new", head=20, tail=19)
    assert unit.came(logs[0].sweep(20))
    read_to_head(unit)
    old.head = 5
    logs[0] = old
    assert unit.came(old.sweep(5))
    read_to_head(unit)
    assert [(sweep.log_id, sweep.log_sequence) for sweep in delivered] == [
        *(("old", 1), ("old", 2), ("old", 3)),
        *(("new", 19), ("new", 20)),
        *(("old", 4), ("old", 5)),
    ]
    assert counts["lost"] == 0


def test_a_log_that_has_another_identity_at_each_reply_is_told_so_that_the_asker_waits():
    """A forged log that did so was asked 18,541 times in 15 s."""
    replies = (LogRecords(log_id=f"log-{number}", head=9, tail=1) for number in range(10_000))
    unit, _ = reader(lambda *_: next(replies), [], Cursor(unit="u1", log_id="a", log_sequence=3))
    assert unit.ask_log()  # one new log is none too many
    for _ in range(9000):
        with pytest.raises(BusError, match="unit 'u1' answers with one log and then with another"):
            unit.ask_log()
    assert len(unit._left) <= MAX_LOGS_LEFT  # pyright: ignore[reportPrivateUsage]


def test_what_a_log_that_went_back_took_again_before_it_was_where_it_had_been_counts_as_lost(caplog):
    """Its sequences 4 to 9 stand for other sweeps now than those that were delivered."""
    delivered = []
    log = Log(head=3)
    unit, counts = reader(log, delivered, Cursor(unit="u1", log_id="a", log_sequence=9))
    for head in (3, 5):
        log.head = head
        with pytest.raises(BusError, match="ends at"):
            unit.ask_log()
        assert not unit.came(log.sweep(head))
    log.head = 12
    read_to_head(unit)
    assert sequences(delivered) == [10, 11, 12]
    assert counts["lost"] == 6
    assert "sweeps 4 to 9 of its log were not read: others were delivered with their sequences before" in caplog.text


def test_a_log_that_went_back_is_told_and_nothing_is_delivered():
    delivered = []
    unit, _ = reader(Log(head=3), delivered, Cursor(unit="u1", log_id="a", log_sequence=9))
    with pytest.raises(BusError, match=r"ends at 3 and was read to 9: .*noctule-gateway repair DATA --unit u1"):
        unit.ask_log()
    assert delivered == []


def spoiled(sequence, **fields):
    return Sweep(unit="u1", log_id="a", log_sequence=sequence, clock_error_s=-1.0, **fields)


@pytest.mark.parametrize(
    ("record", "told"),
    [
        (spoiled(4), "clock_error_s is -1: give 0 to"),
        (spoiled(2**60), "log_sequence is 1152921504606846976: give 0 to 9007199254740991"),
        (spoiled(0), "clock_error_s is -1"),
        (Sweep(unit="u2", log_id="a", log_sequence=4), "it is a sweep of unit 'u2'"),
        (Sweep(unit="u1", log_id="b", log_sequence=4), "it is a sweep of log 'b', and this is log 'a'"),
        (Sweep(unit="u1", log_id="a", log_sequence=99), "its sequence is 99, and the log ends at 5"),
    ],
)
@pytest.mark.parametrize("head", [4, 5])
def test_a_record_that_is_none_of_the_log_is_passed_over_and_told(caplog, record, told, head):
    delivered, good = [], [Log(head=5).sweep(n) for n in (3, 5)][: head - 3]
    records = LogRecords(log_id="a", head=head, tail=1, sweeps=[good[0], record, *good[1:]])
    unit, counts = reader(lambda *_: records, delivered, Cursor(unit="u1", log_id="a", log_sequence=2))
    assert not unit.ask_log()
    assert sequences(delivered) == [3, 5][: head - 3]
    assert unit.cursor.log_sequence == head
    assert (counts["refused"], counts["lost"]) == (1, 0)
    assert "the first is 4: " + told.replace("ends at 5", f"ends at {head}") in caplog.text


@given(st.data())
def test_whatever_records_are_spoiled_the_others_come_and_the_log_is_read_to_its_head(data):
    head = data.draw(st.integers(1, 12))
    bad = data.draw(st.sets(st.integers(1, head)))
    sweeps = [
        spoiled(data.draw(st.just(n) | st.integers(0, 2**64 - 1))) if n in bad else Log().sweep(n)
        for n in range(1, head + 1)
    ]

    def log(_unit, first):
        return LogRecords(log_id="a", head=head, tail=1, sweeps=sweeps[first - 1 :][:3])

    delivered = []
    unit, _ = reader(log, delivered, Cursor(unit="u1", log_id="a"))
    read_to_head(unit)
    assert set(sequences(delivered)) == set(range(1, head + 1)) - bad
    assert unit.cursor.log_sequence == head


def test_a_log_that_sends_nothing_of_what_it_says_it_holds_is_told():
    unit, _ = reader(lambda *_: LogRecords(log_id="a", head=9, tail=4), [], Cursor(log_id="a", log_sequence=3))
    with pytest.raises(BusError, match="says that it holds 4 to 9 and sends nothing"):
        unit.ask_log()


def gap(first, last, damaged=True):
    return LogGap(first=first, last=last, damaged=damaged, reason="its checksum does not fit")


@pytest.mark.parametrize(
    ("held", "head", "gaps", "counted"),
    [
        ([4, 5, 8], 8, [gap(6, 7)], 2),
        ([8], 8, [gap(4, 7)], 4),
        ([4, 5], 8, [gap(6, 8)], 3),
        ([], 8, [gap(4, 8)], 5),
        ([], 1004, [gap(4, 4), gap(5, 1004, damaged=False)], 1),  # commits that a power cut took, then skipped numbers
        ([4, 1005], 1005, [gap(5, 1004, damaged=False)], 0),
    ],
)
def test_what_a_log_states_as_damaged_is_passed_over_and_counted_and_what_was_never_used_is_not(
    caplog, held, head, gaps, counted
):
    delivered, sweeps = [], [Log().sweep(n) for n in held]
    records = LogRecords(log_id="a", head=head, tail=1, sweeps=sweeps, gaps=gaps)
    unit, counts = reader(lambda *_: records, delivered, Cursor(unit="u1", log_id="a", log_sequence=3))
    assert not unit.ask_log()
    assert sequences(delivered) == held
    assert unit.cursor.log_sequence == head
    assert (counts["damaged"], counts["lost"]) == (counted, 0)
    assert ("of its log are lost: its checksum does not fit" in caplog.text) == bool(counted)


def test_nothing_has_moved_when_the_delivery_raised():
    log, stored = Log(head=2), []
    faults = iter([OSError("disk full"), OSError("disk full")])

    def deliver(sweeps):
        for fault in faults:
            raise fault
        stored.extend(sweeps)

    counts = Counter()
    unit = Asking(log, deliver, counts, Cursor(unit="u1", log_id="a"))
    for _ in range(2):
        with pytest.raises(OSError, match="disk full"):
            unit.ask_log()
    assert unit.cursor.log_sequence == 0
    assert counts["delivered"] == 0
    read_to_head(unit)
    assert sequences(stored) == [1, 2]


@given(st.data())
def test_delivered_and_lost_make_up_the_whole_log_in_order(data):
    log, delivered = Log(), []
    unit, counts = reader(log, delivered, Cursor(unit="u1", log_id="a"))
    for _ in range(data.draw(st.integers(1, 20))):
        log.head += data.draw(st.integers(0, 6))
        log.tail = data.draw(st.integers(log.tail, log.head + 1))
        live = data.draw(st.lists(st.integers(max(1, log.head - 6), max(1, log.head)), max_size=6)) if log.head else []
        if unit.came(*map(log.sweep, live)) or data.draw(st.booleans()):
            unit.ask_log()
    read_to_head(unit)
    read = sequences(delivered)
    assert read == sorted(set(read))
    assert len(read) + counts["lost"] == log.head == unit.cursor.log_sequence
    assert (counts["delivered"], counts["refused"]) == (len(read), 0)


SEQUENCES = st.integers(0, 12) | st.sampled_from([2**53 - 1, 2**53 - 2])
IDS = st.sampled_from(["a", "b", ""])
REPLIES = st.builds(
    LogRecords,
    log_id=IDS,
    head=SEQUENCES,
    tail=SEQUENCES,
    sweeps=st.lists(
        st.builds(Sweep, unit=st.sampled_from(["u1", "u1", "u2"]), log_id=IDS, log_sequence=SEQUENCES), max_size=6
    ),
    gaps=st.lists(st.builds(LogGap, first=SEQUENCES, last=SEQUENCES, damaged=st.booleans()), max_size=3),
)


@given(replies=st.lists(REPLIES, min_size=1, max_size=8))
def test_whatever_a_log_replies_a_reader_goes_on_or_waits_and_skips_nothing_uncounted(replies):
    """True asks again at once: without progress that would be for ever."""
    delivered = []
    unit, counts = reader(None, delivered)
    for reply in replies:
        before, counted = unit.cursor, counts.copy()
        try:
            more = unit.read(reply)
        except BusError:
            more = False  # asked again later and later
        after = unit.cursor
        assert not more or after != before
        if after.log_id != before.log_id:
            continue
        assert before.log_sequence <= after.log_sequence <= max(reply.head, before.log_sequence)
        unused = {
            sequence
            for gap in reply.gaps
            if not gap.damaged
            for sequence in range(max(gap.first, before.log_sequence + 1), min(gap.last, after.log_sequence, 20) + 1)
        }
        passed = after.log_sequence - before.log_sequence
        told = sum((counts - counted)[name] for name in ("delivered", "lost", "damaged", "refused"))
        assert told >= passed - len(unused) or after.log_sequence > 20
    by_log = {}
    for sweep in delivered:
        assert sweep.log_sequence > by_log.get(sweep.log_id, 0)
        by_log[sweep.log_id] = sweep.log_sequence


def forged(sequence):
    return Sweep(unit="u1", log_id="a", log_sequence=sequence, waypoint=77)


@pytest.mark.parametrize("most", [1, 9])
@pytest.mark.parametrize("first", ["a stranger's", "its own"])
def test_of_two_live_sweeps_with_one_number_the_logs_own_is_delivered_and_the_strangers_told_once(first, most, caplog):
    delivered, log = [], Log(head=7, most=most)
    unit, counts = reader(log, delivered, Cursor(unit="u1", log_id="a", log_sequence=4))
    both = [forged(5), forged(6), *map(log.sweep, (5, 6, 7))]
    assert unit.came(*(both if first == "a stranger's" else reversed(both)))
    read_to_head(unit)
    assert delivered == [log.sweep(n) for n in (5, 6, 7)]
    assert counts == Counter(delivered=3, refused=2)
    (told,) = [record.getMessage() for record in caplog.records]
    assert "is not in that log, which ends at 7, and is not taken: somebody else publishes" in told


def test_live_sweeps_beyond_the_logs_head_move_no_cursor_and_its_own_come_under_their_numbers(caplog):
    """Before, they were taken as 5 to 8, the log's own were refused, and the log seemed to have gone back."""
    delivered, log = [], Log(head=4)
    unit, counts = reader(log, delivered, Cursor(unit="u1", log_id="a", log_sequence=4))
    assert unit.came(*map(forged, (5, 6, 7, 8, 2**53 - 1)))
    assert not unit.ask_log()
    assert (delivered, unit.cursor.log_sequence, counts["refused"]) == ([], 4, 5)
    log.head = 8
    assert unit.came(log.sweep(8))
    read_to_head(unit)
    assert delivered == [log.sweep(n) for n in (5, 6, 7, 8)]
    assert counts == Counter(delivered=4, refused=5)
    (told,) = [record.getMessage() for record in caplog.records]
    assert told.startswith("unit u1: what came live as sweep 5 of log a is not in that log, which ends at 4")


def test_a_live_sweep_that_comes_again_and_again_is_no_strangers(caplog):
    delivered, log = [], Log(most=2)
    unit, counts = reader(log, delivered, Cursor(unit="u1", log_id="a", log_sequence=0))
    for log.head in range(3, 500, 3):
        assert unit.came(*(log.sweep(max(n, 1)) for n in range(log.head - 100, log.head + 1)))
        read_to_head(unit)
    assert sequences(delivered) == list(range(1, 499))
    assert (counts["refused"], caplog.records) == (0, [])
