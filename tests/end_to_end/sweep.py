"""Which places a test of damage tries (tests/support/fault_sweep.h)."""
import os

IS_WHOLE = "CURVISPLAT_WHOLE_SWEEPS" in os.environ


def some_of(places, stride=4):
    """All places of a sweep where CURVISPLAT_WHOLE_SWEEPS is set, else one in `stride`."""
    return list(places)[:: 1 if IS_WHOLE else stride]
