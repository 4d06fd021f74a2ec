"""The live mapper as a process: its signals, its log, and how it ends. It never goes on with a part of it dead."""

import logging
import os
import signal
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from noctule import tls
from noctule.errors import NoctuleError
from noctule.threads import FAILED, end_process_when_one_fails
from noctule_mapper.live import service
from noctule_mapper.live.config import LiveConfig, load_live

_CLOSE_WITHIN_S = 15.0

_log = logging.getLogger(__name__)


def run_process(
    site: str,
    name: str | None,
    data: Path,
    connect: Sequence[str],
    rerun_url: str | None,
    config: Path | None,
    tls_folder: Path | None,
) -> NoReturn:
    """Map ``site`` until SIGTERM or SIGINT, then end the process: status 0; 1 for what an operator can put in order;
    70 where a part of the mapper has failed, so that its supervisor starts it again.

    ``name`` None is the name in the certificate of ``tls_folder``, or "mapper".
    """
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    end_process_when_one_fails()
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: _stop(stop))
    try:
        parameters = load_live(config) if config else LiveConfig()
        name = name or tls.service_name(tls_folder, "mapper")
        service.run(service.LiveSettings(site, name, data, connect, rerun_url, parameters, tls_folder), stop)
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


def _stop(stop: threading.Event) -> None:
    """Begin to close, and end even if a part can't be closed: the store is safe at any moment."""
    stop.set()
    last_resort = threading.Timer(_CLOSE_WITHIN_S, _give_up)
    last_resort.daemon = True
    last_resort.start()


def _give_up() -> NoReturn:
    _log.error("not closed within %g s: ended as it is; nothing stored is lost", _CLOSE_WITHIN_S)
    logging.shutdown()
    os._exit(1)
