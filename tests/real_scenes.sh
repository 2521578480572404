#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# real_scenes.sh WHITTED FOLDER: the promises about real scenes, in counts and errors (never in time; one thread, so that
# every run gives the same): at most 12 % of the shadow rays and 2 % of error at 640x360, 1 sample, C_E = 8; 4.5 % and
# 2.5 % at 320x180, 16 samples, C_E = 32; from few rays, 320x180, 16 samples, 7 a sample: 1.4 % of the pairs and 1.1 % of
# error; San Miguel within 4 GB. Prints TAP; skips what is not there.
set -u
whitted=$1 folder=$2 n=0 bad=0
dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT

report() { # STATUS WHAT
    n=$((n + 1))
    if [ "$1" -eq 0 ]; then echo "ok $n - $2"; else echo "not ok $n - $2"; bad=1; fi
}

# The slow part, the exact frame of 16 samples, serves both: the estimate's picture is the reference of the run that
# compares the cache with exact, so that exact's error against it is said too, of the whole image. Error is over the part
# that is shadow-tested, whose share the cache's errors tell. (Relative to the estimate's light, a thousandth off exact's.)
judge='import json, sys
def said(what, rays, error, most_rays, most_error):
    print("%s %s: %.2f %% of the rays, l_inf %.2f %%" % ("ok" if rays <= most_rays and error <= most_error else "not ok",
                                                        what, 100 * rays, 100 * error))
def share(run):
    return run["mode_run"]["rays_traced"] / run["mode_run"]["rays_asked"]
cache = json.load(open(sys.argv[1]))
error = cache["error"]
if len(sys.argv) == 2:
    said("640x360, 1 spp, C_E 8", share(cache), error["l_inf"], 0.12, 0.02)
else:
    said("320x180, 16 spp, C_E 32", share(cache), error["l_inf"], 0.045, 0.025)
    few = cache["reference"]["exact"]["l_inf"] * error["l_inf"] / error["l_inf_whole"]
    said("320x180, 16 spp, 7 rays", share(json.load(open(sys.argv[2]))), few, 0.014, 0.011)'

scene() { # NAME [OPTION ...]
    local name=$1 glb=$folder/$1/$1.glb line lines=0
    shift
    if [ ! -f "$glb" ]; then
        n=$((n + 1)); echo "ok $n - $name # SKIP no $glb"
        return
    fi
    local run=("$whitted" "$glb" "$@" --threads 1 --quiet)
    "${run[@]}" --size 640x360 --ce 8 --compare --json "$dir/one.json"
    "${run[@]}" --size 320x180 --spp 16 --visibility estimate --ce 12 --select 7 -o "$dir/few.exr" --json "$dir/few.json"
    "${run[@]}" --size 320x180 --spp 16 --ce 32 --compare --reference "$dir/few.exr" --json "$dir/cache.json"
    while read -r line; do
        lines=$((lines + 1))
        [ "${line%% *}" = ok ]
        report $? "$name $* ${line#*ok }"
    done < <(python3 -c "$judge" "$dir/one.json" && python3 -c "$judge" "$dir/cache.json" "$dir/few.json")
    [ $lines -eq 3 ] || report 1 "$name: three results, not $lines"
    rm -f "$dir"/*
}

for name in kitchen conference breakfast; do
    scene $name
done
scene living-room --env "$folder/hdri/living-room-sky.exr"

# address space is more than memory: a stricter limit than the promise
glb=$folder/san-miguel/san-miguel.glb
if [ -f "$glb" ]; then
    (ulimit -v $((4 * 1024 * 1024)) && exec "$whitted" "$glb" --env "$folder/hdri/kloppenheim_05_1k.hdr" --camera 4 \
        --size 160x90 --compare --quiet --json -) >/dev/null
    report $? "san-miguel within 4 GB of address space"
else
    n=$((n + 1)); echo "ok $n - san-miguel # SKIP no $glb"
fi
echo "1..$n"
exit $bad
