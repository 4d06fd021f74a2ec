"""A scanner's file, imported."""

from pathlib import Path
from typing import Any

from noctule.scans.importing import ImportedScan, import_scan
from noctule.scans.options import Columns, ScanOptions

AIR_C = 20.0


def imported(folder: Path, text: str | bytes, name: str = "scan.csv", **options) -> ImportedScan:
    file = folder / name
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    given_options: dict[str, Any] = {"columns": Columns("angle", "range"), "units": "cm"} | options
    return import_scan(file, ScanOptions(**given_options))
