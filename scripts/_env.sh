# Sourced by the other scripts. Sets `root`, this source tree, and `python`, the interpreter of its .venv, and fills
# .venv with the locked packages and this package. kind=bench: .venv-bench and requirements-bench.lock.
root=$(CDPATH='' cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd -P)
venv=$root/.venv${kind:+-$kind} lock=$root/requirements${kind:+-$kind}.lock
PATH=${PATH//"$venv/bin:"/} # in an active .venv, its own interpreter is no base for a new one
python=$venv/bin/python log=$venv/setup.log stamp=$venv/.chimera-stamp # "unfinished" until all is installed
die() { printf '%s\n' "$2" >&2; exit "$1"; }
version() { local text; text=$("$1" -V 2>/dev/null) && echo "${text%.*}"; }
fits() { [[ $(version "$1") == "Python 3.1"[1-4] && (-z ${PYTHON:-} || $(version "$PYTHON") == "$(version "$1")") ]]; }
place() { echo "$root $HOSTTYPE $(version "$python")"; }
wanted() { echo "$(place) $(cat -- "$lock" "$root/pyproject.toml" | sha256sum)"; }
is_ready() { [[ -r $stamp && $(<"$stamp") == "$(wanted)" ]] && fits "$python"; }
is_upgradable() { fits "$python" && [[ ! -e $stamp || $(<"$stamp") == "$(place) "* ]]; }
find_base() {
    local problem="${PYTHON:+PYTHON=$PYTHON: }no Python 3.11 to 3.14 was found; set PYTHON=/path/to/python"
    for base in "${PYTHON:-python3.14}" python3.13 python3.12 python3.11 python3; do
        fits "$base" || continue
        ! "$base" -Ic 'import ensurepip, venv' 2>/dev/null || return 0
        problem="$base has no module venv or ensurepip; on Debian and Ubuntu: apt install python3-venv"
    done
    die 2 "$problem"
}
empty() { mkdir -p -- "$venv"; echo unfinished >"$stamp"; find "$venv" -mindepth 1 ! -name .chimera-stamp -delete; }
install() (
    unset PYTHONPATH PYTHONHOME
    { [[ -x $python ]] || "$base" -m venv "$venv"; } && "$python" -m ensurepip || exit
    "$python" -m pip install --no-user --require-hashes -r "$lock" || exit
    "$python" -m pip install --no-user --no-deps --no-build-isolation --editable "$root" && wanted >"$stamp.new"
)
set_up() { # pip inherits descriptor 9: the lock is held until the last installing process ends, even an orphan
    find_base; [[ -w $root ]] || die 2 "$root cannot be written to, and its .venv is missing or out of date"
    exec 9>>"$venv.lock"
    flock -n 9 || { echo "another call is setting up the environment; waiting for it" >&2; flock 9 || true; }
    ! is_ready || return 0
    echo "setting up $venv with $(version "$base"): about a minute, once" >&2
    is_upgradable || empty; echo unfinished >"$stamp"
    install >"$log" 2>&1 || { tail -n 5 -- "$log" >&2; die 69 "the installation failed; all of it is in $log"; }
    mv -- "$stamp.new" "$stamp"
}
is_ready || { trap 'exit 130' INT; set_up; trap - INT; exec 9>&-; }
