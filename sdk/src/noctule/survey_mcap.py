"""Surveys as MCAP files: one channel per unit, the schema inside, a sweep's start as its time (noctule[cli])."""

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO

from mcap.reader import NonSeekingReader
from mcap.stream_reader import CRCValidationError
from mcap.writer import Writer

from noctule import bounds, bus, keys
from noctule.errors import BoundsError, SurveyCutError, SurveyError
from noctule.messages_pb2 import Sweep

_SCHEMA = Sweep.DESCRIPTOR.full_name
_ENCODING = "protobuf"
_MAGIC = b"\x89MCAP0\r\n"  # how a file begins and ends
# One sweep a chunk: each has a checksum of its own, and a cut costs only the sweep that it goes through.
_CHUNK_BYTES = 1


def read_each(path: Path) -> Iterator[Sweep | SurveyError]:
    """The sweeps of an MCAP file in the order in which they were written, an error in place of one with a value beyond
    its bounds; other messages in it are passed over.

    Raises SurveyCutError at the place where the file was cut, SurveyError where a bit of it has changed.
    """
    number = 0
    try:
        with path.open("rb") as stream:
            for schema, _, message in NonSeekingReader(stream, validate_crcs=True).iter_messages(log_time_order=False):
                if schema is not None and schema.name == _SCHEMA:
                    number += 1
                    yield _decoded(message.data, f"{path}, sweep {number}")
    except OSError as error:
        raise SurveyError(f"{path} can't be read: {error.strerror}") from error
    except CRCValidationError as error:
        raise SurveyError(f"{path} is not a whole MCAP file of sweeps: {error}") from error
    except Exception as error:  # on broken data the library raises whatever its parts raise
        if _was_cut(path):
            cut = f"{path} is not a whole MCAP file of sweeps: it was cut after sweep {number}"
            raise SurveyCutError(cut) from error
        raise SurveyError(f"{path} is not a whole MCAP file of sweeps: {error}") from error


def _was_cut(path: Path) -> bool:
    """Whether the file begins as an MCAP file does, and does not end as one."""
    with path.open("rb") as stream:
        head = stream.read(len(_MAGIC))
        stream.seek(max(stream.seek(0, os.SEEK_END) - len(_MAGIC), len(head)))
        return _MAGIC.startswith(head) and stream.read() != _MAGIC


def _decoded(payload: bytes, where: str) -> Sweep | SurveyError:
    try:
        return bounds.decode(Sweep, payload)
    except BoundsError as error:
        return SurveyError(f"{where}: {error}")


def write(sweeps: Iterable[Sweep], stream: IO[bytes]) -> None:
    """Write a whole MCAP file; a unit's channel is named as the key on which its sweeps were published."""
    writer = Writer(stream, chunk_size=_CHUNK_BYTES)
    writer.start(library="noctule")
    schema = bus.file_descriptor_set(Sweep.DESCRIPTOR.file).SerializeToString()
    schema_id = writer.register_schema(_SCHEMA, _ENCODING, schema)
    channels: dict[str, int] = {}
    for sweep in sweeps:
        topic = keys.sweep(sweep.site, sweep.unit)
        if topic not in channels:
            channels[topic] = writer.register_channel(topic, _ENCODING, schema_id)
        start_ns = sweep.start.ToNanoseconds()
        writer.add_message(channels[topic], start_ns, sweep.SerializeToString(), start_ns)
    writer.finish()
