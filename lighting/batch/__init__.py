"""Many photos at once: on the CPUs of one machine, or on Ray. The results are the same."""
