# Sourced by the scripts here: makes .venv with this package and the extras named, once for each pyproject.toml.
# Needs Python 3.11 or later. Usage: . scripts/setup.sh; setup [EXTRA,...]; setup_browser
# PYTHON is the Python to take, VENV another folder than .venv, CONSTRAINTS a file of versions for pip, UPGRADE=1 takes
# the newest versions of everything.
VENV="${VENV:-.venv}"
# Tests start hundreds of processes: each would compile anew what it imports, which takes longer than most of them.
unset PYTHONDONTWRITEBYTECODE

# Installs packages of Debian and Ubuntu; fails where this is another system, or nobody may.
apt_install() {
    local sudo=""
    [ "$(id -u)" = 0 ] || sudo="sudo -n"
    command -v apt-get >/dev/null 2>&1 || return 1
    { $sudo apt-get update -qq && DEBIAN_FRONTEND=noninteractive $sudo apt-get install -y -qq --no-install-recommends "$@"; } >&2
}

setup() {
    local extras="${1:-}" python="" candidate stamp wanted version
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
    if [ -z "${UPGRADE:-}" ] && [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$wanted" ]; then
        return 0
    fi
    echo "setup: installing clamp3d into $VENV (once) ..." >&2
    if ! "$python" -c 'import ensurepip' 2>/dev/null; then
        version="$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')"
        apt_install "python$version-venv" || apt_install python3-venv || true
        if ! "$python" -c 'import ensurepip' 2>/dev/null; then
            echo "setup: $python has no venv, and it could not be installed; as root: apt-get install python$version-venv" >&2
            return 2
        fi
    fi
    "$python" -m venv "$VENV"
    # Not compiled: Python does that for what is used, an eighth of it; the rest are 110 MB and most of the time.
    "$VENV/bin/python" -m pip install --quiet --no-compile --disable-pip-version-check ${UPGRADE:+--upgrade --upgrade-strategy eager} \
        ${CONSTRAINTS:+-c "$CONSTRAINTS"} --editable ".${extras:+[$extras]}" >&2
    printf '%s' "$wanted" >"$stamp"
}

# A Chromium for the tests in a browser: the system's, else Debian's, else playwright's own.
setup_browser() {
    local name
    for name in "${CLAMP3D_CHROMIUM:-}" chromium chromium-browser google-chrome google-chrome-stable; do
        if [ -n "$name" ] && command -v "$name" >/dev/null 2>&1; then
            return 0
        fi
    done
    if [ -f "$VENV/.clamp3d-browser" ]; then
        return 0
    fi
    echo "setup: no Chromium here; installing one (once) ..." >&2
    # Ubuntu's package of that name only points to a snap, which does not run everywhere.
    if ! grep -qi '^ID=ubuntu' /etc/os-release 2>/dev/null && apt_install chromium && command -v chromium >/dev/null 2>&1; then
        return 0
    fi
    if "$VENV/bin/python" -m playwright install --with-deps chromium >&2 || "$VENV/bin/python" -m playwright install chromium >&2; then
        touch "$VENV/.clamp3d-browser"
        return 0
    fi
    echo "setup: no Chromium could be installed (neither by apt nor by playwright): the tests in a browser are skipped" >&2
}
