#!/bin/sh
# Builds the image from this checkout on the engine of engine.sh, without an image registry.
#
#   deploy/image.sh PYTHON TAG
#
# PYTHON as of wheels.sh. What is already built is not built again.
set -eu
cd "$(dirname "$0")"
DOCKER_HOST=$(./engine.sh up)
export DOCKER_HOST
base=$(./engine.sh base)
version=$(docker run --rm "$base" python3 -c "import sys; print('%d.%d' % sys.version_info[:2])")
./wheels.sh "$1" "$version"
docker build -f Dockerfile --network none -t "$2" --build-arg "BASE_IMAGE=$base" .
