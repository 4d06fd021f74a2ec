"""The live mapper as a process: its signals, its log, and how it ends. It never goes on with a part of it dead."""

import logging
import os
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from noctule import logs, tls
from noctule.ending import Ending
from noctule.errors import NoctuleError
from noctule.threads import FAILED, end_process_when_one_fails
from noctule_mapper.live import service
from noctule_mapper.live.config import LiveConfig, load_live

_log = logging.getLogger(__name__)


def run_process(
    site: str,
    name: str | None,
    data: Path,
    connect: Sequence[str],
    rerun_url: str | None,
    config: Path | None,
    tls_folder: Path | None,
    metrics_at: str | None,
    log_format: logs.LogFormat,
) -> NoReturn:
    """Map ``site`` until SIGTERM or SIGINT, then end the process: status 0; 1 for what an operator can put in order;
    70 where a part of the mapper has failed, so that its supervisor starts it again.

    ``name`` None is the name in the certificate of ``tls_folder``, or "mapper". ``metrics_at`` None serves no metrics.
    """
    logs.set_up(log_format)
    end_process_when_one_fails()
    ending = Ending()
    try:
        parameters = load_live(config) if config else LiveConfig()
        name = name or tls.service_name(tls_folder, "mapper")
        settings = service.LiveSettings(site, name, data, connect, rerun_url, parameters, tls_folder, metrics_at)
        service.run(settings, ending.begun)
        status = 0
    except NoctuleError as error:
        _log.error("%s", error)
        status = 1
    except BaseException:  # Zenoh's PanicException is no Exception
        _log.critical("the mapper has failed; a new start checks its store and goes on from it", exc_info=True)
        status = FAILED
    # All that matters is closed. On its way out Rerun's SDK would wait without end for a relay that takes nothing.
    logging.shutdown()
    os._exit(status)
