"""What a value should have been, of a finding of pydantic's: for files of parameters and for command lines."""

from collections.abc import Mapping
from typing import Any

_WANTED = {
    "greater_than": "more than {gt}",
    "greater_than_equal": "{ge} or more",
    "less_than": "less than {lt}",
    "less_than_equal": "{le} or less",
    "int_parsing": "a whole number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_parsing": "a number",
    "float_type": "a number",
    "finite_number": "a finite number",
    "bool_parsing": "true or false",
    "bool_type": "true or false",
    "string_type": "a text in quotes",
    "list_type": "a list",
    "model_type": "a table",
    "literal_error": "{expected}",
    "enum": "{expected}",
}


def wanted(error: Mapping[str, Any]) -> str:
    """What to do about one of ``ValidationError.errors()``, to stand after the value and a colon."""
    context = error.get("ctx", {})
    if error["type"] == "value_error":
        return str(context["error"])
    if (give := _WANTED.get(error["type"])) is not None:
        return f"give {give.format(**context)}"
    return f"{error['msg'][0].lower()}{error['msg'][1:]}"
