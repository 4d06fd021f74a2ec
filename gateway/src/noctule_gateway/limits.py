"""How many files a process may have open, which a site of many units comes up against."""

import resource

_FILES_PER_UNIT = 10  # its line, what wakes it, its log for writing and for reading
_FILES_BESIDES = 200


def allow_files(units: int) -> str:
    """Raise this process's limit as is needed for so many units; what to do if that can't be, else empty."""
    allowed, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    needed = units * _FILES_PER_UNIT + _FILES_BESIDES
    if allowed != resource.RLIM_INFINITY and allowed < needed:
        allowed = needed if most == resource.RLIM_INFINITY else min(needed, most)
        resource.setrlimit(resource.RLIMIT_NOFILE, (allowed, most))
    if allowed == resource.RLIM_INFINITY or allowed >= needed:
        return ""
    return (
        f"{units} units need some {needed} open files and {allowed} are allowed: "
        "raise the hard limit (LimitNOFILE of systemd, ulimit -Hn), or serve some units by another gateway"
    )
