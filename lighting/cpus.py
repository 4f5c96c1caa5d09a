"""How many CPUs there are to work with."""

import os


def available_cpus() -> int:
    """The number of CPUs that this process may use; in a container it can be smaller than the machine's."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
