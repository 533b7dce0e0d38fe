# Sourced by scripts/run and scripts/test. Sets `root` (this source tree) and `python` (the interpreter of
# its .venv), after having made sure that .venv holds the locked packages and this package.
#
# .venv/.chimera-stamp holds two digests: of the place (path, Python, machine) and of the contents (lock file
# and pyproject.toml). It says "unfinished" while an installation runs and is replaced by renaming as the last
# step, so the call after a killed one sees what happened and starts over. Another place starts over too, since
# a virtual environment cannot be moved; other contents, or a .venv without a stamp, are upgraded in place.

# A script that needs more sets `kind` first: kind=bench means .venv-bench and requirements-bench.lock.

root=$(CDPATH='' cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd -P)
venv=$root/.venv${kind:+-$kind}
lock=requirements${kind:+-$kind}.lock
python=$venv/bin/python
stamp=$venv/.chimera-stamp

stamp_program='
import hashlib, os, sys

root, lock = sys.argv[1:]
place = repr((root, sys.version_info[:2], sys.implementation.name, os.uname().machine)).encode()
files = [os.path.join(root, name) for name in (lock, "pyproject.toml")]
contents = b"".join(hashlib.sha256(open(file, "rb").read()).digest() for file in files)
print(hashlib.sha256(place).hexdigest(), hashlib.sha256(contents).hexdigest())
'

# The lock belongs to descriptor 9, which pip inherits: it is held until the last of the installing processes has
# ended, however it ended, so nothing stale is ever left behind.
lock_program='
import fcntl, signal, sys

signal.signal(signal.SIGINT, signal.SIG_DFL)
try:
    fcntl.flock(9, fcntl.LOCK_EX | fcntl.LOCK_NB)
except BlockingIOError:
    print("another call is setting up the environment; waiting for it", file=sys.stderr)
    fcntl.flock(9, fcntl.LOCK_EX)
except OSError as error:
    print(f"warning: no lock on .venv ({error}); let one call at a time set it up", file=sys.stderr)
'

say() { printf '%s\n' "$1" >&2; }
die() { say "$2"; exit "$1"; }

python_version() { "$1" -I -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null; }

is_suitable() {
    "$1" -I -c 'import ensurepip, sys, venv; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null
}

find_base_python() {
    local candidate
    if [[ -n ${PYTHON:-} ]]; then
        is_suitable "$PYTHON" || die 2 "PYTHON=$PYTHON is not Python 3.11, 3.12 or 3.13 with its venv module"
        base=$PYTHON
        return
    fi
    for candidate in python3.13 python3.12 python3.11 python3 python; do
        if is_suitable "$candidate"; then
            base=$candidate
            return
        fi
    done
    die 2 "no Python 3.11, 3.12 or 3.13 with its venv module was found; install one or set PYTHON=/path/to/python"
}

current_stamp() { "$python" -IS -c "$stamp_program" "$root" "$lock" 2>/dev/null; }

has_requested_version() { [[ -z ${PYTHON:-} || $(python_version "$PYTHON") == "$(python_version "$python")" ]]; }

is_ready() { [[ -r $stamp && $(<"$stamp") == "$(current_stamp)" ]] && has_requested_version; }

# The .venv there is can be upgraded: its Python works and fits, and no installation into it was broken off.
is_upgradable() {
    local here
    is_suitable "$python" && has_requested_version || return 1
    [[ -e $stamp ]] || return 0
    here=$(current_stamp)
    [[ $(<"$stamp") == "${here%% *} "* ]]
}

make_venv() (
    unset PYTHONPATH PYTHONHOME
    "$base" -m venv "$venv"
)

install() (
    unset PYTHONPATH PYTHONHOME
    export PIP_USER=0 PIP_DISABLE_PIP_VERSION_CHECK=1
    cd -- "$root"
    "$python" -m pip --version || "$python" -m ensurepip || exit
    "$python" -m pip install --require-hashes -r "$lock" || exit
    "$python" -m pip install --no-deps --no-build-isolation --editable .
)

give_up() {
    tail -n 5 -- "$log" >&2
    die 69 "the installation failed; all of it is in $log"
}

set_up() {
    local base log=$venv/setup.log
    find_base_python
    [[ -w $root ]] || die 2 "$root cannot be written to, and its .venv is missing or out of date"
    trap 'exit 130' INT
    exec 9>>"$venv.lock"
    "$base" -I -c "$lock_program"
    if ! is_ready; then
        if is_upgradable; then
            say "bringing $venv up to date"
        else
            say "setting up $venv with Python $(python_version "$base"): about a minute, once"
            rm -rf -- "$venv.old"
            [[ ! -e $venv ]] || mv -- "$venv" "$venv.old"
            mkdir -- "$venv"
            echo unfinished >"$stamp"
            make_venv >"$log" 2>&1 || give_up
            rm -rf -- "$venv.old"
        fi
        echo unfinished >"$stamp"
        install >>"$log" 2>&1 || give_up
        current_stamp >"$stamp.new" || give_up
        mv -- "$stamp.new" "$stamp"
    fi
    exec 9>&-
    trap - INT
}

is_ready || set_up
