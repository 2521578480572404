#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# out_of_memory.sh FAIL_MALLOC RENDERER ...: each allocation of a renderer fails in turn (of the first hundred each one,
# then a spread): it ends with exit 1 and one line, or does without, and leaves no file that is not whole. So it does where
# the address space is too small for Embree. Prints TAP.
set -u
library=$(realpath -- "$1") || exit 1
shift
mapfile -t renderers < <(realpath -- "$@")
dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT
number=0 bad=0
for renderer in "${renderers[@]}"; do
    name=${renderer##*/} tried=0 refused=0 problems=
    cd "$dir" || exit 1
    arguments=(cornell --size 24x16 --threads 2 --quiet -o x.exr -o x.png --json x.json)
    [ "$name" = whitted ] && arguments+=(--vpls 16)
    count=$(LD_PRELOAD=$library timeout 60 "$renderer" "${arguments[@]}" 2>&1 >/dev/null | sed -n 's/ allocations$//p')
    rm -f x.*
    at=1
    while [ -n "$count" ] && [ "$at" -le "$count" ]; do
        said=$(FAIL_AT=$at LD_PRELOAD=$library timeout 60 "$renderer" "${arguments[@]}" 2>&1)
        rc=$?
        tried=$((tried + 1))
        [ $rc -eq 1 ] && refused=$((refused + 1))
        [[ $rc -eq 0 && -z $said || $rc -eq 1 && -n $said && $said != *$'\n'* ]] || problems="$problems $at:$rc"
        for file in *; do
            case $file in
            x.exr) [ "$(head -c 4 x.exr | od -An -tx1 | tr -d ' ')" = 762f3101 ] || problems="$problems $at:exr" ;;
            x.png) [ "$(tail -c 8 x.png | head -c 4)" = IEND ] || problems="$problems $at:png" ;;
            x.json | '*') ;;
            *) problems="$problems $at:$file" ;;
            esac
        done
        rm -f ./*
        at=$((at < 100 ? at + 1 : at + 1 + (count - 100) / 40))
    done
    number=$((number + 1))
    if [ -z "$problems" ] && [ "$refused" -gt 50 ]; then
        echo "ok $number - $name: $tried of $count allocations failed, $refused times one line"
    else
        echo "not ok $number - $name: of ${count:-no} allocations $tried tried, $refused refused;${problems:- too few}"
        bad=1
    fi
    number=$((number + 1)) problems=
    for megabytes in 100 150; do # at some more TBB, inside Embree, ends the process
        said=$(ulimit -v $((megabytes * 1000)) && exec timeout 60 "$renderer" "${arguments[@]}" 2>&1)
        rc=$?
        [[ $rc -eq 1 && $said == "$name: "* && $said != *$'\n'* && -z $(ls) ]] || problems="$problems $megabytes:$rc:$said"
        rm -f ./*
    done
    if [ -z "$problems" ]; then
        echo "ok $number - $name: one line where the address space is too small"
    else
        echo "not ok $number - $name: in a small address space:$problems"
        bad=1
    fi
done
echo "1..$number"
exit $bad
