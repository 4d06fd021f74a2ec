"""The pure modules give the same on an 8051 (SDCC, in the uCsim simulator) as under gcc."""

import subprocess
from pathlib import Path

HERE = Path(__file__).parent
SOURCE = HERE.parents[1] / "firmware" / "src" / "core"
MODULES = ["backlash", "bearing", "calibration", "cobs", "crc", "median", "plan", "ramp", "ring", "turns"]
MODEL = ["-mmcs51", "--model-small", "--stack-auto"]


def run_on_8051(image: Path) -> str:
    """What the program prints through s51's interface at 0xFFFF until it stops itself."""
    command = ["s51", "-t", "52", "-q", "-b", "-I", "if=xram[0xffff]", "-G", image]
    # s51 leaves as soon as its input ends: so that stays open.
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as s51:
        assert s51.stdout is not None
        return s51.stdout.read()


def test_sdcc_and_gcc_agree_on_every_result(tmp_path):
    sources = [HERE / "both_compilers.c", *(SOURCE / f"{module}.c" for module in MODULES)]

    native = tmp_path / "native"
    subprocess.run(["gcc", f"-I{SOURCE}", *sources, "-o", native], check=True)
    expected = subprocess.run([native], check=True, capture_output=True, text=True).stdout.splitlines()

    for source in sources:
        compiler = ["sdcc", *MODEL, "--opt-code-speed", f"-I{SOURCE}", "-c", source]
        subprocess.run([*compiler, "-o", tmp_path / f"{source.stem}.rel"], check=True)
    objects = [tmp_path / f"{source.stem}.rel" for source in sources]
    image = tmp_path / "image.ihx"
    # Above the ring, so that the test's own variables are clear of it.
    subprocess.run(["sdcc", *MODEL, "--xram-loc", "0x1000", *objects, "-o", image], check=True)
    printed = run_on_8051(image).splitlines()
    begin = printed.index(expected[0])
    assert printed[begin : begin + len(expected)] == expected
