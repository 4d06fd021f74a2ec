"""Text from the bus as it is shown: what a terminal would obey, or a log take for lines of its own, is written out."""


def plain(text: str) -> str:
    """``text`` with control characters and line ends as they are written in Python: ESC becomes ``\\x1b``."""
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode("ascii") for each in text)
