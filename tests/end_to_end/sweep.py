"""Which places a test tries (tests/support/fault_sweep.h), and whether it can start ranks."""
import os
import pathlib
import shutil

IS_WHOLE = "CURVISPLAT_WHOLE" in os.environ
ONLY_WHOLE = "only with tools/test.sh --whole"  # why a test is skipped


def some_of(places, stride=4, first=0, turn=0):
    """All places of a sweep where CURVISPLAT_WHOLE is set, else the `first` ones and one in `stride` of those after them: others with
    each `turn`, so that sweeps of one kind complete one another."""
    places = list(places)
    return places if IS_WHOLE else places[:first] + places[first + turn % stride :: stride]


def mpirun(program):
    """The words that start three ranks of a program; none where it cannot have any."""
    can = shutil.which("mpirun") and pathlib.Path(program).with_name("curvisplat-mpi.so").exists()
    return ("mpirun", "--oversubscribe", "--allow-run-as-root", "--bind-to", "none", "-q", "-n", "3") if can else ()
