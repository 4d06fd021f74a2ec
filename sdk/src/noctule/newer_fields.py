"""Messages with fields that this version does not know: they are read without these fields, and counted."""

import logging
import threading

from google.protobuf.message import Message

_log = logging.getLogger(__name__)


class NewerFields:
    """Counts such messages; the log names each kind of message once. From any thread."""

    def __init__(self) -> None:
        self.count = 0
        self._told: set[str] = set()
        self._lock = threading.Lock()

    def note(self, message: Message, payload: bytes) -> None:
        """``message`` was read from ``payload``. It keeps its unknown fields, so a copy of it is whole."""
        known = type(message).FromString(payload)
        known.DiscardUnknownFields()
        if known.ByteSize() == message.ByteSize():
            return
        name = message.DESCRIPTOR.name
        with self._lock:
            self.count += 1
            news = name not in self._told
            self._told.add(name)
        if news:
            _log.warning("%s messages have fields of a newer version, which are ignored: update this program", name)
