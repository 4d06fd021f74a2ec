"""What a caller may choose by name: the method of a contour, the rule of fusion. Nothing is imported with the names, so
that a command line can offer them before it loads what they stand for.
"""

from typing import Literal

Method = Literal["hough", "eht-lsm", "refined"]
Rule = Literal["pcr6+", "pcr6", "pcr5", "pcr2", "dempster", "dsmc"]
DEFAULT_METHOD: Method = "refined"
DEFAULT_RULE: Rule = "pcr6+"
