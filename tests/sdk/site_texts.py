"""Site files as tests write them."""

from pathlib import Path

from noctule import site

HEAD = 'site = "room"\n'

UNIT = '[[unit]]\nname = "u1"\nserial = 1\naddress = "/dev/ttyUSB0"\n'

HERE = "pose = { x_m = 1, y_m = 2, heading_deg = 90 }\n"


def load(tmp_path: Path, text: str) -> site.Site:
    path = tmp_path / "site.toml"
    path.write_text(text)
    return site.load(path)
