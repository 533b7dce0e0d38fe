"""Take the current folder off the Python path, where ``python -m`` puts it first.

A numpy.py or json.py in the current folder must not replace a library, neither in this process nor
in the processes that it starts. ``python -P`` has the same effect.
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
