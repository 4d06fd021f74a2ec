"""A program that keeps the mapper of one site running, as ``noctule-mapper share`` does, and is quick to call it hung:

``one_site.py SITE DATA ENDPOINT HANGS_AFTER_S STARTS_WITHIN_S``
"""

import sys
import time
from pathlib import Path

from noctule.logs import LogFormat, set_up
from noctule_mapper.live.config import LiveConfig
from noctule_mapper.live.service import LiveSettings
from noctule_mapper.sharing.site_process import SiteProcess, forking_context

_STEP_S = 0.2  # as in noctule_mapper.sharing.service


def main() -> None:
    """Run until the process is killed."""
    site, data, endpoint, *limits_s = sys.argv[1:]
    set_up(LogFormat.TEXT)
    settings = LiveSettings(site, "m1", Path(data), [endpoint], None, LiveConfig())
    kept = SiteProcess(settings, LogFormat.TEXT, forking_context(), *map(float, limits_s))
    while True:
        kept.step(mine=True, other=None, now_s=time.monotonic())
        time.sleep(_STEP_S)


if __name__ == "__main__":
    main()
