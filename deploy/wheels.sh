#!/bin/sh
# Puts every wheel of the image into deploy/wheels: softseam of this checkout, and what requirements.lock pins.
# Usage: deploy/wheels.sh [PYTHON]   (a Python of the same version as the base image's, with pip)
set -eu
cd "$(dirname "$0")/.."
python=${1:-python3}
mkdir -p deploy/wheels/locked
rm -f deploy/wheels/softseam-*.whl

# downloading is skipped while the lock and the Python are the same
stamp=deploy/wheels/.stamp
key=$({ "$python" --version; cat requirements.lock; } | sha256sum | cut -d' ' -f1)
if [ "$(cat "$stamp" 2>/dev/null || true)" != "$key" ]; then
    rm -f deploy/wheels/locked/*.whl "$stamp"
    "$python" -m pip --disable-pip-version-check download --quiet --only-binary :all: --require-hashes \
        -r requirements.lock -d deploy/wheels/locked
    echo "$key" > "$stamp"
fi
"$python" -m pip --disable-pip-version-check wheel --quiet --no-deps --no-build-isolation -w deploy/wheels .
ls deploy/wheels/softseam-*.whl
