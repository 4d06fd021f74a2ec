"""The errors that Noctule raises for bad input: each says what was wrong, where, and what to do."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


class NoctuleError(Exception):
    """Base of all errors that a caller can do something about."""


def in_words(error: Exception) -> str:
    """What a command says of an error: of one of the system's which file it is, without Python's number."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename is not None else error.strerror
    return str(error)


class KeyFormatError(NoctuleError):
    """A name or key that does not fit the key scheme."""


class SiteFileError(NoctuleError):
    """A site file that can't be read or does not make sense: a line for each mistake, which begins with the file."""


class SurveyError(NoctuleError):
    """A file of sweeps that can't be read; the message names the line."""


class SurveyCutError(SurveyError):
    """A file of sweeps that ends too early: what comes before the cut can be read."""


class ReportError(NoctuleError):
    """A report of a unit that can't be written."""


class ScanError(NoctuleError):
    """A file of a scanner's own that can't be imported; the message names file, place, column and value."""

    def __init__(
        self, file: "Path", problem: str, place: str = "", column: str = "", value: object | None = None
    ) -> None:
        """``place`` as in "line 12"; ``problem`` says what is wrong and what to do."""
        where = ", ".join([str(file), *([place] if place else []), *([f"column {column!r}"] if column else [])])
        super().__init__(f"{where}: {problem}")
        self.file, self.place, self.column, self.value = file, place, column, value


class BoundsError(NoctuleError):
    """A message with a value that nothing real has, or bytes that are no such message; it names the field."""


class BusError(NoctuleError):
    """The bus gave no answer, or one that can't be used."""


class SilenceError(BusError):
    """A question ran out of time: whether anybody could answer is not known."""


class NotServedError(BusError):
    """No gateway serves the unit that was asked or commanded."""


class BusConfigError(BusError):
    """An endpoint or a configuration that makes no sense, however long one waits."""


class TlsError(BusConfigError):
    """A folder of certificate and key that can't be used; the message never holds a part of a key."""


class CallerError(NoctuleError):
    """A command that does not say who gives it, where it must, or says it falsely."""


class FirmwareKeyError(NoctuleError):
    """A key of firmware images, or a file of such keys, that can't be used."""


class ImageSignatureError(NoctuleError):
    """A firmware image that is not what was signed; the message goes on after the image's name."""


class NoSignatureError(ImageSignatureError):
    """A firmware image that nobody has signed."""


class UnknownKeyError(ImageSignatureError):
    """A firmware image signed by none of the known keys."""


class ImageVersionError(NoctuleError):
    """A file that does not say which firmware it is."""
