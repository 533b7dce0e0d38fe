"""``python -m`` puts the current folder first on the Python path; this takes it off again.

A numpy.py or json.py there must not stand in for a library, neither here nor in the processes that
this one starts, which is what ``python -P`` is for.
"""

import os
import sys


def leave_current_folder() -> None:
    """Take the current folder off the path of this process and of those that it starts."""
    package = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    if not sys.flags.safe_path and sys.path[:1] in ([""], [os.getcwd()]):
        del sys.path[0]
        if package not in sys.path:
            # It runs from a source tree that is not installed.
            sys.path.append(package)
            before = os.environ.get("PYTHONPATH")
            os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (before, package)))
    os.environ["PYTHONSAFEPATH"] = "1"
