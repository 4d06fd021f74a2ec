"""How much of a page goes into one PUT: less when blocks do not get through a bad line, more again when many do."""

BLOCK_BYTES = (128, 32, 16)
LARGER_AFTER = 32  # blocks that went through at once


class BlockSize:
    """The size of the blocks that the line takes at present."""

    def __init__(self) -> None:
        self._index = 0
        self._in_a_row = 0

    def cut(self, content: bytes, at: int) -> bytes:
        """The block of ``content`` that begins ``at`` and ends where blocks of this size do."""
        size = BLOCK_BYTES[self._index]
        return content[at : at + size - at % size]

    def went_through(self, at_once: bool) -> None:
        """A block was answered, at the first attempt or later."""
        self._in_a_row = self._in_a_row + 1 if at_once else 0
        if self._in_a_row == LARGER_AFTER and self._index > 0:
            self._index, self._in_a_row = self._index - 1, 0

    def failed(self) -> None:
        """An attempt was not answered."""
        self._in_a_row = 0

    def shrink(self) -> bool:
        """Take smaller blocks; False if there are none."""
        if self._index == len(BLOCK_BYTES) - 1:
            return False
        self._index += 1
        return True
