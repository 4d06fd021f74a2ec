"""A signed image is taken by the key that signed it, and nothing else is: each refusal says what is wrong."""

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from hypothesis import given
from hypothesis import strategies as st

from noctule import firmware_rules, firmware_signature
from noctule.errors import FirmwareKeyError, ImageSignatureError, NoSignatureError, UnknownKeyError
from noctule.firmware_rules import FirmwareRules
from noctule.firmware_signature import MAX_SIGNATURES, PublicKey

IMAGE = b":021000000210DC\n:00000001FF\n"
# RFC 8032, section 7.1, tests 1 and 2.
SECRET = bytes.fromhex("9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60")
PUBLIC = bytes.fromhex("d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a")
OTHER = Ed25519PrivateKey.from_private_bytes(
    bytes.fromhex("4ccd089b28ff96da9db6c346ec114e0f5b8a319f35aba624da8cf6ed4fb8a6fb")
)
SECRET_KEY, KEY = Ed25519PrivateKey.from_private_bytes(SECRET), PublicKey("release", PUBLIC)
OTHERS = PublicKey("other", OTHER.public_key().public_bytes_raw())
SIGNED = firmware_signature.sign(IMAGE, SECRET_KEY)


def test_a_signed_image_is_the_image_and_one_line_more() -> None:
    assert SIGNED.startswith(IMAGE)
    (line,) = SIGNED.removeprefix(IMAGE).splitlines()
    assert line.startswith(f";noctule signature 1 {KEY.id} ".encode())
    assert firmware_signature.check(SIGNED, [OTHERS, KEY]) == KEY


def test_line_ends_are_not_signed_because_mail_changes_them() -> None:
    assert firmware_signature.check(SIGNED.replace(b"\n", b"\r\n") + b"\r\n", [KEY]) == KEY


def test_an_image_signed_by_two_keys_is_taken_by_each_and_signing_again_adds_nothing() -> None:
    both = firmware_signature.sign(SIGNED, OTHER)
    assert [firmware_signature.check(both, [key]) for key in (KEY, OTHERS)] == [KEY, OTHERS]
    assert sorted(firmware_signature.sign(both, SECRET_KEY).splitlines()) == sorted(both.splitlines())


@pytest.mark.parametrize(
    ("image", "error", "words"),
    [
        (IMAGE, NoSignatureError, "it is not signed: sign it"),
        (firmware_signature.sign(IMAGE, OTHER), UnknownKeyError, f"by key {OTHERS.id}, which is not known here; keys"),
        (SIGNED.replace(b"0210DC", b"0211DB"), ImageSignatureError, f"not what release ({KEY.id}) has signed"),
        (b":00000001FF\n" + SIGNED, ImageSignatureError, "was changed after that"),
        (SIGNED[:-5], ImageSignatureError, "is cut or damaged"),
        (SIGNED[: len(IMAGE) + 4], ImageSignatureError, "';noc' is cut or damaged"),
        (SIGNED.replace(b"signature 1", b"signature 2"), ImageSignatureError, "is cut or damaged"),
        (SIGNED + b"\xff", ImageSignatureError, "not an Intel HEX file"),
        (SIGNED + (SIGNED.splitlines()[-1] + b"\n") * MAX_SIGNATURES, ImageSignatureError, "9 signatures, and 8 are"),
    ],
)
def test_what_is_not_signed_is_refused_with_the_reason(
    image: bytes, error: type[ImageSignatureError], words: str
) -> None:
    with pytest.raises(error) as refused:
        firmware_signature.check(image, [KEY])
    assert words in str(refused.value)
    assert type(refused.value) is error


def test_a_file_that_is_cut_is_not_signed() -> None:
    with pytest.raises(ImageSignatureError, match="no end record"):
        firmware_signature.sign(IMAGE[:-14], SECRET_KEY)


@given(at=st.integers(0, len(SIGNED) - 1), value=st.integers(0, 255))
def test_no_byte_of_a_signed_image_can_be_another(at: int, value: int) -> None:
    changed = SIGNED[:at] + bytes([value]) + SIGNED[at + 1 :]
    try:
        firmware_signature.check(changed, [KEY])
    except ImageSignatureError:
        return
    assert _lines(changed) == _lines(SIGNED) or _lines(changed)[:-1] == _lines(SIGNED)[:-1]


@given(line=st.text(st.characters(codec="ascii"), max_size=200) | st.from_regex(r";noctule signature[ -~]*"))
def test_whatever_stands_in_a_signatures_place_is_refused_in_words(line: str) -> None:
    with pytest.raises(ImageSignatureError):
        firmware_signature.check(IMAGE + line.encode(), [KEY])


@given(end=st.integers(0, len(SIGNED) - 2))
def test_a_file_that_was_cut_anywhere_is_refused(end: int) -> None:
    with pytest.raises(ImageSignatureError):
        firmware_signature.check(SIGNED[:end], [KEY])


def test_rules_are_read_as_they_were_written(tmp_path) -> None:
    rules = FirmwareRules((KEY, OTHERS), (0, 9, 1))
    file = tmp_path / firmware_rules.FILE
    file.write_text(firmware_rules.to_toml(rules))
    assert firmware_rules.load(file) == rules


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("oldest = 1\n[keys]\na = 'x'", "firmware key 'a' is not base64: copy what noctule-deploy firmware-key"),
        ("[keys]\na = 'eA=='", "firmware key 'a' has 1 bytes and not 32"),
        (f"oldest = '0.9'\n[keys]\na = '{firmware_signature.to_text(PUBLIC)}'", "oldest is '0.9': write a version"),
        ("", "it names no keys: add a table [keys]"),
        ("[keys]\n", "it names no keys"),
        ("keys = 3", "it names no keys"),
        ("oldset = '0.9.0'", "oldset is not known here"),
        ("keys", "is not a TOML file"),
    ],
)
def test_a_mistake_in_the_rules_is_named(tmp_path, text: str, words: str) -> None:
    file = tmp_path / firmware_rules.FILE
    file.write_text(text)
    with pytest.raises(FirmwareKeyError, match=r"firmware\.toml") as refused:
        firmware_rules.load(file)
    assert words in str(refused.value)


def _lines(image: bytes) -> list[str]:
    return [line.strip() for line in image.decode("ascii").splitlines() if line.strip()]
