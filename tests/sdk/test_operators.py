"""The list of operators is read again when its file has changed, and as long as it can't be read."""

import os
from pathlib import Path

from noctule.operators import FILE, Operators, to_json


def test_a_list_that_could_not_be_read_is_tried_again_though_its_file_has_not_changed_since(tmp_path: Path) -> None:
    path = tmp_path / FILE
    path.write_text(to_json(["operator.anna.g1"]))
    operators = Operators(tmp_path)
    revoked, unreadable = to_json(["operator.bert.g1"]), "[" + " " * (len(to_json(["operator.bert.g1"])) - 1)
    path.write_text(unreadable)
    written = path.stat()
    operators.look()
    assert operators.admit("operator.anna.g1") and "stays in force" in operators.detail
    path.write_text(revoked)  # as chmod leaves it: the same file, time and size, and now it can be read
    os.utime(path, ns=(written.st_atime_ns, written.st_mtime_ns))
    operators.look()
    assert not operators.admit("operator.anna.g1") and not operators.detail
