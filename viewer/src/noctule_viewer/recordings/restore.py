"""Give a relay that was started again what its last recording holds of the hours before, the newest first.

    python -m noctule_viewer.recordings.restore URL FILE BYTES

draws at most that many bytes. Layouts are left out: they come from those who draw now.
"""

import sys
import tempfile
import warnings
from pathlib import Path

import pyarrow
import rerun as rr
from rerun.chunk import Chunk, RrdReader

from noctule.ending import end_with
from noctule_viewer.recordings import rrd_file

_TIME = "log_time"
_FLUSH_TIMEOUT_S = 60.0
_SCHEMA_BYTES = 2_000  # of each chunk, beside its data


def restore(url: str, path: Path, most_bytes: int) -> None:
    """Send the relay at ``url`` the newest of ``path``, ``most_bytes`` of it. Raises RuntimeError where that fails."""
    # A file begins with up to a relay's whole memory, the newest in front; only what follows is in the order of time.
    read_bytes = 4 * most_bytes
    with tempfile.NamedTemporaryFile(suffix=".rrd") as part:
        part.write(rrd_file.excerpt(path, read_bytes))
        part.flush()
        with warnings.catch_warnings(action="ignore"):  # Rerun's, of a file without an index
            reader = RrdReader(part.name)
        for store in reader.recordings():
            recording = rr.RecordingStream(store.application_id, recording_id=store.recording_id)
            recording.connect_grpc(url)
            recording.send_chunks(_newest(reader.stream(store=store).to_chunks(), most_bytes))
            recording.flush(timeout_sec=_FLUSH_TIMEOUT_S)
            recording.disconnect()


def _newest(chunks: list[Chunk], most_bytes: int) -> list[Chunk]:
    """What has no time, and of all else the newest, in the order of time."""
    static = [chunk for chunk in chunks if chunk.is_static]
    timed = [(batch, chunk) for chunk in chunks if not chunk.is_static for batch in [chunk.to_record_batch()]]
    kept: list[Chunk] = []
    left_bytes = most_bytes
    for batch, chunk in sorted(timed, key=lambda each: _end_ns(each[0]), reverse=True):
        left_bytes -= batch.nbytes + _SCHEMA_BYTES
        if left_bytes < 0:
            break
        kept.append(chunk)
    return [*static, *reversed(kept)]


def _end_ns(batch: pyarrow.RecordBatch) -> int:
    if _TIME not in batch.schema.names:
        return 0
    return max(batch.column(_TIME).cast(pyarrow.int64()).to_pylist(), default=0)


if __name__ == "__main__":
    end_with(lambda: restore(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])))
