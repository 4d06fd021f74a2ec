"""Which firmware images are given to units: those signed by a known key and not older than allowed."""

from dataclasses import dataclass, replace
from pathlib import Path

from noctule import firmware_signature
from noctule.errors import ImageSignatureError
from noctule.firmware_rules import FirmwareRules
from noctule_gateway.errors import ImageError, RefusedImageError
from noctule_gateway.update.image import Image, parse


@dataclass(frozen=True)
class Admission:
    """Admits images by ``rules``. Without rules none is admitted, or, where it ``takes_unsigned``, every sound one.

    Only a gateway whose bus nobody but its own host's users can reach should take those.
    """

    rules: FirmwareRules | None = None
    takes_unsigned: bool = False

    def __str__(self) -> str:
        if self.rules is not None:
            oldest = ".".join(map(str, self.rules.oldest))
            return f"images from version {oldest} on, signed by {' or '.join(map(str, self.rules.keys))}, are taken"
        return f"every image is taken: {UNSIGNED}" if self.takes_unsigned else f"no image is taken: {NO_KEYS}"

    def load(self, path: Path) -> Image:
        """The image of a file, if it is admitted. Raises ImageError, RefusedImageError."""
        try:
            data = path.read_bytes()
        except OSError as error:
            raise ImageError(f"{path} can't be read: {error.strerror}") from error
        return self.admit(data, str(path))

    def admit(self, data: bytes, name: str) -> Image:
        """The image in ``data``, which errors call ``name``. Raises ImageError, RefusedImageError."""
        image = parse(data, name)
        if self.rules is None:
            if not self.takes_unsigned:
                raise RefusedImageError(f"{name} was not taken: {NO_KEYS}")
            return replace(image, signer=UNSIGNED)
        try:
            key = firmware_signature.check(data, self.rules.keys)
        except ImageSignatureError as error:
            raise RefusedImageError(f"{name} was not taken: {error}") from error
        if image.version < self.rules.oldest:
            oldest = ".".join(map(str, self.rules.oldest))
            raise RefusedImageError(
                f"{name} was not taken: it is version {image.version_text}, and {oldest} is the oldest that is allowed"
            )
        return replace(image, signer=f"signed by {key}")


NO_KEYS = (
    "there are no firmware keys. Add them to the fleet file (noctule-deploy firmware-key), render it and copy "
    "this gateway's folder again; without TLS, name a file of keys (--firmware)"
)
UNSIGNED = "signatures are not checked, because there are no firmware keys"
