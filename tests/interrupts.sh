#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# interrupts.sh RENDERER ...: SIGINT at any moment, from loading to writing: exit 130 (or 0 where it came too late; or
# death by the signal where it came before main), files that are whole or as they were, no temporaries. Prints TAP.
set -u
mapfile -t renderers < <(realpath -- "$@")
dir=$(mktemp -d) || exit 1
# no trap: a child that is not yet another program would run it
number=0 bad=0
for renderer in "${renderers[@]}"; do
    number=$((number + 1))
    name=${renderer##*/} problems= stopped=0
    for i in $(seq 0 23); do
        echo older >"$dir/x.png"
        # background jobs of a shell ignore SIGINT; env gives it back
        env --default-signal=INT --chdir="$dir" "$renderer" cornell --size 160x120 --spp 2 --threads 2 --quiet \
            -o x.exr -o x.png --json x.json >"$dir/said" 2>&1 &
        child=$!
        sleep "0.0$((i * 4 / 10))$((i * 4 % 10))"
        kill -INT $child 2>/dev/null
        wait $child
        rc=$?
        case $rc in 0) ;; 130) stopped=$((stopped + 1)) ;; *) problems="$problems $i:exit$rc" ;; esac
        [ -s "$dir/said" ] && problems="$problems $i:$(head -c 60 "$dir/said" | tr '\n' ' ')"
        rm -f "$dir/said"
        [ -e "$dir/x.exr" ] && [ "$(head -c 4 "$dir/x.exr" | od -An -tx1 | tr -d ' ')" != 762f3101 ] && problems="$problems $i:exr"
        [ -e "$dir/x.exr" ] && [ "$(tail -c 8 "$dir/x.png" | head -c 4)" != IEND ] && problems="$problems $i:png"
        [ ! -e "$dir/x.exr" ] && [ "$(cat "$dir/x.png")" != older ] && problems="$problems $i:older"
        [ -e "$dir/x.json" ] && ! python3 -c 'import json, sys; json.load(open(sys.argv[1]))' "$dir/x.json" && problems="$problems $i:json"
        ls "$dir" | grep -q tmp && problems="$problems $i:temporary"
        rm -f "$dir"/*
    done
    if [ -z "$problems" ] && [ $stopped -gt 0 ]; then
        echo "ok $number - $name: 24 interrupts, $stopped in time"
    else
        echo "not ok $number - $name: $stopped in time;$problems"
        bad=1
    fi
done
rm -rf "$dir"
echo "1..$number"
exit $bad
