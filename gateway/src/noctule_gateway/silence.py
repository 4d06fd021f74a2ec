"""Whether anybody is still there: how many time-outs in a row there have been, and what came between them."""

SILENT_AFTER = 6  # time-outs in a row, and nothing between them
GARBLED_AFTER = 60  # time-outs in a row, and between them nothing that can be read


class Silence:
    """Time-outs since something came, and since something that could be read came."""

    def __init__(self) -> None:
        self._nothing_came = self._nothing_read = 0

    def timed_out(self) -> None:
        """An answer has not come."""
        self._nothing_came += 1
        self._nothing_read += 1

    def garbled(self) -> None:
        """Something has come that can't be read."""
        self._nothing_came = 0

    def broken(self) -> None:
        """Something has come that can be read, or all begins anew."""
        self._nothing_came = self._nothing_read = 0

    @property
    def lasts(self) -> bool:
        """There is nobody any more, or nobody to be understood."""
        return self._nothing_came >= SILENT_AFTER or self._nothing_read >= GARBLED_AFTER
