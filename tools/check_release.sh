#!/usr/bin/env bash
# Builds wheel and source archive, looks into both, and tries each, one after the other, in a bare
# environment of every Python that is found (3.11, 3.12, 3.13): the demonstration has to run, from
# empty caches, and the types to be there.
#
#   tools/check_release.sh                 # all interpreters found
#   tools/check_release.sh 3.12            # one of them
#   PIVIDENT_ARCHIVES=wheel tools/check_release.sh     # the wheel alone
#
# PYTHON names the interpreter that builds (it needs the package `build`).
set -euo pipefail
cd "$(dirname "$0")/.."

builder="${PYTHON:-python3}"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT

"$builder" -m build --outdir "$work/dist" . >"$work/build.log" 2>&1 || {
    cat "$work/build.log" >&2
    exit 1
}
"$builder" tools/archive_contents.py "$work"/dist/*.whl "$work"/dist/*.tar.gz

find_python() {
    command -v "python$1" >/dev/null && "python$1" -c '' 2>/dev/null && { command -v "python$1"; return; }
    ls -d "${PYENV_ROOT:-$HOME/.pyenv}"/versions/"$1".*/bin/python 2>/dev/null | tail -n 1
    if command -v uv >/dev/null; then uv python find "$1" 2>/dev/null; fi
}

try_archive() {  # python version, environment, archive
    # What the archive needs stays from the one before; the package itself and what it compiled go.
    "$2/bin/python" -m pip uninstall --quiet --yes pivident 2>/dev/null
    rm -rf "$2"/lib/python*/site-packages/pivident
    "$2/bin/python" -m pip install --quiet --no-compile --disable-pip-version-check "$3"
    (
        cd "$2"
        export OMP_NUM_THREADS=1 PYTHONNOUSERSITE=1
        unset PYTHONPATH
        rm -rf demo
        bin/pivident demo --out demo >demo.log
        test -s demo/report.html
        bin/python -c 'import importlib.resources as r; assert (r.files("pivident") / "py.typed").is_file()'
        bin/pivident completion bash >/dev/null
    )
    echo "Python $1: $(basename "$3") installs and runs"
}

tried=0
for version in "${@:-3.11 3.12 3.13}"; do
    for one in $version; do
        interpreter="$(find_python "$one" | head -n 1)"
        if [ -z "$interpreter" ]; then
            echo "Python $one: not found, not tried"
            continue
        fi
        "$interpreter" -m venv "$work/$one"
        for archive in "$work"/dist/*.whl "$work"/dist/*.tar.gz; do
            case "${PIVIDENT_ARCHIVES:-all}:$archive" in wheel:*.tar.gz) continue ;; esac
            try_archive "$one" "$work/$one" "$archive"
            tried=$((tried + 1))
        done
        rm -rf "${work:?}/$one"
    done
done
test "$tried" -gt 0 || { echo "no interpreter was found" >&2; exit 1; }
