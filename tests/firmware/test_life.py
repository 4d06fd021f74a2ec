"""A unit's life (firmware/README.md, Flash): the number that tells boots that bear the same boot number."""

import re
import socket
import struct
import subprocess
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from firmware.images import with_flash
from firmware.stepped_unit import IMAGE, SteppedUnit, stepped_unit

from noctule_gateway.wire.codec import FrameReader, encode
from noctule_gateway.wire.frames import NO_LIFE, AskHello, Hello, Outcome, Reset

LIFE_PAGE, BOOT_PAGES = 0xF000, (0xF200, 0xF400)
LIFE = 0x12345678
SOUND_LIFE = struct.pack("<II", LIFE, LIFE ^ 0xFFFFFFFF)
SOUND_BOOT = struct.pack("<HH", 40, 40 ^ 0xFFFF)
NO_BOOT = bytes(4)


def power_cycle(unit: SteppedUnit) -> Hello:
    unit.inject("power_cut", for_s=0.2)
    return unit.receive(Hello)


def test_a_life_lasts_over_resets_and_power_cuts_whatever_memory_holds_then():
    with stepped_unit() as unit:
        life = unit.greet().life
        assert life != NO_LIFE
        assert unit.command(Reset(0)) == Outcome.DONE
        assert unit.receive(Hello).life == life
        assert [power_cycle(unit).life for _ in range(3)] == [life] * 3


def test_no_two_units_have_the_same_life():
    lives = set()
    for seed in range(4):
        with stepped_unit("--seed", str(seed)) as unit:
            lives.add(unit.greet().life)
    assert len(lives) == 4


def test_the_life_in_flash_holds(tmp_path):
    contents = {LIFE_PAGE: SOUND_LIFE, BOOT_PAGES[0]: SOUND_BOOT}
    with stepped_unit(image=with_flash(IMAGE, contents, tmp_path / "kept.ihx")) as unit:
        hello = unit.greet()
        assert (hello.life, hello.boot) == (LIFE, 41)


def test_a_life_ends_where_boot_numbers_begin_again(tmp_path):
    contents = {LIFE_PAGE: SOUND_LIFE, BOOT_PAGES[0]: NO_BOOT, BOOT_PAGES[1]: NO_BOOT}
    with stepped_unit(image=with_flash(IMAGE, contents, tmp_path / "again.ihx")) as unit:
        hello = unit.greet()
        assert hello.boot == 1
        assert hello.life not in (LIFE, NO_LIFE)
        assert power_cycle(unit).life == hello.life


def test_a_page_that_is_not_sound_holds_no_life(tmp_path):
    for number, page in enumerate((SOUND_LIFE[:7] + b"\x00", bytes(4) + b"\xff" * 4)):
        contents = {LIFE_PAGE: page, BOOT_PAGES[0]: SOUND_BOOT}
        with stepped_unit(image=with_flash(IMAGE, contents, tmp_path / f"{number}.ihx")) as unit:
            hello = unit.greet()
            assert hello.boot == 41
            assert hello.life not in (LIFE, NO_LIFE)


def test_wherever_the_power_fails_no_two_boots_have_the_same_life_and_number(tmp_path):
    # The life is sound and the boot numbers are lost, so every page is erased and written in the first boot: 3 erases,
    # 4 bytes of the boot page and 1 of its tally, 8 of the life.
    contents = {LIFE_PAGE: SOUND_LIFE, BOOT_PAGES[0]: NO_BOOT, BOOT_PAGES[1]: NO_BOOT}
    image = with_flash(IMAGE, contents, tmp_path / "again.ihx")
    for operation in range(1, 18):
        with stepped_unit("--seed", str(operation), image=image) as unit:
            unit.step(fault={"kind": "power_cut_at_flash_operation", "number": operation})
            boots = []
            for _ in range(3):
                hello = unit.receive(Hello)
                boots.append((hello.life, hello.boot))
                unit.inject("power_cut", for_s=0.2)
        assert LIFE not in {life for life, _ in boots}
        assert all(life == before and number > boot for (before, boot), (life, number) in pairwise(boots))


def test_a_host_of_protocol_2_gets_the_hello_that_it_can_read():
    with stepped_unit() as unit:
        assert unit.greet().life != NO_LIFE
        unit.send(AskHello(9, protocol=2))
        hello = unit.receive(Hello)
        assert (hello.request, hello.protocol, hello.life) == (9, 3, NO_LIFE)


def life_of_a_run(image: Path) -> int:
    """The life of a unit in noctule-sim that keeps no flash, by the default seed."""
    command = ["noctule-sim", "--firmware", str(image), "--tcp", "127.0.0.1:0", "--speed", "10"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as simulator:
        try:
            assert simulator.stdout is not None
            found = re.search(r"127\.0\.0\.1:(\d+)", simulator.stdout.readline())
            assert found is not None
            with socket.create_connection(("127.0.0.1", int(found[1])), timeout=120) as line:
                return next(hellos(line)).life
        finally:
            simulator.terminate()


def hellos(line: socket.socket) -> Iterator[Hello]:
    """The unit's answers, while it is asked again and again: the first words may be lost."""
    reader = FrameReader()
    while True:
        line.sendall(encode(AskHello(1)))
        yield from (frame for frame in reader.feed(line.recv(4096)) if isinstance(frame, Hello))


def test_a_simulated_unit_whose_flash_is_not_kept_has_another_life_in_each_run_of_the_same_seed():
    assert life_of_a_run(IMAGE) != life_of_a_run(IMAGE)
