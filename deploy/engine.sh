#!/bin/sh
# A Docker engine and a base image on a bare Debian or Ubuntu machine, without an image registry.
#
#   deploy/engine.sh up      prints DOCKER_HOST of an engine: the machine's own where one answers, else one of ours
#   deploy/engine.sh base    makes the base image softseam-base:<suite> by debootstrap (once) and prints its name
#   deploy/engine.sh down    stops the engine that `up` started; its images stay for the next time
set -eu
PATH=$PATH:/usr/sbin:/sbin
run=/run/softseam-engine
root=/var/lib/softseam-engine
socket=unix://$run/docker.sock
suite=${SUITE:-bookworm}
image=softseam-base:$suite

say() { echo "engine: $*" >&2; }
answers() { docker ${1:+-H "$1"} info >/dev/null 2>&1; }

need() {
    missing=""
    command -v dockerd >/dev/null && command -v docker >/dev/null || missing="$missing docker.io"
    command -v docker-compose >/dev/null || docker compose version >/dev/null 2>&1 || missing="$missing docker-compose"
    command -v debootstrap >/dev/null || missing="$missing debootstrap"
    command -v iptables >/dev/null || missing="$missing iptables"
    command -v docker-init >/dev/null || missing="$missing tini"
    [ -z "$missing" ] && return
    if [ "$(id -u)" -ne 0 ] || ! command -v apt-get >/dev/null; then
        say "needs$missing: install them, or run as root on Debian"
        exit 1
    fi
    say "installing$missing"
    export DEBIAN_FRONTEND=noninteractive
    # shellcheck disable=SC2086
    apt-get install -y -qq --no-install-recommends $missing >&2 || {
        apt-get update -qq >&2
        apt-get install -y -qq --no-install-recommends $missing >&2
    }
}

start() {
    # $1: storage driver
    rm -f "$run/docker.pid"
    setsid dockerd -H "$socket" --data-root "$root" --exec-root "$run/exec" --pidfile "$run/docker.pid" \
        --storage-driver "$1" >"$run/dockerd.log" 2>&1 </dev/null &
    pid=$!
    n=0
    while [ $n -lt 150 ]; do
        answers "$socket" && return 0
        kill -0 "$pid" 2>/dev/null || return 1
        n=$((n + 1))
        sleep 0.2
    done
    kill "$pid" 2>/dev/null || true
    return 1
}

up() {
    need
    if [ -n "${DOCKER_HOST:-}" ] && answers "$DOCKER_HOST"; then echo "$DOCKER_HOST"; return; fi
    if answers "$socket"; then echo "$socket"; return; fi
    if answers unix:///var/run/docker.sock; then echo unix:///var/run/docker.sock; return; fi
    if [ "$(id -u)" -ne 0 ]; then say "no engine answers, and only root can start one"; exit 1; fi
    mkdir -p "$run" "$root"
    # overlay2 does not work on every file system; vfs does, slowly
    start overlay2 || start vfs || { say "dockerd does not start:"; tail -n 20 "$run/dockerd.log" >&2; exit 1; }
    echo "$socket"
}

base() {
    DOCKER_HOST=$(up)
    export DOCKER_HOST
    if ! docker image inspect "$image" >/dev/null 2>&1; then
        # the mirror that this machine's apt uses for the suite, else debootstrap's own default
        # shellcheck disable=SC2016
        mirror=$(apt-get indextargets --format '$(CODENAME) $(REPO_URI)' 'Created-By: Packages' 2>/dev/null |
            sed -n "s/^$suite //p" | head -n 1)
        tree=$(mktemp -d)
        say "making $image by debootstrap (about a minute)"
        # shellcheck disable=SC2086
        debootstrap --variant=minbase --include=python3,python3-venv,ca-certificates "$suite" "$tree" $mirror \
            >"$run-debootstrap.log" 2>&1 || { tail -n 20 "$run-debootstrap.log" >&2; rm -rf "$tree"; exit 1; }
        rm -rf "$tree"/var/cache/apt/archives/*.deb "$tree"/var/lib/apt/lists/*
        tar -C "$tree" -c . | docker import - "$image" >/dev/null
        rm -rf "$tree"
    fi
    echo "$image"
}

down() {
    [ -f "$run/docker.pid" ] || return 0
    pid=$(cat "$run/docker.pid")
    kill "$pid" 2>/dev/null || return 0
    n=0
    while kill -0 "$pid" 2>/dev/null && [ $n -lt 100 ]; do n=$((n + 1)); sleep 0.2; done
}

case ${1:-} in
    up) up ;;
    base) base ;;
    down) down ;;
    *) sed -n '2,6s/^# \{0,1\}//p' "$0" >&2; exit 2 ;;
esac
