"""What floods a unit with commands is refused in words, and a stop is carried out all the same."""

from concurrent.futures import Future

from noctule.caller import Who
from noctule.messages_pb2 import CommandReply, CommandRequest
from noctule_gateway.bus.command_cache import MAX_UNDER_WAY, CommandCache
from noctule_gateway.link.order_queue import OrderQueue
from noctule_gateway.link.standing_orders import StandingOrders, Wanted
from noctule_gateway.wire import frames, orders

ANNA = Who("operator.anna.g1", signed=True)


class Slow:
    """A unit that answers when it is asked to; ``begun`` are the commands that have reached it."""

    def __init__(self) -> None:
        self.begun: list[tuple[str, CommandRequest]] = []
        self.replies: list[Future[CommandReply]] = []

    def __call__(self, name: str, request: CommandRequest, _who: Who) -> Future[CommandReply]:
        self.begun.append((name, request))
        self.replies.append(Future())
        return self.replies[-1]


def unrecorded(_command: str, _request_id: str, _who: Who, _why: str) -> None:
    """Refusals are of no interest here."""


def request(number: int, image: bytes = b"") -> CommandRequest:
    return CommandRequest(request_id=f"r{number}", image=image)


def test_of_twenty_thousand_commands_sixteen_wait_and_the_others_are_refused_in_words() -> None:
    """20,000 orders to one unit took 250 MB, and the operator's stop timed out."""
    unit = Slow()
    cache = CommandCache(unit, unrecorded)
    replies = [cache.carry_out("home", request(number), ANNA) for number in range(20_000)]
    assert len(unit.begun) == MAX_UNDER_WAY == 16
    assert cache.refused == 20_000 - 16
    told = replies[-1].result(0)
    assert (told.request_id, told.done) == ("r19999", False)
    assert told.error == "16 commands to this unit are under way: wait until they are answered, then try again"
    cache.carry_out("stop", request(20_000), ANNA)
    assert unit.begun[-1][0] == "stop"


def test_there_is_room_again_when_a_command_was_answered_and_a_refused_one_can_be_tried_again() -> None:
    unit = Slow()
    cache = CommandCache(unit, unrecorded)
    for number in range(17):
        cache.carry_out("home", request(number), ANNA)
    unit.replies[0].set_result(CommandReply(done=True))
    again = cache.carry_out("home", request(16), ANNA)
    assert not again.done()
    assert len(unit.begun) == 17


def test_of_a_hundred_images_one_is_kept_and_none_with_a_command_that_needs_none() -> None:
    """100 images of a megabyte were kept."""
    unit, image = Slow(), b":" * 2**20
    cache = CommandCache(unit, unrecorded)
    refused = [cache.carry_out("update", request(number, image), ANNA) for number in range(100)][1:]
    assert all("the unit is being updated" in reply.result(0).error for reply in refused)
    assert all(reply.result(0).under_way for reply in refused)
    cache.carry_out("home", request(100, image), ANNA)
    assert [len(request.image) for _, request in unit.begun] == [2**20, 0]


def test_a_stop_goes_before_all_orders_that_wait() -> None:
    queue = OrderQueue(StandingOrders(Wanted(None, orders.start(0.0), False)))
    for number in range(16):
        queue.add(frames.Home(number))
    queue.add(frames.Stop(16))
    assert isinstance(queue.give(), frames.Stop)


def test_an_id_that_was_used_for_another_command_is_refused_and_not_answered_with_that_ones_result() -> None:
    """`stop` under the id of an earlier `start` was answered "done", and the unit went on."""
    unit, told = Slow(), []
    cache = CommandCache(unit, lambda *refusal: told.append(refusal))
    start = CommandRequest(request_id="mine", pause_s=2.0)
    first = cache.carry_out("start", start, ANNA)
    first.set_result(CommandReply(request_id="mine", done=True))
    for name, other in (("stop", CommandRequest(request_id="mine")), ("start", CommandRequest(request_id="mine"))):
        refused = cache.carry_out(name, other, ANNA).result(0)
        assert (refused.request_id, refused.done) == ("mine", False)
        assert refused.error == "its request_id was used for another command (start): give each command its own"
    assert cache.carry_out("start", CommandRequest(request_id="mine", pause_s=2.0), ANNA) is first
    assert len(unit.begun) == 1
    assert cache.refused == 2
    cache.carry_out("home", CommandRequest(), ANNA)
    assert [(command, request_id, who) for command, request_id, who, _ in told] == [
        ("stop", "mine", ANNA),
        ("start", "mine", ANNA),
        ("home", "", ANNA),
    ]
    assert [why.partition(":")[0] for *_, why in told] == [
        "its request_id was used for another command (start)",
        "its request_id was used for another command (start)",
        "request_id is empty",
    ]


def test_an_update_that_is_asked_for_again_is_the_same_one_only_with_the_same_image() -> None:
    cache = CommandCache(Slow(), unrecorded)
    first = cache.carry_out("update", request(1, b":one"), ANNA)
    assert cache.carry_out("update", request(1, b":one"), ANNA) is first
    assert (
        "was used for another command (update)" in cache.carry_out("update", request(1, b":two"), ANNA).result(0).error
    )
