#!/bin/sh
# Puts every wheel of the image into deploy/wheels: softseam of this checkout, and what requirements.lock pins; and the
# kernels that were compiled in this checkout, of which the image takes those that it would compile itself.
#
#   deploy/wheels.sh [PYTHON [VERSION]]
#
# PYTHON has pip and hatchling (make's .venv/bin/python has); VERSION is the base image's, e.g. 3.11; default: PYTHON's.
set -eu
cd "$(dirname "$0")/.."
python=${1:-python3}
version=${2:-$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')}
mkdir -p deploy/wheels/locked
rm -f deploy/wheels/softseam-*.whl

# downloading is skipped while the lock and the version are the same
stamp=deploy/wheels/.stamp
key=$({ echo "$version"; cat requirements.lock; } | sha256sum | cut -d' ' -f1)
if [ "$(cat "$stamp" 2>/dev/null || true)" != "$key" ]; then
    rm -f deploy/wheels/locked/*.whl "$stamp"
    "$python" -m pip --disable-pip-version-check download --quiet --only-binary :all: --python-version "$version" \
        --require-hashes -r requirements.lock -d deploy/wheels/locked
    echo "$key" > "$stamp"
fi
"$python" -m pip --disable-pip-version-check wheel --quiet --no-deps --no-build-isolation -w deploy/wheels .

# the same kernels as long as the sources are the same, however many more tests have compiled meanwhile
sources=services/softseam_services/__pycache__/kernels.json
if ! cmp -s "$sources" "deploy/wheels/kernels/${sources#*/}"; then
    rm -rf deploy/wheels/kernels
    mkdir -p deploy/wheels/kernels
    if [ -f "$sources" ]; then
        for each in services coupling; do
            (cd $each && find softseam_* -name '*.nb[ic]' -o -name kernels.json | tar -c -T -) | tar -x -C deploy/wheels/kernels
        done
    fi
fi
ls deploy/wheels/softseam-*.whl
