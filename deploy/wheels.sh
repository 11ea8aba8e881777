#!/bin/sh
# Puts every wheel of the image into deploy/wheels: softseam of this checkout, and what requirements.lock pins.
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
ls deploy/wheels/softseam-*.whl
