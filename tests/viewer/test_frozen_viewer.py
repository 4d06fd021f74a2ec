"""Somebody whose viewer is frozen holds up neither those who draw nor those who watch beside."""

from pathlib import Path

from mapper.rerun_relay import relay, viewer
from mapper.test_rerun_link import draw_noise, link, put_s, text, wait_for_drawn
from system.processes import wait_until

from noctule_mapper.rerun_view.drawing import Drawing

HELD_UP_S = 2.0  # far under the 5 s that a blocked put would take, far over what a busy machine adds
DRAWINGS = 100  # of 190 kB each: far more than the buffers of a line hold


def test_a_frozen_viewer_holds_up_neither_the_mapper_nor_other_viewers(tmp_path: Path) -> None:
    slowest_s = 0.0
    frozen_folder, beside_folder = tmp_path / "frozen", tmp_path / "beside"
    frozen_folder.mkdir()
    beside_folder.mkdir()
    with relay() as far_end:
        far_end.start()
        with (
            link(far_end.url) as line,
            viewer(far_end.url, frozen_folder) as frozen,
            viewer(far_end.url, beside_folder) as beside,
        ):
            line.put(text("greeting", "hello"))
            for watching in (frozen, beside):
                watching.wait_for("greeting")
            frozen.freeze()
            for number in range(DRAWINGS):
                drawing = Drawing(draw_noise, (number,), time_s=float(number), sweep=number)
                slowest_s = max(slowest_s, put_s(line, drawing))
                wait_for_drawn(line, number + 2)
            line.put(text("farewell", "goodbye"))
            beside.wait_for("farewell")
            seen = sum(chunk.num_rows for chunk in frozen.seen()["noise"])
            frozen.thaw()
            wait_until(lambda: frozen.wait_for("farewell"), "a viewer that goes on does not see the present")
    assert slowest_s < HELD_UP_S
    assert seen < DRAWINGS / 2, "the viewer was not frozen, so that this shows nothing"
