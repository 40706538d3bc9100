# Sourced by the scripts here: makes .venv with this package and the extras named, once for each pyproject.toml.
# Needs Python 3.11 or later with venv and pip. Usage: . scripts/setup.sh; setup [EXTRA,...]
# PYTHON is the Python to take, VENV another folder than .venv, CONSTRAINTS a file of versions for pip.
VENV="${VENV:-.venv}"

setup() {
    local extras="${1:-}" python="" candidate stamp wanted
    for candidate in "${PYTHON:-}" python3 python3.14 python3.13 python3.12 python3.11 python; do
        if [ -n "$candidate" ] && command -v "$candidate" >/dev/null 2>&1 &&
            "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            python="$candidate"
            break
        fi
    done
    if [ -z "$python" ]; then
        echo "setup: Python 3.11 or later is needed; set PYTHON=/path/to/python3" >&2
        return 2
    fi
    wanted="$extras $("$python" --version) $(cat pyproject.toml ${CONSTRAINTS:-} | cksum)"
    stamp="$VENV/.clamp3d-setup${extras:+-$extras}"
    if [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$wanted" ]; then
        return 0
    fi
    echo "setup: installing clamp3d into $VENV (once) ..." >&2
    if ! "$python" -c 'import ensurepip' 2>/dev/null; then
        echo "setup: this Python has no venv; on Debian and Ubuntu: apt-get install python3-venv" >&2
        return 2
    fi
    "$python" -m venv "$VENV"
    "$VENV/bin/python" -m pip install --quiet --disable-pip-version-check ${CONSTRAINTS:+-c "$CONSTRAINTS"} --editable ".${extras:+[$extras]}" >&2
    printf '%s' "$wanted" >"$stamp"
}
